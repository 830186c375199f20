//! Homing of joints whose position is unknown after power-up.
//!
//! A drive with its own homing procedure executes it, and reads zero at its mark. The adapter moves any other
//! joint slowly against its mechanical stop.

mod stop;

use super::dialogue::Order;
use super::{Adapter, Link, OnTrip, Phase, Setpoint};
use crate::table::{HomingBy, HomingEntry};
pub(crate) use stop::{EASED, RUNAWAY, STILL};
use stop::{Outcome, Stop};

/// Reason why a joint was not homed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HomingFault {
    /// The timeout expired.
    #[error(
        "the mark was not found in time: does its switch work, is the way there free, is `timeout` long enough?"
    )]
    TimedOut,
    /// The drive reported a failure.
    #[error("the drive reports that homing failed: is its switch stuck, or its method wrong?")]
    Drive,
    /// The drive ended the homing before it was seen running.
    #[error("the drive reported the end of homing before its start: is homing configured in the drive?")]
    NotBegun,
    /// The drive disabled itself during the homing.
    #[error("the drive disabled itself during homing")]
    LetGo,
    /// The drive refused a homing object.
    #[error("the drive refuses an object of its homing: code 0x{0:08X}")]
    Refused(u32),
    /// The joint did not move off its stop.
    #[error("it does not move off the stop again: is it jammed, or its brake closed?")]
    Jammed,
    /// The joint came to rest at two different positions.
    #[error("its stop lies at two places, {0:.4} apart: is something soft in its way?")]
    Ambiguous(f64),
    /// The joint moved back when it was held at the stop with half of its effort.
    #[error(
        "with half of `effort` it does not stay where it came to rest: was it no stop, but its weight that stopped it?"
    )]
    Balanced,
    /// The joint moved much faster than commanded.
    #[error("it moves {0:.1} times as fast as it is commanded: does its load pull it?")]
    Runaway(f64),
}

/// Progress of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingState {
    /// The position is unknown.
    Waiting,
    /// Homing is running.
    Running,
    /// The position is known.
    Homed,
    /// Homing failed.
    Failed(HomingFault),
}

/// Homing of one joint.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    pub(super) order: u8,
    pub(super) state: HomingState,
    timeout_ns: u64,
    elapsed_ns: u64,
    /// Homing at a stop by the adapter; `None` for homing by the drive.
    pub(super) stop: Option<Stop>,
}

impl Homing {
    pub(super) fn from_entry(entry: &HomingEntry) -> Self {
        Self {
            order: entry.order.unwrap_or(0),
            state: HomingState::Waiting,
            timeout_ns: entry.timeout().as_nanos() as u64,
            elapsed_ns: 0,
            stop: (entry.by == HomingBy::Stop).then(|| Stop::from_entry(entry)),
        }
    }

    /// Starts the homing.
    pub(super) fn begin(&mut self) {
        (self.state, self.elapsed_ns) = (HomingState::Running, 0);
        if let Some(stop) = &mut self.stop {
            stop.begin();
        }
    }

    /// Discards the position, whether known or being determined.
    pub(super) fn forget(&mut self) {
        self.state = HomingState::Waiting;
    }

    /// Advances the time by a cycle. Returns `true` if the timeout has expired.
    pub(super) fn pass(&mut self, cycle_ns: u64) -> bool {
        self.elapsed_ns += cycle_ns;
        self.elapsed_ns > self.timeout_ns
    }
}

impl Adapter {
    /// Allows homing to continue (the default), or stops it. Stopping disables the joints in progress
    /// immediately, and their homing restarts when it is allowed again. Meanwhile, held joints follow
    /// [`set`](Self::set).
    pub fn allow_homing(&mut self, is_allowed: bool) {
        let was_allowed = core::mem::replace(&mut self.is_homing_allowed, is_allowed);
        if !is_allowed {
            self.links.iter_mut().for_each(Link::interrupt_homing);
        } else if !was_allowed && self.awaits_homing() {
            self.links.iter_mut().filter(|link| link.phase == Phase::Enabled).for_each(Link::hold);
        }
    }

    /// Returns `true` while homing is allowed.
    pub fn allows_homing(&self) -> bool {
        self.is_homing_allowed
    }

    /// Returns `true` if some joint still has to be homed.
    pub fn awaits_homing(&self) -> bool {
        !self.links.iter().all(Link::is_homed)
    }

    /// Advances the homing of the joints by a cycle, lowest order first.
    pub(super) fn advance_homing(&mut self) {
        if self.tripped || self.is_observer || !self.is_homing_allowed {
            self.links.iter_mut().for_each(Link::interrupt_homing);
            return;
        }
        for link in &mut self.links {
            if let Some(Err(fault)) = link.advance_homing(self.cycle_ns) {
                link.end_homing(HomingState::Failed(fault));
                self.tripped = true;
            }
        }
        if self.tripped {
            // these joints are disabled because of another one
            self.links.iter_mut().for_each(Link::interrupt_homing);
            return;
        }
        let is_ready = |link: &Link| match link.phase {
            Phase::Disabled => link.fresh && link.silent == 0,
            Phase::Enabled => true,
            Phase::Checking(_) | Phase::Homing | Phase::Enabling | Phase::Fault => false,
        };
        if !self.links.iter().all(is_ready) {
            return;
        }
        let homings = self.links.iter().filter_map(|link| link.homing.as_ref());
        let waiting = homings.filter(|homing| homing.state == HomingState::Waiting);
        let first = waiting.map(|homing| homing.order).min();
        for link in &mut self.links {
            if let Some(homing) = &mut link.homing
                && homing.state == HomingState::Waiting
                && Some(homing.order) == first
            {
                homing.begin();
                link.dialogue.begin_homing();
                link.phase = Phase::Homing;
            }
        }
    }
}

impl Link {
    /// Returns `true` if the drive's reading is the joint's position: it needs no homing, or has been homed.
    pub fn is_homed(&self) -> bool {
        self.homing.as_ref().is_none_or(|homing| homing.state == HomingState::Homed)
    }

    /// Progress of the homing; `None` if the joint needs none.
    pub fn homing(&self) -> Option<HomingState> {
        self.homing.as_ref().map(|homing| homing.state)
    }

    /// Discards the homing: the drive's reading is no longer the joint's position.
    pub(super) fn forget_homing(&mut self) {
        if let Some(homing) = &mut self.homing
            && !matches!(homing.state, HomingState::Failed(_))
        {
            homing.forget();
        }
    }

    /// Disables the drive in the middle of its homing, which restarts later.
    fn interrupt_homing(&mut self) {
        if self.phase == Phase::Homing {
            self.end_homing(HomingState::Waiting);
        }
    }

    /// Records that a trip disables the drive, if it does: the drive has not disabled itself, and its homing
    /// stays valid.
    pub(super) fn let_go(&mut self, on_trip: OnTrip) {
        self.interrupt_homing();
        let lets_go = self.phase == Phase::Enabled && on_trip == OnTrip::Disable;
        if lets_go || self.phase == Phase::Enabling {
            (self.phase, self.fresh) = (Phase::Disabled, false);
        }
    }

    /// Ends the homing and disables the drive.
    pub(super) fn end_homing(&mut self, state: HomingState) {
        if self.phase == Phase::Homing {
            (self.phase, self.fresh) = (Phase::Disabled, false);
        }
        if let Some(homing) = &mut self.homing {
            homing.state = state;
        }
    }

    /// Order of a homing cycle.
    pub(super) fn homing_order(&self) -> Order {
        match self.homing.as_ref().map(|homing| &homing.stop) {
            Some(Some(stop)) if stop.is_enabled => {
                let (velocity, kd) = stop.command(self.velocity);
                self.command(Setpoint { velocity, kd, ..Setpoint::default() })
            }
            Some(Some(_)) => Order::Enable,
            _ => Order::Home,
        }
    }

    /// Advances the homing by a cycle. Returns the result once it has finished.
    fn advance_homing(&mut self, cycle_ns: u64) -> Option<Result<(), HomingFault>> {
        let Self { homing: Some(homing), phase: Phase::Homing, dialogue, gear, .. } = self else {
            return None;
        };
        let Some(stop) = &mut homing.stop else {
            match dialogue.homing_result() {
                Some(Ok(())) => self.end_homing(HomingState::Homed),
                Some(Err(fault)) => return Some(Err(fault)),
                None if homing.pass(cycle_ns) => return Some(Err(HomingFault::TimedOut)),
                None => {}
            }
            return None;
        };
        if stop.is_enabled && self.silent == 0 {
            // the offset cancels out: any constant would do
            match stop.step(self.position - gear.offset, cycle_ns) {
                Outcome::Moving => {}
                Outcome::Failed(fault) => return Some(Err(fault)),
                Outcome::Found(at) => {
                    let moved = stop.position - at - gear.offset;
                    gear.offset += moved;
                    self.position += moved;
                    homing.state = HomingState::Homed;
                    self.phase = Phase::Enabled;
                    self.hold();
                    return Some(Ok(()));
                }
            }
        }
        homing.pass(cycle_ns).then_some(Err(HomingFault::TimedOut))
    }

    /// Holds the joint at its position with the gains of the safe states until it is commanded.
    pub(super) fn hold(&mut self) {
        let Self { position, stiffness: kp, damping: kd, .. } = *self;
        self.setpoint = Setpoint { position, kp, kd, ..Setpoint::default() };
    }
}
