//! Data of a run that all parts of its launch share.

use std::rc::Rc;

use super::signals::Signals;
use super::worker_program::WorkerProgram;
use super::{Hosting, LaunchError, Options};
use crate::plan::{ClockKind, Plan, SchedulingClass};
use crate::region::Region;
use crate::run_folder::RunFolder;
use std::sync::atomic::Ordering::Relaxed;

/// A run: its plan and options, its files and shared memory, and the signals that end it.
pub(super) struct Run {
    pub(super) plan: Plan,
    pub(super) options: Options,
    pub(super) folder: RunFolder,
    pub(super) region: Rc<Region>,
    pub(super) signals: Signals,
    pub(super) program: WorkerProgram,
}

impl Run {
    /// Creates the folder and the control block of a run.
    ///
    /// # Errors
    /// Signals cannot be caught, or the folder cannot be created.
    pub(super) fn create(mut plan: Plan, options: &Options) -> Result<Self, LaunchError> {
        if let Some(core) = options.core.filter(|_| plan.clock == ClockKind::Lockstep) {
            plan.components.iter_mut().for_each(|component| component.core = Some(core));
        }
        let signals = Signals::new(options.catch_signals)
            .map_err(|error| LaunchError::System { what: "catching signals", reason: error.to_string() })?;
        let (folder, region) = RunFolder::create(&plan)?;
        Ok(Self {
            plan,
            options: options.clone(),
            folder,
            region: Rc::new(region),
            signals,
            program: WorkerProgram::new(&options.program),
        })
    }

    /// Returns `true` if the run is in simulated time.
    pub(super) fn is_lockstep(&self) -> bool {
        self.plan.clock == ClockKind::Lockstep
    }

    /// Returns `true` if the launching program replaces a component.
    pub(super) fn is_played(&self, component: &str) -> bool {
        self.options.stand_in.iter().any(|name| name == component)
    }

    /// Returns the start of the run on `CLOCK_MONOTONIC`, ns; 0 before.
    pub(super) fn start_ns(&self) -> u64 {
        self.region.header().start_ns.load(Relaxed)
    }

    /// Moves the launcher off the real-time cores; in lockstep it shares the single core with all components.
    /// A thread that hosts components inline is only moved if a core is set in the options.
    pub(super) fn place_launcher(&self) {
        if self.options.hosting == Hosting::Inline && self.options.core.is_none() {
            return;
        }
        let core = self.plan.components.iter().find_map(|component| component.core);
        let core = core.filter(|_| self.is_lockstep());
        let cores = core.map_or_else(|| self.plan.scheduling.shared_cores.clone(), |core| vec![core]);
        let class = SchedulingClass::Normal;
        // Without the privilege to choose its cores, the launcher is not moved.
        let _ = crate::os::apply(&crate::os::Request { class, cores, lock_memory: false });
    }
}
