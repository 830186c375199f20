//! The launcher: starts, supervises and ends the processes of a plan.
//!
//! The launcher creates all services, starts one process per component, and keeps the processes at a barrier
//! until all ports are connected. It supervises the processes and restarts them if their policies permit. On
//! a failure it brings the robot to its safe state. It leaves no shared memory behind. If the launcher itself
//! is killed, a [`guard`] process brings the robot to its safe state and removes the shared memory.

mod accounts;
mod child;
mod cores;
mod ending;
mod episodes;
mod error;
mod event;
mod event_log;
mod exit;
mod expectations;
mod findings;
pub mod guard;
mod guarding;
mod hang;
mod idle_states;
mod lockstep;
mod logged_event;
mod lost_steps;
mod neighbours;
mod options;
mod places;
mod reached;
mod realtime;
mod report;
mod reporter;
mod reserve;
mod restart;
mod run;
mod safe_stop;
mod services;
mod shared_memory;
mod signals;
mod status;
mod stop_reason;
mod stops;
mod supervision;
mod supervisor;
mod watchdog;
mod worker_program;
mod workers;

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crate::os::{Placement, monotonic_ns};
use crate::plan::{ClockKind, ComponentPlan, Plan};
use crate::region::{Command, EventReader, Phase, Region};
use crate::run_folder::RunFolder;
use crate::worker::Registry;
use episodes::present_episode_ns;
use event_log::{EventWriter, logging};
use findings::Findings;
use idle_states::IdleStates;
use lockstep::Lockstep;
use logged_event::{reported_events, unread_events};
use realtime::Realtime;
use run::Run;
use safe_stop::SafeStop;
use supervisor::Supervisor;

pub use cores::{CoreReport, CoreWatch};
pub use error::LaunchError;
pub use event::Event;
pub use exit::Exit;
pub(crate) use lockstep::Limit;
pub use logged_event::{LoggedEvent, REPORTED_EVENTS, logged};
pub use options::{Hosting, Options};
pub use report::{
    ComponentReport, EdgeReport, EpisodeReport, ExpectationReport, LatencyReport, REPORT_VERSION, Report,
    steps_per_second,
};
pub use status::{ComponentStatus, Status};

/// A launch in progress. It reports and logs the events of its parts, and ends them in order.
pub(crate) struct Launch {
    run: Rc<Run>,
    supervisor: Supervisor,
    lockstep: Lockstep,
    realtime: Realtime,
    log: Rc<EventWriter>,
    findings: Findings,
    idle_states: IdleStates,
    cores: Option<CoreWatch>,
    /// Time of the stop command to the components, ns.
    ended_ns: Option<u64>,
    /// Previous core and priority of this thread.
    _placement: Placement,
}

impl Launch {
    /// Starts everything and passes the barrier before the first step. Returns the exit if a signal arrived
    /// meanwhile.
    ///
    /// # Errors
    /// The graph did not start; nothing is left behind.
    pub(crate) fn start(
        plan: Plan,
        registry: &Registry,
        options: &Options,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<(Self, Option<Exit>), LaunchError> {
        crate::domain::quieten();
        options.check(&plan)?;
        reserve::check(&plan, options.hosting)?;
        let run = Rc::new(Run::create(plan, options)?);
        let mut launch = Self {
            supervisor: Supervisor::new(&run, registry),
            lockstep: Lockstep::new(&run),
            realtime: Realtime::new(&run),
            log: Rc::new(EventWriter::new(&run.plan, run.region.clone())),
            run,
            findings: Findings::default(),
            idle_states: IdleStates::default(),
            cores: None,
            ended_ns: None,
            _placement: Placement::remember(),
        };
        let observe = &mut logging(&launch.log, observe);
        let exit = launch.set_up(observe)?;
        Ok((launch, exit))
    }

    fn set_up(&mut self, observe: &mut dyn FnMut(Event<'_>)) -> Result<Option<Exit>, LaunchError> {
        let Run { plan, options, folder, .. } = &*self.run;
        self.run.place_launcher();
        self.idle_states = IdleStates::request(plan, options.hosting)?;
        self.supervisor.create()?;
        observe(Event::Created { run: folder.id(), plan });
        neighbours::report(plan, observe);
        self.supervisor.workers.start_all()?;
        if !self.supervisor.workers.pass_barrier(observe)? {
            return Ok(Some(Exit::Interrupted));
        }
        self.findings.note_denied(&self.run, &self.idle_states, observe);
        // By then every process waits for its first release.
        self.cores = Some(CoreWatch::start(plan.components.iter().filter_map(|c| c.core).collect()));
        let is_lockstep = self.run.is_lockstep();
        let start_ns = if is_lockstep { monotonic_ns() } else { monotonic_ns() + 20_000_000 };
        self.supervisor.begin(start_ns);
        self.supervisor.reporter.next_status_ns = if is_lockstep { 0 } else { start_ns };
        self.realtime.begin(start_ns);
        observe(Event::Started);
        Ok(None)
    }

    /// Supervises a real-time run until a time after its start, ns, or until a component ends the episode.
    /// Returns the exit if the run ended earlier by a signal or a permanent failure.
    pub(crate) fn supervise(&mut self, until_ns: u64, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        self.realtime.supervise(until_ns, &mut self.supervisor, &mut logging(&self.log, observe))
    }

    /// Runs rounds of simulated time up to a limit. Returns the exit if the run ended earlier by a signal or
    /// a failure.
    pub(crate) fn run_rounds(&mut self, limit: Limit, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        self.lockstep.run_rounds(limit, &mut self.supervisor, &mut logging(&self.log, observe))
    }

    /// Resets all components for an episode, one after the other, and restarts simulated time. Returns the
    /// exit if one of them cannot continue.
    pub(crate) fn reset(
        &mut self,
        index: u64,
        seed: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        let observe = &mut logging(&self.log, observe);
        self.report_last_accounts(observe);
        self.lockstep.reset((index, seed), &mut self.supervisor, observe)
    }

    /// Returns the time of the next round of simulated time, ns; `u64::MAX` for none.
    pub(crate) fn next_round_ns(&self) -> u64 {
        self.lockstep.next_round_ns()
    }

    /// In lockstep, performs due checks, and waits for a signal, the end of a process, or a time on
    /// `CLOCK_MONOTONIC`, ns. Returns the exit if a signal arrived.
    pub(crate) fn wait(&mut self, until_ns: u64, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        self.lockstep.wait(until_ns, &mut self.supervisor, &mut logging(&self.log, observe))
    }

    /// Ends the run and reports it.
    pub(crate) fn finish(&mut self, exit: Exit, observe: &mut dyn FnMut(Event<'_>)) -> Report {
        let observe = &mut logging(&self.log, observe);
        let run = self.run.clone();
        let start = run.start_ns();
        let wall = if start == 0 { 0 } else { monotonic_ns().saturating_sub(start) };
        let simulated = if run.is_lockstep() { self.lockstep.simulated_ns() } else { wall };
        if !run.is_lockstep() && start != 0 {
            self.supervisor.reporter.episodes.note(&run.region, observe);
        }
        let cores = self.cores.take().map(|watch| watch.stop());
        let in_good_order = start != 0 && matches!(exit, Exit::Finished | Exit::Interrupted);
        if in_good_order && !run.is_lockstep() {
            self.findings.note_unmet(&run, &self.supervisor, observe);
        }
        if in_good_order {
            self.findings.note_gates(&run, self.clock_ns(), observe);
        }
        self.report_last_accounts(observe);
        observe(Event::Ending(&exit));
        self.end(observe);
        if in_good_order {
            self.findings.note_ends(&run, &mut self.supervisor, observe);
            self.findings.note_results(&run, observe);
        }
        self.report_last_accounts(observe);
        if start != 0 {
            self.findings.note_rest(&run);
        }
        let mut report = self.report(exit, simulated);
        report.cores = cores.unwrap_or_default();
        report.realtime_factor = simulated as f64 / wall.max(1) as f64;
        // An interrupted or failed run is not at its expected end.
        if report.exit == Exit::Finished {
            let expectations = run.plan.expectations.iter();
            report.expectations = expectations.map(|each| expectations::verdict(each, &report)).collect();
        }
        report
    }

    /// Ends all components: the actuators reach their safe state first, then all components receive the stop
    /// command, and those that do not stop are killed.
    fn end(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let Run { plan, region, .. } = &*self.run;
        let Supervisor { workers, memory, .. } = &mut self.supervisor;
        let is_running = plan.clock == ClockKind::Realtime
            && region.components().iter().any(|block| block.phase() == Phase::Running);
        let has_actuators = plan.components.iter().any(|component| component.actuator);
        if is_running && has_actuators && region.header().command() == Command::Run {
            let unsettled = SafeStop::order(&self.run, workers).settle_at_the_end(observe);
            self.findings.warnings.extend(unsettled);
        }
        // The reserve for restarts makes space for results.
        memory.release_reserve();
        region.header().order(Command::Stop);
        self.ended_ns = Some(monotonic_ns());
        workers.end_all(|| memory.wake_triggered());
        // Their pipes are closed now, so their last lines have arrived or will arrive in a moment.
        std::thread::sleep(Duration::from_millis(2));
        workers.relay_output(observe);
    }

    /// Returns the report of a run that continues.
    pub(crate) fn report_so_far(&self, exit: Exit) -> Report {
        let lasted_ns = if self.run.is_lockstep() { self.lockstep.simulated_ns() } else { self.time_ns() };
        self.report(exit, lasted_ns)
    }

    fn report(&self, exit: Exit, duration_ns: u64) -> Report {
        let Run { plan, folder, region, .. } = &*self.run;
        let is_lockstep = self.run.is_lockstep();
        let components = plan.components.iter().zip(region.components());
        let (events, events_left_out) = reported_events(plan, region);
        let end_ns =
            if is_lockstep { self.lockstep.reached_ns() } else { self.ended_ns.unwrap_or_else(monotonic_ns) };
        // While the robot settles, only actuators step.
        let line_ns = match region.header().safe_stop_ns.load(Relaxed) {
            0 => end_ns,
            safe_stop_ns => end_ns.min(safe_stop_ns),
        };
        let end_of = |plan: &ComponentPlan| if plan.actuator || is_lockstep { end_ns } else { line_ns };
        let result = |plan: &ComponentPlan| Some((plan.name.clone(), folder.result(&plan.name)?));
        Report {
            version: REPORT_VERSION,
            graph: plan.name.clone(),
            clock: plan.clock,
            duration_s: duration_ns as f64 * 1e-9,
            realtime_factor: 1.0,
            state_hash: is_lockstep.then(|| self.state_hash()),
            episodes: self.supervisor.reporter.episodes.reports(plan, region, line_ns),
            exit,
            lost: self.findings.denied.clone(),
            warnings: self.findings.warnings.clone(),
            idle_exit_ns: self.idle_states.exit_ns,
            components: components
                .map(|(plan, block)| report::component(plan, block, end_of(plan)))
                .collect(),
            latencies: report::latencies(plan, region),
            edges: report::edges(plan, region),
            cores: Vec::new(),
            results: plan.components.iter().filter_map(result).collect(),
            expectations: Vec::new(),
            events_left_out,
            events,
        }
    }

    /// Returns the digest of all values published in the current episode.
    pub(crate) fn state_hash(&self) -> String {
        report::state_hash(&self.run.plan, &self.run.region)
    }

    /// Returns `true` if the launching program publishes in place of a component, which is not started.
    pub(crate) fn stands_in_for(&self, component: &str) -> bool {
        self.run.is_played(component)
    }

    /// Returns the plan of the run.
    pub(crate) fn plan(&self) -> &Plan {
        &self.run.plan
    }

    /// Returns the folder of the run.
    pub(crate) fn folder(&self) -> &RunFolder {
        &self.run.folder
    }

    /// Returns the control block of the run.
    pub(crate) fn region(&self) -> &Rc<Region> {
        &self.run.region
    }

    /// Returns the time of the run, ns: simulated time in lockstep, else the time since the start.
    pub(crate) fn time_ns(&self) -> u64 {
        match self.run.plan.clock {
            ClockKind::Lockstep => self.lockstep.reached_ns(),
            ClockKind::Realtime => monotonic_ns().saturating_sub(self.run.start_ns()),
        }
    }

    /// Returns the current time on the clock that the run's components read, ns; simulated time in lockstep.
    fn clock_ns(&self) -> u64 {
        if self.run.is_lockstep() { self.lockstep.reached_ns() } else { monotonic_ns() }
    }

    /// Begins the next episode and returns its index. For runs in which no component begins episodes.
    pub(crate) fn begin_episode(&mut self, seed: u64, observe: &mut dyn FnMut(Event<'_>)) -> u64 {
        let observe = &mut logging(&self.log, observe);
        let header = self.run.region.header();
        // The launcher itself records every episode that it begins.
        header.begin_next_episode(seed, monotonic_ns());
        self.supervisor.reporter.episodes.note(&self.run.region, observe);
        header.episode.load(Relaxed)
    }

    /// Returns the start of the current real-time episode, ns since the start of the run; 0 in lockstep.
    pub(crate) fn episode_ns(&self) -> u64 {
        present_episode_ns(&self.run.plan, &self.run.region)
    }

    /// Returns the events since the last call with this reader.
    pub(crate) fn events(&self, reader: &mut EventReader) -> Vec<LoggedEvent> {
        unread_events(reader, &self.run.plan, &self.run.region)
    }

    /// Reports all remaining changes at the end of a run or episode.
    fn report_last_accounts(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let now_ns = self.clock_ns();
        let Run { plan, region, .. } = &*self.run;
        self.supervisor.reporter.accounts.report((plan, region), now_ns, true, observe);
    }
}
