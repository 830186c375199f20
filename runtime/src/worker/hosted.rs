//! A component of any type that is stepped by its host's loop.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use super::stepper::Stepper;
use super::timing::Timing;
use super::{Configured, Failure, Make, configure, connect, failure};
use crate::context::Context;
use crate::os;
use crate::plan::Plan;
use crate::region::Region;
use crate::run_folder::RunFolder;
use crate::transport::Connect;

/// The run that hosts a component.
#[derive(Debug)]
pub(crate) struct Host<'a> {
    pub(crate) folder: &'a RunFolder,
    pub(crate) plan: &'a Plan,
    pub(crate) region: &'a Rc<Region>,
}

/// A component of any type that the caller steps in simulated time, for hosting many components in one
/// thread.
pub(crate) trait Hosted {
    /// Connects the ports, once the ports of all components are open.
    fn connect(&mut self) -> Result<(), Failure>;

    /// Begins the run; steps may follow.
    fn begin(&mut self);

    /// Runs the step that is due at `time_ns` and began at `began_ns` on `CLOCK_MONOTONIC`. Returns its end
    /// on that clock.
    fn step(&mut self, time_ns: u64, began_ns: u64) -> Result<u64, Failure>;

    /// Resets the component, its ports and its clock for an episode with this index and seed.
    fn reset(&mut self, index: u64, seed: u64) -> Result<(), Failure>;

    /// Stops the component and saves its result.
    fn finish(self: Box<Self>, folder: &RunFolder) -> Result<(), Failure>;
}

/// Configures a component of a run in the calling thread.
pub(super) fn open(host: &Host<'_>, index: usize, make: Make) -> Result<Box<dyn Hosted>, Failure> {
    failure::catch_panic_messages();
    let context = Rc::new(Context::new(host.plan, index, host.region.clone()).traced());
    context.block().thread.store(os::thread_id() as u32, Relaxed);
    let Configured { stepper, ports, .. } = configure(host.folder, host.plan, index, context, make)?;
    Ok(Box::new(Open { stepper, ports }))
}

/// A component and its ports.
struct Open {
    stepper: Stepper,
    ports: Vec<Rc<dyn Connect>>,
}

impl Hosted for Open {
    fn connect(&mut self) -> Result<(), Failure> {
        let tick = self.stepper.context().block().steps.load(Relaxed);
        connect(&self.ports).map_err(|text| Failure::error(tick, text))
    }

    fn begin(&mut self) {
        self.stepper.context().clock().begin();
    }

    fn step(&mut self, time_ns: u64, began_ns: u64) -> Result<u64, Failure> {
        self.stepper.step(Timing::lockstep(time_ns, self.stepper.period_ns()))?;
        let ended_ns = os::monotonic_ns();
        self.stepper.account_inline(ended_ns.saturating_sub(began_ns));
        Ok(ended_ns)
    }

    fn reset(&mut self, index: u64, seed: u64) -> Result<(), Failure> {
        self.ports.iter().for_each(|port| port.begin_episode());
        self.stepper.reset(index, seed)
    }

    fn finish(self: Box<Self>, folder: &RunFolder) -> Result<(), Failure> {
        self.stepper.finish(folder)
    }
}
