//! Errors and warnings that occur while a simulation is set up.

use motorium_robots::{ActuatorError, Model};
use motorium_worlds::{MeshCollision, ObjectShape};

use crate::joint::JointProperties;
use crate::{
    Capabilities, ConnectError, Integrator, LibraryError, Options, ResetError, RobotSetup, World, WorldError,
};

/// The simulation cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// The world description is invalid.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The rapier engine does not support floating bases.
    #[error(
        "robot \"{robot}\" has a floating base, which the rapier engine cannot simulate; \
         use `physics.articulated` (`ArticulatedSimulator`)"
    )]
    FloatingBase {
        /// Name of the robot.
        robot: String,
    },
    /// The simulation contains no robot.
    #[error(
        "the simulation has no robot, expected at least one; for objects alone, add a robot that does not touch them, such as `pendulum`"
    )]
    NoRobot,
    /// Two links or two joints of different robots have the same name.
    #[error(
        "two robots have a link or a joint named \"{name}\"; give each robot a prefix (`Model::prefixed`)"
    )]
    Name {
        /// The duplicate name.
        name: String,
    },
    /// The rapier engine does not support several articulations.
    #[error(
        "the rapier engine does not support several articulations; join robots with fixed bases by `Model::world`, or use \
         `physics.articulated` (`ArticulatedSimulator`)"
    )]
    SeveralArticulations,
    /// The rapier engine does not support terrain.
    #[error("the rapier engine simulates no terrain; use `physics.articulated` (`ArticulatedSimulator`)")]
    Terrain,
    /// The world or a robot uses a feature that the engine does not support.
    #[error(
        "the {engine} engine simulates no {ability}, which \"{owner}\" has; use `physics.articulated` \
         (`ArticulatedSimulator`)"
    )]
    Unable {
        /// Name of the engine.
        engine: &'static str,
        /// The unsupported feature.
        ability: &'static str,
        /// Name of the object or link, or `ground` or `terrain`.
        owner: String,
        /// For a link, the property of its surface: `soft` or `grain`.
        surface: Option<&'static str>,
    },
    /// A connection of the world is invalid.
    #[error(transparent)]
    Connection(#[from] ConnectError),
    /// The MuJoCo library is not available.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// MuJoCo rejects this robot or world.
    #[error(
        "MuJoCo rejects the model: {reason}; `physics.articulated` (`ArticulatedSimulator`) may accept it"
    )]
    Refused {
        /// The message from MuJoCo.
        reason: String,
    },
    /// The engine supports ideal actuators only.
    #[error("this engine supports only ideal actuators; use `physics.articulated` (`ArticulatedSimulator`)")]
    IdealDrives,
    /// The engine does not support the requested integration method.
    #[error(
        "the {engine} engine does not support a choice of integration method; remove `integrator`, or use `physics.articulated` \
         (`ArticulatedSimulator`)"
    )]
    Integrator {
        /// Name of the engine.
        engine: &'static str,
    },
    /// The settings of an actuator are invalid.
    #[error("actuator of joint \"{joint}\": {error}")]
    Actuator {
        /// Name of the joint.
        joint: String,
        /// Error of the settings.
        error: ActuatorError,
    },
    /// The initial state is invalid.
    #[error("initial state: {0}")]
    State(#[from] ResetError),
    /// A setting is out of range.
    #[error("`{name}` is {value}, expected {expected}")]
    Option {
        /// Name of the setting.
        name: &'static str,
        /// Actual value.
        value: f64,
        /// Expected range, as a phrase.
        expected: &'static str,
    },
}

/// A problem with the set-up that does not prevent the simulation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildWarning {
    /// A collision shape is unusable.
    #[error(
        "a collision shape of link \"{link}\" is ignored: {reason}; \
         a box, cylinder, sphere or capsule needs no mesh"
    )]
    ShapeIgnored {
        /// Name of the link.
        link: String,
        /// Reason why the shape cannot be used.
        reason: String,
    },
    /// A collision rule names links that the robot does not have.
    #[error("a collision rule is ignored: {reason}")]
    RuleIgnored {
        /// Reason why the rule cannot be applied.
        reason: String,
    },
    /// The robot has no collision shapes, but the world has a ground or objects.
    #[error(
        "robot \"{robot}\" has no collision shapes and passes through the ground and all objects; \
         `motorium robot hulls` gives the links convex hulls of their visuals"
    )]
    NoShapes {
        /// Name of the robot.
        robot: String,
    },
    /// Two links start so close to each other that contacts between them are disabled.
    #[error(
        "links \"{first}\" and \"{second}\" start {apart:.1} mm apart and will never collide with each other; \
         if they should collide, start them more than 1 cm apart",
        apart = distance * 1e3
    )]
    SelfCollisionOff {
        /// Name of one link.
        first: String,
        /// Name of the other link.
        second: String,
        /// Distance between them at the start \[m\].
        distance: f64,
    },
    /// A link overlaps something at the start.
    #[error(
        "link \"{link}\" starts inside \"{other}\" and will be pushed out; change the start pose or move \"{other}\""
    )]
    StartsInside {
        /// Name of the link.
        link: String,
        /// Name of the object, or `ground`.
        other: String,
    },
    /// Two objects overlap at the start, or one overlaps the ground.
    #[error(
        "\"{first}\" and \"{second}\" start {depth:.1} mm inside each other and will be pushed apart; start them farther apart",
        depth = depth * 1e3
    )]
    ObjectsOverlap {
        /// Name of one object.
        first: String,
        /// Name of the other object, or `ground`.
        second: String,
        /// Depth of the overlap \[m\].
        depth: f64,
    },
    /// A joint starts beyond its limits.
    #[error(
        "joint \"{joint}\" starts at {position}, outside its limits {lower} to {upper}, and will be moved back into them"
    )]
    StartsBeyondLimit {
        /// Name of the joint.
        joint: String,
        /// Initial position \[rad or m\].
        position: f64,
        /// Lower limit of the joint.
        lower: f64,
        /// Upper limit of the joint.
        upper: f64,
    },
    /// A drive has an effort limit of zero.
    #[error(
        "joint \"{joint}\" has an effort limit of zero: its drive has no effect; correct the robot's URDF"
    )]
    NoEffort {
        /// Name of the joint.
        joint: String,
    },
}

impl BuildWarning {
    /// Formats the warnings. Ignored shapes, overlapping objects, and pairs of links that start too close are
    /// each summarised in one text.
    ///
    /// ```
    /// use motorium_physics::BuildWarning;
    ///
    /// let ignored = |link: &str| BuildWarning::ShapeIgnored { link: link.into(), reason: "no mesh".into() };
    /// let summary = BuildWarning::summarise(&[ignored("base"), ignored("hand")]);
    /// assert_eq!(summary, ["collision shapes of 2 links (base, hand) are ignored, the first: no mesh"]);
    /// ```
    pub fn summarise(warnings: &[Self]) -> Vec<String> {
        let (mut ignored, mut reasons, mut close, mut summary) =
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
                other => summary.push(other.to_string()),
            }
        }
        match reasons.as_slice() {
            [] => {}
            [(warning, _)] => summary.push(warning.to_string()),
            [(_, reason), ..] => summary.push(format!(
                "collision shapes of {} links ({}) are ignored, the first: {reason}",
                ignored.len(),
                ignored.join(", ")
            )),
        }
        match overlapping.as_slice() {
            [] => {}
            [one] => summary.push(one.to_string()),
            [first, ..] => {
                summary.push(format!("{} pairs of objects overlap, the first: {first}", overlapping.len()))
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
            [one] => summary.push(one.to_string()),
            several => summary.push(format!(
                "{} pairs of links start less than a centimetre apart and will never collide with each other: {}",
                several.len(),
                several.iter().map(pair).collect::<Vec<_>>().join(", ")
            )),
        }
        summary
    }
}

impl BuildError {
    /// Returns an error if the robots or the world use a feature that an engine with these abilities does not
    /// support.
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
            let ability = "triangle collision";
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
                (grain && !abilities.textures, "direction-dependent friction"),
            ];
            if let Some((_, ability)) = wants.into_iter().find(|(missing, _)| *missing) {
                let surface = is_link.then_some(if soft { "soft" } else { "grain" });
                return Err(Self::Unable { engine, ability, owner: owner.to_owned(), surface });
            }
        }
        Ok(())
    }

    /// Returns an error if two robots share the name of a link or a joint.
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
    /// Returns a warning for each robot without collision shapes in a world that has something to touch.
    pub(crate) fn without_shapes(setups: &[RobotSetup], world: &World) -> Vec<Self> {
        if world.ground.is_none() && world.terrain.is_none() && world.objects.is_empty() {
            return Vec::new();
        }
        let bare = setups.iter().map(|setup| &setup.model).filter(|model| !model.has_shapes());
        bare.map(|model| Self::NoShapes { robot: model.name().to_owned() }).collect()
    }

    /// Adds warnings for joints that start beyond their limits at `q` (one entry per joint) and for drives
    /// with an effort limit of zero.
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
    /// Checks the range of every setting.
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
