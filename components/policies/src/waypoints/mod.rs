//! `policy.waypoints`: drives a base from pose to pose.

mod config;

pub use config::{WaypointConfig, WaypointsConfig};

use motorium::component::{Component, ConfigureError, Episode, EpisodeEnd, Setup, Tick};
use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium::state::{BaseState, Odometry, TwistTarget};
use motorium::transport::{Input, Output, Parameter};
use motorium_primitives::profile::MotionLimits;
use motorium_primitives::reach::Repeat;
use motorium_primitives::route::{Place, Route, RouteSettings, Stop, turn_between};
use motorium_robots::{MobileBase, Model, Steering};
use nalgebra::{Quaternion, UnitQuaternion};

use crate::robot::warn_of_angles;

/// A policy that drives a base through planar poses by feedback from its odometry; see [`Route`].
///
/// A goal is reached if the base is within the tolerances at the end of the dwell time. The pose for this
/// evaluation comes from the odometry or, if wired, from the input `true_base`. That input is used for
/// nothing else.
#[derive(Debug)]
pub struct WaypointsPolicy {
    odometry: Input<Odometry>,
    truth: Input<BaseState>,
    target: Output<TwistTarget>,
    speed_factor: Parameter<f64>,
    route: Route,
    /// The route as configured.
    start: Route,
    tolerance: [f64; 2],
    episode_end: Option<EpisodeEnd>,
    record: Record,
}

/// Statistics of the goals.
#[derive(Debug, Default)]
struct Record {
    reached: u64,
    missed: u64,
    /// Largest distance and angle at a goal.
    worst: Option<[f64; 2]>,
    beside: Option<f64>,
}

/// Fraction of the wheel speed used for planning; the rest is available for corrections.
const PLANNED: f64 = 0.8;

impl Component for WaypointsPolicy {
    const KIND: &'static str = "policy.waypoints";
    const SUMMARY: &'static str = "drives a wheeled base through planar poses";
    const RESETS: bool = true;
    type Config = WaypointsConfig;

    fn declare(config: &WaypointsConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        route(config, declare.robot())?;
        for (index, goal) in config.goals.iter().enumerate() {
            warn_of_angles(&format!("goals[{index}].yaw"), goal.yaw.as_slice(), declare);
        }
        declare.may_end_episodes();
        declare.input::<Odometry>("odometry", "pose of the base");
        declare.optional_input::<BaseState>("true_base", "true pose of the base, for evaluating goals");
        declare.output::<TwistTarget>("target", "target velocity of the base, in its own axes");
        declare.float("speed", 1.0, 0.0..=1.0, "", "speed factor; 0 stops the base");
        Ok(())
    }

    fn configure(config: WaypointsConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let route = route(&config, setup.robot().ok())?;
        Ok(Self {
            odometry: setup.input("odometry")?,
            truth: setup.input("true_base")?,
            target: setup.output("target")?,
            speed_factor: setup.parameter("speed")?,
            start: route.clone(),
            route,
            tolerance: [config.position_tolerance, config.yaw_tolerance],
            episode_end: setup.episode_end(),
            record: Record::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(odometry) = self.odometry.latest() else { return Ok(()) };
        let at = Place { x: odometry.position[0], y: odometry.position[1], yaw: odometry.yaw };
        // scaling time instead of speed keeps the arcs
        let factor = self.speed_factor.get();
        let step = self.route.step(at, factor * tick.dt());
        let truth = self.truth.latest().map(|base| planar_pose(&base));
        if let Some(wanted) = step.stopped {
            self.record.judge(wanted, truth.unwrap_or(at), self.tolerance);
        }
        if let Some(beside) = step.beside {
            self.record.beside = Some(self.record.beside.unwrap_or(0.0).max(beside));
        }
        if self.route.is_finished()
            && let Some(end) = &self.episode_end
        {
            end.end();
        }
        let mut target = self.target.loan()?;
        target.linear = [factor * step.command.x, factor * step.command.y, 0.0];
        target.angular = [0.0, 0.0, factor * step.command.yaw];
        target.publish()
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.route.clone_from(&self.start);
        self.record = Record::default();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Record { reached, missed, worst, beside } = &self.record;
        Some(serde_json::json!({
            "goals_reached": reached,
            "goals_missed": missed,
            "position_error_m": worst.map(|worst| worst[0]),
            "yaw_error_rad": worst.map(|worst| worst[1]),
            "path_error_m": beside,
            "finished": self.route.is_finished(),
        }))
    }
}

impl Record {
    fn judge(&mut self, wanted: Place, at: Place, tolerance: [f64; 2]) {
        let distance = (wanted.x - at.x).hypot(wanted.y - at.y);
        let error = [distance, turn_between(wanted.yaw, at.yaw).abs()];
        let is_reached = error.iter().zip(&tolerance).all(|(error, tolerance)| error <= tolerance);
        self.reached += u64::from(is_reached);
        self.missed += u64::from(!is_reached);
        let worst = self.worst.unwrap_or_default();
        self.worst = Some([worst[0].max(error[0]), worst[1].max(error[1])]);
    }
}

/// Returns the planar pose of a base.
fn planar_pose(base: &BaseState) -> Place {
    let [x, y, z, w] = base.orientation;
    let (_, _, yaw) = UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).euler_angles();
    Place { x: base.position[0], y: base.position[1], yaw }
}

/// Creates the route of a configuration for a robot.
fn route(config: &WaypointsConfig, robot: Option<&RobotReference>) -> Result<Route, ConfigError> {
    if config.goals.is_empty() {
        return Err(ConfigError::key("goals", "no goal is given, expected at least one"));
    }
    let robot = crate::robot::required(robot, "wheels")?;
    let loaded = crate::robot::load(robot)?;
    let base = loaded.profile.as_ref().and_then(|profile| profile.mobile_base.as_ref()).ok_or_else(|| {
        let message = format!("robot `{}` has no wheels: its profile has no [mobile_base]", robot.name);
        ConfigError::key("robot", message)
    })?;
    if matches!(base.drive, Steering::Ackermann | Steering::SteeredWheels) {
        let message =
            format!("robot `{}` cannot turn on the spot, as this policy does at its goals", robot.name);
        return Err(
            ConfigError::key("robot", message).advise("it supports differential and omnidirectional bases")
        );
    }
    let [speed, turn_speed] = fastest(&loaded.model, base);
    let settings = RouteSettings {
        drive: MotionLimits {
            velocity: positive("speed", config.speed.unwrap_or(speed.min(0.5)))?,
            acceleration: positive("acceleration", config.acceleration)?,
            jerk: positive("jerk", config.jerk)?,
        },
        turn: MotionLimits {
            velocity: positive("turn_speed", config.turn_speed.unwrap_or(turn_speed.min(1.0)))?,
            acceleration: positive("turn_acceleration", config.turn_acceleration)?,
            jerk: positive("turn_jerk", config.turn_jerk)?,
        },
        sideways: base.drive == Steering::Omnidirectional,
        gain: positive("gain", config.gain)?,
        turn_gain: positive("turn_gain", config.turn_gain)?,
        length: positive("length", config.length)?,
        // a tenth of the tolerance, because the base's error when it continues also affects the next goal
        arrival: [
            0.1 * positive("position_tolerance", config.position_tolerance)?,
            0.1 * positive("yaw_tolerance", config.yaw_tolerance)?,
        ],
        grace: config.grace.as_secs_f64(),
        forever: config.repeat == Repeat::Forever,
    };
    let mut stops = Vec::new();
    for (index, goal) in config.goals.iter().enumerate() {
        for number in goal.position.iter().chain(&goal.yaw) {
            if number.abs() > 1e6 {
                let message = format!("{number}, expected a number of at most 1e6");
                return Err(ConfigError::key(format!("goals[{index}]"), message));
            }
        }
        stops.push(Stop { position: goal.position, yaw: goal.yaw, dwell: goal.dwell.as_secs_f64() });
    }
    Ok(Route::new(stops, settings))
}

fn positive(key: &str, value: f64) -> Result<f64, ConfigError> {
    if value.is_finite() && value > 0.0 {
        return Ok(value);
    }
    Err(ConfigError::key(key, format!("{value}, expected a positive number")))
}

/// Returns the forward speed and turn rate used for planning, from the velocity limits of the base's joints.
fn fastest(model: &Model, base: &MobileBase) -> [f64; 2] {
    let limit =
        |joint: &String| model.joint_index(joint).map_or(f64::INFINITY, |i| model.velocity_limit()[i]);
    if base.wheels.is_empty() {
        let limits: Vec<f64> = base.joints.iter().map(limit).collect();
        return [0, 2].map(|place| PLANNED * limits.get(place).copied().unwrap_or(f64::INFINITY));
    }
    let rim = base.wheels.iter().map(limit).fold(f64::INFINITY, f64::min) * base.wheel_radius.unwrap_or(1.0);
    // half the track is the distance of a wheel from the centre of rotation
    [PLANNED * rim, PLANNED * rim / (0.5 * base.track.unwrap_or(1.0))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_are_judged_by_distance_and_by_angle() {
        let mut record = Record::default();
        let wanted = Place { x: 1.0, y: 2.0, yaw: 3.12 };
        record.judge(wanted, Place { x: 1.01, ..wanted }, [0.02, 0.01]);
        record.judge(wanted, Place { x: 1.03, ..wanted }, [0.02, 0.01]);
        record.judge(wanted, Place { yaw: -3.15, ..wanted }, [0.02, 0.01]);
        assert_eq!((record.reached, record.missed), (1, 2));
        let [distance, angle] = record.worst.unwrap();
        assert!((distance - 0.03).abs() < 1e-12 && (angle - 0.013_185).abs() < 1e-5, "{angle}");
    }

    #[test]
    fn planar_pose_is_independent_of_lean() {
        let turn = UnitQuaternion::from_euler_angles(0.01, -0.02, 2.5);
        let base =
            BaseState { position: [1.0, 2.0, 0.3], orientation: turn.coords.into(), ..BaseState::default() };
        let found = planar_pose(&base);
        assert!((found.yaw - 2.5).abs() < 1e-12 && (found.x, found.y) == (1.0, 2.0));
    }
}
