//! A run controlled by a program, which launches it, steps it, reads and writes its topics, resets it and
//! ends it.
//!
//! A [`Session`] belongs to one thread. A program may have several sessions, each in a separate thread and on
//! a separate core, for example for the roll-outs of a learner. The command `motorium run` uses [`run`], a
//! loop over a session.
//!
//! # Time
//! In lockstep, time only passes within [`step_until`](Session::step_until), [`step`](Session::step) and
//! [`run`](Session::run), as fast as the machine allows or at a [`pace`](Session::pace). In real time,
//! `step_until` waits, and supervises the components while it waits.
//!
//! # Episodes
//! In lockstep, [`reset`](Session::reset) resets all components and simulated time. The values published in
//! an episode depend only on the episode's seed, on parameters, and on the values and times of the session's
//! own publications. If all of these are equal, two episodes are bitwise equal.
//!
//! In real time, [`begin_episode`](Session::begin_episode) begins the next numbered section of the run,
//! without resetting anything.
//!
//! # Forks
//! A session belongs to the process that launched it. In a forked child (for example with Python's
//! `multiprocessing`), every call is an error ([`SessionError::OtherProcess`]). Dropping the session in the
//! child has no effect, and the run of the parent continues. Readers and [taps](crate::transport::Tap) opened
//! by the session behave in the same way.
//!
//! # Ending
//! [`stop`](Session::stop) ends a run in an orderly way and returns its report. Dropping a session ends its
//! components immediately. In both cases nothing is left in shared memory.

mod drive;
mod error;
mod pace;
mod ports;
mod reader;
mod topics;

pub use drive::run;
pub use error::SessionError;
pub use reader::TopicReader;
pub use topics::{TopicWriter, Value};

use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crate::declare::ParameterValue;
use crate::launcher::{EpisodeReport, Event, Exit, Launch, LaunchError, Limit, LoggedEvent, Options, Report};
use crate::os::{Owned, monotonic_ns};
use crate::parameter::ParameterTable;
use crate::plan::{ClockKind, Plan};
use crate::region::EventReader;
use crate::worker::Registry;
use pace::Pace;
use ports::Ports;

/// A run controlled by a Rust program. See [the module](self).
///
/// ```
/// use std::time::Duration;
/// use motorium::launcher::Options;
/// use motorium::prelude::*;
/// use motorium::session::Session;
/// # use motorium::{graph, worker::{Kind, Registry, RobotSource}};
/// # #[derive(serde::Deserialize, schemars::JsonSchema)]
/// # struct NoConfig {}
/// # struct Counter { wrench: Output<Wrench>, step: Parameter<f64>, sum: f64 }
/// # impl Component for Counter {
/// #     const KIND: &'static str = "example.counter";
/// #     const SUMMARY: &'static str = "counts";
/// #     const RESETS: bool = true;
/// #     type Config = NoConfig;
/// #     fn declare(_: &NoConfig, declare: &mut Declare) -> Result<(), ConfigError> {
/// #         declare.output::<Wrench>("wrench", "the count as a force");
/// #         declare.float("step", 1.0, 0.0..=10.0, "N", "added in each step");
/// #         Ok(())
/// #     }
/// #     fn configure(_: NoConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
/// #         Ok(Self { wrench: setup.output("wrench")?, step: setup.parameter("step")?, sum: 0.0 })
/// #     }
/// #     fn step(&mut self, _: &Tick) -> Result<(), StepError> {
/// #         self.sum += self.step.get();
/// #         self.wrench.send(&Wrench { force: [0.0, 0.0, self.sum], ..Wrench::default() })
/// #     }
/// #     fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
/// #         self.sum = 0.0;
/// #         Ok(())
/// #     }
/// # }
/// # let registry = Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, [Kind::of::<Counter>()]);
/// # let text = r#"
/// #     name = "count"
/// #     clock = "lockstep"
/// #     [component.counter]
/// #     kind = "example.counter"
/// #     rate = "1 kHz"
/// #     publish = { wrench = "count" }
/// # "#;
/// # let checked = graph::check("count.toml".as_ref(), text.into(), &[], &registry, &graph::Machine::detect()).unwrap();
/// // `checked` is a graph with a component `counter` that publishes how often it stepped.
/// let mut session = Session::launch(checked.plan, &registry, &Options::inline())?;
/// session.step_until(Duration::from_millis(10))?;
/// assert_eq!(session.read::<Wrench>("count")?.unwrap().value.force[2], 10.0);
///
/// session.set("counter", "step", 2.0)?;
/// session.reset(7)?;
/// assert_eq!(session.events().last().unwrap().text, "reset for episode 1, seed 7");
/// assert!(session.read::<Wrench>("count")?.is_none());
/// session.step()?;
/// assert_eq!(session.read::<Wrench>("count")?.unwrap().value.force[2], 2.0);
/// assert_eq!(session.stop().episodes.len(), 2);
/// # Ok::<(), motorium::session::SessionError>(())
/// ```
pub struct Session<'o> {
    ports: Owned<Ports>,
    parameters: Owned<Option<ParameterTable>>,
    launch: Owned<Launch>,
    observe: Box<dyn FnMut(Event<'_>) + 'o>,
    exit: Option<Exit>,
    pace: Option<Pace>,
    /// The current episode's seed, and the number of steps of the run before the episode.
    episode: (u64, u64),
    episodes: Vec<EpisodeReport>,
    events: EventReader,
}

impl core::fmt::Debug for Session<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let run = self.launch.folder().id();
        f.debug_struct("Session").field("run", &run).field("time", &self.time()).finish_non_exhaustive()
    }
}

impl Session<'static> {
    /// Launches a plan. When this function returns, all components are configured and connected, but no
    /// component has stepped.
    ///
    /// # Errors
    /// The graph did not start. Nothing is left in shared memory.
    pub fn launch(plan: Plan, registry: &Registry, options: &Options) -> Result<Self, SessionError> {
        Self::observed(plan, registry, options, |_| {})
    }
}

impl<'o> Session<'o> {
    /// Launches a plan like [`launch`](Session::launch), and calls `observe` with every [`Event`], including
    /// a status about 20 times a second while time passes.
    ///
    /// # Errors
    /// Same as [`launch`](Session::launch).
    pub fn observed(
        plan: Plan,
        registry: &Registry,
        options: &Options,
        observe: impl FnMut(Event<'_>) + 'o,
    ) -> Result<Self, SessionError> {
        let mut observe: Box<dyn FnMut(Event<'_>) + 'o> = Box::new(observe);
        let seed = plan.seed;
        let (launch, exit) = Launch::start(plan, registry, options, &mut *observe)?;
        let (ports, parameters, launch) =
            (Owned::new(Ports::default()), Owned::new(None), Owned::new(launch));
        let (episodes, pace, events, episode) = (Vec::new(), None, EventReader::default(), (0, seed));
        Ok(Self { ports, parameters, launch, observe, exit, pace, episode, episodes, events })
    }

    /// Returns the plan of the run.
    pub fn plan(&self) -> &Plan {
        self.launch.plan()
    }

    /// Returns the run's id, which identifies the run in commands such as `motorium top`.
    pub fn id(&self) -> &str {
        self.launch.folder().id()
    }

    /// Returns the time since the start of the current episode or, without episodes, since the start of the
    /// run. In lockstep, the result is simulated time.
    pub fn time(&self) -> Duration {
        Duration::from_nanos(self.launch.time_ns().saturating_sub(self.launch.episode_ns()))
    }

    /// Returns the index of the current episode, counted from 0.
    pub fn episode(&self) -> u64 {
        self.launch.region().header().episode.load(Relaxed)
    }

    /// Returns `true` if a component has ended the current episode.
    pub fn is_episode_over(&self) -> bool {
        self.launch.region().header().is_episode_over()
    }

    /// Returns the digest of all values published in the current episode. In lockstep, equal episodes have
    /// equal digests.
    pub fn state_hash(&self) -> String {
        self.launch.state_hash()
    }

    /// Returns the events of the run since the last call, oldest first. The first call returns all events
    /// that are still in the log.
    pub fn events(&mut self) -> Vec<LoggedEvent> {
        self.launch.events(&mut self.events)
    }

    /// Returns the number of events that were overwritten in the log before [`events`](Self::events) could
    /// read them.
    pub fn lost_events(&self) -> u64 {
        self.events.lost()
    }

    /// Lets time pass until [`time`](Self::time) reaches `time`. In lockstep, this runs all rounds before
    /// this time. In real time, this waits. Returns early if a component ends the episode.
    ///
    /// # Errors
    /// The run has ended.
    pub fn step_until(&mut self, time: Duration) -> Result<(), SessionError> {
        self.check_alive()?;
        let until_ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let exit = match (self.launch.plan().clock, self.pace) {
            (ClockKind::Realtime, _) => {
                let until_ns = until_ns.saturating_add(self.launch.episode_ns());
                self.launch.supervise(until_ns, &mut *self.observe)
            }
            (ClockKind::Lockstep, None) => {
                self.launch.run_rounds(Limit { until_ns, rounds: u64::MAX }, &mut *self.observe)
            }
            (ClockKind::Lockstep, Some(_)) => self.step_paced(until_ns),
        };
        self.ended(exit)
    }

    /// Runs one lockstep round: steps all components that are due at the next release time.
    ///
    /// # Errors
    /// The run is in real time, or has ended.
    pub fn step(&mut self) -> Result<(), SessionError> {
        self.in_lockstep("a single step")?;
        self.check_alive()?;
        let exit = self.launch.run_rounds(Limit { until_ns: u64::MAX, rounds: 1 }, &mut *self.observe);
        self.ended(exit)
    }

    /// Resets all components and simulated time, and begins an episode with this seed. The first episode has
    /// the seed of the plan.
    ///
    /// After the reset, all topics are empty, and time is zero. Parameters keep their values.
    ///
    /// # Errors
    /// The run is in real time or has ended, or a component cannot be reset.
    pub fn reset(&mut self, seed: u64) -> Result<(), SessionError> {
        self.in_lockstep("a reset")?;
        self.check_alive()?;
        let plan = self.launch.plan();
        let fixed = |name: &str| !self.launch.stands_in_for(name);
        if let Some(component) = plan.components.iter().find(|c| !c.resets && fixed(&c.name)) {
            return Err(SessionError::NoReset { component: component.name.clone() });
        }
        self.note_episode();
        let index = self.episode.0 + 1;
        let exit = self.launch.reset(index, seed, &mut *self.observe);
        self.ports.begin_episode(index);
        self.episode = (index, seed);
        self.pace = self.pace.map(|pace| pace.anchored(monotonic_ns(), 0));
        self.ended(exit)
    }

    /// Begins the next episode in real time with this seed: a numbered section of the run, without a reset.
    /// Returns the index of the episode.
    ///
    /// Each component enters the episode at its next step: its stamps have the new index, weights that wait
    /// for an episode are applied, and
    /// [`Component::begin_episode`](crate::component::Component::begin_episode) is called.
    /// [`time`](Self::time) restarts at zero. Robots, topics, parameters and
    /// [`Tick::time_ns`](crate::component::Tick::time_ns) continue unchanged.
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use motorium::session::{Session, SessionError};
    /// /// Three attempts of 2 s each on a robot.
    /// fn attempts(session: &mut Session<'_>) -> Result<(), SessionError> {
    ///     session.step_until(Duration::from_secs(2))?;
    ///     for seed in [1, 2] {
    ///         session.begin_episode(seed)?;
    ///         session.step_until(Duration::from_secs(2))?;
    ///     }
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// The run is in lockstep or has ended, or a component begins the episodes of this run.
    pub fn begin_episode(&mut self, seed: u64) -> Result<u64, SessionError> {
        self.launch.check()?;
        if self.launch.plan().clock == ClockKind::Lockstep {
            return Err(SessionError::SimulatedTime { what: "an episode without a reset" });
        }
        if let Some(driver) = self.launch.plan().episode_driver() {
            return Err(SessionError::EpisodeDriver { component: driver.name.clone() });
        }
        self.check_alive()?;
        Ok(self.launch.begin_episode(seed, &mut *self.observe))
    }

    /// Sets a parameter of a component to a value such as `1.5`, `3`, `true`, `"trot"` or `[0.0, 0.5]`. The
    /// value takes effect at the component's next step and persists through resets.
    ///
    /// # Errors
    /// The parameter does not exist, or the value has the wrong type or is out of range.
    pub fn set(
        &mut self,
        component: &str,
        parameter: &str,
        value: impl Into<ParameterValue>,
    ) -> Result<(), SessionError> {
        self.set_many(component, [(parameter, value.into())])
    }

    /// Sets several parameters of a component together. All values take effect at the component's next step.
    /// If a parameter cannot be set, all parameters stay unchanged.
    ///
    /// # Errors
    /// Same as [`set`](Self::set).
    pub fn set_many<'a>(
        &mut self,
        component: &str,
        values: impl IntoIterator<Item = (&'a str, ParameterValue)>,
    ) -> Result<(), SessionError> {
        self.launch.check()?;
        if self.parameters.is_none() {
            let domain = self.launch.folder().domain().map_err(LaunchError::from)?;
            *self.parameters = Some(ParameterTable::open(&domain, self.launch.plan().clone())?);
        }
        if let Some(table) = &*self.parameters {
            let paths: Vec<(String, ParameterValue)> = values
                .into_iter()
                .map(|(parameter, value)| (format!("{component}.{parameter}"), value))
                .collect();
            table.set_many(paths.iter().map(|(path, value)| (path.as_str(), value.clone())))?;
        }
        Ok(())
    }

    /// Sets the pace of simulated time to a multiple of real time. With `None` the run is as fast as the
    /// machine allows.
    ///
    /// # Errors
    /// The run is in real time, or the factor is not finite or not above zero.
    pub fn pace(&mut self, factor: Option<f64>) -> Result<(), SessionError> {
        self.in_lockstep("a pace")?;
        let (wall_ns, simulated_ns) = (monotonic_ns(), self.launch.time_ns());
        self.pace = match factor {
            None => None,
            Some(factor) => Some(Pace::new(factor, wall_ns, simulated_ns).ok_or(SessionError::Pace(factor))?),
        };
        Ok(())
    }

    /// Pauses simulated time in [`run`](Self::run) if `held` is true, otherwise continues it. The command
    /// `motorium step` pauses and continues a run from a separate terminal. [`step`](Self::step) and
    /// [`step_until`](Self::step_until) also work in a paused run, because the program calls them explicitly.
    ///
    /// # Errors
    /// The run is in real time, which cannot be paused.
    pub fn pause(&mut self, held: bool) -> Result<(), SessionError> {
        self.in_lockstep("a pause")?;
        self.launch.region().header().pause(held);
        Ok(())
    }

    /// Ends the run in an orderly way: actuators enter their safe state, and components save their results.
    /// In a forked child, this does not end the run, and the report covers the run so far.
    pub fn stop(mut self) -> Report {
        if let Err(error) = self.launch.check() {
            return self.launch.report_so_far(Exit::SafeStop { reason: format!("the session: {error}") });
        }
        let plan = self.launch.plan();
        let (planned, clock) = (plan.episodes.is_some(), plan.clock);
        if clock == ClockKind::Lockstep && (self.episode.0 > 0 || planned) {
            self.note_episode();
        }
        let exit = self.exit.take().unwrap_or(Exit::Finished);
        let mut report = self.launch.finish(exit, &mut *self.observe);
        if clock == ClockKind::Lockstep {
            report.episodes = core::mem::take(&mut self.episodes);
        }
        report
    }

    /// Adds the current episode to the report.
    fn note_episode(&mut self) {
        let (index, seed) = self.episode;
        let blocks = self.launch.region().components();
        let steps = |block: &crate::region::ComponentBlock| {
            block.steps.load(Relaxed).saturating_sub(block.episode_first.load(Relaxed))
        };
        self.episodes.push(EpisodeReport {
            index,
            seed,
            duration_s: self.launch.time_ns() as f64 * 1e-9,
            steps: blocks.iter().map(steps).sum(),
            state_hash: Some(self.launch.state_hash()),
        });
    }

    fn ended(&mut self, exit: Option<Exit>) -> Result<(), SessionError> {
        self.exit = exit;
        self.check_alive()
    }

    fn check_alive(&self) -> Result<(), SessionError> {
        self.launch.check()?;
        self.exit.clone().map_or(Ok(()), |exit| Err(SessionError::Ended(exit)))
    }

    fn in_lockstep(&self, what: &'static str) -> Result<(), SessionError> {
        self.launch.check()?;
        match self.launch.plan().clock {
            ClockKind::Lockstep => Ok(()),
            ClockKind::Realtime => Err(SessionError::RealTime { what }),
        }
    }

    /// Returns the current time on the clock of [`Stamp`](crate::state::Stamp)s, ns: `CLOCK_MONOTONIC` in
    /// real time, simulated time in lockstep.
    pub fn stamp_ns(&self) -> u64 {
        match self.launch.plan().clock {
            ClockKind::Lockstep => self.launch.time_ns(),
            ClockKind::Realtime => monotonic_ns(),
        }
    }
}

#[cfg(test)]
mod tests;
