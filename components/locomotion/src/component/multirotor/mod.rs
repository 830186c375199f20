//! `control.multirotor`: a controller that flies a rotor-driven robot to a target pose.

mod config;

pub use config::MultirotorConfig;

use motorium::prelude::*;
use motorium_control::checks::{downward_gravity, in_range};
use motorium_control::measured::{load_robot, required_robot};
use motorium_control::{GoalError, GoalRecord, GoalTolerance};
use motorium_robots::{Kinematics, Loaded, Spin};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::multirotor::{Flight, FlightControl, FlightSettings, FlightTarget, Mixer, Propeller};

/// A controller that converts target poses to rotor thrusts; see [`FlightControl`] and [`Mixer`].
///
/// Without a target, the controller holds the initial pose of the robot. Without a fresh base state, it
/// commands nothing, so the rotors stop.
pub struct MultirotorController {
    base_state: Input<BaseState>,
    target: Input<PoseTarget>,
    joint_command: Output<JointCommand>,
    parts: Parts,
    config: MultirotorConfig,
    goal: Option<Goal>,
    thrusts: Vec<f64>,
    record: GoalRecord,
    /// Number of the current goal, and the time since the target came to rest there, s.
    rested: (u64, f64),
    last_ns: Option<u64>,
    saturated: u64,
    stale: u64,
}

/// The last applied target.
#[derive(Clone, Copy, Debug)]
struct Goal {
    target: FlightTarget,
    number: u64,
    rests: bool,
}

/// Time constant of the target's acceleration estimate, the derivative of its velocity, s.
const SMOOTHING: f64 = 0.02;

/// Maximum feed-forward acceleration of the target, m/s^2.
const MOST_ACCELERATION: f64 = 5.0;

/// Validated components of a controller.
struct Parts {
    control: FlightControl,
    mixer: Mixer,
    tolerance: GoalTolerance,
}

impl Parts {
    fn new(config: &MultirotorConfig, robot: &RobotReference) -> Result<Self, ConfigError> {
        in_range("position_frequency", config.position_frequency, 0.1..=100.0)?;
        in_range("attitude_frequency", config.attitude_frequency, 1.0..=1000.0)?;
        in_range("integral_rate", config.integral_rate, 0.0..=config.position_frequency)?;
        in_range("max_tilt", config.max_tilt, 0.01..=1.4)?;
        in_range("max_thrust_share", config.max_thrust_share, 0.1..=1.0)?;
        let gravity = downward_gravity(config.gravity)?;
        in_range("position_tolerance", config.position_tolerance, 1e-9..=1e3)?;
        in_range("yaw_tolerance", config.yaw_tolerance, 1e-9..=10.0)?;
        if config.attitude_frequency < 3.0 * config.position_frequency {
            let message = format!(
                "{} rad/s, expected at least three times `position_frequency`, {} rad/s: otherwise the robot oscillates",
                config.attitude_frequency,
                3.0 * config.position_frequency
            );
            return Err(ConfigError::key("attitude_frequency", message));
        }
        let refused = |message: String| ConfigError::key("robot", message);
        let Loaded { model, profile, .. } = load_robot(robot)?;
        let rotors = profile.map(|profile| profile.rotors).unwrap_or_default();
        if rotors.is_empty() {
            let message = format!("robot `{}` has no rotors: its profile has no [rotors.NAME]", robot.name);
            return Err(refused(message).advise(
                "add a table for each rotor, with `frame`, `spin`, `max_thrust` and `torque_per_thrust`",
            ));
        }
        if model.joint_count() > 0 {
            let message =
                format!("robot `{}` has joints, but this controller flies only rigid bodies", robot.name);
            return Err(refused(message).advise("make the joints of the robot `fixed` in the URDF"));
        }
        if !model.base().floating {
            let message = format!("the base of robot `{}` is fixed", robot.name);
            return Err(refused(message).advise("write `base = \"floating\"` in the robot's profile"));
        }
        let inertia = &model.base().inertia;
        let mut kinematics = Kinematics::new(&model);
        let mut q = model.neutral();
        q[..7].copy_from_slice(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        kinematics.update(&model, &q);
        let mut propellers = Vec::new();
        for rotor in rotors.values() {
            let frame = model.frame(&rotor.frame).map_err(|error| refused(error.to_string()))?;
            let pose = kinematics.pose(&model, frame);
            let sign = if rotor.spin == Spin::Clockwise { 1.0 } else { -1.0 };
            propellers.push(Propeller {
                position: pose.translation.vector - inertia.com,
                direction: pose.rotation * Vector3::z(),
                max_thrust: rotor.max_thrust,
                torque_per_thrust: sign * rotor.torque_per_thrust,
            });
        }
        let mixer = Mixer::new(&propellers)
            .map_err(|error| refused(format!("the rotors of robot `{}`: {error}", robot.name)))?;
        let weight = inertia.mass * gravity;
        let most = config.max_thrust_share * mixer.max_thrust();
        if most < 1.05 * weight {
            let message = format!(
                "the rotors of robot `{}` produce at most {most:.3} N, but the robot weighs {weight:.3} N",
                robot.name
            );
            return Err(
                refused(message).advise("raise `max_thrust_share`, or check `max_thrust` and the mass")
            );
        }
        let flight = Flight { mass: inertia.mass, inertia: inertia.rotational, gravity };
        let settings = FlightSettings {
            position: config.position_frequency,
            attitude: config.attitude_frequency,
            integral: config.integral_rate,
            max_tilt: config.max_tilt,
            thrust: [0.02 * most, most],
        };
        Ok(Self {
            control: FlightControl::new(flight, settings),
            mixer,
            tolerance: GoalTolerance {
                position: config.position_tolerance,
                orientation: config.yaw_tolerance,
            },
        })
    }
}

impl Component for MultirotorController {
    const KIND: &'static str = "control.multirotor";
    const SUMMARY: &'static str = "flies a multirotor to target poses";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = MultirotorConfig;

    fn declare(config: &MultirotorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        Parts::new(config, required_robot(declare)?)?;
        declare.input::<BaseState>("base_state", "measured pose and velocity of the base");
        declare
            .optional_input::<PoseTarget>("target", "target pose; only the yaw of its orientation is used");
        declare.output::<JointCommand>("joint_command", "thrust of each rotor, as its effort");
        Ok(())
    }

    fn configure(config: MultirotorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let parts = Parts::new(&config, setup.robot()?)?;
        Ok(Self {
            base_state: setup.input("base_state")?,
            target: setup.input("target")?,
            joint_command: setup.output("joint_command")?,
            thrusts: vec![0.0; parts.mixer.rotors()],
            record: GoalRecord::new(parts.tolerance),
            parts,
            config,
            goal: None,
            rested: (0, 0.0),
            last_ns: None,
            saturated: 0,
            stale: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(base) = self.base_state.latest() else { return Ok(()) };
        if base.age_ns() > self.config.state_timeout.ns {
            self.stale += 1;
            self.last_ns = None;
            return Ok(());
        }
        let (pose, velocity, angular) = (
            isometry(base.position, base.orientation),
            base.linear_velocity.into(),
            base.angular_velocity.into(),
        );
        if self.last_ns.is_none() {
            self.parts.control.reset();
        }
        self.last_ns = Some(tick.time_ns);
        let dt = tick.dt();
        self.take_target(&pose, dt);
        let Some(goal) = self.goal else { return Ok(()) };
        let (thrust, torque) = self.parts.control.update(&goal.target, &pose, &velocity, &angular, dt);
        let whole = self.parts.mixer.mix(thrust, &torque, &mut self.thrusts);
        self.saturated += u64::from(!whole);
        self.observe(&goal, &pose, dt);
        let mut command = self.joint_command.loan()?;
        command.set_count(self.thrusts.len());
        command.position_mut().fill(0.0);
        command.velocity_mut().fill(0.0);
        command.kp_mut().fill(0.0);
        command.kd_mut().fill(0.0);
        command.effort_mut().copy_from_slice(&self.thrusts);
        command.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.parts.control.reset();
        self.record.reset();
        (self.goal, self.rested, self.last_ns) = (None, (0, 0.0), None);
        (self.saturated, self.stale) = (0, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let goals = self.record.summary();
        Some(serde_json::json!({
            "position_error_m": goals.worst.map(|error| error.position),
            "yaw_error_rad": goals.worst.and_then(|error| error.orientation),
            "goals_reached": goals.reached,
            "goals_missed": goals.missed,
            "last_position_error_m": self.record.latest().map(|error| error.position),
            "steps_with_saturated_rotors": self.saturated,
            "steps_without_fresh_state": self.stale,
        }))
    }
}

impl MultirotorController {
    /// Applies the newest target; the initial pose is the first target.
    fn take_target(&mut self, pose: &Isometry3<f64>, dt: f64) {
        let Some(target) = self.target.latest() else {
            let here = FlightTarget {
                position: pose.translation.vector,
                yaw: [yaw_of(&pose.rotation), 0.0],
                ..FlightTarget::default()
            };
            self.goal = self.goal.or(Some(Goal { target: here, number: 0, rests: false }));
            return;
        };
        let stands = target.age_ns() > self.config.target_timeout.ns;
        let turn = isometry(target.position, target.orientation);
        let (velocity, rate) =
            if stands { ([0.0; 3], 0.0) } else { (target.linear_velocity, target.angular_velocity[2]) };
        let velocity = Vector3::from(velocity);
        let acceleration = self.goal.map_or(Vector3::zeros(), |goal| {
            let slope = ((velocity - goal.target.velocity) / dt).cap_magnitude(MOST_ACCELERATION);
            goal.target.acceleration + (slope - goal.target.acceleration) * (dt / SMOOTHING).min(1.0)
        });
        self.goal = Some(Goal {
            target: FlightTarget {
                acceleration,
                position: turn.translation.vector,
                velocity,
                yaw: [yaw_of(&turn.rotation), rate],
            },
            number: target.goal,
            rests: target.at_goal != 0,
        });
    }

    /// Records the error at a goal after the settling time.
    fn observe(&mut self, goal: &Goal, pose: &Isometry3<f64>, dt: f64) {
        if self.rested.0 != goal.number || !goal.rests {
            self.rested = (goal.number, 0.0);
        }
        self.rested.1 += dt;
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw_of(&pose.rotation) - goal.target.yaw[0]);
        let error = GoalError {
            position: (pose.translation.vector - goal.target.position).norm(),
            orientation: Some(turned.angle()),
        };
        let settled = goal.rests && self.rested.1 >= self.config.settle.as_secs_f64();
        self.record.observe(goal.number, settled, error, dt);
    }
}

fn isometry(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Isometry3<f64> {
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6).unwrap_or_default();
    Isometry3::from_parts(Translation3::from(position), turn)
}

fn yaw_of(turn: &UnitQuaternion<f64>) -> f64 {
    let ahead = turn * Vector3::x();
    ahead.y.atan2(ahead.x)
}
