//! Two components for the measurement of the command gate. The commander publishes commands for 7 joints. The
//! actuator applies the commands, with or without the gate, and measures the time that this takes.

use core::hint::black_box;

use motorium::component::{Component, ConfigureError, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::os::monotonic_ns;
use motorium::safety::{CommandGate, JointLimits, JointSetpoint, Measured, Verdict};
use motorium::state::{Field as _, JointCommand};
use motorium::transport::{Input, Output};
use motorium::worker::Kind;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::Distribution;

/// Number of joints of the commanded arm.
const JOINTS: usize = 7;
/// Effort limit of each joint, N m.
const EFFORT: f64 = 87.0;
/// Maximum age of commands applied by the actuator without a gate, ns.
const STALE_NS: u64 = 5_000_000;
/// Maximum number of recorded steps.
const NOTED: usize = 1 << 16;

/// Returns the kinds of both components, for a host program.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub(crate) fn kinds() -> [Kind; 2] {
    [Kind::of::<Commander>(), Kind::of::<Actuator>()]
}

/// The `config` table of `bench.commander`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CommanderConfig {}

/// Commands all joints along a slow wave, well within their limits.
struct Commander {
    command: Output<JointCommand>,
}

impl Component for Commander {
    const KIND: &'static str = "bench.commander";
    const SUMMARY: &'static str = "commands 7 joints along a slow wave, for benchmarks";
    type Config = CommanderConfig;

    fn declare(_: &CommanderConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.output::<JointCommand>("command", "positions and velocities of the wave");
        Ok(())
    }

    fn configure(_: CommanderConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { command: setup.output("command")? })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let (height, rate) = (0.15, 1.0);
        let phase = rate * tick.time_ns as f64 * 1e-9;
        let mut command = self.command.loan()?;
        command.set_count(JOINTS);
        // Starts at rest at the joints' positions, so the gate follows from the first command.
        command.position_mut().fill(height * (1.0 - phase.cos()));
        command.velocity_mut().fill(height * rate * phase.sin());
        command.effort_mut().fill(1.0);
        command.kp_mut().fill(600.0);
        command.kd_mut().fill(40.0);
        command.publish()
    }
}

/// The `config` table of `bench.actuator`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ActuatorConfig {
    /// `true` if the commands pass through the gate.
    gated: bool,
}

/// Applies the commands of 7 joints that follow their commands exactly, and records the time of each step
/// with a command.
struct Actuator {
    command: Input<JointCommand>,
    gate: Option<CommandGate>,
    setpoints: Vec<JointSetpoint>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    took_ns: Vec<u64>,
}

impl Actuator {
    /// Returns the sum of the efforts of all joints, N m; `None` without a command.
    #[inline(never)]
    fn apply_gated(&mut self) -> Option<f64> {
        let gate = self.gate.as_mut()?;
        let mut gravity = |effort: &mut [f64]| effort.fill(0.0);
        let measured = Measured { position: &self.position, velocity: &self.velocity, gravity: &mut gravity };
        let verdict = gate.check(&mut self.command, measured);
        let efforts = efforts(gate.setpoints(), &self.position, &self.velocity);
        (verdict == Verdict::Applied).then_some(efforts)
    }

    /// Applies the newest command without the gate: checks only values and age.
    #[inline(never)]
    fn apply_bare(&mut self) -> Option<f64> {
        let command = self.command.latest()?;
        if command.check().is_err() || command.age_ns() > STALE_NS || command.count() != JOINTS {
            return None;
        }
        let (position, velocity) = (command.position(), command.velocity());
        for (i, setpoint) in self.setpoints.iter_mut().enumerate() {
            (setpoint.position, setpoint.velocity) = (position[i], velocity[i]);
            (setpoint.kp, setpoint.kd) = (command.kp()[i], command.kd()[i]);
            setpoint.effort = command.effort()[i];
        }
        Some(efforts(&self.setpoints, &self.position, &self.velocity))
    }
}

fn efforts(setpoints: &[JointSetpoint], position: &[f64], velocity: &[f64]) -> f64 {
    let joints = setpoints.iter().zip(position).zip(velocity);
    joints.map(|((setpoint, q), v)| setpoint.effort_at(*q, *v, EFFORT)).sum()
}

impl Component for Actuator {
    const KIND: &'static str = "bench.actuator";
    const SUMMARY: &'static str =
        "applies the commands of 7 joints, with or without the gate, for benchmarks";
    type Config = ActuatorConfig;

    fn declare(_: &ActuatorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.actuator();
        declare.input::<JointCommand>("command", "the commands to apply");
        Ok(())
    }

    fn configure(config: ActuatorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let joint = |i: usize| JointLimits {
            lower: -2.9,
            upper: 2.9,
            velocity: 2.175,
            acceleration: 12.5,
            effort_rate: 1_000.0,
            kp: 600.0,
            kd: 40.0,
            ..JointLimits::new(&format!("joint{i}"))
        };
        let joints = (1..=JOINTS).map(|i| joint(i).with_effort(EFFORT)).collect();
        let gate = if config.gated { Some(setup.command_gate(joints)?) } else { None };
        Ok(Self {
            command: setup.input("command")?,
            gate,
            setpoints: vec![JointSetpoint::default(); JOINTS],
            position: vec![0.0; JOINTS],
            velocity: vec![0.0; JOINTS],
            took_ns: Vec::with_capacity(NOTED),
        })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let began = monotonic_ns();
        let applied = if self.gate.is_some() { self.apply_gated() } else { self.apply_bare() };
        let applied = black_box(applied);
        let took = monotonic_ns() - began;
        if applied.is_some() && self.took_ns.len() < NOTED {
            self.took_ns.push(took);
        }
        // The joints are at their commanded positions.
        if let Some(command) = self.command.current() {
            self.position.copy_from_slice(command.position());
            self.velocity.copy_from_slice(command.velocity());
        }
        Ok(())
    }

    /// Returns the time of each step that followed a command.
    fn result(&self) -> Option<serde_json::Value> {
        let took = Distribution::from_samples(self.took_ns.clone());
        (took.count > 0).then(|| serde_json::json!({ "step_ns": took }))
    }
}
