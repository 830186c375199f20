//! The trait of a component, and what it is configured with: the place to start reading.
//!
//! A component declares its ports and parameters, is configured once, and is then stepped. The same type runs as
//! a process of its own or hosted with others in one process, in real time or in lockstep, without change.
//!
//! * [`Component`] is the trait to implement;
//! * [`Declare`] takes its ports and parameters, so that a graph can be checked while nothing runs;
//! * [`Setup`] hands out the ports when it is configured;
//! * [`Kind`](crate::worker::Kind) and [`Registry`](crate::worker::Registry) make a component type known by name, such
//!   as `physics.rapier`.

mod error;
mod setup;

pub use crate::declare::{ConfigError, Declare, StepError};
pub use crate::transport::Parameter;
pub use error::ConfigureError;
pub use setup::{Checkpoint, Setup};

use std::time::Duration;

/// One step of a component: its number and the time it computes for, which is not the time it runs at.
///
/// ```
/// use motorium::component::Tick;
/// use std::time::Duration;
///
/// let tick = Tick { index: 3, time_ns: 3_000_000, period: Duration::from_millis(1) };
/// assert_eq!((tick.dt(), tick.time()), (0.001, 0.003));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tick {
    /// Number of the step, from 0; it goes on through restarts of the component.
    pub index: u64,
    /// Nanoseconds since the run began for which the step computes: the scheduled release of a time-triggered
    /// component, the publish time of the sample that woke a triggered one.
    pub time_ns: u64,
    /// Nominal time between two steps, derived from the rate; for a triggered component the period of the
    /// time-triggered component at the head of its chain.
    pub period: Duration,
}

impl Tick {
    /// Nominal time between two steps, s.
    pub fn dt(&self) -> f64 {
        self.period.as_secs_f64()
    }

    /// Time since the run began, s.
    pub fn time(&self) -> f64 {
        self.time_ns as f64 * 1e-9
    }
}

/// A component of a graph.
///
/// ```
/// use motorium::prelude::*;
///
/// #[derive(serde::Deserialize, schemars::JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct MirrorConfig {}
///
/// /// Publishes the joint state with all velocities reversed.
/// struct Mirror {
///     state: Input<JointState>,
///     mirrored: Output<JointState>,
/// }
///
/// impl Component for Mirror {
///     const KIND: &'static str = "example.mirror";
///     const SUMMARY: &'static str = "reverses velocities";
///     type Config = MirrorConfig;
///
///     fn declare(_: &MirrorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
///         declare.input::<JointState>("state", "joint state to mirror");
///         declare.output::<JointState>("mirrored", "joint state, velocities reversed");
///         Ok(())
///     }
///
///     fn configure(_: MirrorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
///         Ok(Self { state: setup.input("state")?, mirrored: setup.output("mirrored")? })
///     }
///
///     fn step(&mut self, _: &Tick) -> Result<(), StepError> {
///         let Some(state) = self.state.latest() else { return Ok(()) };
///         let mut mirrored = self.mirrored.loan()?;
///         *mirrored = *state;
///         mirrored.velocity_mut().iter_mut().for_each(|v| *v = -*v);
///         mirrored.publish()?;
///         Ok(())
///     }
/// }
/// ```
pub trait Component: Sized + 'static {
    /// The name of this kind of component in graph files, `family.name`.
    const KIND: &'static str;

    /// One line for lists and completions.
    const SUMMARY: &'static str;

    /// The configuration has a key `world`, in whose place the graph's `[world]` comes where there is one.
    const READS_WORLD: bool = false;

    /// The `config` table of the component in the graph file. Use `#[serde(deny_unknown_fields)]`, so that a
    /// misspelt key is an error.
    type Config: serde::de::DeserializeOwned + schemars::JsonSchema;

    /// Declares ports and parameters, and checks the configuration as far as that is possible without running.
    ///
    /// # Errors
    /// The configuration cannot work: the graph is refused before anything starts.
    fn declare(config: &Self::Config, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Builds the component. All memory it will ever need is allocated here.
    ///
    /// # Errors
    /// The component cannot run.
    fn configure(config: Self::Config, setup: &mut Setup) -> Result<Self, ConfigureError>;

    /// Computes one step: read inputs, compute, publish. No allocation, no lock, no log, no system call.
    ///
    /// # Errors
    /// The step failed; the policy `on_error` of the graph file decides on the consequence.
    fn step(&mut self, tick: &Tick) -> Result<(), StepError>;

    /// Runs once when the run ends in an orderly way. Not called when the process is killed.
    fn stop(&mut self) {}

    /// The component's entry under `results` in the report of the finished run.
    fn result(&self) -> Option<serde_json::Value> {
        None
    }
}
