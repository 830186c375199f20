//! A component as a separate program: a first-order low-pass filter of joint velocities.
//!
//! ```console
//! $ cargo build --release --example low_pass
//! ```
//!
//! A graph names it with `exec = "target/release/examples/low_pass"`. `motorium check` queries its ports.

use motorium::prelude::*;

motorium::main!(LowPass);

/// The `config` table.
#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LowPassConfig {
    /// Joints of the robot.
    joints: usize,
}

/// Republishes joint states with velocities filtered by `y += dt / (tau + dt) (v - y)`.
pub(crate) struct LowPass {
    state: Input<JointState>,
    filtered: Output<JointState>,
    /// Time constant tau, s.
    time_constant: Parameter<f64>,
    /// The filtered velocities, rad/s.
    velocity: Vec<f64>,
}

impl Component for LowPass {
    const KIND: &'static str = "example.low_pass";
    const SUMMARY: &'static str = "filters joint velocities";
    type Config = LowPassConfig;

    fn declare(config: &LowPassConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        if !(1..=MAX_JOINTS).contains(&config.joints) {
            let message = format!("{} joints, expected 1 to {MAX_JOINTS}", config.joints);
            return Err(ConfigError::key("joints", message));
        }
        declare.input::<JointState>("state", "measured joint state");
        declare.output::<JointState>("filtered", "joint state with filtered velocities");
        declare.float("time_constant", 0.01, 0.0..=1.0, "s", "time constant of the filter");
        Ok(())
    }

    fn configure(config: LowPassConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            state: setup.input("state")?,
            filtered: setup.output("filtered")?,
            time_constant: setup.parameter("time_constant")?,
            velocity: vec![0.0; config.joints],
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let Some(state) = self.state.latest() else { return Ok(()) };
        if state.count() != self.velocity.len() {
            return Err(StepError::failed("the state has another number of joints than the configuration"));
        }
        let share = tick.dt() / (self.time_constant.get() + tick.dt());
        for (filtered, measured) in self.velocity.iter_mut().zip(state.velocity()) {
            *filtered += share * (measured - *filtered);
        }
        let mut filtered = self.filtered.loan()?;
        *filtered = *state;
        filtered.velocity_mut().copy_from_slice(&self.velocity);
        filtered.publish()
    }
}
