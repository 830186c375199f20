//! Observation of the whole graph from within a component.

use std::fmt;
use std::sync::Arc;

use super::{ConfigureError, Setup};
use crate::os::{Watch, monotonic_ns};
use crate::plan::{ClockKind, Plan};
use crate::region::{Command, EventReader, EventRecord, Region};
use crate::transport::{Domain, PortError, Tap};
use std::sync::atomic::Ordering::Relaxed;

impl Setup {
    /// Returns a view of the whole graph. Intended for components that declared
    /// [`taps`](crate::declare::Declare::taps), such as recorders and viewers. The view may be moved to a
    /// helper thread.
    ///
    /// # Errors
    /// The control block of the run cannot be mapped a second time.
    pub fn observer(&self) -> Result<Observer, ConfigureError> {
        let region = self.run().region().map_err(ConfigureError::failed)?;
        Ok(Observer { plan: Arc::new(self.plan().clone()), domain: self.domain().clone(), region })
    }
}

/// A view of the whole graph from within a component: the plan, the topics (read by [`Tap`]s) and the event
/// log.
///
/// ```
/// use motorium::prelude::*;
///
/// fn topics(setup: &mut Setup) -> Result<Vec<String>, ConfigureError> {
///     let observer = setup.observer()?;
///     Ok(observer.plan().topics.iter().map(|topic| topic.name.clone()).collect())
/// }
/// ```
pub struct Observer {
    plan: Arc<Plan>,
    domain: Domain,
    region: Region,
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Observer").field("graph", &self.plan.name).finish_non_exhaustive()
    }
}

impl Observer {
    /// Returns the plan of the run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Opens a tap, which reads every published value, on the topic with index `topic` in the plan. On a
    /// topic of slices, each value consists of the bytes of a whole slice. The tap must stay on the thread
    /// that opened it.
    ///
    /// # Errors
    /// The topic cannot be opened, or already has four observers.
    pub fn tap(&self, topic: usize) -> Result<Tap, PortError> {
        Tap::open(&self.domain, &self.plan.topics[topic])
    }

    /// Returns the events since the last call with this reader, oldest first. The first call returns all
    /// events that are still in the log.
    pub fn events(&self, reader: &mut EventReader) -> Vec<EventRecord> {
        reader.read(self.region.events())
    }

    /// Returns the time of the graph's first step on the clock of stamps, ns; 0 in lockstep and before the
    /// first step.
    pub fn start_ns(&self) -> u64 {
        match self.plan.clock {
            ClockKind::Realtime => self.region.header().start_ns.load(Relaxed),
            ClockKind::Lockstep => 0,
        }
    }

    /// Returns `true` if the launcher died during the run. Such a run counts as failed, even if its guard has
    /// not reported the failure yet.
    pub fn is_orphaned(&self) -> bool {
        let header = self.region.header();
        let launcher = || Watch::new(header.launcher.load(Relaxed));
        header.command() == Command::Run && !launcher().is_ok_and(|launcher| !launcher.has_ended())
    }

    /// Returns the current time, ns, on the clock with which the run's events are timed. In real time, the
    /// stamps of samples use the same clock.
    pub fn now_ns(&self) -> u64 {
        monotonic_ns()
    }
}
