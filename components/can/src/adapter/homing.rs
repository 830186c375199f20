//! The homing of joints whose position is not known when their power comes on.
//!
//! A drive with a procedure of its own is asked for it, and says zero at its mark. Any other joint is led slowly into its
//! mechanical stop by the adapter, with the effort that it may stand there with: it comes to rest, moves off the stop, and comes to
//! rest a second time at the same place. A joint that does not move off again is jammed, or its brake is closed; one that finds two
//! places has met something that gave way.

use super::dialogue::Order;
use super::{Adapter, Link, Phase, Setpoint};
use crate::table::{HomingBy, HomingEntry};

/// Time over which motion is judged, ns.
const WINDOW_NS: u64 = 200_000_000;
/// Windows in a row without motion after which it stands.
const STILL_WINDOWS: u32 = 2;
/// Share of the commanded velocity below which a joint does not move. One that is heavy gathers way faster than that.
const STILL: f64 = 0.03;
/// Multiple of the commanded velocity beyond which it runs away.
const RUNAWAY: f64 = 5.0;
/// Largest difference of the two places of a stop, as a share of the way between.
const REPEATS_WITHIN: f64 = 0.4;

/// The reason why a joint was not homed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HomingFault {
    /// Its time was over.
    #[error(
        "the mark was not found in time: does its switch work, is the way there free, is `timeout` long enough?"
    )]
    TimedOut,
    /// The drive reported that it failed.
    #[error("the drive says that homing failed: is its switch stuck, or its method that of another switch?")]
    Drive,
    /// The drive ended it before it was seen to begin.
    #[error("the drive ended it before it had begun: is homing set up in it?")]
    NotBegun,
    /// The drive let go meanwhile.
    #[error("the drive let go while it was homed")]
    LetGo,
    /// The joint did not move off its stop.
    #[error("it does not move off the stop again: is it jammed, or its brake closed?")]
    Jammed,
    /// The joint came to rest at two places.
    #[error("its stop lies at two places, {0:.4} apart: is something soft in its way?")]
    Ambiguous(f64),
    /// The joint moved much faster than it was commanded.
    #[error("it moves {0:.1} times as fast as it is commanded: does its load pull it?")]
    Runaway(f64),
}

/// The progress of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HomingState {
    /// Its position is not known.
    Waiting,
    /// It is being homed.
    Running,
    /// Its position is known.
    Homed,
    /// It was not homed.
    Failed(HomingFault),
}

/// The homing of one joint.
#[derive(Clone, Debug)]
pub(super) struct Homing {
    pub(super) order: u8,
    pub(super) state: HomingState,
    timeout_ns: u64,
    elapsed_ns: u64,
    /// By the adapter; `None` by the drive.
    pub(super) stop: Option<Stop>,
}

impl Homing {
    pub(super) fn of(entry: &HomingEntry) -> Self {
        Self {
            order: entry.order.unwrap_or(0),
            state: HomingState::Waiting,
            timeout_ns: entry.timeout().as_nanos() as u64,
            elapsed_ns: 0,
            stop: (entry.by == HomingBy::Stop).then(|| Stop::of(entry)),
        }
    }

    /// Begins it.
    pub(super) fn begin(&mut self) {
        (self.state, self.elapsed_ns) = (HomingState::Running, 0);
        if let Some(stop) = &mut self.stop {
            stop.begin();
        }
    }

    /// Forgets the position, if it was known or about to be.
    pub(super) fn forget(&mut self) {
        self.state = HomingState::Waiting;
    }

    /// Lets a cycle pass; true if its time is over.
    pub(super) fn pass(&mut self, cycle_ns: u64) -> bool {
        self.elapsed_ns += cycle_ns;
        self.elapsed_ns > self.timeout_ns
    }
}

/// The stage of a homing at a stop; positions are those of the joint but for its offset.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// To the stop.
    Approach,
    /// Away from it, from this position.
    BackOff(f64),
    /// To the stop again, which was found at this position.
    ApproachAgain(f64),
    /// Away from it for good.
    Leave(f64),
}

/// A homing at the mechanical stop of a joint.
#[derive(Clone, Debug)]
pub(super) struct Stop {
    velocity: f64,
    /// Velocity gain with which it stands against the stop with the effort that it may.
    kd: f64,
    /// Position of the joint at the stop.
    pub(super) position: f64,
    back_off: f64,
    stage: Stage,
    /// The drive follows commands.
    pub(super) is_enabled: bool,
    window_ns: u64,
    from: Option<f64>,
    still: u32,
}

/// The outcome of one cycle of a homing at a stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    /// It goes on.
    Moving,
    /// The stop was found at this position, and the joint has moved off it.
    Found(f64),
    /// It failed.
    Failed(HomingFault),
}

impl Stop {
    fn of(entry: &HomingEntry) -> Self {
        // the table has been checked
        let velocity = entry.velocity.unwrap_or(1.0);
        Self {
            velocity,
            kd: entry.effort.unwrap_or_default() / velocity.abs(),
            position: entry.position.unwrap_or_default(),
            back_off: entry.back_off(),
            stage: Stage::Approach,
            is_enabled: false,
            window_ns: 0,
            from: None,
            still: 0,
        }
    }

    fn begin(&mut self) {
        (self.stage, self.is_enabled) = (Stage::Approach, false);
        self.begin_window(None);
        self.still = 0;
    }

    fn begin_window(&mut self, from: Option<f64>) {
        (self.window_ns, self.from) = (0, from);
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.still) = (stage, 0);
        self.begin_window(None);
    }

    fn direction(&self) -> f64 {
        match self.stage {
            Stage::Approach | Stage::ApproachAgain(_) => self.velocity.signum(),
            Stage::BackOff(_) | Stage::Leave(_) => -self.velocity.signum(),
        }
    }

    /// The velocity to command to a joint that has this one, and the gain with which it is followed: with no more than its effort.
    pub(super) fn command(&self, measured: f64) -> (f64, f64) {
        let most = self.velocity.abs();
        ((self.direction() * most).clamp(measured - most, measured + most), self.kd)
    }

    /// A cycle that ends with the joint at this position.
    pub(super) fn step(&mut self, position: f64, cycle_ns: u64) -> Outcome {
        let forward = (position - self.from.unwrap_or(position)) * self.direction();
        if let Stage::BackOff(from) | Stage::Leave(from) = self.stage
            && (from - position) * self.velocity.signum() >= self.back_off
        {
            match self.stage {
                Stage::Leave(_) => return Outcome::Found(from),
                _ => self.enter(Stage::ApproachAgain(from)),
            }
            return Outcome::Moving;
        }
        if self.from.is_none() {
            self.begin_window(Some(position));
            return Outcome::Moving;
        }
        self.window_ns += cycle_ns;
        if self.window_ns < WINDOW_NS {
            return Outcome::Moving;
        }
        let commanded = self.velocity.abs() * self.window_ns as f64 * 1e-9;
        let share = forward / commanded;
        self.begin_window(Some(position));
        if share.abs() > RUNAWAY {
            return Outcome::Failed(HomingFault::Runaway(share.abs()));
        }
        self.still = if share.abs() < STILL { self.still + 1 } else { 0 };
        if self.still < STILL_WINDOWS {
            return Outcome::Moving;
        }
        match self.stage {
            Stage::Approach => self.enter(Stage::BackOff(position)),
            Stage::BackOff(_) | Stage::Leave(_) => return Outcome::Failed(HomingFault::Jammed),
            Stage::ApproachAgain(first) => {
                let apart = (position - first).abs();
                if apart > REPEATS_WITHIN * self.back_off {
                    return Outcome::Failed(HomingFault::Ambiguous(apart));
                }
                self.enter(Stage::Leave(position));
            }
        }
        Outcome::Moving
    }
}

impl Adapter {
    /// Lets homing go on, which it does by default, or stops it: joints under way let go, and begin anew when it may go on.
    pub fn allow_homing(&mut self, is_allowed: bool) {
        self.is_homing_allowed = is_allowed;
    }

    /// True if some joint has yet to be homed.
    pub fn awaits_homing(&self) -> bool {
        !self.links.iter().all(Link::is_homed)
    }

    /// Goes on with the homing of the joints by a cycle, those of the lowest order first.
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
        let is_ready = |link: &Link| match link.phase {
            Phase::Disabled => link.fresh && link.silent == 0,
            Phase::Enabled => true,
            Phase::Checking(_) | Phase::Homing | Phase::Enabling | Phase::Fault => false,
        };
        if self.tripped || !self.links.iter().all(is_ready) {
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
    /// True if its position is that of the joint: it needs no homing, or has been homed.
    pub fn is_homed(&self) -> bool {
        self.homing.as_ref().is_none_or(|homing| homing.state == HomingState::Homed)
    }

    /// The progress of its homing; `None` if it needs none.
    pub fn homing(&self) -> Option<HomingState> {
        self.homing.as_ref().map(|homing| homing.state)
    }

    /// Forgets where it stands: its position is that of the joint no more.
    pub(super) fn forget_homing(&mut self) {
        if let Some(homing) = &mut self.homing
            && !matches!(homing.state, HomingState::Failed(_))
        {
            homing.forget();
        }
    }

    /// Lets it go in the middle of its homing, which begins anew some day.
    fn interrupt_homing(&mut self) {
        if self.phase == Phase::Homing {
            self.end_homing(HomingState::Waiting);
        }
    }

    /// Ends its homing: it lets go.
    pub(super) fn end_homing(&mut self, state: HomingState) {
        if self.phase == Phase::Homing {
            (self.phase, self.fresh) = (Phase::Disabled, false);
        }
        if let Some(homing) = &mut self.homing {
            homing.state = state;
        }
    }

    /// The order of a cycle of its homing.
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

    /// Goes on with its homing by a cycle; the result once it is over.
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
            // whatever the offset is: a zero would do as well
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

    /// Holds the joint where it is, with the gains of the safe states, until it is commanded.
    pub(super) fn hold(&mut self) {
        let Self { position, stiffness: kp, damping: kd, .. } = *self;
        self.setpoint = Setpoint { position, kp, kd, ..Setpoint::default() };
    }
}
