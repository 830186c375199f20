//! Errors of steps and resets.

use motorium_robots::{ActuatorError, Model, TerrainError};

use crate::properties::Surface;
use crate::robot::{Articulation, BASE_BOUND};
use crate::{JointCommand, WorldError};

/// An error of a step. The state is the one before the step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// A command that is not a number, or a negative gain.
    #[error(
        "the command of joint {joint} (\"{name}\") is {command:?}: every field must be finite and no gain negative; \
         check what the controller publishes"
    )]
    InvalidCommand {
        /// Index of the joint in `q`.
        joint: usize,
        /// Its name.
        name: String,
        /// The command found.
        command: JointCommand,
    },
    /// A step length that is not a positive number.
    #[error("the step length is {0} s, expected a positive number such as 0.001")]
    InvalidStep(f64),
    /// The mass matrix could not be factorised.
    #[error(
        "the mass matrix is singular at joint {joint} (\"{name}\"): what hangs on it has no inertia; \
         give its links a mass and a rotational inertia, or the joint an armature"
    )]
    SingularMassMatrix {
        /// Index of the joint in `q`.
        joint: usize,
        /// Its name.
        name: String,
    },
    /// The state left the range in which the simulation means anything.
    #[error(
        "joint {joint} (\"{name}\") would move at {velocity} rad/s or m/s, expected less than {bound}: \
         the simulation diverges; use a shorter step, or check efforts, gains and the initial pose"
    )]
    Diverged {
        /// Index of the joint in `q`.
        joint: usize,
        /// Its name.
        name: String,
        /// Velocity after the step; may be infinite or NaN.
        velocity: f64,
        /// The bound that was broken.
        bound: f64,
    },
    /// The base left the range in which the simulation means anything.
    #[error(
        "the base \"{base}\" would move at {linear} m/s and {angular} rad/s, expected less than {} and {}: \
         the simulation diverges; use a shorter step, or check efforts, gains and the initial pose",
        BASE_BOUND.0, BASE_BOUND.1
    )]
    BaseDiverged {
        /// Its link.
        base: String,
        /// Speed of its origin after the step \[m/s\]; may be infinite or NaN.
        linear: f64,
        /// Its rate of turn \[rad/s\].
        angular: f64,
    },
    /// More contacts than the MuJoCo engine has room for.
    #[error(
        "the contacts of this step do not fit into the memory of MuJoCo; \
         let fewer objects touch one another, or use `physics.articulated`"
    )]
    TooManyContacts,
    /// The pose or velocity of an object is not a number any more.
    #[error(
        "object \"{object}\" has no finite pose after the step: \
         the simulation diverges; use a shorter step or avoid objects that start inside one another"
    )]
    ObjectDiverged {
        /// Name of the object.
        object: String,
    },
}

impl StepError {
    /// Entry `index` of the velocity of an articulation moves nothing with inertia.
    pub(crate) fn singular(own: &Articulation, index: usize) -> Self {
        let model = own.model();
        let joint = index.saturating_sub(model.nv() - model.joint_count());
        let name = model.joint_names().get(joint).map_or("the base", String::as_str).to_owned();
        let joint = own.joints().start + joint;
        Self::SingularMassMatrix { joint, name }
    }

    /// The first command that cannot be followed.
    pub(crate) fn check_commands(commands: &[JointCommand], names: &[String]) -> Result<(), Self> {
        match commands.iter().position(|command| !command.is_valid()) {
            None => Ok(()),
            Some(joint) => {
                let (name, command) = (names[joint].clone(), commands[joint]);
                Err(Self::InvalidCommand { joint, name, command })
            }
        }
    }
}

impl ResetError {
    /// The error of a terrain that cannot be made.
    pub(crate) fn terrain(error: TerrainError) -> Self {
        Self::World(WorldError::Terrain(error))
    }

    /// Checks the numbers of a state of `model`, whose first joint is joint `first` of all.
    pub(crate) fn check(model: &Model, q: &[f64], v: &[f64], first: usize) -> Result<(), Self> {
        let (offset, base) = (model.nq() - model.joint_count(), model.nv() - model.joint_count());
        if q[..offset].iter().chain(&v[..base]).any(|x| !x.is_finite())
            || offset > 0 && (q[3..7].iter().map(|x| x * x).sum::<f64>() - 1.0).abs() > 1e-6
        {
            return Err(Self::Base { pose: q[..offset].to_vec(), velocity: v[..base].to_vec() });
        }
        for (joint, name) in model.joint_names().iter().enumerate() {
            let (position, velocity) = (q[offset + joint], v[base + joint]);
            if !(position.is_finite() && velocity.is_finite()) {
                let joint = first + joint;
                return Err(Self::NotFinite { joint, name: name.clone(), position, velocity });
            }
        }
        Ok(())
    }
}

/// A state that [`Simulator::reset`](crate::Simulator::reset) refuses.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResetError {
    /// The vectors have the wrong length.
    #[error(
        "the state has {positions} positions and {velocities} velocities, expected {} and {}",
        expected.0, expected.1
    )]
    Length {
        /// Positions given.
        positions: usize,
        /// Velocities given.
        velocities: usize,
        /// Numbers for the robots of the simulation.
        expected: (usize, usize),
    },
    /// A floating base that is nowhere.
    #[error(
        "the base would start at {pose:?} with velocity {velocity:?}: expected finite numbers, and a unit quaternion x y z w \
         after the position"
    )]
    Base {
        /// Position and quaternion given.
        pose: Vec<f64>,
        /// Velocity given.
        velocity: Vec<f64>,
    },
    /// The properties of another robot or another world.
    #[error(
        "the properties are those of another robot or world; change those that `Simulation::properties` gives"
    )]
    Properties,
    /// A world with a mistake in it.
    #[error(transparent)]
    World(WorldError),
    /// A surface that cannot be.
    #[error(
        "the surface of \"{}\" has friction {} and restitution {}: expected a number from 0 up, and one from 0 to 1",
        .0.name, .0.friction, .0.restitution
    )]
    Surface(Surface),
    /// Settings of an actuator that cannot be.
    #[error("actuator: {0}")]
    Actuator(#[from] ActuatorError),
    /// Properties with which the engine cannot simulate the robot.
    #[error("{reason}")]
    Refused {
        /// Words of the engine.
        reason: String,
    },
    /// A value is not finite.
    #[error("joint {joint} (\"{name}\") would start at position {position}, velocity {velocity}: not finite")]
    NotFinite {
        /// Index of the joint in `q`.
        joint: usize,
        /// Its name.
        name: String,
        /// Position given.
        position: f64,
        /// Velocity given.
        velocity: f64,
    },
}
