//! Safe stops: the actuators reach their safe state, and the robot settles.

use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use super::Event;
use super::reached::Reached;
use super::run::Run;
use super::workers::Workers;
use crate::os::monotonic_ns;
use crate::region::{Command, ComponentBlock};

/// An ordered safe stop.
pub(super) struct SafeStop<'a> {
    run: &'a Run,
    workers: &'a mut Workers,
    /// Time of the order, ns.
    ordered_ns: u64,
}

impl<'a> SafeStop<'a> {
    /// Orders the safe state of all actuators.
    pub(super) fn order(run: &'a Run, workers: &'a mut Workers) -> Self {
        let header = run.region.header();
        let ordered_ns = monotonic_ns();
        header.safe_stop_ns.store(ordered_ns, Relaxed);
        header.order(Command::SafeStop);
        workers.interrupt_all();
        Self { run, workers, ordered_ns }
    }

    /// Waits until the robot has settled after a failure.
    pub(super) fn settle_after(mut self, reason: &str, observe: &mut dyn FnMut(Event<'_>)) {
        observe(Event::SafeStop { reason });
        let settle = Duration::from_nanos(self.run.plan.settle_ns());
        let until = Instant::now() + settle;
        let mut reported = false;
        while Instant::now() < until {
            self.workers.relay_output(observe);
            if !reported && let Some(after_ns) = self.all_safe_after_ns() {
                observe(Event::Safe { after_ns });
                reported = true;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        if !reported {
            self.report_unsafe(observe);
        }
    }

    /// Waits until the robot has settled at the end of a run. Returns a warning for each actuator that did
    /// not keep its safe state until then.
    pub(super) fn settle_at_the_end(mut self, observe: &mut dyn FnMut(Event<'_>)) -> Vec<String> {
        let settle_ns = self.run.plan.settle_ns();
        std::thread::sleep(Duration::from_nanos(settle_ns));
        if settle_ns == 0 || self.all_safe_after_ns().is_some() {
            return Vec::new();
        }
        self.report_unsafe(observe);
        let components = &self.run.plan.components;
        let warning = |(index, reached): (usize, Reached)| {
            let name = &components[index].name;
            match reached {
                // Moving joints are recorded at the end (`note_rest`).
                Reached::Safe { .. } | Reached::Moving => None,
                Reached::Not => Some(format!("`{name}` did not reach its safe state before the end")),
                Reached::Dead => Some(format!(
                    "`{name}` ended before the robot had settled, so nothing controlled the robot"
                )),
            }
        };
        self.actuators().into_iter().filter_map(warning).collect()
    }

    /// Returns the actuators with their states since the order.
    fn actuators(&mut self) -> Vec<(usize, Reached)> {
        let blocks = self.run.plan.components.iter().zip(self.run.region.components()).enumerate();
        let actuators = blocks.filter(|(_, (component, _))| component.actuator);
        let reached = |(index, (_, block)): (usize, (_, &ComponentBlock))| {
            let ended = self.workers.child(index).ended().is_some();
            (index, Reached::from_block(block, ended, self.ordered_ns))
        };
        actuators.map(reached).collect()
    }

    /// Returns the time from the order until the last actuator was in its safe state, ns; `None` unless all
    /// are alive, safe and at rest.
    fn all_safe_after_ns(&mut self) -> Option<u64> {
        let mut last = self.ordered_ns;
        let actuators = self.actuators();
        for (_, reached) in &actuators {
            let Reached::Safe { since_ns } = reached else { return None };
            last = last.max(*since_ns);
        }
        (!actuators.is_empty()).then(|| last - self.ordered_ns)
    }

    /// Reports the actuators outside their safe state.
    fn report_unsafe(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let actuators = self.actuators();
        let names = |wanted: fn(&Reached) -> bool| -> Vec<&str> {
            let those = actuators.iter().filter(|(_, reached)| wanted(reached));
            those.map(|(index, _)| self.run.plan.components[*index].name.as_str()).collect()
        };
        let dead = names(|reached| matches!(reached, Reached::Dead));
        let late = names(|reached| matches!(reached, Reached::Not));
        let moving = names(|reached| matches!(reached, Reached::Moving));
        let safe = names(|reached| matches!(reached, Reached::Safe { .. }));
        if !actuators.is_empty() {
            observe(Event::NotSafe { dead: &dead, late: &late, moving: &moving, safe: &safe });
        }
    }
}
