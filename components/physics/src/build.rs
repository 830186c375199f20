//! Errors and warnings of setting up a simulation.

use motorium_robots::{ActuatorError, MeshCollision, Model, ObjectShape};

use crate::joint::JointProperties;
use crate::{
    Capabilities, ConnectError, Integrator, LibraryError, Options, ResetError, RobotSetup, World, WorldError,
};

/// An error of setting up a simulation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// The world description has a mistake.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A floating base with the rapier engine.
    #[error(
        "robot \"{robot}\" has a floating base, which the rapier engine cannot simulate; \
         use `physics.articulated` (`ArticulatedSimulator`)"
    )]
    FloatingBase {
        /// The robot.
        robot: String,
    },
    /// No robot at all.
    #[error(
        "a simulation needs a robot; for objects alone take one that hangs out of their way, such as `pendulum`"
    )]
    NoRobot,
    /// Two links or two joints of the robots have one name.
    #[error("two of the robots have a link or a joint \"{name}\"; give each a prefix (`Model::prefixed`)")]
    Name {
        /// The name.
        name: String,
    },
    /// Several articulations with the rapier engine.
    #[error(
        "the rapier engine simulates one articulation; join robots with fixed bases by `Model::world`, or use \
         `physics.articulated` (`ArticulatedSimulator`)"
    )]
    SeveralArticulations,
    /// A terrain with the rapier engine.
    #[error("the rapier engine simulates no terrain; use `physics.articulated` (`ArticulatedSimulator`)")]
    Terrain,
    /// The world, or a robot, has something that the engine cannot simulate.
    #[error(
        "the {engine} engine simulates no {ability}, which \"{owner}\" has; use `physics.articulated` \
         (`ArticulatedSimulator`)"
    )]
    Unable {
        /// The engine.
        engine: &'static str,
        /// Unsupported feature.
        ability: &'static str,
        /// The object, link, `ground` or `terrain`.
        owner: String,
        /// Surface property of a link: `soft` or `grain`.
        surface: Option<&'static str>,
    },
    /// A connection of the world that cannot be made.
    #[error(transparent)]
    Connection(#[from] ConnectError),
    /// The library of the MuJoCo engine is not there.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// MuJoCo cannot simulate this robot or world.
    #[error("MuJoCo refuses the model: {reason}; `physics.articulated` (`ArticulatedSimulator`) may take it")]
    Refused {
        /// Words of MuJoCo.
        reason: String,
    },
    /// An actuator that is not ideal, with another engine than ours.
    #[error("this engine simulates ideal drives only; use `physics.articulated` (`ArticulatedSimulator`)")]
    IdealDrives,
    /// A method of integration that the engine does not have.
    #[error(
        "the {engine} engine has a method of integration of its own; leave `integrator` out, or use `physics.articulated` \
         (`ArticulatedSimulator`)"
    )]
    Integrator {
        /// The engine.
        engine: &'static str,
    },
    /// The settings of an actuator have a mistake.
    #[error("actuator of joint \"{joint}\": {error}")]
    Actuator {
        /// The joint.
        joint: String,
        /// The mistake.
        error: ActuatorError,
    },
    /// The initial state has a mistake.
    #[error("initial state: {0}")]
    State(#[from] ResetError),
    /// A setting is out of its range.
    #[error("`{name}` is {value}, expected {expected}")]
    Option {
        /// The setting.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The range expected.
        expected: &'static str,
    },
}

/// A warning about the set-up of a simulation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildWarning {
    /// A collision shape that cannot be used.
    #[error(
        "a collision shape of link \"{link}\" is ignored: {reason}; \
         a box, cylinder, sphere or capsule needs no mesh"
    )]
    ShapeIgnored {
        /// The link.
        link: String,
        /// The problem.
        reason: String,
    },
    /// A collision rule for links that the robot does not have.
    #[error("a collision rule is ignored: {reason}")]
    RuleIgnored {
        /// The problem.
        reason: String,
    },
    /// A robot without collision shapes in a world that has something to touch.
    #[error(
        "robot \"{robot}\" has no collision shapes: it passes through the ground and all objects; \
         `motorium robot hulls` gives its links the hulls of their visuals"
    )]
    NoShapes {
        /// The robot.
        robot: String,
    },
    /// Two links are too close at the start to ever count as touching.
    #[error(
        "links \"{first}\" and \"{second}\" start {apart:.1} mm apart and will never collide with one another; \
         start farther apart than a centimetre if they should",
        apart = distance * 1e3
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
    /// Two objects start inside one another, or one inside the ground.
    #[error(
        "\"{first}\" and \"{second}\" start {depth:.1} mm inside one another and will be pushed apart; start them farther apart",
        depth = depth * 1e3
    )]
    ObjectsOverlap {
        /// An object.
        first: String,
        /// Another object, or the ground.
        second: String,
        /// Depth of the overlap \[m\].
        depth: f64,
    },
    /// A joint starts beyond its limits.
    #[error(
        "joint \"{joint}\" starts at {position}, outside its limits {lower} to {upper}, and will be drawn back in"
    )]
    StartsBeyondLimit {
        /// The joint.
        joint: String,
        /// Initial position \[rad or m\].
        position: f64,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A drive without effort.
    #[error(
        "joint \"{joint}\" has an effort limit of zero: its drive can do nothing; correct the robot's URDF"
    )]
    NoEffort {
        /// The joint.
        joint: String,
    },
}

impl BuildWarning {
    /// The warnings as texts: one for all shapes that are ignored, one for all objects that overlap, one for
    /// all pairs of links that start too close.
    ///
    /// ```
    /// use motorium_physics::BuildWarning;
    ///
    /// let ignored = |link: &str| BuildWarning::ShapeIgnored { link: link.into(), reason: "no mesh".into() };
    /// let told = BuildWarning::summarise(&[ignored("base"), ignored("hand")]);
    /// assert_eq!(told, ["collision shapes of 2 links (base, hand) are ignored, the first: no mesh"]);
    /// ```
    pub fn summarise(warnings: &[Self]) -> Vec<String> {
        let (mut ignored, mut reasons, mut close, mut told) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut overlapping = Vec::new();
        for warning in warnings {
            match warning {
                Self::ShapeIgnored { link, reason } => {
                    reasons.push((warning, reason));
                    if !ignored.contains(&link.as_str()) {
                        ignored.push(link.as_str());
                    }
                }
                Self::SelfCollisionOff { .. } => close.push(warning),
                Self::ObjectsOverlap { .. } => overlapping.push(warning),
                other => told.push(other.to_string()),
            }
        }
        match reasons.as_slice() {
            [] => {}
            [(warning, _)] => told.push(warning.to_string()),
            [(_, reason), ..] => told.push(format!(
                "collision shapes of {} links ({}) are ignored, the first: {reason}",
                ignored.len(),
                ignored.join(", ")
            )),
        }
        match overlapping.as_slice() {
            [] => {}
            [one] => told.push(one.to_string()),
            [first, ..] => {
                told.push(format!("{} pairs of objects overlap, the first: {first}", overlapping.len()))
            }
        }
        let pair = |warning: &&Self| match warning {
            Self::SelfCollisionOff { first, second, distance } => {
                format!("{first} and {second} {:.1} mm", distance * 1e3)
            }
            other => other.to_string(),
        };
        match close.as_slice() {
            [] => {}
            [one] => told.push(one.to_string()),
            several => told.push(format!(
                "{} pairs of links start less than a centimetre apart and will never collide with one another: {}",
                several.len(),
                several.iter().map(pair).collect::<Vec<_>>().join(", ")
            )),
        }
        told
    }
}

impl BuildError {
    /// Refuses features that an engine with these capabilities does not support.
    pub(crate) fn check_abilities(
        (engine, abilities): (&'static str, Capabilities),
        setups: &[RobotSetup],
        world: &World,
        options: &Options,
    ) -> Result<(), Self> {
        if options.integrator != Integrator::Euler && !abilities.integrators {
            return Err(Self::Integrator { engine });
        }
        for setup in setups {
            setup.soft.iter().try_for_each(|(link, soft)| soft.check(link))?;
            setup.grain.iter().try_for_each(|(link, grain)| grain.check(link))?;
        }
        let objects = world.objects.iter().map(|object| {
            let turning = [object.torsional_friction, object.rolling_friction];
            let more = [object.conveyor.is_some(), object.soft.is_some(), object.grain.is_some()];
            (object.name.as_str(), turning, more)
        });
        let ground = world.ground.iter().map(|ground| {
            let turning = [ground.torsional_friction, ground.rolling_friction];
            ("ground", turning, [ground.conveyor.is_some(), ground.soft.is_some(), ground.grain.is_some()])
        });
        let terrain = world.terrain.iter().map(|terrain| {
            let turning = [terrain.torsional_friction, terrain.rolling_friction];
            ("terrain", turning, [false, terrain.soft.is_some(), false])
        });
        let links = setups.iter().flat_map(|setup| {
            let soft = setup.soft.keys().map(|link| (link.as_str(), [0.0; 2], [false, true, false]));
            soft.chain(setup.grain.keys().map(|link| (link.as_str(), [0.0; 2], [false, false, true])))
        });
        let triangles = world.objects.iter().find(|object| {
            matches!(&object.shape, ObjectShape::Mesh(mesh) if mesh.collision == MeshCollision::Triangles)
        });
        if let Some(object) = triangles.filter(|_| !abilities.triangles) {
            let ability = "contacts of the triangles of a mesh";
            return Err(Self::Unable { engine, ability, owner: object.name.clone(), surface: None });
        }
        if let Some(connection) = world.connections.first().filter(|_| !abilities.connections) {
            let (ability, owner) = ("connection", connection.parts[0].clone());
            return Err(Self::Unable { engine, ability, owner, surface: None });
        }
        let all = ground.chain(terrain).chain(objects).map(|thing| (thing, false));
        let all = all.chain(links.map(|link| (link, true)));
        for ((owner, [torsional, rolling], [conveyor, soft, grain]), is_link) in all {
            let wants = [
                (torsional > 0.0 && !abilities.rolling_friction, "torsional friction"),
                (rolling > 0.0 && !abilities.rolling_friction, "rolling friction"),
                (conveyor && !abilities.conveyors, "conveyor"),
                (soft && !abilities.textures, "soft surface"),
                (grain && !abilities.textures, "friction that differs by direction"),
            ];
            if let Some((_, ability)) = wants.into_iter().find(|(missing, _)| *missing) {
                let surface = is_link.then_some(if soft { "soft" } else { "grain" });
                return Err(Self::Unable { engine, ability, owner: owner.to_owned(), surface });
            }
        }
        Ok(())
    }

    /// Refuses robots that share a name of a link or a joint.
    pub(crate) fn check_names(setups: &[RobotSetup]) -> Result<(), Self> {
        if setups.is_empty() {
            return Err(Self::NoRobot);
        }
        for (index, own) in setups.iter().enumerate() {
            let others = || setups[..index].iter().map(|setup| &setup.model);
            let links = own.model.frames().iter().map(|frame| &frame.name);
            let mut links = links.filter(|name| others().any(|other| other.frame(name).is_ok()));
            let joints = own.model.joint_names().iter();
            let mut joints = joints.filter(|name| others().any(|other| other.joint_index(name).is_some()));
            if let Some(name) = links.next().or_else(|| joints.next()) {
                return Err(Self::Name { name: name.clone() });
            }
        }
        Ok(())
    }
}

impl BuildWarning {
    /// Robots that touch nothing of a world that has something to touch.
    pub(crate) fn without_shapes(setups: &[RobotSetup], world: &World) -> Vec<Self> {
        if world.ground.is_none() && world.terrain.is_none() && world.objects.is_empty() {
            return Vec::new();
        }
        let bare = setups.iter().map(|setup| &setup.model).filter(|model| !model.has_shapes());
        bare.map(|model| Self::NoShapes { robot: model.name().to_owned() }).collect()
    }

    /// Joints that start beyond their limits at `q` (one per joint), or whose drive has no effort.
    pub(crate) fn of_joints(model: &Model, joints: &[JointProperties], q: &[f64], into: &mut Vec<Self>) {
        for ((joint, name), position) in joints.iter().zip(model.joint_names()).zip(q.iter().copied()) {
            if position < joint.lower || position > joint.upper {
                let (lower, upper) = (joint.lower, joint.upper);
                into.push(Self::StartsBeyondLimit { joint: name.clone(), position, lower, upper });
            }
            if joint.effort_limit == 0.0 {
                into.push(Self::NoEffort { joint: name.clone() });
            }
        }
    }
}

impl Options {
    /// Checks every value.
    pub(crate) fn check(&self) -> Result<(), BuildError> {
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
            if good {
                Ok(())
            } else {
                Err(BuildError::Option { name, value, expected: "a number from 0 up" })
            }
        };
        count("substeps", self.substeps)?;
        count("contact_iterations", self.contact_iterations)?;
        amount("armature", self.armature)?;
        amount("friction", self.friction)?;
        if !(0.0..=1.0).contains(&self.restitution) {
            let (name, value) = ("restitution", self.restitution);
            return Err(BuildError::Option { name, value, expected: "a number from 0 to 1" });
        }
        Ok(())
    }
}
