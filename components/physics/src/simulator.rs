//! What every physics engine of motorium offers, whatever it is built on.

use motorium_robots::{FrameId, Model};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::BuildWarning;

/// What one joint is told to do until it is told something else.
///
/// The drive applies, at the end of every integration step,
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + effort, -limit, +limit)
/// ```
///
/// with `limit` the effort limit of the joint: the impedance law of torque-controlled drives ("MIT mode"). `kp = kd = 0`
/// is pure effort control, `kp = 0` velocity control. `q` and `v` are those at the *end* of the step (implicit), so
/// gains of any size stay stable.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointCommand {
    /// Position setpoint \[rad or m\].
    pub position: f64,
    /// Velocity setpoint \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[Nm or N\].
    pub effort: f64,
    /// Position gain Kp \[Nm/rad or N/m\], not negative.
    pub kp: f64,
    /// Velocity gain Kd \[Nms/rad or Ns/m\], not negative.
    pub kd: f64,
}

impl JointCommand {
    /// Nothing but an effort \[Nm or N\].
    pub fn effort(effort: f64) -> Self {
        Self { effort, ..Self::default() }
    }

    /// Hold `position` \[rad or m\] with these gains.
    pub fn hold(position: f64, kp: f64, kd: f64) -> Self {
        Self { position, kp, kd, ..Self::default() }
    }

    /// Finite, and with gains that are not negative.
    pub fn is_valid(&self) -> bool {
        [self.position, self.velocity, self.effort, self.kp, self.kd].iter().all(|x| x.is_finite())
            && self.kp >= 0.0
            && self.kd >= 0.0
    }
}

/// An object of the world. Look it up once with [`Simulator::object`], outside the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectId(pub(crate) usize);

impl ObjectId {
    /// Position in the `objects` of the [`World`](crate::World).
    pub fn index(self) -> usize {
        self.0
    }
}

/// One point where two surfaces touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact<'a> {
    /// Robot link, object, or `"ground"`.
    pub first: &'a str,
    /// Robot link, object, or `"ground"`.
    pub second: &'a str,
    /// The point, in the world \[m\].
    pub point: Point3<f64>,
    /// Unit normal in the world, pointing from `first` to `second`.
    pub normal: Vector3<f64>,
    /// How deep the surfaces overlap \[m\]; not negative.
    pub depth: f64,
    /// Normal force during the last step \[N\].
    pub force: f64,
}

/// What happened in a step, beyond the state itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Joints whose effort was cut at the limit.
    pub saturated: usize,
    /// Joints that stand at a position limit.
    pub at_limit: usize,
    /// Joints faster than their velocity limit. They are not slowed down: nothing in the joint would.
    pub overspeed: usize,
    /// The robot was within reach of a contact, so the contact solver ran.
    pub near_contact: bool,
}

/// Why a step was refused. The state is the one before the step.
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
        /// What was found.
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
        /// Velocity the step led to; may be infinite or NaN.
        velocity: f64,
        /// The bound that was broken.
        bound: f64,
    },
    /// The base left the range in which the simulation means anything.
    #[error(
        "the base would move at {linear} m/s and {angular} rad/s, expected less than {} and {}: \
         the simulation diverges; use a shorter step, or check efforts, gains and the initial pose",
        BASE_BOUND.0, BASE_BOUND.1
    )]
    BaseDiverged {
        /// Speed of its origin the step led to \[m/s\]; may be infinite or NaN.
        linear: f64,
        /// Its rate of turn \[rad/s\].
        angular: f64,
    },
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

/// Speed \[m/s\] and rate of turn \[rad/s\] of a base beyond which the simulation no longer means anything.
pub(crate) const BASE_BOUND: (f64, f64) = (200.0, 1000.0);

impl StepError {
    /// Entry `index` of the velocity moves nothing with inertia.
    pub(crate) fn singular(model: &Model, index: usize) -> Self {
        let joint = index.saturating_sub(model.nv() - model.joint_count());
        let name = model.joint_names().get(joint).map_or("the base", String::as_str).to_owned();
        Self::SingularMassMatrix { joint, name }
    }

    /// The first command that cannot be followed.
    pub(crate) fn of_commands(commands: &[JointCommand], names: &[String]) -> Result<(), Self> {
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
    /// Checks length and numbers of a state.
    pub(crate) fn of_state(model: &Model, q: &[f64], v: &[f64]) -> Result<(), Self> {
        let (positions, velocities) = (model.nq(), model.nv());
        if q.len() != positions || v.len() != velocities {
            let expected = (positions, velocities);
            return Err(Self::Length { positions: q.len(), velocities: v.len(), expected });
        }
        let (offset, base) = (positions - model.joint_count(), velocities - model.joint_count());
        if q[..offset].iter().chain(&v[..base]).any(|x| !x.is_finite())
            || offset > 0 && (q[3..7].iter().map(|x| x * x).sum::<f64>() - 1.0).abs() > 1e-6
        {
            return Err(Self::Base { pose: q[..offset].to_vec(), velocity: v[..base].to_vec() });
        }
        for (joint, name) in model.joint_names().iter().enumerate() {
            let (position, velocity) = (q[offset + joint], v[base + joint]);
            if !(position.is_finite() && velocity.is_finite()) {
                return Err(Self::NotFinite { joint, name: name.clone(), position, velocity });
            }
        }
        Ok(())
    }
}

/// Why a state was refused by [`Simulator::reset`].
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
        /// Of each for this robot.
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

/// A robot in a world that moves when told to.
///
/// Vectors have one entry per drive: the independent joints of the robot, in the order of
/// [`motorium_robots::Model::joint_names`], then its rotors, if it has any. Poses are in the world, which is the base
/// frame of a robot with a fixed base. After construction and the first step nothing here allocates on the way, unless an
/// engine says so.
pub trait Simulator {
    /// The robot.
    fn model(&self) -> &Model;

    /// What was doubtful about the model or the world. Nothing is printed anywhere.
    fn warnings(&self) -> &[BuildWarning];

    /// The whole configuration (nq): a floating base first, as in [`motorium_robots`].
    fn configuration(&self) -> &[f64];

    /// The whole velocity (nv).
    fn velocity(&self) -> &[f64];

    /// Names of the drives.
    fn joint_names(&self) -> &[String];

    /// Positions q \[rad or m\].
    fn positions(&self) -> &[f64];

    /// Velocities v \[rad/s or m/s\].
    fn velocities(&self) -> &[f64];

    /// Efforts tau the drives applied during the last step, after clamping \[Nm or N\]. Joint friction, damping and
    /// limit stops are not part of it. With substeps, that of the last one.
    fn efforts(&self) -> &[f64];

    /// The commands, one per joint; they stay until changed.
    fn commands_mut(&mut self) -> &mut [JointCommand];

    /// Moves everything on by `dt` \[s\].
    ///
    /// # Errors
    ///
    /// [`StepError`]; the robot's state is then that before the step. The state never contains NaN.
    fn step(&mut self, dt: f64) -> Result<StepReport, StepError>;

    /// Puts the robot at `q` (nq) with velocity `v` (nv), the objects at the poses of the world description, at rest. Commands
    /// become zero efforts.
    ///
    /// # Errors
    ///
    /// [`ResetError`]; nothing has changed then.
    fn reset(&mut self, q: &[f64], v: &[f64]) -> Result<(), ResetError>;

    /// Acceleration of free fall in the world \[m/s2\].
    fn gravity(&self) -> Vector3<f64>;

    /// Sets the acceleration of free fall \[m/s2\].
    fn set_gravity(&mut self, gravity: Vector3<f64>);

    /// Pose of the robot's base in the world.
    fn base_pose(&self) -> Isometry3<f64> {
        Isometry3::identity()
    }

    /// Pose of a robot link in the world.
    fn frame_pose(&self, frame: FrameId) -> Isometry3<f64>;

    /// The object with this name.
    fn object(&self, name: &str) -> Option<ObjectId>;

    /// Pose of an object in the world.
    fn object_pose(&self, object: ObjectId) -> Isometry3<f64>;

    /// Places an object and stops it. A fixed one may be placed too.
    fn set_object_pose(&mut self, object: ObjectId, pose: Isometry3<f64>);

    /// Velocity of an object: linear at its centre \[m/s\] and angular \[rad/s\], world axes.
    fn object_velocity(&self, object: ObjectId) -> (Vector3<f64>, Vector3<f64>);

    /// Shows every contact point of the last step to `visit`.
    fn visit_contacts(&self, visit: &mut dyn FnMut(&Contact<'_>));

    /// Whether the two (robot link, object, or `"ground"`) touched in the last step.
    fn touching(&self, first: &str, second: &str) -> bool {
        let mut found = false;
        self.visit_contacts(&mut |contact| {
            found |= (contact.first == first && contact.second == second)
                || (contact.first == second && contact.second == first);
        });
        found
    }
}
