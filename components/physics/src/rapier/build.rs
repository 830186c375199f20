//! Setting up the engine.

use motorium_robots::{Kinematics, Model};
use nalgebra::{Isometry3, Vector3};

use super::arm::Arm;
use super::proximity::{ENTER, Proximity};
use super::scene::{Enclose, Scene};
use super::surfaces::{self, Owner, PairTable, Surface};
use super::{Options, Rapier, State};
use crate::articulated::{Articulated, JointProperties};
use crate::{JointCommand, ResetError, Simulator, World, WorldError};

/// Why a simulation could not be set up.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// The world description has a mistake.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The initial state has a mistake.
    #[error("initial state: {0}")]
    State(#[from] ResetError),
    /// A setting is out of its range.
    #[error("`{name}` is {value}, expected {expected}")]
    Option {
        /// The setting.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What was expected.
        expected: &'static str,
    },
}

/// What is doubtful about a simulation that nevertheless runs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildWarning {
    /// A mesh is not part of the collision geometry.
    #[error(
        "the collision mesh of link \"{link}\" is ignored; give the link a box, cylinder, sphere or capsule"
    )]
    MeshIgnored {
        /// The link.
        link: String,
    },
    /// Two links are too close at the start to ever count as touching.
    #[error(
        "links \"{first}\" and \"{second}\" start {distance} m apart and will never collide with one another; \
         start farther apart than a centimetre if they should"
    )]
    SelfCollisionOff {
        /// A link.
        first: String,
        /// Another link.
        second: String,
        /// Their distance at the start \[m\].
        distance: f64,
    },
    /// A link starts inside something.
    #[error(
        "link \"{link}\" starts inside \"{other}\" and will be pushed out; start elsewhere or move \"{other}\""
    )]
    StartsInside {
        /// The link.
        link: String,
        /// The object or `ground`.
        other: String,
    },
    /// A joint starts beyond its limits.
    #[error(
        "joint \"{joint}\" starts at {position}, outside its limits {lower} to {upper}, and will be drawn back in"
    )]
    StartsBeyondLimit {
        /// The joint.
        joint: String,
        /// Where it starts \[rad or m\].
        position: f64,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A drive that can do nothing.
    #[error(
        "joint \"{joint}\" has an effort limit of zero: its drive can do nothing; correct the robot's URDF"
    )]
    NoEffort {
        /// The joint.
        joint: String,
    },
}

impl Rapier {
    /// A simulation of `model` in `world`, at rest at `q` (nq \[rad or m\]).
    ///
    /// # Errors
    ///
    /// [`BuildError`]. What is merely doubtful is in [`warnings`](Rapier::warnings).
    pub fn new(model: Model, world: World, q: &[f64], options: Options) -> Result<Self, BuildError> {
        check(&options)?;
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
        simulation.check_joints();
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

    fn check_joints(&mut self) {
        for (i, joint) in self.articulated.joints().iter().enumerate() {
            let name = self.model.joint_names()[i].clone();
            let position = self.state.q[i];
            if position < joint.lower || position > joint.upper {
                let (lower, upper) = (joint.lower, joint.upper);
                let joint = name.clone();
                self.warnings.push(BuildWarning::StartsBeyondLimit { joint, position, lower, upper });
            }
            if joint.effort_limit == 0.0 {
                self.warnings.push(BuildWarning::NoEffort { joint: name });
            }
        }
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

fn check(options: &Options) -> Result<(), BuildError> {
    let count = |name, value: usize| {
        let good = (1..=100).contains(&value);
        let value = value as f64;
        if good {
            Ok(())
        } else {
            Err(BuildError::Option { name, value, expected: "a whole number from 1 to 100" })
        }
    };
    let amount = |name, value: f64| {
        let good = value.is_finite() && value >= 0.0;
        if good { Ok(()) } else { Err(BuildError::Option { name, value, expected: "a number from 0 up" }) }
    };
    count("substeps", options.substeps)?;
    count("contact_iterations", options.contact_iterations)?;
    amount("armature", options.armature)?;
    amount("friction", options.friction)
}
