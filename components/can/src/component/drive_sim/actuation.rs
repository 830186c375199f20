//! The actuator between the torque of a simulated drive and the effort on its joint.

use std::path::Path;

use super::config::DriveSimulationConfig;
use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::{Actuator, ActuatorSettings, ActuatorTable, Delay, DriveCommand, Model, Motor};

/// Velocity gain of an engaged brake, N m s/rad or N s/m. The brake reaches the joint's full effort at a very
/// low velocity.
pub(super) const BRAKE: f64 = 1e5;

/// Actuator of a joint behind a simulated drive.
pub(super) struct Actuation {
    actuator: Actuator,
    delay: Delay<f64>,
    /// Command at the motor in the previous step, for which physics now reports the load.
    command: Option<DriveCommand>,
}

/// Effort on a joint: `effort - damping * v` at its velocity `v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Effort {
    pub(super) effort: f64,
    pub(super) damping: f64,
}

/// Returns the actuators of the joints of a model; `None` for an ideal one.
pub(super) fn actuations(
    config: &DriveSimulationConfig,
    model: &Model,
    folder: &Path,
) -> Result<Vec<Option<Actuation>>, ConfigError> {
    let tables = (config.actuator.as_ref(), &config.actuators);
    let settings = ActuatorTable::of_joints(tables, model, folder, TimeSpan::as_secs_f64);
    let settings = settings.map_err(|error| {
        let refused = ConfigError::key(error.key, error.message);
        error.advice.map_or(refused.clone(), |advice| refused.advise(advice))
    })?;
    let of_joint = |joint: usize| {
        let Some(settings) = settings.get(joint).and_then(Option::as_ref) else { return Ok(None) };
        Actuation::new(settings, model.effort_limit()[joint], &model.joint_names()[joint]).map(Some)
    };
    (0..model.joint_count()).map(of_joint).collect()
}

impl Actuation {
    fn new(settings: &ActuatorSettings, limit: f64, joint: &str) -> Result<Self, ConfigError> {
        if settings.network.is_some() {
            let message = "a network replaces the control law, but the drive's protocol defines this law";
            return Err(ConfigError::key(format!("actuators.{joint}.network"), message)
                .advise("leave it out, or let `physics.articulated` simulate the drive"));
        }
        let actuator = Actuator::new(settings, limit).map_err(|error| {
            ConfigError::key(format!("actuators.{joint}.{}", error.setting), error.to_string())
        })?;
        Ok(Self { actuator, delay: Delay::new(settings.delay, 0.0), command: None })
    }

    /// Returns the state of the motor after a step of `h` \[s\]. `joint` is the state reported by physics,
    /// and `effort` the effort that acted on the joint.
    pub(super) fn motor(&mut self, joint: Motor, effort: f64, h: f64) -> Motor {
        self.actuator.begin(joint);
        if let Some(command) = self.command.take() {
            self.actuator.apply_load(&command, effort, h);
        }
        self.actuator.motor().unwrap_or(joint)
    }

    /// Returns the effort on the joint in the next step of `h` \[s\] for the drive's torque; an engaged brake
    /// damps the motor.
    pub(super) fn effort(&mut self, wanted: f64, brake: f64, joint: Motor, h: f64) -> Effort {
        let acting = self.delay.acting(wanted);
        self.delay.advance(wanted, h);
        // The motor does not produce the effort of a brake. That effort counts towards the motor's limits
        // only if both are on one shaft.
        let command = DriveCommand { kd: brake, ..DriveCommand::effort(acting) };
        if let Some(law) = self.actuator.joint_law(&command, joint, h) {
            self.command = Some(command);
            return Effort { effort: law.effort, damping: law.slope };
        }
        Effort { effort: self.actuator.step(acting, joint.velocity, h), damping: brake }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorium_robots::Drivetrain;

    const H: f64 = 2.5e-4;

    #[test]
    fn drive_torque_lags_like_its_actuator() {
        let settings = ActuatorSettings { lag: 0.01, delay: 1e-3, ..ActuatorSettings::default() };
        let mut actuation = Actuation::new(&settings, 50.0, "joint").unwrap();
        for step in 0..200 {
            let motor = actuation.motor(Motor::default(), 0.0, H);
            assert_eq!(motor, Motor::default());
            let Effort { effort, damping } = actuation.effort(6.0, 0.0, motor, H);
            let time = H * f64::from(step - 3);
            let expected = if time > 0.0 { 6.0 * (1.0 - (-time / 0.01).exp()) } else { 0.0 };
            assert!((effort - expected).abs() < 0.1 && damping == 0.0, "{step}: {effort}, {expected}");
        }
    }

    #[test]
    fn a_series_elastic_drive_loads_its_spring_on_a_blocked_joint() {
        let drivetrain = Drivetrain { motor_inertia: 0.1, stiffness: 300.0, damping: 4.0, backlash: 0.0 };
        let settings = ActuatorSettings { drivetrain: Some(drivetrain), ..ActuatorSettings::default() };
        let mut actuation = Actuation::new(&settings, f64::INFINITY, "joint").unwrap();
        let (blocked, mut carried) = (Motor::default(), 0.0);
        let mut run = |wanted: f64, brake: f64| {
            let mut motor = Motor::default();
            for _ in 0..8000 {
                motor = actuation.motor(blocked, carried, H);
                carried = actuation.effort(wanted, brake, blocked, H).effort;
            }
            (motor.position, carried)
        };
        let (position, effort) = run(6.0, 0.0);
        assert!((position - 6.0 / 300.0).abs() < 1e-6 && (effort - 6.0).abs() < 1e-4, "{position}, {effort}");
        let (braked, _) = run(0.0, 1e5);
        assert!((braked - position).abs() < 1e-3, "the brake holds the motor at {position}, not {braked}");
    }
}
