//! Properties of the components in the graph.

use super::super::graphs::When;
use super::Machine;
use crate::plan::SchedulingClass;
use crate::schedule::Overheads;

impl Machine<'_> {
    /// Returns the duration of the longest step, including its entry.
    pub(super) fn body(&self, index: usize) -> i64 {
        let mut cost = self.nodes[index].budget_ns.unwrap();
        if let When::After(writer) = self.nodes[index].when
            && self.nodes[writer].core == self.nodes[index].core
        {
            cost += self.overheads.hop_same_core_ns;
        }
        cost as i64
    }

    /// Returns the longest work of the worker after the step.
    pub(super) fn tail(&self, index: usize) -> i64 {
        let Overheads { worker_ns, timer_ns, look_ns, .. } = self.overheads;
        let waiting = match self.nodes[index].when {
            When::Every(..) | When::OnEvents(_) => timer_ns,
            When::After(writer) if self.nodes[writer].core != self.nodes[index].core => look_ns,
            When::After(_) => 0,
        };
        (worker_ns + waiting) as i64
    }

    pub(super) fn priority(&self, index: usize) -> u8 {
        match self.nodes[index].class {
            SchedulingClass::Fifo(priority) => priority,
            SchedulingClass::Deadline { .. } => u8::MAX,
            SchedulingClass::Normal => panic!("only real-time components are simulated"),
        }
    }

    pub(super) fn by_deadline(&self, index: usize) -> bool {
        matches!(self.nodes[index].class, SchedulingClass::Deadline { .. })
    }

    /// Returns `true` if a component and the component it triggers are one task in the analysis.
    pub(super) fn one_task(&self, writer: usize, reader: usize) -> bool {
        let base = |index: usize| self.priority(index) - self.nodes[index].rise;
        self.nodes[writer].core == self.nodes[reader].core && base(writer) == base(reader)
    }

    pub(super) fn spin(&self, index: usize) -> i64 {
        let waits_for_the_clock = matches!(self.nodes[index].when, When::Every(..));
        if self.by_deadline(index) || !waits_for_the_clock { 0 } else { self.spin }
    }

    /// Returns `true` if all components that a component triggers are on its core.
    pub(super) fn stays(&self, index: usize) -> bool {
        self.nodes.iter().all(|reader| match reader.when {
            When::After(writer) if writer == index => reader.core == self.nodes[index].core,
            _ => true,
        })
    }
}
