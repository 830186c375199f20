//! The component trait and its configuration. Start here.
//!
//! A component declares its ports and parameters, is configured once, and is then stepped. The same type runs
//! unchanged in a separate process or in a process with several components, in real time or in lockstep.
//!
//! * [`Component`] is the trait to implement;
//! * [`Declare`] collects its ports and parameters, so that a graph can be checked without running;
//! * [`Setup`] provides the ports during configuration;
//! * `Kind` and `Registry` register a component type under a name, such as `physics.rapier`.

mod beside;
mod checkpoint;
mod clock;
mod dynamic;
mod error;
mod helper;
mod observer;
mod setup;
mod weights;

pub use crate::declare::{ConfigError, Declare, StepError};
pub use crate::parameter::{Choice, Parameter, ParameterArray};
pub use checkpoint::Checkpoint;
pub use clock::RunClock;
pub use dynamic::DynamicComponent;
pub use error::ConfigureError;
pub(crate) use helper::Helpers;
pub use helper::StopRequest;
pub use observer::Observer;
pub(crate) use setup::Prepared;
pub use setup::{EpisodeDriver, EpisodeEnd, Setup};
pub use weights::{TakeWeights, WeightsInput};

use std::time::Duration;

/// One step of a component: its index and the time for which the step computes, as opposed to the time at
/// which the step runs.
///
/// ```
/// use motorium::component::Tick;
/// use std::time::Duration;
///
/// let tick = Tick::periodic(3, Duration::from_millis(1));
/// assert_eq!((tick.dt(), tick.time(), tick.deadline_ns), (0.001, 0.003, 4_000_000));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tick {
    /// Index of the step, counted from 0 since the start of the run or the last reset. Restarts of the
    /// component and new episodes in real time do not reset the index.
    pub index: u64,
    /// Time for which the step computes, ns since the start of the run or, in lockstep, since the last reset.
    /// For a time-triggered component this is its scheduled release, for a triggered component the publish
    /// time of the sample that woke it, and for a sporadic component the arrival of the event that released
    /// it.
    pub time_ns: u64,
    /// Deadline of the step, ns on the clock of `time_ns`. The deadline is one period after `time_ns`, when
    /// the next step of a time-triggered component is due. Lockstep uses the same value, but no step is ever
    /// late there because time does not advance within a step. [`RunClock::left_ns`] returns the remaining
    /// time.
    pub deadline_ns: u64,
    /// Nominal time between two steps, derived from the rate. For a component triggered by a topic, it is the
    /// period of the component that starts the chain of triggers; for a component released by events, it is
    /// `min_interval`.
    pub period: Duration,
    /// Index of the episode, counted from 0; always 0 in a run without episodes.
    pub episode: u64,
    /// True in the first step of an episode: after [`configure`](Component::configure) at the start of the
    /// run, after [`reset`](Component::reset) in lockstep, and after
    /// [`begin_episode`](Component::begin_episode) in real time.
    pub begins_episode: bool,
    /// True for an actuator once the run is stopping or has ended. The actuator then brings its robot to
    /// rest, and its steps are not counted in its statistics. Components that are not actuators do not step.
    pub settling: bool,
}

/// An episode of a run. In lockstep it is the simulated time between two resets of all components. In real
/// time it is a numbered section of the run, without a reset.
///
/// ```
/// use motorium::component::Episode;
///
/// let second = Episode { index: 1, seed: 7 };
/// assert_ne!(second, Episode { seed: 8, ..second });
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Episode {
    /// Index of the episode in the run, counted from 0. Episode 0 begins with the run, without a call of
    /// `reset` or `begin_episode`.
    pub index: u64,
    /// The component's seed in this episode, derived from the episode's seed and the component's name. In the
    /// first episode, it equals [`Setup::seed`].
    pub seed: u64,
}

impl Tick {
    /// Creates the tick of step `index` of a time-triggered component in the first episode. Intended for
    /// tests of components.
    pub fn periodic(index: u64, period: Duration) -> Self {
        let period_ns = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        let time_ns = index.saturating_mul(period_ns);
        Self {
            index,
            time_ns,
            deadline_ns: time_ns.saturating_add(period_ns),
            period,
            episode: 0,
            begins_episode: index == 0,
            settling: false,
        }
    }

    /// Returns the nominal time between two steps, s.
    pub fn dt(&self) -> f64 {
        self.period.as_secs_f64()
    }

    /// Returns the number of periods between two steps at `last_ns` and `now_ns`, rounded and not less than
    /// 1, for components that must catch up after a delay. Returns 1 for the first step (`last_ns` is
    /// `None`). Also returns 1 after a gap of more than [`CATCH_UP`](Self::CATCH_UP) periods, because such a
    /// gap means that the machine and its world were suspended.
    ///
    /// ```
    /// use motorium::component::Tick;
    /// use std::time::Duration;
    ///
    /// let tick = Tick::periodic(10, Duration::from_millis(1));
    /// assert_eq!(tick.periods_since(Some(9_000_000), tick.time_ns), 1);
    /// assert_eq!(tick.periods_since(Some(7_000_000), tick.time_ns), 3);
    /// assert_eq!(tick.periods_since(Some(0), tick.time_ns), 1);
    /// assert_eq!(tick.periods_since(None, tick.time_ns), 1);
    /// ```
    pub fn periods_since(&self, last_ns: Option<u64>, now_ns: u64) -> u32 {
        let period = u64::try_from(self.period.as_nanos()).unwrap_or(u64::MAX).max(1);
        let elapsed = last_ns.map_or(period, |last| now_ns.saturating_sub(last));
        match u32::try_from(elapsed.saturating_add(period / 2) / period) {
            Ok(periods) if periods <= Self::CATCH_UP => periods.max(1),
            _ => 1,
        }
    }

    /// Maximum number of periods that [`periods_since`](Self::periods_since) returns. A longer gap counts as
    /// one period.
    pub const CATCH_UP: u32 = 5;

    /// Returns the time for which the step computes ([`time_ns`](Self::time_ns)), s since the start of the
    /// run or, in lockstep, since the last reset.
    pub fn time(&self) -> f64 {
        self.time_ns as f64 * 1e-9
    }
}

/// A component of a graph: a unit of a robot program that reads inputs, computes and publishes outputs in
/// steps.
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
    /// Kind of the component in graph files, `family.name`.
    const KIND: &'static str;

    /// One-line summary for lists and completions.
    const SUMMARY: &'static str;

    /// `true` if the configuration has a key `world`, which defaults to the graph's `[world]`.
    const READS_WORLD: bool = false;

    /// `true` if the configuration has a key `gravity` \[m/s^2\], three numbers. The default is the `gravity`
    /// of the graph's `[world]`. Without it, the default is the gravity in the world's `file`, if the program
    /// can read that file (`Registry::with_gravity_of_file`).
    const READS_GRAVITY: bool = false;

    /// Type of the component's `config` table in the graph file. Use `#[serde(deny_unknown_fields)]`, which
    /// makes misspelt keys an error.
    type Config: serde::de::DeserializeOwned + schemars::JsonSchema;

    /// Declares ports and parameters, and checks the configuration as far as possible without running.
    ///
    /// Must be fast, because `motorium check`, editors and every start wait for it. Reading the model of a
    /// robot or the header of a file is fine; fitting, training or planning belongs in
    /// [`configure`](Self::configure). `motorium check` measures the time and warns above 100 ms.
    ///
    /// # Errors
    /// The configuration is invalid. The graph is then rejected before anything starts.
    fn declare(config: &Self::Config, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Builds the component and allocates all memory that it will need.
    ///
    /// # Errors
    /// The component cannot run with this configuration or on this machine.
    fn configure(config: Self::Config, setup: &mut Setup) -> Result<Self, ConfigureError>;

    /// Computes one step: read inputs, compute, publish. A step must not allocate, lock, log or make system
    /// calls.
    ///
    /// # Errors
    /// The step failed. The policy `on_error` in the graph file decides on the consequence.
    fn step(&mut self, tick: &Tick) -> Result<(), StepError>;

    /// `true` if [`reset`](Self::reset) is implemented. A graph with a component that cannot be reset runs as
    /// a single episode.
    const RESETS: bool = false;

    /// Resets to the state after [`configure`](Self::configure) for a new episode, with the episode's seed
    /// for random numbers. Called between two steps. Must not publish.
    ///
    /// Steps after a reset must not depend on steps before it: episodes with equal seeds are bitwise equal.
    /// Ports are empty, as at the start, and parameters keep their values. A component with a `CommandGate`
    /// must also call the gate's `reset`.
    ///
    /// ```
    /// # use motorium::prelude::*;
    /// struct Integrator { input: Input<Wrench>, sum: f64 }
    ///
    /// impl Component for Integrator {
    ///     const RESETS: bool = true;
    ///
    ///     fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
    ///         self.sum = 0.0;
    ///         Ok(())
    ///     }
    /// #   const KIND: &'static str = "example.integrator";
    /// #   const SUMMARY: &'static str = "adds up forces";
    /// #   type Config = ();
    /// #   fn declare(_: &(), declare: &mut Declare) -> Result<(), ConfigError> {
    /// #       declare.input::<Wrench>("wrench", "wrench to add up");
    /// #       Ok(())
    /// #   }
    /// #   fn configure(_: (), setup: &mut Setup) -> Result<Self, ConfigureError> {
    /// #       Ok(Self { input: setup.input("wrench")?, sum: 0.0 })
    /// #   }
    /// #   fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
    /// #       self.sum += self.input.latest().map_or(0.0, |wrench| wrench.force[2] * tick.dt());
    /// #       Ok(())
    /// #   }
    /// }
    /// ```
    ///
    /// # Errors
    /// The component cannot continue. The run then ends.
    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        Err(StepError::failed("it cannot be reset"))
    }

    /// Begins an episode in real time. The robot, the clock and the ports continue unchanged. Called at the
    /// start of the first step of the episode and as part of this step, so the rules of [`step`](Self::step)
    /// apply. Must not publish.
    ///
    /// A component restarts its task here: it starts the next movement, reseeds its random numbers and clears
    /// its history.
    ///
    /// ```
    /// # use motorium::prelude::*;
    /// /// Reports the height of its robot above the place where the episode began.
    /// struct Climb { base: Input<BaseState>, begins: bool, from: f64, climbed: f64 }
    ///
    /// impl Component for Climb {
    ///     fn begin_episode(&mut self, _: &Episode) -> Result<(), StepError> {
    ///         self.begins = true;
    ///         Ok(())
    ///     }
    /// #   const KIND: &'static str = "example.climb";
    /// #   const SUMMARY: &'static str = "measures a climb";
    /// #   type Config = ();
    /// #   fn declare(_: &(), declare: &mut Declare) -> Result<(), ConfigError> {
    /// #       declare.input::<BaseState>("base", "state of the base");
    /// #       Ok(())
    /// #   }
    /// #   fn configure(_: (), setup: &mut Setup) -> Result<Self, ConfigureError> {
    /// #       Ok(Self { base: setup.input("base")?, begins: true, from: 0.0, climbed: 0.0 })
    /// #   }
    ///
    ///     fn step(&mut self, _: &Tick) -> Result<(), StepError> {
    ///         let Some(base) = self.base.latest() else { return Ok(()) };
    ///         if std::mem::take(&mut self.begins) {
    ///             self.from = base.position[2];
    ///         }
    ///         self.climbed = base.position[2] - self.from;
    ///         Ok(())
    ///     }
    /// }
    /// ```
    ///
    /// # Errors
    /// The component cannot begin the episode. The policy `on_error` in the graph file decides on the
    /// consequence.
    fn begin_episode(&mut self, _: &Episode) -> Result<(), StepError> {
        Ok(())
    }

    /// Stops the component. Called once at the end of the run, unless the process is killed.
    fn stop(&mut self) {}

    /// Returns the component's entry under `results` in the report of the finished run.
    fn result(&self) -> Option<serde_json::Value> {
        None
    }
}
