//! The launcher: from a plan to running processes, and back to nothing.
//!
//! The launcher makes every service, starts one process per component, holds them at a barrier until all ports
//! are connected, watches them, restarts what may be restarted, brings the robot to its safe state when something
//! fails, and leaves no shared memory behind. A [`guard`] process does the last two when the launcher itself is
//! killed.

mod barrier;
mod child;
mod cores;
mod event;
pub mod guard;
mod hang;
mod idle_states;
mod lockstep;
mod lost_steps;
mod places;
mod report;
mod reserve;
mod restart;
mod shutdown;
mod status;
mod stop_reason;
mod supervise;
mod watchdog;

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::Ordering::{Relaxed, Release};
use std::time::Duration;

use iceoryx2::node::Node;

use crate::os::monotonic_ns;
use crate::plan::{ClockKind, Plan, Program};
use crate::region::{Command, Region};
use crate::run_folder::{RunFolder, RunFolderError};
use crate::transport::{DomainError, ParameterService, PortError, Shared, TopicMemory, TopicService};
use crate::worker::Registry;
use child::Child;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;
use idle_states::IdleStates;
use places::Places;
use reserve::Spare;

pub use cores::{CoreReport, CoreWatch};
pub use event::Event;
pub use report::{
    ComponentReport, EdgeReport, Exit, LatencyReport, REPORT_VERSION, Report, steps_per_second,
};
pub use status::{ComponentStatus, Status};

/// Options of a launch.
#[derive(Debug, Clone)]
pub struct Options {
    /// Processes or threads for the components.
    pub hosting: Hosting,
    /// The program that hosts built-in kinds and the guard; usually the current one.
    pub program: PathBuf,
}

/// The hosting of components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hosting {
    /// Each component in a process of its own.
    Processes,
    /// All components as threads of the launching process, unprotected from one another: for tests and for learning.
    OneProcess,
}

/// Error of a launch.
#[derive(Debug, thiserror::Error)]
pub enum LaunchError {
    /// The run's folder or its control block could not be made.
    #[error(transparent)]
    Folder(#[from] RunFolderError),
    /// The run's domain could not be joined.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// A topic or parameter could not be made.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A process could not be started.
    #[error("component `{name}`: {program} could not be started: {reason}")]
    Start {
        /// The component.
        name: String,
        /// Its program.
        program: PathBuf,
        /// The error of the system.
        reason: String,
    },
    /// A component failed before the graph began to run.
    #[error("component `{name}` did not start: {reason}")]
    Component {
        /// The component.
        name: String,
        /// Its error, or the kind of its end.
        reason: String,
    },
    /// A resource of this machine or of this process does not suffice. Nothing was made.
    #[error("{what}: the graph needs {need}, but {found}; {advice}")]
    Exhausted {
        /// The lack.
        what: &'static str,
        /// The amount that the graph needs.
        need: String,
        /// The amount there is, as a clause.
        found: String,
        /// Advice, in one sentence.
        advice: String,
    },
    /// The system denied the launcher something that it needs.
    #[error("{what}: {reason}")]
    System {
        /// The action that was tried.
        what: &'static str,
        /// The error of the system.
        reason: String,
    },
}

/// Runs a plan to its end: its duration, a signal, or a failure that its policies do not forgive.
///
/// `observe` is called with every [`Event`] while the graph runs; with a [`Status`] about 20 times a second.
///
/// # Errors
/// The graph did not start; nothing is left behind then. A graph that ran and failed is no error: its report says how
/// it ended.
pub fn run(
    plan: Plan,
    registry: &Registry,
    options: &Options,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Report, LaunchError> {
    crate::transport::quieten();
    reserve::check(&plan)?;
    let signals = shutdown::Signals::catch()
        .map_err(|error| LaunchError::System { what: "catching signals", reason: error.to_string() })?;
    let (folder, region) = RunFolder::create(&plan)?;
    let mut launch = Launch {
        plan,
        registry,
        options,
        folder,
        region,
        children: Vec::new(),
        guard: None,
        guard_since_ns: 0,
        ended_ns: None,
        lost: Vec::new(),
        warnings: Vec::new(),
        idle_states: IdleStates::default(),
        spare: Spare::none(),
        places: Places::default(),
    };
    let result = launch.live(&signals, observe);
    launch.clean_up();
    result
}

/// A launch in progress.
struct Launch<'a> {
    plan: Plan,
    registry: &'a Registry,
    options: &'a Options,
    folder: RunFolder,
    region: Region,
    children: Vec<Child>,
    guard: Option<Child>,
    /// Time from which on the guard is expected to be alive, ns.
    guard_since_ns: u64,
    /// Time at which the components were told to stop, ns.
    ended_ns: Option<u64>,
    lost: Vec<String>,
    warnings: Vec<String>,
    idle_states: IdleStates,
    spare: Spare,
    places: Places,
}

/// Everything in shared memory that must outlive the components.
struct Services {
    node: Option<Node<Shared>>,
    topics: Vec<TopicService>,
    parameters: Vec<ParameterService>,
    /// The topics that components wait for.
    waited_for: Vec<Rc<TopicMemory>>,
}

impl Drop for Services {
    /// Lets go of the services without a look at their words in shared memory, which a component may have damaged; the files
    /// and objects are removed by their names.
    fn drop(&mut self) {
        self.topics.drain(..).for_each(TopicService::abandon);
        self.parameters.drain(..).for_each(ParameterService::abandon);
        if let Some(node) = self.node.take() {
            node.abandon();
        }
    }
}

impl Launch<'_> {
    fn live(
        &mut self,
        signals: &shutdown::Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Result<Report, LaunchError> {
        self.place_launcher();
        self.limit_idle_states()?;
        if self.options.hosting == Hosting::Processes {
            self.start_guard()?;
        }
        let services = self.create_services()?;
        self.spare = Spare::reserve(&self.folder)?;
        observe(Event::Created { run: self.folder.id(), plan: &self.plan });
        for index in 0..self.plan.components.len() {
            let child = self.start(index)?;
            self.children.push(child);
        }
        if !self.pass_barrier(signals, observe)? {
            self.end(&services, observe);
            return Ok(self.report(Exit::Interrupted, 0));
        }
        let lockstep = self.plan.clock == ClockKind::Lockstep;
        let header = self.region.header();
        // By then every process waits for its first release.
        let watch =
            CoreWatch::start(self.plan.components.iter().filter_map(|component| component.core).collect());
        let start = if lockstep { monotonic_ns() } else { monotonic_ns() + 20_000_000 };
        header.start_ns.store(start, Release);
        header.order(Command::Run);
        self.signal_all();
        observe(Event::Started);
        let (exit, simulated_ns) = if lockstep {
            self.run_lockstep(&services, signals, observe)
        } else {
            (self.supervise(&services, signals, observe), monotonic_ns().saturating_sub(start))
        };
        let wall = monotonic_ns().saturating_sub(start);
        let simulated = if lockstep { simulated_ns } else { wall };
        let cores = watch.stop();
        self.end(&services, observe);
        let mut report = self.report(exit, simulated);
        report.cores = cores;
        report.realtime_factor = simulated as f64 / wall.max(1) as f64;
        Ok(report)
    }

    /// The launcher keeps off the real-time cores; in lockstep it shares the one core with all components.
    fn place_launcher(&self) {
        let lockstep = self.plan.clock == ClockKind::Lockstep;
        let core = self.plan.components.iter().find_map(|component| component.core).filter(|_| lockstep);
        let cores = core.map_or_else(|| self.plan.scheduling.shared_cores.clone(), |core| vec![core]);
        let class = crate::plan::SchedulingClass::Normal;
        // Without the right to choose its cores the launcher stays where it is.
        let _ = crate::os::apply(&crate::os::Request { class, cores, lock_memory: false });
    }

    fn create_services(&self) -> Result<Services, LaunchError> {
        let node = self.folder.domain()?.node()?;
        let (topics, parameters, waited_for) = (Vec::new(), Vec::new(), Vec::new());
        let mut services = Services { node: None, topics, parameters, waited_for };
        for topic in &self.plan.topics {
            let service = TopicService::create(&node, topic)?;
            services.waited_for.extend(service.waited_for());
            services.topics.push(service);
        }
        for component in &self.plan.components {
            services.parameters.extend(ParameterService::create(&node, component)?);
        }
        services.node = Some(node);
        Ok(services)
    }

    fn start(&self, index: usize) -> Result<Child, LaunchError> {
        let component = &self.plan.components[index];
        let child = match (&component.program, self.options.hosting) {
            (Program::Exec { path }, _) => Child::process(path, &self.folder, &component.name)?,
            (Program::Builtin { .. }, Hosting::Processes) => {
                Child::process(&self.options.program, &self.folder, &component.name)?
            }
            (Program::Builtin { kind }, Hosting::OneProcess) => {
                Child::thread(self.registry.find(kind), &self.folder, &component.name)?
            }
        };
        self.region.components()[index].pid.store(child.pid(), Relaxed);
        Ok(child)
    }

    fn start_guard(&mut self) -> Result<(), LaunchError> {
        let guard = Child::guard(&self.options.program, &self.folder)?;
        self.region.header().guard.store(guard.pid(), Relaxed);
        self.guard_since_ns = monotonic_ns();
        self.guard = Some(guard);
        Ok(())
    }

    /// Interrupts every worker, so that it reads the command.
    fn signal_all(&self) {
        for (index, child) in self.children.iter().enumerate() {
            child.interrupt(self.region.components()[index].thread.load(Relaxed) as i32);
        }
    }

    fn clean_up(&mut self) {
        for child in &mut self.children {
            child.kill();
        }
        self.end_cleaner();
        self.folder.remove();
        if let Some(guard) = &mut self.guard {
            guard.kill();
        }
    }
}

/// Time within which components must be configured.
const CONFIGURE_WITHIN: Duration = Duration::from_secs(30);
