//! The contact scene: colliders, objects that move, and the impulses between all of them.

use motorium_robots::{FrameId, Kinematics, Model, Reference};
use nalgebra::{DMatrix, Isometry3, Vector3};

use super::colliders::{Collider, Colliders, Owner};
use super::detect::{ContactPoint, Detector};
use super::impulses::Impulses;
use super::objects::Objects;
use crate::World;

/// Colliders, their poses, their contact points, and the impulses there.
pub(crate) struct ContactScene {
    colliders: Colliders,
    detector: Detector,
    pub(crate) impulses: Impulses,
    pub(crate) objects: Objects,
    /// A frame on the base, and on each body.
    frames: Vec<Option<FrameId>>,
    /// Jacobian of each of those frames, local-world-aligned, once a contact point needs it.
    jacobians: Vec<FrameJacobian>,
}

#[derive(Clone)]
struct FrameJacobian {
    known: bool,
    /// 6 x nv.
    matrix: DMatrix<f64>,
    /// Origin of the frame in the world \[m\].
    origin: Vector3<f64>,
}

impl ContactScene {
    /// A scene of these colliders; `world` gives the objects.
    pub(crate) fn new(model: &Model, colliders: Colliders, world: &World) -> Self {
        let detector = Detector::new(&colliders);
        let frame_on = |body: Option<usize>| {
            let there = |frame: &motorium_robots::Frame| frame.body == body && !frame.in_world;
            let name = model.frames().iter().find(|frame| there(frame)).map(|frame| frame.name.as_str());
            name.and_then(|name| model.frame(name).ok())
        };
        let bodies = model.bodies().len();
        let frames: Vec<_> =
            std::iter::once(frame_on(None)).chain((0..bodies).map(|body| frame_on(Some(body)))).collect();
        let jacobian =
            FrameJacobian { known: false, matrix: DMatrix::zeros(6, model.nv()), origin: Vector3::zeros() };
        Self {
            impulses: Impulses::new(model.nv(), model.mass(), detector.capacity()),
            jacobians: vec![jacobian; frames.len()],
            objects: Objects::new(world),
            frames,
            colliders,
            detector,
        }
    }

    /// The colliders.
    pub(crate) fn colliders(&self) -> &Colliders {
        &self.colliders
    }

    /// Takes pairs of colliders out of the detection. The poses must be [set](Self::set_poses) anew.
    pub(crate) fn exclude(&mut self, pairs: &[[usize; 2]]) {
        self.colliders.exclude(pairs);
        self.detector = Detector::new(&self.colliders);
    }

    /// Places the robot as `kinematics` stands, its base at `base`, and the objects in their next state.
    pub(crate) fn set_poses(&mut self, kinematics: &Kinematics, base: &Isometry3<f64>) {
        let objects = &self.objects.next;
        self.detector.set_poses(&self.colliders.colliders, |owner| match owner {
            Owner::World => Isometry3::identity(),
            Owner::Base => *base,
            Owner::Body(index) => kinematics.body_pose(index),
            Owner::Object(index) => objects[index].pose,
        });
    }

    /// Finds the contact points within `margin` \[m\] and sets up their impulses for a step of `h` \[s\]: the objects
    /// of the next state fall, the robot moves with `v`.
    pub(crate) fn prepare(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        v: &[f64],
        (gravity, h, margin): (&Vector3<f64>, f64, f64),
    ) {
        let Self { colliders, detector, impulses, objects, frames, jacobians } = self;
        let points = detector.detect(colliders, margin);
        // Poses do not change yet: only the velocities fall.
        objects.before_fall();
        objects.fall(gravity, h);
        jacobians.iter_mut().for_each(|jacobian| jacobian.known = false);
        let slope =
            |owner: Owner, point: &ContactPoint, direction: &Vector3<f64>, sign: f64, row: &mut [f64]| {
                let slot = match owner {
                    Owner::Base => 0,
                    Owner::Body(index) => index + 1,
                    Owner::World | Owner::Object(_) => return,
                };
                let Some(frame) = frames[slot] else { return };
                let FrameJacobian { known, matrix, origin } = &mut jacobians[slot];
                if !*known {
                    *known = true;
                    kinematics.jacobian(model, frame, Reference::LocalWorldAligned, matrix);
                    *origin = kinematics.pose(model, frame).translation.vector;
                }
                let turn = (point.point.coords - *origin).cross(direction);
                for (entry, column) in row.iter_mut().zip(matrix.column_iter()) {
                    let linear = column[0] * direction.x + column[1] * direction.y + column[2] * direction.z;
                    let angular = column[3] * turn.x + column[4] * turn.y + column[5] * turn.z;
                    *entry += sign * (linear + angular);
                }
            };
        impulses.prepare(points, h, v, (&objects.before, &objects.next), slope);
    }

    /// Height of the lowest point of the robot, as it was placed last \[m\]; infinite without colliders.
    pub(crate) fn lowest(&self) -> f64 {
        self.detector.lowest(&self.colliders.colliders)
    }

    /// The contact points within `margin` \[m\], as all was placed last. Those of the last step are dropped.
    pub(crate) fn detect(&mut self, margin: f64) -> &[ContactPoint] {
        self.detector.detect(&self.colliders, margin)
    }

    /// Speed of the fastest body or object \[m/s\], at the origin of its frame.
    pub(crate) fn fastest(&self, model: &Model, kinematics: &Kinematics) -> f64 {
        let bodies = self
            .frames
            .iter()
            .flatten()
            .map(|frame| kinematics.velocity(model, *frame).linear.norm_squared());
        let objects = self.objects.next.iter().map(|object| object.linear.norm_squared());
        bodies.chain(objects).fold(0.0, f64::max).sqrt()
    }

    /// The objects where the world description has them, without impulses of a step before.
    pub(crate) fn restart(&mut self, world: &World) {
        self.objects = Objects::new(world);
        for (index, object) in world.objects.iter().enumerate().filter(|(_, object)| !object.is_dynamic()) {
            self.set_object_pose(index, &object.pose());
        }
        self.detector.forget();
        self.impulses.forget();
    }

    /// Pose of object `index` of the world.
    pub(crate) fn object_pose(&self, index: usize) -> Isometry3<f64> {
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].pose,
            None => self.colliders.colliders[self.object_collider(index)].placement,
        }
    }

    /// Places object `index` of the world, at rest.
    pub(crate) fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].stop_at(*pose),
            None => {
                let collider = self.object_collider(index);
                self.colliders.colliders[collider].placement = *pose;
                self.detector.set_pose(collider, *pose);
            }
        }
    }

    /// Linear \[m/s\] and angular \[rad/s\] velocity of object `index` of the world, world axes.
    pub(crate) fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        self.objects.movable[index].map_or((Vector3::zeros(), Vector3::zeros()), |movable| {
            let body = &self.objects.now[movable];
            (body.linear, body.angular)
        })
    }

    /// The collider of object `index`: one each, after those of the robot.
    fn object_collider(&self, index: usize) -> usize {
        self.colliders.first_object + index
    }

    /// True when a contact point of the last step is on the robot.
    pub(crate) fn on_robot(&self) -> bool {
        self.detector.points().iter().any(|point| point.owners.0.is_robot() || point.owners.1.is_robot())
    }

    /// True when a contact point of the last step is between the robot and something else.
    pub(crate) fn between_robot_and_world(&self) -> bool {
        let outside = |point: &ContactPoint| point.owners.0.is_robot() != point.owners.1.is_robot();
        self.detector.points().iter().any(outside)
    }

    /// Contact points of the last step with the index of their impulse and their colliders.
    pub(crate) fn points(&self) -> impl Iterator<Item = (usize, &ContactPoint, &Collider, &Collider)> {
        let colliders = &self.colliders.colliders;
        self.detector.points().iter().enumerate().map(|(index, point)| {
            (index, point, &colliders[point.colliders.0], &colliders[point.colliders.1])
        })
    }

    /// Sum of the forces on the robot in a step of `h` \[s\], world axes \[N\].
    pub(crate) fn force_on_robot(&self, h: f64) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, point, ..) in self.points() {
            let force = self.impulses.vector(index) / h;
            match (point.owners.0.is_robot(), point.owners.1.is_robot()) {
                (true, false) => sum += force,
                (false, true) => sum -= force,
                _ => {}
            }
        }
        sum
    }
}
