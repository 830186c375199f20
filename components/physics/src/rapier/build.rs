//! Setting up the engine.

use motorium_robots::{Kinematics, Model};
use nalgebra::{Isometry3, Vector3};

use super::arm::Arm;
use super::proximity::{ENTER, Proximity};
use super::scene::{Enclose, Scene};
use super::surfaces::{self, Owner, PairTable, Surface};
use super::{Rapier, State};
use crate::articulated::{Articulated, JointProperties};
use crate::{BuildError, BuildWarning, JointCommand, Options, Simulator, World};

impl Rapier {
    /// A simulation of `model` in `world`, at rest at `q` (nq \[rad or m\]).
    ///
    /// # Errors
    ///
    /// [`BuildError`]. What is merely doubtful is in [`warnings`](Rapier::warnings).
    pub fn new(model: Model, world: World, q: &[f64], options: Options) -> Result<Self, BuildError> {
        options.check()?;
        if model.base().floating {
            return Err(BuildError::FloatingBase { robot: model.name().to_owned() });
        }
        world.check(model.frames().iter().map(|frame| frame.name.as_str()))?;
        let n = model.nv();
        let mut warnings = Vec::new();
        let surfaces = surfaces::list(&model, &world, options.friction, &mut warnings);
        let joints = JointProperties::of(&model, options.armature);
        let (scene, arm) = populate(&model, &world, &options, &surfaces, |call| call());
        let pairs = PairTable::new(&surfaces, &model, &world, options.self_collision);
        let mut simulation = Self {
            gravity: Vector3::from(world.gravity),
            state: State::new(n),
            commands: vec![JointCommand::default(); n],
            articulated: Articulated::new(&model, joints),
            kinematics: Kinematics::new(&model),
            proximity: Proximity::new(&surfaces, &pairs),
            overdriven: vec![false; n],
            near: false,
            stale: true,
            dt: 1e-3,
            model,
            options,
            world,
            warnings,
            surfaces,
            pairs,
            scene,
            arm,
        };
        simulation.reset(q, &vec![0.0; n])?;
        simulation.settle_pairs();
        BuildWarning::of_joints(
            &simulation.model,
            simulation.articulated.joints(),
            q,
            &mut simulation.warnings,
        );
        Ok(simulation)
    }

    /// Takes links that start close to one another out of the self-collision, and warns of links inside things.
    fn settle_pairs(&mut self) {
        self.place_surfaces();
        let mut off = Vec::new();
        for (first, second, distance) in self.proximity.within(&self.surfaces, ENTER) {
            let (a, b) = (&self.surfaces[first], &self.surfaces[second]);
            let robot = |surface: &Surface| matches!(surface.owner, Owner::Base | Owner::Body(_));
            if robot(a) && robot(b) {
                off.push((first, second));
                self.warnings.push(BuildWarning::SelfCollisionOff {
                    first: b.name.clone(),
                    second: a.name.clone(),
                    distance,
                });
            } else if distance == 0.0 {
                let (link, other) = if robot(a) { (a, b) } else { (b, a) };
                self.warnings
                    .push(BuildWarning::StartsInside { link: link.name.clone(), other: other.name.clone() });
            }
        }
        for (first, second) in off {
            self.pairs.set(first, second, false);
        }
        self.proximity = Proximity::new(&self.surfaces, &self.pairs);
    }

    /// Tells the proximity check where every surface is.
    pub(super) fn place_surfaces(&mut self) {
        let (kinematics, scene) = (&self.kinematics, &self.scene);
        self.proximity.place(&self.surfaces, |owner| match owner {
            Owner::Base | Owner::Ground => Isometry3::identity(),
            Owner::Body(index) => kinematics.body_pose(index),
            Owner::Object(index) => scene.object_pose(index),
        });
    }
}

/// Rapier's sets with the objects at their start and the robot switched off.
pub(super) fn populate(
    model: &Model,
    world: &World,
    options: &Options,
    surfaces: &[Surface],
    enclose: Enclose,
) -> (Scene, Arm) {
    let mut scene = Scene::new(world, options.contact_iterations, enclose);
    let arm = Arm::new(model, &JointProperties::of(model, options.armature), &mut scene);
    for (index, surface) in surfaces.iter().enumerate() {
        let body = match surface.owner {
            Owner::Base => Some(arm.base),
            Owner::Body(body) => Some(arm.links[body]),
            Owner::Object(object) => Some(scene.objects[object]),
            Owner::Ground => None,
        };
        scene.attach(index, surface, body);
    }
    (scene, arm)
}
