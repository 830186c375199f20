//! The contact scene: colliders, movable objects, and the impulses between all of them.

mod calm;
mod connected;

use motorium_robots::Kinematics;
use motorium_worlds::{Terrain, TerrainError};
use nalgebra::{Isometry3, Point3, Vector3};

use super::colliders::{Collider, Colliders, Owner};
use super::connections::{Connections, Joined};
use super::detect::{Detector, DetectorState};
use super::impulses::{Impulses, Known};
use super::objects::{FreeBody, Objects};
use super::parties::{Least, NEAR};
use super::point::{ContactPoint, Motion};
use super::sums::ImpulseSums;
use crate::robot::{Articulation, Robot};
use crate::{Options, Surface, World};

/// Colliders, their poses, their contact points, and the impulses there.
pub(crate) struct ContactScene {
    colliders: Colliders,
    detector: Detector,
    pub(crate) impulses: Impulses,
    pub(crate) objects: Objects,
    connections: Connections,
    /// Number of articulations.
    articulations: usize,
    /// Length of the next integration step of each articulation and each movable object \[s\]; zero if its
    /// step is complete.
    lengths: Vec<f64>,
    /// True for robots that may hold something, and for everything that they may hold; these use the steps of
    /// grasps.
    near: Vec<bool>,
    /// Number of integration steps of the current step.
    steps: usize,
    /// True if objects at rest may sleep.
    sleeping: bool,
}

/// The state of a [`ContactScene`] that later steps depend on.
#[derive(Clone, Debug)]
pub(crate) struct SceneState {
    detector: DetectorState,
    impulses: Vec<Known>,
    objects: Vec<FreeBody>,
    /// Gravity in the last integration step \[m/s2\].
    gravity: Vector3<f64>,
    /// Placements of fixed objects.
    placements: Vec<Isometry3<f64>>,
    connections: (Vec<Joined>, u64),
}

impl ContactScene {
    /// Creates a scene of these colliders with the objects of `world`.
    pub(crate) fn new(robot: &Robot, colliders: Colliders, world: &World, options: &Options) -> Self {
        let detector = Detector::new(&colliders, &robot.articulations);
        let objects = Objects::new(world, options.integrator);
        let articulations = robot.articulations.len();
        let bodies = articulations + objects.now.len();
        Self {
            articulations,
            lengths: vec![0.0; bodies],
            near: vec![false; bodies],
            steps: 1,
            sleeping: options.sleeping,
            impulses: Impulses::new(
                robot,
                objects.now.len(),
                detector.capacity() * if colliders.resist_turning() { 2 } else { 1 },
            ),
            objects,
            connections: Connections::default(),
            colliders,
            detector,
        }
    }

    /// Returns the colliders.
    pub(crate) fn colliders(&self) -> &Colliders {
        &self.colliders
    }

    /// Updates the surface of each collider and the masses of the articulations.
    pub(crate) fn set_properties(&mut self, surfaces: &[Surface], robot: &Robot) {
        self.colliders.set_surfaces(surfaces);
        self.impulses.set_masses(robot);
    }

    /// Applies the heights of another terrain of the same size. Returns `true` if they differ.
    pub(crate) fn set_terrain(&mut self, terrain: Option<&Terrain>) -> Result<bool, TerrainError> {
        self.colliders.set_terrain(terrain)
    }

    /// Excludes pairs of colliders from the detection. The poses must be [set](Self::set_poses) again.
    pub(crate) fn exclude(&mut self, robot: &Robot, pairs: &[[usize; 2]]) {
        self.colliders.exclude(pairs);
        self.detector = Detector::new(&self.colliders, &robot.articulations);
    }

    /// Places each articulation according to its `kinematics` and its base in `bases`, and the objects in
    /// their next state.
    pub(crate) fn set_poses<'a>(
        &mut self,
        kinematics: impl Fn(usize) -> &'a Kinematics,
        bases: &[Isometry3<f64>],
    ) {
        self.connections.update_points((&kinematics, bases), &self.objects.next);
        self.detector.set_poses(&self.colliders, (kinematics, bases), &self.objects.next);
    }

    /// Begins a step of `dt` \[s\] in the current poses and finds the contact points. Also finds the robots
    /// near enough to an object or to another robot to use the integration steps of contacts, together with
    /// everything they may touch. Returns the number of integration steps: the maximum over all awake bodies,
    /// each of which uses `far` or `near`.
    pub(crate) fn begin(&mut self, dt: f64, gravity: &Vector3<f64>, [far, near]: [usize; 2]) -> usize {
        self.objects.feel(gravity);
        self.lengths.fill(dt);
        self.set_moving();
        self.detector.detect(&self.colliders, &self.connections, (dt, Least::OF_STEP));
        self.add_connections();
        self.impulses.sort(self.detector.points());
        self.impulses.find_near(self.detector.points(), NEAR, &mut self.near);
        let asleep = |body: usize| self.objects.is_asleep(body.checked_sub(self.articulations));
        let awake = (0..self.near.len()).filter(|body| !asleep(*body));
        self.steps = awake.map(|body| if self.near[body] { near } else { far }).max().unwrap_or(far);
        self.steps
    }

    /// Sets the lengths of the integration step with this index, from 0.
    pub(crate) fn set_lengths(&mut self, step: usize, dt: f64, [far, near]: [usize; 2]) {
        for (body, length) in self.lengths.iter_mut().enumerate() {
            // An object may wake in any of the steps, so it uses the short ones, if any.
            let asleep = self.objects.is_asleep(body.checked_sub(self.articulations));
            let steps = if self.near[body] || asleep { near.min(self.steps) } else { far };
            *length = if step < steps { dt / steps as f64 } else { 0.0 };
        }
        self.set_moving();
    }

    /// Returns the length of the next integration step of an articulation \[s\]; zero if its step is
    /// complete.
    pub(crate) fn length(&self, articulation: usize) -> f64 {
        self.lengths[articulation]
    }

    /// Returns the length of the longest of the next integration steps \[s\].
    pub(crate) fn longest(&self) -> f64 {
        self.lengths.iter().fold(0.0, |most, length| most.max(*length))
    }

    fn set_moving(&mut self) {
        let Self { detector, colliders, objects, lengths, articulations, .. } = self;
        let of = |body: usize| if lengths[body] > 0.0 { Motion::Moves } else { Motion::Done };
        detector.set_moving(&colliders.colliders, |owner| match owner {
            Owner::World => Motion::Rests,
            Owner::Base(articulation) | Owner::Body(articulation, _) => of(articulation),
            Owner::Object(object) if objects.next[object].asleep => Motion::Rests,
            Owner::Object(object) => of(*articulations + object),
        });
    }

    /// Sets up the impulses at the contact points for an integration step. The objects of the next state fall
    /// freely, the articulations move with `v`.
    pub(crate) fn prepare<'a>(
        &mut self,
        articulations: &[Articulation],
        kinematics: impl Fn(usize) -> &'a Kinematics,
        v: &[f64],
        gravity: &Vector3<f64>,
    ) {
        let h = self.longest();
        let Self { detector, impulses, objects, lengths, .. } = self;
        detector.keep_for(h);
        impulses.wake(detector.points_mut(), &mut objects.next, lengths);
        objects.find_free(detector.points());
        // Only the velocities change by free fall; the poses do not change yet.
        objects.before_fall();
        objects.fall(gravity, &lengths[articulations.len()..]);
        let slopes = |owner: Owner, point: &Point3<f64>, axes: &[_; 3], sign: f64, columns: &mut [_]| {
            let (of, body) = match owner {
                Owner::Base(of) => (of, None),
                Owner::Body(of, index) => (of, Some(index)),
                Owner::World | Owner::Object(_) => return,
            };
            let model = articulations[of].model();
            kinematics(of).add_point_jacobian(model, body, point, (axes, sign), columns);
        };
        impulses.prepare(detector.points(), v, (&objects.before, &objects.next), slopes);
    }

    /// Adds the impulses of this integration step to `sums`. Impulses on sleeping bodies are added once per
    /// step of `dt` \[s\], in the first integration step.
    pub(crate) fn add_impulses(&self, first: bool, dt: f64, sums: &mut ImpulseSums) {
        let share = |point: &ContactPoint| match point.kept {
            false => 1.0,
            true if first => dt / point.h,
            true => 0.0,
        };
        for (index, point, ..) in self.points() {
            let (one, two) = point.colliders;
            let impulse = self.impulses.at_contact(index, point);
            sums.add([one, two], &point.point, &(impulse * share(point)));
        }
        let points = self.detector.points();
        for (index, point) in points.iter().enumerate() {
            let Some(held) = point.held else { continue };
            let impulse = self.impulses.at_contact(index, point);
            for (part, sign) in self.connections.sums(point.key).into_iter().zip([1.0, -1.0]) {
                match part {
                    Some(part) if held.turning => sums.add_moment_to(part, &(impulse * sign)),
                    Some(part) => sums.add_to(part, &point.point, &(impulse * sign)),
                    None => {}
                }
            }
        }
        for (index, moment) in self.impulses.couples(points) {
            let (one, two) = points[index].colliders;
            sums.add_moment([one, two], &(moment * share(&points[index])));
        }
    }

    /// Ends an integration step: moves the objects by their velocities with the impulses. Objects of an
    /// island in which nothing has moved for half a second are put to sleep.
    pub(crate) fn finish(&mut self) {
        let Self { detector, impulses, objects, lengths, articulations, .. } = self;
        impulses.push_objects(&mut objects.next);
        objects.move_on(&lengths[*articulations..]);
        if self.sleeping && !detector.is_full() {
            impulses.put_to_sleep(&mut objects.next);
        }
    }

    /// Returns the height of the lowest point of an articulation when it was last placed \[m\]; infinite
    /// without colliders.
    pub(crate) fn lowest(&self, articulation: usize) -> f64 {
        self.detector.lowest(&self.colliders.colliders, articulation)
    }

    /// Returns the height of the lowest point of an articulation above the terrain below it \[m\]; `None`
    /// without a terrain.
    pub(crate) fn above_terrain(&self, articulation: usize) -> Option<f64> {
        self.detector.above_terrain(&self.colliders, articulation)
    }

    /// Finds the contact points of robots within `least` \[m\] and all points that may touch within `h`
    /// \[s\], in the last placed poses. The points of the last step are dropped.
    pub(crate) fn detect(&mut self, h: f64, least: f64) -> &[ContactPoint] {
        let least = Least { robots: least, grasps: least };
        self.detector.detect(&self.colliders, &self.connections, (h, least));
        self.add_connections();
        self.detector.points()
    }

    /// Saves everything that later steps depend on.
    pub(crate) fn save(&self) -> SceneState {
        SceneState {
            detector: self.detector.save(),
            impulses: self.impulses.save(),
            objects: self.objects.now.clone(),
            gravity: self.objects.gravity,
            placements: self.placements().collect(),
            connections: self.connections.save(),
        }
    }

    /// Returns `true` if the state has the same numbers of pairs and objects.
    pub(crate) fn fits(&self, state: &SceneState) -> bool {
        self.detector.fits(&state.detector)
            && self.objects.now.len() == state.objects.len()
            && self.placements().count() == state.placements.len()
    }

    /// Restores a saved state of this scene.
    pub(crate) fn restore(&mut self, state: &SceneState) {
        self.objects.now.clone_from(&state.objects);
        self.objects.begin();
        self.objects.gravity = state.gravity;
        for (collider, placement) in (self.colliders.first_object..).zip(&state.placements) {
            self.colliders.colliders[collider].placement = *placement;
            self.detector.set_pose(collider, *placement);
        }
        self.connections.restore(&state.connections);
        self.make_room();
        self.detector.restore(&state.detector);
        self.impulses.restore(&state.impulses);
    }

    /// Returns the placements of the colliders after the robot's.
    fn placements(&self) -> impl Iterator<Item = Isometry3<f64>> {
        self.colliders.colliders[self.colliders.first_object..].iter().map(|collider| collider.placement)
    }

    /// Moves the objects to their poses in the world description, without impulses of an earlier step.
    pub(crate) fn restart(&mut self, world: &World) {
        self.objects = Objects::new(world, self.objects.method);
        for (index, object) in world.objects.iter().enumerate().filter(|(_, object)| !object.is_dynamic()) {
            self.set_object_pose(index, &object.pose());
        }
        self.connections.reset();
        self.detector.forget();
        self.impulses.forget();
    }

    /// Returns the pose of object `index` of the world.
    pub(crate) fn object_pose(&self, index: usize) -> Isometry3<f64> {
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].object_pose(),
            None => {
                let collider = &self.colliders.colliders[self.colliders.objects[index].start];
                collider.part.map_or(collider.placement, |(_, part)| collider.placement * part.inverse())
            }
        }
    }

    /// Moves object `index` of the world to a pose, at rest.
    pub(crate) fn set_object_pose(&mut self, index: usize, pose: &Isometry3<f64>) {
        // Other objects may have rested on it.
        self.objects.wake();
        match self.objects.movable[index] {
            Some(movable) => self.objects.now[movable].stop_at(*pose),
            None => {
                for index in self.colliders.objects[index].clone() {
                    let collider = &mut self.colliders.colliders[index];
                    collider.placement = collider.part.map_or(*pose, |(_, part)| pose * part);
                    self.detector.set_pose(index, collider.placement);
                }
            }
        }
    }

    /// Returns the linear \[m/s\] and angular \[rad/s\] velocity of object `index` of the world, world axes.
    pub(crate) fn object_velocity(&self, index: usize) -> (Vector3<f64>, Vector3<f64>) {
        self.objects.movable[index].map_or((Vector3::zeros(), Vector3::zeros()), |movable| {
            let body = &self.objects.now[movable];
            (body.linear, body.angular)
        })
    }

    /// Sets the velocity of object `index` of the world if it is movable.
    pub(crate) fn set_object_velocity(
        &mut self,
        index: usize,
        linear: &Vector3<f64>,
        angular: &Vector3<f64>,
    ) {
        if let Some(movable) = self.objects.movable[index] {
            self.objects.wake();
            let body = &mut self.objects.now[movable];
            (body.linear, body.angular) = (*linear, *angular);
        }
    }

    /// Returns `true` if a contact point of the last step is on a robot.
    pub(crate) fn on_robot(&self) -> bool {
        let on_robot = |point: &ContactPoint| point.owners.0.is_robot() || point.owners.1.is_robot();
        self.detector.points().iter().any(|point| point.held.is_none() && on_robot(point))
    }

    /// Returns `true` if a contact point of the last step is between an articulation and something else.
    pub(crate) fn is_held(&self, articulation: usize) -> bool {
        let own = |owner: Owner| owner.articulation() == Some(articulation);
        let outside = |point: &ContactPoint| own(point.owners.0) != own(point.owners.1);
        self.detector.points().iter().any(outside)
    }

    /// Returns `true` if a contact point of the last step is on an articulation.
    pub(crate) fn is_touched(&self, articulation: usize) -> bool {
        let own = |owner: Owner| owner.articulation() == Some(articulation);
        self.detector.points().iter().any(|point| own(point.owners.0) || own(point.owners.1))
    }

    /// Returns the contact points of the last step with the index of their impulse and their colliders.
    pub(crate) fn points(&self) -> impl Iterator<Item = (usize, &ContactPoint, &Collider, &Collider)> {
        let colliders = &self.colliders.colliders;
        let contacts = self.detector.points().iter().enumerate().filter(|(_, point)| point.held.is_none());
        contacts.map(|(index, point)| {
            (index, point, &colliders[point.colliders.0], &colliders[point.colliders.1])
        })
    }

    /// Returns the force at the contact point with this index on the first of its two colliders, world axes
    /// \[N\].
    pub(crate) fn force(&self, index: usize, point: &ContactPoint) -> Vector3<f64> {
        self.impulses.at_contact(index, point) / point.h
    }

    /// Returns the sum of the forces on the robots in the last integration step, world axes \[N\].
    pub(crate) fn force_on_robot(&self) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, point, ..) in self.points() {
            let force = self.force(index, point);
            match (point.owners.0.is_robot(), point.owners.1.is_robot()) {
                (true, false) => sum += force,
                (false, true) => sum -= force,
                _ => {}
            }
        }
        sum
    }
}
