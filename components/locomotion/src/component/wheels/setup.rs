//! Validated settings of a wheel controller, from the model and the profile of the robot.

use motorium::prelude::*;
use motorium_control::checks::in_range;
use motorium_control::measured::load_robot;
use motorium_robots::{Gains, Kinematics, Loaded, MobileBase, Model, Profile, Steering};
use nalgebra::{Isometry3, Vector3};

use super::config::WheelsConfig;
use crate::wheels::{PlanarPose, Wheel, WheelBase, WheelDrive, WheelLimits};

/// Ratio of proportional to derivative gain for wheels without a gain in the profile, 1/s.
const KP_PER_KD: f64 = 20.0;

/// A base, its drive, and the indices of its joints in the robot.
#[derive(Debug)]
pub(super) struct WheelSetup {
    pub(super) model: Model,
    pub(super) drive: WheelDrive,
    pub(super) wheels: Vec<BaseJoint>,
    /// Steering joint of every wheel.
    pub(super) steering: Vec<Option<BaseJoint>>,
    pub(super) gains: Gains,
    pub(super) start: PlanarPose,
}

/// A joint of the base.
#[derive(Clone, Copy, Debug)]
pub(super) struct BaseJoint {
    pub(super) index: usize,
    /// -1 for an axis opposite to the base's convention.
    pub(super) sign: f64,
}

impl WheelSetup {
    pub(super) fn new(config: &WheelsConfig, robot: &RobotReference) -> Result<Self, ConfigError> {
        let Loaded { model, profile, .. } = load_robot(robot)?;
        check_numbers(config)?;
        let without = || {
            let message = format!("robot `{}` has no wheels: its profile has no [mobile_base]", robot.name);
            ConfigError::key("robot", message).advise(
                "add `[mobile_base]` to its profile, with `drive`, `frame`, `wheels` and `wheel_radius`",
            )
        };
        let profile = profile.ok_or_else(without)?;
        let facts = profile.mobile_base.as_ref().ok_or_else(without)?;
        let (base, wheels, steering) = geometry(&model, facts, &robot.name)?;
        let gains = gains(config, &model, &profile, &wheels)?;
        let limits = limits(config, &model, &profile, &base, &wheels)?;
        let steers = |joint: &Option<BaseJoint>| match joint {
            None => [0.0; 3],
            Some(BaseJoint { index, sign }) => {
                let (one, other) = (sign * model.lower()[*index], sign * model.upper()[*index]);
                [one.min(other), one.max(other), model.velocity_limit()[*index]]
            }
        };
        let steering_limits = steering.iter().map(steers).collect();
        let ([x, y], yaw) = (config.start.position, config.start.yaw);
        Ok(Self {
            drive: WheelDrive::new(base, limits, steering_limits),
            wheels,
            steering,
            gains,
            start: PlanarPose { x, y, yaw },
            model,
        })
    }
}

fn check_numbers(config: &WheelsConfig) -> Result<(), ConfigError> {
    if let Some(speed) = config.speed {
        in_range("speed", speed, 1e-6..=1e3)?;
    }
    in_range("acceleration", config.acceleration, 1e-3..=1e3)?;
    in_range("max_lead", config.max_lead, 1e-4..=1e3)?;
    in_range("slip", config.slip, 0.0..=1.0)?;
    for (key, gain) in [("wheel_kp", config.wheel_kp), ("wheel_kd", config.wheel_kd)] {
        if let Some(gain) = gain {
            in_range(key, gain, 0.0..=1e9)?;
        }
    }
    let start = [config.start.position[0], config.start.position[1], config.start.yaw];
    for number in start {
        in_range("start", number, -1e6..=1e6)?;
    }
    Ok(())
}

type Geometry = (WheelBase, Vec<BaseJoint>, Vec<Option<BaseJoint>>);

/// Geometry of the base: wheel positions from the model, radii from the profile.
fn geometry(model: &Model, facts: &MobileBase, robot: &str) -> Result<Geometry, ConfigError> {
    let refused = |message: String| ConfigError::key("robot", message);
    let joint = |name: &String| {
        model.joint_index(name).ok_or_else(|| refused(format!("robot `{robot}` has no joint \"{name}\"")))
    };
    if facts.drive == Steering::SteeredWheels {
        let message = format!(
            "every wheel of robot `{robot}` steers independently, which this controller does not support"
        );
        return Err(refused(message).advise("it supports differential, Ackermann and omnidirectional bases"));
    }
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &model.neutral());
    let frame = model.frame(&facts.frame).map_err(|error| refused(error.to_string()))?;
    let from_base = kinematics.pose(model, frame).inverse();
    if facts.wheels.is_empty() {
        if facts.joints.len() != 3 {
            let message = format!("{} joints of [mobile_base], expected 3: x, y, yaw", facts.joints.len());
            return Err(refused(message));
        }
        let joints = facts.joints.iter().map(|name| Ok(BaseJoint { index: joint(name)?, sign: 1.0 }));
        let joints = joints.collect::<Result<Vec<_>, ConfigError>>()?;
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
    let base = base.map_err(|error| refused(format!("[mobile_base] of robot `{robot}`: {error}")))?;
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
) -> Result<Gains, ConfigError> {
    let mut gains = profile.gains(model).map_err(|error| {
        ConfigError::key("robot", error.to_string()).advise("add `[gains]` to the profile of the robot")
    })?;
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
) -> Result<WheelLimits, ConfigError> {
    let of_profile =
        profile.acceleration_limit(model).map_err(|error| ConfigError::key("robot", error.to_string()))?;
    let (mut speed, mut acceleration) = (Vec::new(), Vec::new());
    for (joint, wheel) in wheels.iter().zip(base.wheels()) {
        let rim = config.speed.map_or(f64::INFINITY, |speed| speed / wheel.radius);
        speed.push(model.velocity_limit()[joint.index].min(rim));
        acceleration.push(of_profile[joint.index].min(config.acceleration / wheel.radius));
    }
    Ok(WheelLimits { speed, acceleration })
}
