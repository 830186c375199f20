//! Work put off to the end of a step: wake-ups on the same core, slots for the next publications, records of
//! ages.

use std::cell::RefCell;
use std::fmt::Debug;
use std::rc::Rc;

use super::first_lines::FirstLines;
use crate::region::Region;

/// Number of ages kept until the end of a step; further ones are recorded immediately.
const AGES: usize = 32;

/// The work that an output leaves to the end of the step.
pub(crate) trait AfterStep: Debug {
    /// Wakes the components that the step has triggered.
    fn wake(&self);

    /// Counts the publications of the step, and chooses the memory of the next one, which the next step needs
    /// first.
    fn finish(&self, region: &Region, first_lines: &FirstLines);

    /// Forgets the publications of the episode before.
    fn begin_episode(&self);
}

/// The work of one component that is put off to the end of its steps.
#[derive(Debug)]
pub(crate) struct Deferred {
    region: Rc<Region>,
    outputs: RefCell<Vec<Rc<dyn AfterStep>>>,
    /// Ages of the samples read in this step, by edge, ns.
    ages: RefCell<Vec<(usize, u64)>>,
}

impl Deferred {
    pub(super) fn new(region: Rc<Region>) -> Self {
        Self { region, outputs: RefCell::default(), ages: RefCell::new(Vec::with_capacity(AGES)) }
    }

    /// Adds the work of an output to the end of every step.
    pub(crate) fn add(&self, output: Rc<dyn AfterStep>) {
        self.outputs.borrow_mut().push(output);
    }

    /// Starts an episode: no output has published yet.
    pub(super) fn begin_episode(&self) {
        self.outputs.borrow().iter().for_each(|output| output.begin_episode());
        self.ages.borrow_mut().clear();
    }

    /// Records an age of a sample, ns, at the end of the step.
    #[inline]
    pub(super) fn note_age(&self, edge: usize, age_ns: u64) {
        let mut ages = self.ages.borrow_mut();
        if ages.len() < AGES {
            ages.push((edge, age_ns));
        } else {
            self.region.edges()[edge].age.record(age_ns);
        }
    }

    /// Wakes the components on this core that the step has triggered. They may run before this returns.
    #[inline]
    pub(crate) fn wake(&self) {
        self.outputs.borrow().iter().for_each(|output| output.wake());
    }

    /// Does the rest of the work put off.
    pub(crate) fn finish(&self, first_lines: &FirstLines) {
        self.outputs.borrow().iter().for_each(|output| output.finish(&self.region, first_lines));
        for (edge, age_ns) in self.ages.borrow_mut().drain(..) {
            self.region.edges()[edge].age.record(age_ns);
        }
    }
}
