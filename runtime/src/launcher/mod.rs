//! The launcher: starts, supervises and ends the processes of a plan.
//!
//! The launcher creates every service, starts one process per component and holds them at a barrier until all
//! ports are connected. It supervises the processes, restarts them where permitted, brings the robot to its
//! safe state on a failure, and leaves no shared memory behind. A [`guard`] process does the last two if the
//! launcher itself is killed.

mod accounts;
mod barrier;
mod child;
mod cores;
mod ending;
mod episodes;
mod error;
mod event;
mod event_log;
mod exit;
mod expectations;
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
mod report;
mod reserve;
mod restart;
mod services;
mod shortfalls;
mod shutdown;
mod signals;
mod status;
mod stop_reason;
mod stops;
mod supervise;
mod supervision;
mod watchdog;
mod worker_program;

use std::rc::Rc;
use std::sync::atomic::Ordering::{Relaxed, Release};

use crate::os::{Placement, monotonic_ns};
use crate::plan::{ClockKind, Plan, Program};
use crate::region::{Command, EventReader, Region};
use crate::run_folder::RunFolder;
use crate::worker::{Host, Registry, Rounds};
use accounts::Accounts;
use child::Child;
use episodes::{Episodes, present_episode_ns};
use event_log::{EventWriter, logging};
use guarding::Guard;
use idle_states::IdleStates;
use logged_event::unread_events;
use places::Places;
use reserve::Spare;
use services::Services;
use signals::Signals;
use stops::Stops;
use supervision::Supervision;
use worker_program::WorkerProgram;

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

/// A launch in progress: the processes, threads or hosted components of a run, and everything that is removed
/// with it.
pub(crate) struct Launch {
    plan: Plan,
    registry: Registry,
    options: Options,
    folder: RunFolder,
    region: Rc<Region>,
    services: Services,
    signals: Signals,
    children: Vec<Child>,
    supervision: Vec<Supervision>,
    guard: Guard,
    program: WorkerProgram,
    /// Time of the stop command to the components, ns.
    ended_ns: Option<u64>,
    lost: Vec<String>,
    warnings: Vec<String>,
    idle_states: IdleStates,
    spare: Spare,
    places: Places,
    stops: Stops,
    cores: Option<CoreWatch>,
    /// The event log, and what it contains of the accounts of components.
    log: Rc<EventWriter>,
    accounts: Accounts,
    /// Order of the ticks, and the simulated time of the next one, ns.
    rounds: Rounds,
    reached_ns: u64,
    /// Simulated time of the episodes before, ns.
    before_ns: u64,
    /// Real time: the episodes that have begun.
    episodes: Episodes,
    /// Time of the next status, and of the next look at everything in real time, `CLOCK_MONOTONIC` ns.
    next_status_ns: u64,
    due_ns: u64,
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
        mut plan: Plan,
        registry: &Registry,
        options: &Options,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<(Self, Option<Exit>), LaunchError> {
        crate::domain::quieten();
        options.check(&plan)?;
        reserve::check(&plan, options.hosting)?;
        if let Some(core) = options.core.filter(|_| plan.clock == ClockKind::Lockstep) {
            plan.components.iter_mut().for_each(|component| component.core = Some(core));
        }
        let signals = Signals::new(options.catch_signals)
            .map_err(|error| LaunchError::System { what: "catching signals", reason: error.to_string() })?;
        let (folder, region) = RunFolder::create(&plan)?;
        let region = Rc::new(region);
        let plays = |index: usize| !options.stand_in.contains(&plan.components[index].name);
        let mut launch = Self {
            rounds: Rounds::new(&plan, plays),
            log: Rc::new(EventWriter::new(&plan, region.clone())),
            accounts: Accounts::new(&plan),
            plan,
            registry: registry.clone(),
            options: options.clone(),
            folder,
            region,
            services: Services::default(),
            signals,
            children: Vec::new(),
            supervision: Vec::new(),
            guard: Guard::default(),
            program: WorkerProgram::new(&options.program),
            ended_ns: None,
            lost: Vec::new(),
            warnings: Vec::new(),
            idle_states: IdleStates::default(),
            spare: Spare::none(),
            places: Places::default(),
            stops: Stops::default(),
            cores: None,
            reached_ns: 0,
            before_ns: 0,
            episodes: Episodes::default(),
            next_status_ns: 0,
            due_ns: 0,
            _placement: Placement::remember(),
        };
        let observe = &mut logging(&launch.log, observe);
        let exit = launch.set_up(observe)?;
        Ok((launch, exit))
    }

    fn set_up(&mut self, observe: &mut dyn FnMut(Event<'_>)) -> Result<Option<Exit>, LaunchError> {
        self.place_launcher();
        self.idle_states = IdleStates::request(&self.plan, self.options.hosting)?;
        if self.options.hosting == Hosting::Processes {
            self.guard.start(&self.program, (&self.folder, &self.region))?;
        }
        self.services = Services::create(&self.folder, &self.plan)?;
        self.spare = Spare::reserve(&self.folder)?;
        observe(Event::Created { run: self.folder.id(), plan: &self.plan });
        self.report_neighbours(observe);
        for index in 0..self.plan.components.len() {
            let child = self.start_child(index)?;
            self.children.push(child);
        }
        if !self.pass_barrier(observe)? {
            return Ok(Some(Exit::Interrupted));
        }
        let lockstep = self.plan.clock == ClockKind::Lockstep;
        // By then every process waits for its first release.
        self.cores = Some(CoreWatch::start(self.plan.components.iter().filter_map(|c| c.core).collect()));
        let start = if lockstep { monotonic_ns() } else { monotonic_ns() + 20_000_000 };
        let header = self.region.header();
        header.start_ns.store(start, Release);
        header.order(Command::Run);
        self.children.iter_mut().zip(self.region.components()).for_each(|(child, block)| child.begin(block));
        self.signal_all();
        self.supervision = self.supervision(start);
        (self.next_status_ns, self.due_ns) = (if lockstep { 0 } else { start }, start);
        observe(Event::Started);
        Ok(None)
    }

    /// Ends the run and reports it.
    pub(crate) fn finish(&mut self, exit: Exit, observe: &mut dyn FnMut(Event<'_>)) -> Report {
        let observe = &mut logging(&self.log, observe);
        let start = self.region.header().start_ns.load(Relaxed);
        let wall = if start == 0 { 0 } else { monotonic_ns().saturating_sub(start) };
        let lockstep = self.plan.clock == ClockKind::Lockstep;
        let simulated = if lockstep { self.before_ns + self.reached_ns } else { wall };
        if !lockstep && start != 0 {
            self.episodes.note(&self.region, observe);
        }
        let cores = self.cores.take().map(|watch| watch.stop());
        let in_good_order = matches!(exit, Exit::Finished | Exit::Interrupted);
        if self.plan.clock == ClockKind::Realtime && start != 0 && in_good_order {
            self.note_unmet(observe);
        }
        if start != 0 && in_good_order {
            self.note_gates(observe);
        }
        self.report_last_accounts(observe);
        observe(Event::Ending(&exit));
        self.end(observe);
        if start != 0 && in_good_order {
            self.note_ends(observe);
            self.note_results(observe);
        }
        self.report_last_accounts(observe);
        if start != 0 {
            self.note_rest();
        }
        let mut report = self.report(exit, simulated);
        report.cores = cores.unwrap_or_default();
        report.realtime_factor = simulated as f64 / wall.max(1) as f64;
        // An interrupted or failed run is not at its expected end.
        if report.exit == Exit::Finished {
            let expectations = self.plan.expectations.iter();
            report.expectations = expectations.map(|each| expectations::verdict(each, &report)).collect();
        }
        report
    }

    /// The report of a run that continues.
    pub(crate) fn report_so_far(&self, exit: Exit) -> Report {
        self.report(exit, self.before_ns + self.time_ns())
    }

    /// True if the launching program takes the place of a component.
    pub(crate) fn stands_in_for(&self, component: &str) -> bool {
        self.options.stand_in.iter().any(|name| name == component)
    }

    /// The plan of the run.
    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The folder of the run.
    pub(crate) fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// The control block of the run.
    pub(crate) fn region(&self) -> &Rc<Region> {
        &self.region
    }

    /// Time of the run, ns: simulated in lockstep, else since the start.
    pub(crate) fn time_ns(&self) -> u64 {
        match self.plan.clock {
            ClockKind::Lockstep => self.reached_ns,
            ClockKind::Realtime => monotonic_ns().saturating_sub(self.region.header().start_ns.load(Relaxed)),
        }
    }

    /// Begins the next episode, and returns its number. For runs whose episodes no component begins.
    pub(crate) fn begin_episode(&mut self, seed: u64, observe: &mut dyn FnMut(Event<'_>)) -> u64 {
        let observe = &mut logging(&self.log, observe);
        let header = self.region.header();
        // The launcher itself notes every episode that it begins.
        header.begin_next_episode(seed, monotonic_ns());
        self.episodes.note(&self.region, observe);
        header.episode.load(Relaxed)
    }

    /// Start of the present episode of real time, ns since the start of the run; 0 in lockstep.
    pub(crate) fn episode_ns(&self) -> u64 {
        present_episode_ns(&self.plan, &self.region)
    }

    /// The events since the last call of this reader.
    pub(crate) fn events(&self, reader: &mut EventReader) -> Vec<LoggedEvent> {
        unread_events(reader, &self.plan, &self.region)
    }

    /// Reports everything remaining at the end of a run or episode.
    fn report_last_accounts(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let now_ns = match self.plan.clock {
            ClockKind::Realtime => monotonic_ns(),
            ClockKind::Lockstep => self.reached_ns,
        };
        self.accounts.report((&self.plan, &self.region), now_ns, true, observe);
    }

    /// The launcher avoids the real-time cores; in lockstep it shares the single core with all components. A
    /// thread that hosts them itself is not moved unless a core was given.
    fn place_launcher(&self) {
        let lockstep = self.plan.clock == ClockKind::Lockstep;
        if self.options.hosting == Hosting::Inline && self.options.core.is_none() {
            return;
        }
        let core = self.plan.components.iter().find_map(|component| component.core).filter(|_| lockstep);
        let cores = core.map_or_else(|| self.plan.scheduling.shared_cores.clone(), |core| vec![core]);
        let class = crate::plan::SchedulingClass::Normal;
        // Without the privilege to choose its cores, the launcher is not moved.
        let _ = crate::os::apply(&crate::os::Request { class, cores, lock_memory: false });
    }

    fn start_child(&self, index: usize) -> Result<Child, LaunchError> {
        let component = &self.plan.components[index];
        let block = &self.region.components()[index];
        if self.options.stand_in.contains(&component.name) {
            return Ok(Child::played(&component.name, block));
        }
        let child = match (&component.program, self.options.hosting) {
            (Program::Exec { path } | Program::Sibling { path, .. }, _) => {
                Child::process(path, &self.folder, &component.name, (&self.region, index))?
            }
            (Program::Builtin { .. }, Hosting::Processes) => {
                Child::process(self.program.path(), &self.folder, &component.name, (&self.region, index))?
            }
            (Program::Builtin { kind }, Hosting::Threads) => {
                Child::thread(self.registry.find(kind), &self.folder, &component.name)?
            }
            (Program::Builtin { kind }, Hosting::Inline) => {
                let host = Host { folder: &self.folder, plan: &self.plan, region: &self.region };
                let mut child = Child::inline(self.registry.find(kind), &host, index)?;
                // A restarted component joins a run that has passed its barrier.
                if self.region.header().command() as u32 >= Command::Run as u32 {
                    child.connect(block);
                    child.begin(block);
                }
                child
            }
        };
        block.pid.store(child.pid(), Relaxed);
        Ok(child)
    }

    /// Interrupts every worker, so that it reads the command.
    fn signal_all(&self) {
        for (index, child) in self.children.iter().enumerate() {
            child.interrupt(self.region.components()[index].thread.load(Relaxed) as i32);
        }
    }
}

impl Drop for Launch {
    /// Ends the remaining processes, and removes everything from shared memory.
    fn drop(&mut self) {
        self.region.header().order(Command::Stop);
        self.signal_all();
        for child in &mut self.children {
            child.kill();
        }
        self.children.clear();
        self.places.end_cleaner();
        self.services = Services::default();
        self.folder.remove();
        self.guard.kill();
    }
}
