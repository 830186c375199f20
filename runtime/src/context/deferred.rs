//! Work deferred to the end of a step: wake-ups on the same core, slots for the next publications, records of
//! ages.

use std::cell::RefCell;
use std::fmt::Debug;
use std::rc::Rc;

use super::first_lines::FirstLines;
use crate::region::Region;

/// Number of ages deferred to the end of a step; further ages are recorded immediately.
const AGES: usize = 32;

/// Work that an output defers to the end of the step.
pub(crate) trait AfterStep: Debug {
    /// Wakes the components that the step triggered.
    fn wake(&self);

    /// Counts the publications of the step, and selects the memory of the next publication, which the next
    /// step needs first.
    fn finish(&self, region: &Region, first_lines: &FirstLines);

    /// Discards the publications of the previous episode.
    fn begin_episode(&self);
}

/// Work of one component that is deferred to the end of its steps.
#[derive(Debug)]
pub(crate) struct Deferred {
    region: Rc<Region>,
    outputs: RefCell<Vec<Rc<dyn AfterStep>>>,
    /// Ages of the samples read in this step, ns, with the index of their edge.
    ages: RefCell<Vec<(usize, u64)>>,
}

impl Deferred {
    pub(super) fn new(region: Rc<Region>) -> Self {
        Self { region, outputs: RefCell::default(), ages: RefCell::new(Vec::with_capacity(AGES)) }
    }

    /// Registers an output, whose deferred work is done at the end of every step.
    pub(crate) fn add(&self, output: Rc<dyn AfterStep>) {
        self.outputs.borrow_mut().push(output);
    }

    /// Starts an episode, in which no output has published yet.
    pub(super) fn begin_episode(&self) {
        self.outputs.borrow().iter().for_each(|output| output.begin_episode());
        self.ages.borrow_mut().clear();
    }

    /// Defers the record of a sample's age, ns, to the end of the step.
    #[inline]
    pub(super) fn note_age(&self, edge: usize, age_ns: u64) {
        let mut ages = self.ages.borrow_mut();
        if ages.len() < AGES {
            ages.push((edge, age_ns));
        } else {
            self.region.edges()[edge].age.record(age_ns);
        }
    }

    /// Wakes the components on this core that the step triggered. They may run before this returns.
    #[inline]
    pub(crate) fn wake(&self) {
        self.outputs.borrow().iter().for_each(|output| output.wake());
    }

    /// Does the rest of the deferred work.
    pub(crate) fn finish(&self, first_lines: &FirstLines) {
        self.outputs.borrow().iter().for_each(|output| output.finish(&self.region, first_lines));
        for (edge, age_ns) in self.ages.borrow_mut().drain(..) {
            self.region.edges()[edge].age.record(age_ns);
        }
    }
}
