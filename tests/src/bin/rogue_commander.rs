//! A user component that sends configurable nonsense commands, measures the reactions of the joints, and
//! presses an emergency stop.
//!
//! It is triggered by the true joint state, so it observes every step of the simulation.

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::{EmergencyStop, JointCommand, JointState};
use motorium::transport::{Input, Output};

/// A command that no controller should make.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Nonsense {
    None,
    NotANumber,
    Infinite,
    WrongCount,
    NegativeGain,
    FarPosition,
    JumpingPosition,
    HugePosition,
    HugeVelocity,
    HugeEffort,
    PureEffort,
    HugeKp,
    HugeKd,
}

#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct RogueConfig {
    /// The nonsense to command.
    nonsense: Nonsense,
    /// Index of the affected joint.
    joint: usize,
    /// First step of the nonsense and of the emergency stop, and the first step after them.
    from: u64,
    until: u64,
    /// Interval between nonsense commands, in steps.
    every: u64,
    /// First step whose accelerations are measured.
    measure_from: u64,
}

impl Default for RogueConfig {
    fn default() -> Self {
        let (from, until) = (u64::MAX, u64::MAX);
        Self { nonsense: Nonsense::None, joint: 0, from, until, every: 1, measure_from: 0 }
    }
}

struct Rogue {
    state: Input<JointState>,
    command: Output<JointCommand>,
    stop: Output<EmergencyStop>,
    config: RogueConfig,
    start: Vec<f64>,
    /// Velocities and time of the last state, ns.
    last: Option<(Vec<f64>, u64)>,
    fastest: Vec<f64>,
    hardest: Vec<f64>,
}

impl Component for Rogue {
    const KIND: &'static str = "test.rogue";
    const SUMMARY: &'static str = "commands nonsense and measures the joints";
    type Config = RogueConfig;

    fn declare(_: &RogueConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.input::<JointState>("joint_state", "true state of the joints");
        declare.output::<JointCommand>("joint_command", "nonsense");
        declare.output::<EmergencyStop>("stop", "emergency stop");
        Ok(())
    }

    fn configure(config: RogueConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            state: setup.input("joint_state")?,
            command: setup.output("joint_command")?,
            stop: setup.output("stop")?,
            config,
            start: Vec::new(),
            last: None,
            fastest: Vec::new(),
            hardest: Vec::new(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(state) = self.state.latest() else { return Ok(()) };
        let (count, time_ns) = (state.count(), state.time_ns());
        if self.start.is_empty() {
            self.start = state.position().to_vec();
            (self.fastest, self.hardest) = (vec![0.0; count], vec![0.0; count]);
        }
        for (fastest, v) in self.fastest.iter_mut().zip(state.velocity()) {
            *fastest = fastest.max(v.abs());
        }
        let dt =
            self.last.as_ref().map_or(0.0, |(_, last_ns)| time_ns.saturating_sub(*last_ns) as f64 * 1e-9);
        if let Some((last, _)) = self
            .last
            .as_ref()
            .filter(|_| tick.index >= self.config.measure_from && (0.0005..0.0015).contains(&dt))
        {
            for ((hardest, v), last) in self.hardest.iter_mut().zip(state.velocity()).zip(last) {
                *hardest = hardest.max((v - last).abs() / dt);
            }
        }
        self.last = Some((state.velocity().to_vec(), time_ns));
        let due = (self.config.from..self.config.until).contains(&tick.index);
        let mut stop = self.stop.loan()?;
        stop.stop = u64::from(due);
        stop.publish()?;
        let mut command = self.command.loan()?;
        command.set_count(count);
        command.position_mut().copy_from_slice(&self.start);
        command.velocity_mut().fill(0.0);
        command.effort_mut().fill(0.0);
        command.kp_mut().fill(600.0);
        command.kd_mut().fill(40.0);
        // The wrist has little inertia.
        command.kp_mut().iter_mut().skip(4).for_each(|kp| *kp = 50.0);
        command.kd_mut().iter_mut().skip(4).for_each(|kd| *kd = 2.0);
        let joint = self.config.joint;
        let is_turn = due && (tick.index - self.config.from).is_multiple_of(self.config.every);
        if is_turn {
            match self.config.nonsense {
                Nonsense::None => {}
                Nonsense::NotANumber => command.effort_mut()[joint] = f64::NAN,
                Nonsense::Infinite => command.position_mut()[joint] = f64::INFINITY,
                Nonsense::WrongCount => command.set_count(count - 1),
                Nonsense::NegativeGain => command.kd_mut()[joint] = -1.0,
                Nonsense::FarPosition => command.position_mut()[joint] = 10.0,
                Nonsense::JumpingPosition => command.position_mut()[joint] += 2.0,
                Nonsense::HugePosition => command.position_mut()[joint] = 1e300,
                Nonsense::HugeVelocity => command.velocity_mut()[joint] = 1e6,
                Nonsense::HugeEffort => command.effort_mut()[joint] = 1e9,
                Nonsense::PureEffort => {
                    (command.kp_mut()[joint], command.kd_mut()[joint]) = (0.0, 0.0);
                    command.effort_mut()[joint] = 1e308;
                }
                Nonsense::HugeKp => command.kp_mut()[joint] = 1e300,
                Nonsense::HugeKd => command.kd_mut()[joint] = 1e300,
            }
        }
        // A publication withheld by the runtime does not end the component.
        let _ = command.publish();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "fastest": self.fastest, "hardest": self.hardest }))
    }
}

motorium::main!(Rogue);
