//! Conversion of the velocity of a robot's base to the setpoints of all its joints.

use motorium_robots::{
    Dynamics, Gains, Kinematics, MobileBase, Model, Profile, ProfileError, Steering, UnknownFrame,
};
use nalgebra::{Isometry3, Vector3};

use super::{BaseKind, PlanarTwist, Wheel, WheelBase, WheelDrive, WheelError, WheelLimits, WheelsConfig};

/// Ratio of proportional to derivative gain for wheels without a gain in the profile, 1/s.
const KP_PER_KD: f64 = 20.0;

/// A joint that moves the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseJoint {
    /// Index of the joint among the robot's joints.
    pub index: usize,
    /// Sign of the joint's axis: 1, or -1 if it is opposite to the base's convention.
    pub sign: f64,
}

/// Error returned when the wheels of a robot cannot be controlled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotWheelsError {
    /// The profile of the robot has no mobile base.
    #[error("robot `{robot}` has no wheels: its profile has no [mobile_base]")]
    Missing {
        /// Name of the robot.
        robot: String,
    },
    /// The mobile base names an unknown joint.
    #[error("robot `{robot}` has no joint \"{joint}\"")]
    Joint {
        /// Name of the robot.
        robot: String,
        /// Name of the joint.
        joint: String,
    },
    /// The mobile base names an unknown frame.
    #[error(transparent)]
    Frame(#[from] UnknownFrame),
    /// The number of pose joints is not 3.
    #[error("[mobile_base] has {found} joints, expected 3: x, y, yaw")]
    PoseJoints {
        /// Number of joints.
        found: usize,
    },
    /// All wheels steer independently, which is not supported.
    #[error("every wheel of robot `{robot}` steers independently, which this controller does not support")]
    Independent {
        /// Name of the robot.
        robot: String,
    },
    /// The wheels do not suit the kind of base.
    #[error("[mobile_base] of robot `{robot}`: {source}")]
    Wheels {
        /// Name of the robot.
        robot: String,
        /// The reason.
        source: WheelError,
    },
    /// The profile has no gains for the joints.
    #[error(transparent)]
    Gains(ProfileError),
    /// The acceleration limits of the profile are invalid.
    #[error(transparent)]
    Limits(ProfileError),
}

impl RobotWheelsError {
    /// Returns an action that fixes the error, if one is known.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            Self::Missing { .. } => Some(
                "add `[mobile_base]` to the robot's profile, with `drive`, `frame`, `wheels` and `wheel_radius`",
            ),
            Self::Independent { .. } => Some("use a differential, Ackermann or omnidirectional base"),
            Self::Gains(_) => Some("add `[gains]` to the profile of the robot"),
            _ => None,
        }
    }
}

/// Computes the joint setpoints that move the wheeled base of a robot at a given velocity: the control law of
/// `control.wheels`.
///
/// Wheels follow [`WheelDrive`] with setpoints of angle and speed. Other joints hold their initial positions.
/// Only [`new`](Self::new) and [`clone`](Clone::clone) allocate.
///
/// ```
/// use motorium_locomotion::wheels::{PlanarTwist, RobotWheels, WheelsConfig};
///
/// let rover = motorium_robots::load("differential-drive", std::path::Path::new("."))?;
/// let named = ("rover", &rover.model);
/// let mut wheels = RobotWheels::new(named, rover.profile.as_ref(), &WheelsConfig::default())?;
/// let measured = [0.0; 2];
/// wheels.begin(&measured);
/// for _ in 0..200 {
///     wheels.follow(&PlanarTwist { x: 0.1, y: 0.0, yaw: 0.5 }, &measured, 0.005);
/// }
/// // the right wheel, at 8 cm from the middle, is faster
/// assert!((wheels.velocity()[1] - (0.1 + 0.5 * 0.08) / 0.033).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RobotWheels {
    model: Model,
    drive: WheelDrive,
    wheels: Vec<BaseJoint>,
    /// Steering joint of every wheel.
    steering: Vec<Option<BaseJoint>>,
    gains: Gains,
    max_lead: f64,
    /// Gravity torques for an upright base; `None` without compensation.
    dynamics: Option<Dynamics>,
    /// Gravitational acceleration, m/s^2.
    down: Vector3<f64>,
    configuration: Vec<f64>,
    gravity: Vec<f64>,
    setpoint: Vec<f64>,
    rate: Vec<f64>,
    effort: Vec<f64>,
    steered: Vec<f64>,
}

impl RobotWheels {
    /// Creates the controller of a robot at rest, given the robot's name and model.
    ///
    /// # Errors
    ///
    /// [`RobotWheelsError`] if the robot has no suitable `[mobile_base]` or no gains.
    pub fn new(
        (robot, model): (&str, &Model),
        profile: Option<&Profile>,
        config: &WheelsConfig,
    ) -> Result<Self, RobotWheelsError> {
        let missing = || RobotWheelsError::Missing { robot: robot.to_owned() };
        let profile = profile.ok_or_else(missing)?;
        let facts = profile.mobile_base.as_ref().ok_or_else(missing)?;
        let (base, wheels, steering) = geometry((robot, model), facts)?;
        let gains = gains(config, model, profile, &wheels)?;
        let limits = limits(config, model, profile, &base, &wheels)?;
        let steers = |joint: &Option<BaseJoint>| match joint {
            None => [0.0; 3],
            Some(BaseJoint { index, sign }) => {
                let (one, other) = (sign * model.lower()[*index], sign * model.upper()[*index]);
                [one.min(other), one.max(other), model.velocity_limit()[*index]]
            }
        };
        let steering_limits = steering.iter().map(steers).collect();
        let zeros = vec![0.0; model.joint_count()];
        Ok(Self {
            drive: WheelDrive::new(base, limits, steering_limits),
            max_lead: config.max_lead,
            dynamics: config.gravity_compensation.then(|| Dynamics::new(model)),
            down: config.gravity.into(),
            configuration: model.neutral(),
            gravity: vec![0.0; model.nv()],
            setpoint: zeros.clone(),
            rate: zeros.clone(),
            effort: zeros,
            steered: vec![0.0; wheels.len()],
            model: model.clone(),
            wheels,
            steering,
            gains,
        })
    }

    /// Returns the wheel drive, with its limits.
    pub fn drive(&self) -> &WheelDrive {
        &self.drive
    }

    /// Returns the joint of every wheel, or the pose joints of a planar base.
    pub fn wheels(&self) -> &[BaseJoint] {
        &self.wheels
    }

    /// Returns `true` if a joint is part of the base.
    pub fn is_of_base(&self, joint: usize) -> bool {
        self.wheels.iter().chain(self.steering.iter().flatten()).any(|own| own.index == joint)
    }

    /// Returns the gains of all joints.
    pub fn gains(&self) -> &Gains {
        &self.gains
    }

    /// Returns the position setpoints of all joints \[rad or m\].
    pub fn position(&self) -> &[f64] {
        &self.setpoint
    }

    /// Returns the velocity setpoints of all joints \[rad/s or m/s\].
    pub fn velocity(&self) -> &[f64] {
        &self.rate
    }

    /// Returns the feed-forward efforts of all joints \[Nm or N\]: gravity compensation, and 0 for wheels.
    pub fn effort(&self) -> &[f64] {
        &self.effort
    }

    /// Sets the position at which a joint outside the base is held \[rad or m\].
    pub fn hold(&mut self, joint: usize, position: f64) {
        self.setpoint[joint] = position;
    }

    /// Starts at rest, with all joints at their measured positions \[rad or m\].
    pub fn begin(&mut self, measured: &[f64]) {
        for (steered, joint) in self.steered.iter_mut().zip(&self.steering) {
            *steered = joint.map_or(0.0, |joint| joint.sign * measured[joint.index]);
        }
        self.drive.begin(&self.steered);
        self.setpoint.copy_from_slice(measured);
        self.rate.fill(0.0);
    }

    /// Advances all setpoints by a time step `dt` \[s\] towards the velocity `twist` of the base; `measured`
    /// contains the joint positions \[rad or m\]. Returns `true` once the velocity is reached.
    pub fn follow(&mut self, twist: &PlanarTwist, measured: &[f64], dt: f64) -> bool {
        let yaw = match self.drive.base().kind() {
            BaseKind::Planar => self.wheels[2].sign * measured[self.wheels[2].index],
            _ => 0.0,
        };
        let follows = self.drive.follow(twist, yaw, dt);
        self.lead(measured, dt);
        self.compensate(measured);
        follows
    }

    /// Advances the setpoints of the base's joints.
    fn lead(&mut self, measured: &[f64], dt: f64) {
        for (place, joint) in self.wheels.iter().enumerate() {
            let BaseJoint { index, sign } = *joint;
            self.rate[index] = sign * self.drive.speeds()[place];
            let lead = self.setpoint[index] + self.rate[index] * dt - measured[index];
            self.setpoint[index] = measured[index] + lead.clamp(-self.max_lead, self.max_lead);
        }
        for (place, joint) in self.steering.iter().enumerate() {
            let Some(BaseJoint { index, sign }) = *joint else { continue };
            self.setpoint[index] = sign * self.drive.steering()[place];
            self.rate[index] = sign * self.drive.steering_rate()[place];
        }
    }

    /// Computes the efforts that hold the joints against gravity.
    fn compensate(&mut self, measured: &[f64]) {
        if let Some(dynamics) = &mut self.dynamics {
            let base = self.configuration.len() - measured.len();
            self.configuration[base..].copy_from_slice(measured);
            dynamics.gravity(&self.model, &self.configuration, self.down, &mut self.gravity);
        }
        let weights = self.model.joints_of_v(&self.gravity).iter().zip(self.model.effort_limit());
        for (effort, (weight, limit)) in self.effort.iter_mut().zip(weights) {
            *effort = weight.max(-limit).min(*limit);
        }
        for joint in &self.wheels {
            self.effort[joint.index] = 0.0;
        }
    }
}

type Geometry = (WheelBase, Vec<BaseJoint>, Vec<Option<BaseJoint>>);

/// Geometry of the base: wheel positions from the model, radii from the profile.
fn geometry((robot, model): (&str, &Model), facts: &MobileBase) -> Result<Geometry, RobotWheelsError> {
    let joint = |name: &String| {
        model
            .joint_index(name)
            .ok_or_else(|| RobotWheelsError::Joint { robot: robot.to_owned(), joint: name.clone() })
    };
    if facts.drive == Steering::SteeredWheels {
        return Err(RobotWheelsError::Independent { robot: robot.to_owned() });
    }
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &model.neutral());
    let frame = model.frame(&facts.frame)?;
    let from_base = kinematics.pose(model, frame).inverse();
    if facts.wheels.is_empty() {
        if facts.joints.len() != 3 {
            return Err(RobotWheelsError::PoseJoints { found: facts.joints.len() });
        }
        let joints = facts.joints.iter().map(|name| Ok(BaseJoint { index: joint(name)?, sign: 1.0 }));
        let joints = joints.collect::<Result<Vec<_>, RobotWheelsError>>()?;
        return Ok((WheelBase::planar(), joints, vec![None; 3]));
    }
    let steered: Vec<usize> = facts.steering.iter().map(joint).collect::<Result<_, _>>()?;
    let radius = facts.wheel_radius.unwrap_or(0.0);
    let (mut wheels, mut joints, mut steering) = (Vec::new(), Vec::new(), Vec::new());
    for name in &facts.wheels {
        let index = joint(name)?;
        let body = model.joint_body(index);
        let pose = from_base * kinematics.body_pose(body);
        let steers = std::iter::successors(model.bodies()[body].parent, |body| model.bodies()[*body].parent)
            .find(|body| steered.contains(&model.bodies()[*body].joint.coordinate.index()));
        let steers = steers.map(|body| BaseJoint {
            index: model.bodies()[body].joint.coordinate.index(),
            sign: sense(model, body, &(from_base * kinematics.body_pose(body)), Vector3::z()),
        });
        wheels.push(Wheel {
            position: [pose.translation.x, pose.translation.y],
            radius,
            steered: steers.is_some(),
            rollers: 0.0,
        });
        joints.push(BaseJoint { index, sign: sense(model, body, &pose, Vector3::y()) });
        steering.push(steers);
    }
    let base = match facts.drive {
        Steering::Differential => WheelBase::differential(wheels),
        Steering::Ackermann => WheelBase::ackermann(wheels),
        _ => {
            // the rollers form an X seen from above, so the forces of all wheels add up in a turn
            for wheel in &mut wheels {
                wheel.rollers = -(wheel.position[0] * wheel.position[1]).signum();
            }
            WheelBase::mecanum(wheels)
        }
    };
    let base = base.map_err(|source| RobotWheelsError::Wheels { robot: robot.to_owned(), source })?;
    Ok((base, joints, steering))
}

/// Returns 1, or -1 for a joint whose axis points against `axis` of the base.
fn sense(model: &Model, body: usize, pose: &Isometry3<f64>, axis: Vector3<f64>) -> f64 {
    let joint = pose.rotation * model.bodies()[body].joint.axis.into_inner();
    if joint.dot(&axis) < 0.0 { -1.0 } else { 1.0 }
}

/// Returns the gains of the profile, with the configured gains of the wheels.
fn gains(
    config: &WheelsConfig,
    model: &Model,
    profile: &Profile,
    wheels: &[BaseJoint],
) -> Result<Gains, RobotWheelsError> {
    let mut gains = profile.gains(model).map_err(RobotWheelsError::Gains)?;
    for BaseJoint { index, .. } in wheels {
        let kd = config.wheel_kd.unwrap_or(gains.kd[*index]);
        let usual = if gains.kp[*index] > 0.0 { gains.kp[*index] } else { KP_PER_KD * kd };
        (gains.kp[*index], gains.kd[*index]) = (config.wheel_kp.unwrap_or(usual), kd);
    }
    Ok(gains)
}

fn limits(
    config: &WheelsConfig,
    model: &Model,
    profile: &Profile,
    base: &WheelBase,
    wheels: &[BaseJoint],
) -> Result<WheelLimits, RobotWheelsError> {
    let of_profile = profile.acceleration_limit(model).map_err(RobotWheelsError::Limits)?;
    let (mut speed, mut acceleration) = (Vec::new(), Vec::new());
    for (joint, wheel) in wheels.iter().zip(base.wheels()) {
        let rim = config.speed.map_or(f64::INFINITY, |speed| speed / wheel.radius);
        speed.push(model.velocity_limit()[joint.index].min(rim));
        acceleration.push(of_profile[joint.index].min(config.acceleration / wheel.radius));
    }
    Ok(WheelLimits { speed, acceleration })
}
