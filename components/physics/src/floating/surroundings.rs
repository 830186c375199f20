//! What the robot can touch: pieces, objects that move, and the impulses between all of them.

use motorium_robots::{FrameId, Kinematics, Model, Reference};
use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::contact::{Detector, Impulses, Objects, Owner, Piece, Touch, list, may_touch};
use crate::{BuildWarning, Options, World};

/// Links that start closer than this never touch one another \[m\].
const TOO_CLOSE: f64 = 0.010;

/// Pieces, where they are, what they touch, and what pushes there.
pub(super) struct Surroundings {
    pieces: Vec<Piece>,
    detector: Detector,
    pub(super) impulses: Impulses,
    pub(super) objects: Objects,
    self_collision: bool,
    /// Pairs of pieces that never touch, the lower index first.
    never: Vec<(usize, usize)>,
    /// Index of the piece of the first object.
    first_object: usize,
    /// A frame on the base, and on each body.
    frames: Vec<Option<FrameId>>,
    /// Jacobians of those frames, local-world-aligned, and where they are: filled in when something touches.
    jacobians: Vec<(bool, DMatrix<f64>, Vector3<f64>)>,
}

impl Surroundings {
    pub(super) fn new(
        model: &Model,
        world: &World,
        options: &Options,
        warnings: &mut Vec<BuildWarning>,
    ) -> Self {
        let objects = Objects::new(world);
        let pieces = list(model, world, options.friction, &objects.movable, warnings);
        let owner = |index: usize| pieces[index].owner;
        let detector =
            Detector::new(&pieces, |a, b| may_touch(model, owner(a), owner(b), options.self_collision));
        let on = |body: Option<usize>| {
            let there = |frame: &motorium_robots::Frame| frame.body == body && !frame.in_world;
            let name = model.frames().iter().find(|frame| there(frame)).map(|frame| frame.name.as_str());
            name.and_then(|name| model.frame(name).ok())
        };
        let bodies = model.bodies().len();
        let frames: Vec<_> =
            std::iter::once(on(None)).chain((0..bodies).map(|body| on(Some(body)))).collect();
        let jacobian = (false, DMatrix::zeros(6, model.nv()), Vector3::zeros());
        Self {
            impulses: Impulses::new(model.nv(), detector.capacity()),
            jacobians: vec![jacobian; frames.len()],
            self_collision: options.self_collision,
            never: Vec::new(),
            first_object: pieces.len() - world.objects.len() - usize::from(world.ground.is_some()),
            frames,
            pieces,
            detector,
            objects,
        }
    }

    /// Takes links that are close to one another out of the self-collision, and warns of links inside things. To be called
    /// when everything is placed; when it says that it took some, place everything and ask again: there may be more.
    pub(super) fn settle(&mut self, model: &Model, warnings: &mut Vec<BuildWarning>) -> bool {
        let before = self.never.len();
        let mut off = std::mem::take(&mut self.never);
        for touch in self.detector.detect(&self.pieces, TOO_CLOSE) {
            let (a, b) = (touch.pieces.0.min(touch.pieces.1), touch.pieces.0.max(touch.pieces.1));
            let (first, second) = (&self.pieces[a], &self.pieces[b]);
            if first.owner.is_robot() && second.owner.is_robot() {
                if !off.contains(&(a, b)) {
                    off.push((a, b));
                    let (first, second) = (first.name.clone(), second.name.clone());
                    let distance = touch.distance.max(0.0);
                    // Links of several pieces are named once.
                    let named = |warning: &BuildWarning| {
                        matches!(warning, BuildWarning::SelfCollisionOff { first: a, second: b, .. }
                            if (a, b) == (&first, &second))
                    };
                    if !warnings.iter().any(named) {
                        warnings.push(BuildWarning::SelfCollisionOff { first, second, distance });
                    }
                }
            } else if first.owner.is_robot() && touch.distance < -1e-3 {
                let warning =
                    BuildWarning::StartsInside { link: first.name.clone(), other: second.name.clone() };
                if !warnings.contains(&warning) {
                    warnings.push(warning);
                }
            }
        }
        if off.len() > before {
            let owner = |index: usize| self.pieces[index].owner;
            self.detector = Detector::new(&self.pieces, |a, b| {
                may_touch(model, owner(a), owner(b), self.self_collision) && !off.contains(&(a, b))
            });
        }
        self.never = off;
        self.never.len() > before
    }

    /// Takes note of where the robot and the objects of the next state are.
    pub(super) fn place(&mut self, kinematics: &Kinematics, q: &[f64]) {
        let objects = &self.objects.next;
        self.detector.place(&self.pieces, |owner| match owner {
            Owner::World => Isometry3::identity(),
            Owner::Base => base_pose(q),
            Owner::Body(index) => kinematics.body_pose(index),
            Owner::Object(index) => objects[index].pose,
        });
    }

    /// Finds what touches within `margin` \[m\] and sets up its impulses for a step of `h` \[s\]: the objects of the next state
    /// fall, the robot moves with `v`. Gives the number of touches.
    pub(super) fn meet(
        &mut self,
        model: &Model,
        kinematics: &Kinematics,
        v: &[f64],
        (gravity, h, margin): (&Vector3<f64>, f64, f64),
    ) -> usize {
        let Self { pieces, detector, impulses, objects, frames, jacobians, .. } = self;
        let touches = detector.detect(pieces, margin);
        // Poses do not change yet: only the velocities fall.
        objects.before_fall();
        objects.fall(gravity, h);
        jacobians.iter_mut().for_each(|(known, ..)| *known = false);
        let slope = |owner: Owner, touch: &Touch, direction: &Vector3<f64>, sign: f64, row: &mut [f64]| {
            let slot = match owner {
                Owner::Base => 0,
                Owner::Body(index) => index + 1,
                Owner::World | Owner::Object(_) => return,
            };
            let Some(frame) = frames[slot] else { return };
            let (known, jacobian, origin) = &mut jacobians[slot];
            if !*known {
                *known = true;
                kinematics.jacobian(model, frame, Reference::LocalWorldAligned, jacobian);
                *origin = kinematics.pose(model, frame).translation.vector;
            }
            let turn = (touch.point.coords - *origin).cross(direction);
            for (entry, column) in row.iter_mut().zip(jacobian.column_iter()) {
                let linear = column[0] * direction.x + column[1] * direction.y + column[2] * direction.z;
                let angular = column[3] * turn.x + column[4] * turn.y + column[5] * turn.z;
                *entry += sign * (linear + angular);
            }
        };
        impulses.prepare(touches, h, v, (&objects.before, &objects.next), slope);
        touches.len()
    }

    /// Height of the lowest point of the robot, as it was placed last \[m\].
    pub(super) fn lowest(&self) -> f64 {
        self.detector.lowest(&self.pieces)
    }

    /// Whether anything is nearer than `margin` \[m\] to anything it may touch, as it was placed last. What is known of the
    /// touches of the last step is lost.
    pub(super) fn any_within(&mut self, margin: f64) -> bool {
        !self.detector.detect(&self.pieces, margin).is_empty()
    }

    /// Speed of the fastest body or object \[m/s\], at the origin of its frame.
    pub(super) fn fastest(&self, model: &Model, kinematics: &Kinematics) -> f64 {
        let bodies =
            self.frames.iter().flatten().map(|frame| kinematics.velocity(model, *frame).linear.norm());
        let objects = self.objects.next.iter().map(|object| object.linear.norm());
        bodies.chain(objects).fold(0.0, f64::max)
    }

    /// The objects where the world description has them, no touch remembered.
    pub(super) fn restart(&mut self, world: &World) {
        self.objects = Objects::new(world);
        self.impulses.forget();
    }

    /// Pose of an object of the world.
    pub(super) fn object_pose(&self, index: usize) -> Isometry3<f64> {
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].pose,
            None => self.pieces[self.object_piece(index)].placement,
        }
    }

    /// Places an object of the world and stops it.
    pub(super) fn set_object_pose(&mut self, index: usize, pose: Isometry3<f64>) {
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].stop_at(pose),
            None => {
                let piece = self.object_piece(index);
                self.pieces[piece].placement = pose;
                self.detector.set_pose(piece, pose);
            }
        }
    }

    /// Linear \[m/s\] and angular \[rad/s\] velocity of an object of the world.
    pub(super) fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        self.objects.movable[index].map_or((Vector3::zeros(), Vector3::zeros()), |movable| {
            let body = &self.objects.now[movable];
            (body.linear, body.angular)
        })
    }

    /// The piece of an object: one each, after those of the robot.
    fn object_piece(&self, index: usize) -> usize {
        self.first_object + index
    }

    /// Whether something that is not the robot touches it.
    pub(super) fn touch_robot(&self) -> bool {
        let outside = |touch: &Touch| touch.owners.0.is_robot() != touch.owners.1.is_robot();
        self.detector.touches().iter().any(outside)
    }

    /// Touches of the last step, with their impulses \[Ns\].
    pub(super) fn touches(&self) -> impl Iterator<Item = (usize, &Touch, &Piece, &Piece)> {
        self.detector
            .touches()
            .iter()
            .enumerate()
            .map(|(index, touch)| (index, touch, &self.pieces[touch.pieces.0], &self.pieces[touch.pieces.1]))
    }

    /// Sum of the forces on the robot in a step of `h` \[s\].
    pub(super) fn force_on_robot(&self, h: f64) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, touch, ..) in self.touches() {
            let force = self.impulses.vector(index) / h;
            match (touch.owners.0.is_robot(), touch.owners.1.is_robot()) {
                (true, false) => sum += force,
                (false, true) => sum -= force,
                _ => {}
            }
        }
        sum
    }
}

/// Pose of a floating base in the world.
pub(super) fn base_pose(q: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(q[6], q[3], q[4], q[5]));
    Isometry3::from_parts(Translation3::new(q[0], q[1], q[2]), rotation)
}
