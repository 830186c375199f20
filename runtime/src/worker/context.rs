//! What the ports and the loop of one component share.

use std::cell::{Cell, RefCell};
use std::rc::{Rc, Weak};
use std::sync::Arc;
use std::sync::atomic::Ordering::{Acquire, Relaxed};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64};

use iceoryx2::node::Node;

use crate::os::{current_core, monotonic_ns};
use crate::plan::{ClockKind, OnOverrun, Plan, TopicPlan};
use crate::region::{Command, ComponentBlock, Region};
use crate::transport::{AfterStep, Bell, PortError, Shared, open_bell};

/// So many ages of samples wait for the end of a step; further ones are recorded at once.
const AGES: usize = 32;
/// At every so manieth publication the core is looked up.
const CORE_LOOKED_UP: u32 = 64;

/// What the ports and the loop of one component share: whose they are, and what time it is.
#[derive(Debug)]
pub struct Context {
    region: Rc<Region>,
    index: usize,
    incarnation: u32,
    lockstep: bool,
    actuator: bool,
    hold_late_outputs: bool,
    settle_ns: u64,
    time_ns: Cell<u64>,
    deadline_ns: Cell<u64>,
    cause_ns: Cell<Option<u64>>,
    signals: Arc<Signals>,
    after_step: RefCell<Vec<Rc<dyn AfterStep>>>,
    /// Ages of samples to be recorded when the step is over, by edge, ns.
    ages: RefCell<Vec<(usize, u64)>>,
    /// When the step began, on the clock of stamps, ns.
    woken_ns: Cell<u64>,
    /// The core as it was seen last, and how often it was asked for.
    core: Cell<(usize, u32)>,
    /// The bells of the topics that its ports have joined, by topic.
    bells: RefCell<Vec<(String, Weak<Bell>)>>,
}

/// What the watcher thread tells the stepping thread.
#[derive(Debug, Default)]
pub(super) struct Signals {
    /// Set when this process was asked to end.
    pub(super) terminated: Arc<AtomicBool>,
    /// When the launcher was found dead, `CLOCK_MONOTONIC` ns; 0 while it lives.
    pub(super) orphaned_ns: AtomicU64,
    /// Raised by the watcher with every message.
    pub(super) raised: AtomicU32,
    /// The last message the stepping thread has seen.
    pub(super) seen: AtomicU32,
}

impl Context {
    pub(crate) fn new(plan: &Plan, index: usize, region: Rc<Region>) -> Self {
        let component = &plan.components[index];
        let incarnation = region.components()[index].restarts.load(Relaxed);
        Self {
            region,
            index,
            incarnation,
            lockstep: plan.clock == ClockKind::Lockstep,
            actuator: component.actuator,
            hold_late_outputs: component.on_overrun == OnOverrun::Hold,
            settle_ns: plan.safety.settle_ns,
            time_ns: Cell::new(0),
            deadline_ns: Cell::new(u64::MAX),
            cause_ns: Cell::new(None),
            signals: Arc::default(),
            after_step: RefCell::default(),
            ages: RefCell::new(Vec::with_capacity(AGES)),
            woken_ns: Cell::new(0),
            core: Cell::new((0, 0)),
            bells: RefCell::default(),
        }
    }

    #[inline]
    pub(crate) fn region(&self) -> &Region {
        &self.region
    }

    #[inline]
    pub(crate) fn block(&self) -> &ComponentBlock {
        &self.region.components()[self.index]
    }

    #[inline]
    pub(crate) fn index(&self) -> usize {
        self.index
    }

    #[inline]
    pub(crate) fn incarnation(&self) -> u32 {
        self.incarnation
    }

    #[inline]
    pub(crate) fn is_lockstep(&self) -> bool {
        self.lockstep
    }

    pub(super) fn signals(&self) -> &Arc<Signals> {
        &self.signals
    }

    /// Now on the clock of stamps: `CLOCK_MONOTONIC`, or simulated time in lockstep; ns.
    #[inline]
    pub(crate) fn now_ns(&self) -> u64 {
        if self.lockstep { self.time_ns.get() } else { monotonic_ns() }
    }

    /// When the run began, on the clock of stamps, ns.
    pub(crate) fn start_ns(&self) -> u64 {
        if self.lockstep { 0 } else { self.region.header().start_ns.load(Acquire) }
    }

    /// The core of this thread, looked up now and then: threads are pinned, or it matters little.
    #[inline]
    pub(crate) fn core(&self) -> usize {
        let (mut core, asked) = self.core.get();
        if asked.is_multiple_of(CORE_LOOKED_UP) {
            core = current_core();
        }
        self.core.set((core, asked.wrapping_add(1)));
        core
    }

    /// The bell of a topic, mapped once for all ports of the component.
    pub(crate) fn bell(&self, node: &Node<Shared>, topic: &TopicPlan) -> Result<Rc<Bell>, PortError> {
        let mut bells = self.bells.borrow_mut();
        let open = bells.iter().find(|(name, _)| *name == topic.name).and_then(|(_, bell)| bell.upgrade());
        if let Some(bell) = open {
            return Ok(bell);
        }
        let bell = Rc::new(open_bell(node, topic)?);
        bells.retain(|(name, _)| *name != topic.name);
        bells.push((topic.name.clone(), Rc::downgrade(&bell)));
        Ok(bell)
    }

    /// Takes in what an output has to do after every step.
    pub(crate) fn after_the_step(&self, duties: Rc<dyn AfterStep>) {
        self.after_step.borrow_mut().push(duties);
    }

    /// Records how old a sample is that was just looked at for the first time, as of the beginning of the step: after
    /// the step, which has better things to do. One published since then has no age yet.
    #[inline]
    pub(crate) fn note_age(&self, edge: usize, publish_ns: u64) {
        let age_ns = self.woken_ns.get().saturating_sub(publish_ns);
        let mut ages = self.ages.borrow_mut();
        if ages.len() < AGES {
            ages.push((edge, age_ns));
        } else {
            self.region.edges()[edge].age.record(age_ns);
        }
    }

    /// Wakes those whom a step has triggered on this core. They may run before this returns.
    pub(super) fn wake_triggered(&self) {
        self.after_step.borrow().iter().for_each(|output| output.wake());
    }

    /// Does what else is left to do after a step.
    pub(super) fn end_step(&self) {
        self.after_step.borrow().iter().for_each(|output| output.echo());
        for (edge, age_ns) in self.ages.borrow_mut().drain(..) {
            self.region.edges()[edge].age.record(age_ns);
        }
    }

    pub(super) fn begin(&self) {
        self.time_ns.set(self.start_ns());
    }

    /// Prepares a step: its time in lockstep, when it began, its deadline, and no cause yet.
    #[inline]
    pub(crate) fn enter_step(&self, time_ns: u64, woken_ns: u64, deadline_ns: u64) {
        self.time_ns.set(time_ns);
        self.woken_ns.set(if self.lockstep { time_ns } else { woken_ns });
        self.deadline_ns.set(deadline_ns);
        self.cause_ns.set(None);
    }

    /// Takes over the source time of the input that causes this step's outputs.
    #[inline]
    pub(crate) fn inherit(&self, source_ns: u64) {
        self.cause_ns.set(Some(source_ns));
    }

    #[inline]
    pub(crate) fn source_time_or(&self, now_ns: u64) -> u64 {
        self.cause_ns.get().unwrap_or(now_ns)
    }

    /// Whether a sample made now is too late to be published under the overrun policy `hold`.
    #[inline]
    pub(crate) fn withholds(&self, now_ns: u64) -> bool {
        self.hold_late_outputs && now_ns > self.deadline_ns.get()
    }

    /// Whether actuators must be in their safe state whatever the command says.
    pub(crate) fn is_stopping(&self) -> bool {
        self.signals.orphaned_ns.load(Relaxed) != 0 || self.signals.terminated.load(Relaxed)
    }

    /// Whether the loop is to end: the run stops, this process was asked to, or the launcher is gone (actuators
    /// then stay in their safe state for the settling time first).
    pub(crate) fn must_leave(&self) -> bool {
        self.signals.seen.store(self.signals.raised.load(Acquire), Relaxed);
        if self.region.header().command() == Command::Stop {
            return true;
        }
        let orphaned = self.signals.orphaned_ns.load(Relaxed);
        if orphaned != 0 {
            return !self.actuator || monotonic_ns() > orphaned + self.settle_ns;
        }
        self.signals.terminated.load(Relaxed)
    }
}
