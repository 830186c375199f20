//! Errors of steps and resets.

use motorium_robots::{ActuatorError, Model};
use motorium_worlds::TerrainError;

use crate::surface::Surface;
use crate::{JointSetpoint, WorldError};

/// Linear \[m/s\] and angular \[rad/s\] speed of a base beyond which the simulation is no longer meaningful.
pub(crate) const BASE_BOUND: (f64, f64) = (200.0, 1000.0);

/// The step failed. The simulator keeps its state from before the step.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepError {
    /// A command contains a field that is not finite, or a negative gain.
    #[error(
        "the command of joint {joint} (\"{name}\") is {command:?}, expected finite fields and gains from 0 up; \
         check the controller's commands"
    )]
    InvalidCommand {
        /// Index of the joint in `q`.
        joint: usize,
        /// Name of the joint.
        name: String,
        /// Rejected command.
        command: Box<JointSetpoint>,
    },
    /// The step length is not a positive number.
    #[error("the step length is {0} s, expected a positive number such as 0.001")]
    InvalidStep(f64),
    /// The mass matrix could not be factorised.
    #[error(
        "the mass matrix is singular at joint {joint} (\"{name}\"): the bodies that it moves have no inertia; \
         give its links a mass and a rotational inertia, or the joint an armature"
    )]
    SingularMassMatrix {
        /// Index of the joint in `q`.
        joint: usize,
        /// Name of the joint.
        name: String,
    },
    /// A joint velocity exceeds the bound up to which the simulation is meaningful.
    #[error(
        "joint {joint} (\"{name}\") would reach {velocity} rad/s or m/s, expected less than {bound}; \
         the simulation diverges; use a shorter step, or check efforts, gains and the initial pose"
    )]
    Diverged {
        /// Index of the joint in `q`.
        joint: usize,
        /// Name of the joint.
        name: String,
        /// Velocity at the end of the step; may be infinite or NaN.
        velocity: f64,
        /// Bound that the velocity exceeds.
        bound: f64,
    },
    /// The velocity of a base exceeds the bound up to which the simulation is meaningful.
    #[error(
        "the base \"{base}\" would reach {linear} m/s and {angular} rad/s, expected less than {} and {}; \
         the simulation diverges; use a shorter step, or check efforts, gains and the initial pose",
        BASE_BOUND.0, BASE_BOUND.1
    )]
    BaseDiverged {
        /// Name of the base link.
        base: String,
        /// Speed of the base's origin at the end of the step \[m/s\]; may be infinite or NaN.
        linear: f64,
        /// Angular speed of the base at the end of the step \[rad/s\]; may be infinite or NaN.
        angular: f64,
    },
    /// The step has more contacts than the MuJoCo engine has memory for.
    #[error(
        "the step has more contacts than fit into MuJoCo's memory; \
         reduce the number of touching objects, or use `physics.articulated`"
    )]
    TooManyContacts,
    /// The pose or velocity of an object is no longer finite.
    #[error(
        "object \"{object}\" would have a pose that is not finite; \
         the simulation diverges; use a shorter step, or avoid objects that overlap at the start"
    )]
    ObjectDiverged {
        /// Name of the object.
        object: String,
    },
}

impl StepError {
    /// Returns an error for the first invalid command.
    pub(crate) fn check_commands(commands: &[JointSetpoint], names: &[String]) -> Result<(), Self> {
        match commands.iter().position(|command| !command.is_valid()) {
            None => Ok(()),
            Some(joint) => {
                let (name, command) = (names[joint].clone(), commands[joint]);
                Err(Self::InvalidCommand { joint, name, command: Box::new(command) })
            }
        }
    }
}

impl ResetError {
    /// Creates the error for an invalid terrain.
    pub(crate) fn terrain(error: TerrainError) -> Self {
        Self::World(WorldError::Terrain(error))
    }

    /// Checks the numbers of a state of `model`. The first joint of the model has index `first` among all
    /// joints.
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

/// The state passed to [`Simulator::reset`](crate::Simulator::reset) was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ResetError {
    /// The vectors have the wrong length.
    #[error(
        "the state has {positions} positions and {velocities} velocities, expected {} and {}",
        expected.0, expected.1
    )]
    Length {
        /// Number of positions given.
        positions: usize,
        /// Number of velocities given.
        velocities: usize,
        /// Expected numbers of positions and velocities.
        expected: (usize, usize),
    },
    /// The pose or velocity of a floating base is invalid.
    #[error(
        "the base would start at {pose:?} with velocity {velocity:?}, expected finite numbers, with a unit quaternion x y z w \
         after the position"
    )]
    Base {
        /// Position and quaternion given.
        pose: Vec<f64>,
        /// Velocity given.
        velocity: Vec<f64>,
    },
    /// The properties do not match the robots and the world of the simulation.
    #[error(
        "the properties belong to a different robot or world; start from the properties returned by \
         `Simulation::properties`"
    )]
    Properties,
    /// The world is invalid.
    #[error(transparent)]
    World(WorldError),
    /// A surface has an invalid friction or restitution.
    #[error(
        "the surface of \"{}\" has friction {} and restitution {}, expected a friction of at least 0 and a restitution from 0 to 1",
        .0.name, .0.friction, .0.restitution
    )]
    Surface(Surface),
    /// The settings of an actuator are invalid.
    #[error("actuator: {0}")]
    Actuator(#[from] ActuatorError),
    /// The engine cannot simulate the robot with the changed properties.
    #[error("{reason}")]
    Refused {
        /// Message of the engine.
        reason: String,
    },
    /// A value is not finite.
    #[error(
        "joint {joint} (\"{name}\") would start at position {position} and velocity {velocity}, expected finite numbers"
    )]
    NotFinite {
        /// Index of the joint in `q`.
        joint: usize,
        /// Name of the joint.
        name: String,
        /// Position given.
        position: f64,
        /// Velocity given.
        velocity: f64,
    },
}
