//! A motorium component: moves one joint of a robot back and forth, smoothly, at a frequency that may be
//! changed while it runs.
//!
//! The motion is [`Oscillation`], a plain calculation with tests; [`Controller`] makes it a component.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

motorium::main!(Controller);

/// The `config` table of the component in the graph file. Doc comments show up in the JSON Schema.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Config {
    /// Index of the joint that moves.
    #[serde(default)]
    joint: usize,
    /// Amplitude of the motion from the initial position, rad.
    amplitude: f64,
    /// Proportional gain, N m/rad: one number for all joints, or one for each.
    kp: Gains,
    /// Derivative gain, N m s/rad: one number for all joints, or one for each.
    kd: Gains,
}

/// One number for all joints, or one for each.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected one number, or a list with one number per joint")]
enum Gains {
    All(f64),
    Each(Vec<f64>),
}

impl Gains {
    /// Returns `true` if they are one number, or one for each joint.
    fn fit(&self, joints: usize) -> bool {
        match self {
            Self::All(_) => true,
            Self::Each(gains) => gains.len() == joints,
        }
    }

    fn write(&self, gains: &mut [f64]) {
        match self {
            Self::All(gain) => gains.fill(*gain),
            Self::Each(each) => gains.copy_from_slice(each),
        }
    }
}

/// A position and its velocity, rad and rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Setpoint {
    position: f64,
    velocity: f64,
}

/// A periodic motion to `amplitude` and back, which starts at rest: `amplitude/2 (1 - cos(phase))`.
#[derive(Debug, Clone)]
struct Oscillation {
    amplitude: f64,
    phase: f64,
}

impl Oscillation {
    fn new(amplitude: f64) -> Self {
        Self { amplitude, phase: 0.0 }
    }

    /// Advances by `dt` seconds. The frequency (Hz) may change at any time: the phase stays continuous.
    fn advance(&mut self, frequency: f64, dt: f64) -> Setpoint {
        let rate = std::f64::consts::TAU * frequency;
        self.phase = (self.phase + rate * dt) % std::f64::consts::TAU;
        Setpoint {
            position: 0.5 * self.amplitude * (1.0 - self.phase.cos()),
            velocity: 0.5 * self.amplitude * rate * self.phase.sin(),
        }
    }
}

/// Moves one joint back and forth, and holds all others at their initial positions.
struct Controller {
    state: Input<JointState>,
    command: Output<JointCommand>,
    frequency: Parameter<f64>,
    config: Config,
    motion: Oscillation,
    /// The first state received: the motion is relative to it.
    start: Option<JointState>,
    /// The setpoint of the last step, and the largest tracking error, rad.
    last: Option<f64>,
    largest_error: f64,
}

impl Component for Controller {
    const KIND: &'static str = env!("CARGO_PKG_NAME");
    const SUMMARY: &'static str = "moves one joint of a robot back and forth";
    type Config = Config;

    // `motorium check` calls this: errors are reported before anything runs.
    fn declare(config: &Config, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("state", "measured joint state");
        declare.output::<JointCommand>("command", "setpoints and gains for all joints");
        declare.float("frequency", 0.5, 0.05..=2.0, "Hz", "oscillations per second");
        for (key, gains) in [("kp", &config.kp), ("kd", &config.kd)] {
            if let Gains::Each(gains) = gains
                && config.joint >= gains.len()
            {
                let message =
                    format!("{} numbers, and the joint that moves is number {}", gains.len(), config.joint);
                return Err(ConfigError::key(key, message)
                    .advise("write one number for all joints, or one for each; joints count from 0"));
            }
        }
        if !(-1.0..=1.0).contains(&config.amplitude) {
            let message = format!("{} rad, expected from -1 to 1", config.amplitude);
            return Err(ConfigError::key("amplitude", message));
        }
        Ok(())
    }

    // All memory is allocated here.
    fn configure(config: Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            state: setup.input("state")?,
            command: setup.output("command")?,
            frequency: setup.parameter("frequency")?,
            motion: Oscillation::new(config.amplitude),
            config,
            start: None,
            last: None,
            largest_error: 0.0,
        })
    }

    // The hot path: no allocation, no lock, no log, no system call.
    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(state) = self.state.latest() else { return Ok(()) };
        let (joints, joint) = (state.count(), self.config.joint);
        if joint >= joints {
            return Err(StepError::failed("`joint` is beyond the last joint of the robot"));
        }
        if !self.config.kp.fit(joints) || !self.config.kd.fit(joints) {
            return Err(StepError::failed(
                "`kp` and `kd` need one number, or one for each joint of the robot",
            ));
        }
        if let Some(last) = self.last {
            self.largest_error = self.largest_error.max((last - state.position()[joint]).abs());
        }
        let start = self.start.get_or_insert(*state);
        let setpoint = self.motion.advance(self.frequency.get(), tick.dt());

        // A lent sample is shared memory with old content: write every field.
        let mut command = self.command.loan()?;
        command.set_count(joints);
        command.position_mut().copy_from_slice(start.position());
        command.position_mut()[joint] += setpoint.position;
        command.velocity_mut().fill(0.0);
        command.velocity_mut()[joint] = setpoint.velocity;
        command.effort_mut().fill(0.0);
        self.config.kp.write(command.kp_mut());
        self.config.kd.write(command.kd_mut());
        self.last = Some(command.position()[joint]);
        command.publish()
    }

    // Appears under `results` in the report of the run.
    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "largest_error_rad": self.largest_error }))
    }
}

#[cfg(test)]
mod tests {
    use motorium::testing::{Graph, Instance, Probe, Source};

    use super::*;

    #[test]
    fn oscillation_starts_at_rest_and_returns() {
        let mut motion = Oscillation::new(0.4);
        let dt = 1e-3;
        let path: Vec<Setpoint> = (0..1000).map(|_| motion.advance(1.0, dt)).collect();
        assert!(path[0].position.abs() < 1e-5 && path[0].velocity.abs() < 1e-2);
        assert!((path[499].position - 0.4).abs() < 1e-9);
        assert!(path[999].position.abs() < 1e-9);
    }

    #[test]
    fn velocity_stays_the_derivative_on_frequency_change() {
        let mut motion = Oscillation::new(0.4);
        let dt = 1e-4;
        let mut last = motion.advance(0.5, dt);
        for i in 0..40_000 {
            let frequency = if i < 20_000 { 0.5 } else { 1.5 };
            let next = motion.advance(frequency, dt);
            let difference = (next.position - last.position) / dt;
            assert!((next.velocity - difference).abs() < 2e-3, "{} is not {difference}", next.velocity);
            last = next;
        }
    }

    fn declare(config: &str) -> Result<(), ConfigError> {
        let config: Config = serde_json::from_str(config).expect("a config table");
        Controller::declare(&config, &mut Declare::new(None))
    }

    #[test]
    fn a_configuration_that_cannot_work_is_refused_with_its_key() {
        let good = r#"{ "joint": 1, "amplitude": 0.3, "kp": 1.0, "kd": [0.1, 0.2] }"#;
        assert_eq!(declare(good), Ok(()));
        for (key, wrong) in
            [("kd", good.replace("[0.1, 0.2]", "[0.1]")), ("amplitude", good.replace("0.3", "3.0"))]
        {
            assert_eq!(declare(&wrong).unwrap_err().key.as_deref(), Some(key));
        }
    }

    /// Two joints at rest, the second at 0.3 rad.
    fn robot() -> Source {
        Source::new("robot", "state", |_| {
            let mut state = JointState::default();
            state.set_count(2);
            state.position_mut()[1] = 0.3;
            Some(state)
        })
    }

    // The component alone in a graph, in simulated time: two seconds last a few milliseconds.
    #[test]
    fn commands_start_at_the_measured_pose_and_move_one_joint() {
        let commands = Probe::<JointCommand>::for_topic("command");
        let controller = Instance::of::<Controller>("controller")
            .trigger("state")
            .subscribe("state", "state")
            .publish("command", "command")
            .parameter("frequency", 0.5)
            .config("joint", 1)
            .config("amplitude", 0.2)
            .config("kp", 1.5)
            .config("kd", vec![0.1, 0.2]);
        let report = Graph::new("motion").with(robot()).with(controller).with(&commands).run("2 s").unwrap();

        let path: Vec<f64> = commands.values().iter().map(|command| command.position()[1]).collect();
        assert_eq!(path.len(), 2000);
        assert!((path[0] - 0.3).abs() < 1e-5);
        assert!((path[999] - 0.5).abs() < 1e-9);
        assert!(
            commands
                .values()
                .iter()
                .all(|command| command.position()[0] == 0.0 && command.kp() == [1.5, 1.5])
        );
        // `motorium::main!` counts: no step allocates
        assert!(report.components.iter().all(|component| component.allocations == Some(0)));
    }
}
