//! The contact scene: colliders, objects that move, and the impulses between all of them.

use motorium_robots::{Kinematics, Terrain, TerrainError};
use nalgebra::{Isometry3, Vector3};

use super::colliders::{Collider, Colliders, Owner};
use super::detect::{ContactPoint, Detector, DetectorState};
use super::impulses::Impulses;
use super::objects::{FreeBody, Objects};
use crate::robot::{Articulation, Robot};
use crate::{Surface, World};

/// Colliders, their poses, their contact points, and the impulses there.
pub(crate) struct ContactScene {
    colliders: Colliders,
    detector: Detector,
    pub(crate) impulses: Impulses,
    pub(crate) objects: Objects,
}

/// The state of a [`ContactScene`] that later steps depend on.
#[derive(Clone, Debug)]
pub(crate) struct SceneState {
    detector: DetectorState,
    impulses: Vec<(u64, [f64; 3])>,
    objects: Vec<FreeBody>,
    /// Of the objects that do not move.
    placements: Vec<Isometry3<f64>>,
}

impl ContactScene {
    /// A scene of these colliders; `world` gives the objects.
    pub(crate) fn new(robot: &Robot, colliders: Colliders, world: &World) -> Self {
        let detector = Detector::new(&colliders);
        let objects = Objects::new(world);
        Self {
            impulses: Impulses::new(&robot.articulations, objects.now.len(), detector.capacity()),
            objects,
            colliders,
            detector,
        }
    }

    /// The colliders.
    pub(crate) fn colliders(&self) -> &Colliders {
        &self.colliders
    }

    /// Takes over a surface for each collider, and the masses of the articulations.
    pub(crate) fn set_properties(&mut self, surfaces: &[Surface], articulations: &[Articulation]) {
        self.colliders.set_surfaces(surfaces);
        self.impulses.set_masses(articulations);
    }

    /// Takes over the heights of another terrain of the same size. True if they are others.
    pub(crate) fn set_terrain(&mut self, terrain: Option<&Terrain>) -> Result<bool, TerrainError> {
        self.colliders.set_terrain(terrain)
    }

    /// Takes pairs of colliders out of the detection. The poses must be [set](Self::set_poses) anew.
    pub(crate) fn exclude(&mut self, pairs: &[[usize; 2]]) {
        self.colliders.exclude(pairs);
        self.detector = Detector::new(&self.colliders);
    }

    /// Places each articulation as its `kinematics` stands, its base as in `bases`, and the objects in their next state.
    pub(crate) fn set_poses<'a>(
        &mut self,
        kinematics: impl Fn(usize) -> &'a Kinematics,
        bases: &[Isometry3<f64>],
    ) {
        self.detector.set_poses(&self.colliders, (kinematics, bases), &self.objects.next);
    }

    /// Sets up the impulses at the contact points for a step of `h` \[s\]: the objects of the next state fall, the
    /// articulations move with `v`.
    pub(crate) fn prepare<'a>(
        &mut self,
        articulations: &[Articulation],
        kinematics: impl Fn(usize) -> &'a Kinematics,
        v: &[f64],
        (gravity, h): (&Vector3<f64>, f64),
    ) {
        let Self { detector, impulses, objects, .. } = self;
        let points = detector.keep_for(h);
        // Poses do not change yet: only the velocities fall.
        objects.before_fall();
        objects.fall(gravity, h);
        let slopes = |owner: Owner, point: &ContactPoint, axes: &[_; 3], sign: f64, columns: &mut [_]| {
            let (of, body) = match owner {
                Owner::Base(of) => (of, None),
                Owner::Body(of, index) => (of, Some(index)),
                Owner::World | Owner::Object(_) => return,
            };
            let model = articulations[of].model();
            kinematics(of).add_point_jacobian(model, body, &point.point, (axes, sign), columns);
        };
        impulses.prepare(points, h, v, (&objects.before, &objects.next), slopes);
    }

    /// Height of the lowest point of an articulation, as it was placed last \[m\]; infinite without colliders.
    pub(crate) fn lowest(&self, articulation: usize) -> f64 {
        self.detector.lowest(&self.colliders.colliders, articulation)
    }

    /// Height of the lowest point of an articulation above the terrain below it \[m\]; `None` without a terrain.
    pub(crate) fn above_terrain(&self, articulation: usize) -> Option<f64> {
        self.detector.above_terrain(&self.colliders, articulation)
    }

    /// The contact points within `least` \[m\] and those that may touch within `h` \[s\], as all was placed last. Those of
    /// the last step are dropped.
    pub(crate) fn detect(&mut self, h: f64, least: f64) -> &[ContactPoint] {
        self.detector.detect(&self.colliders, h, least)
    }

    /// All that later steps depend on.
    pub(crate) fn save(&self) -> SceneState {
        SceneState {
            detector: self.detector.save(),
            impulses: self.impulses.save(),
            objects: self.objects.now.clone(),
            placements: self.placements().collect(),
        }
    }

    /// True for a state of a scene with as many pairs and objects.
    pub(crate) fn fits(&self, state: &SceneState) -> bool {
        self.detector.fits(&state.detector)
            && self.objects.now.len() == state.objects.len()
            && self.placements().count() == state.placements.len()
    }

    /// Goes back to a saved state of this scene.
    pub(crate) fn restore(&mut self, state: &SceneState) {
        self.objects.now.clone_from(&state.objects);
        self.objects.begin();
        for (collider, placement) in (self.colliders.first_object..).zip(&state.placements) {
            self.colliders.colliders[collider].placement = *placement;
            self.detector.set_pose(collider, *placement);
        }
        self.detector.restore(&state.detector);
        self.impulses.restore(&state.impulses);
    }

    /// Placements of the colliders after those of the robot.
    fn placements(&self) -> impl Iterator<Item = Isometry3<f64>> {
        self.colliders.colliders[self.colliders.first_object..].iter().map(|collider| collider.placement)
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

    /// True when a contact point of the last step is on a robot.
    pub(crate) fn on_robot(&self) -> bool {
        self.detector.points().iter().any(|point| point.owners.0.is_robot() || point.owners.1.is_robot())
    }

    /// True when a contact point of the last step is between an articulation and something else.
    pub(crate) fn is_held(&self, articulation: usize) -> bool {
        let own = |owner: Owner| owner.articulation() == Some(articulation);
        let outside = |point: &ContactPoint| own(point.owners.0) != own(point.owners.1);
        self.detector.points().iter().any(outside)
    }

    /// Contact points of the last step with the index of their impulse and their colliders.
    pub(crate) fn points(&self) -> impl Iterator<Item = (usize, &ContactPoint, &Collider, &Collider)> {
        let colliders = &self.colliders.colliders;
        self.detector.points().iter().enumerate().map(|(index, point)| {
            (index, point, &colliders[point.colliders.0], &colliders[point.colliders.1])
        })
    }

    /// Sum of the forces on the robots in a step of `h` \[s\], world axes \[N\].
    pub(crate) fn force_on_robot(&self, h: f64) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, point, ..) in self.points() {
            let force = self.impulses.vector(index, &point.normal) / h;
            match (point.owners.0.is_robot(), point.owners.1.is_robot()) {
                (true, false) => sum += force,
                (false, true) => sum -= force,
                _ => {}
            }
        }
        sum
    }
}
