//! Pure logic of the adapter: cycles of commands and answers, without ports, clocks or processes.
//!
//! In each cycle, every drive receives one frame and answers with one frame. A drive is first checked (a
//! Damiao drive reports its ranges and its watchdog), then polled for its state while disabled. It is then
//! enabled together with all others, and follows commands. The adapter trips if a drive is silent for three
//! cycles, reports a fault or disables itself. From then on all drives are damped or disabled until
//! [`Adapter::resume`] is called.
//!
//! Answers carry no sequence number, and an answer that is exactly one cycle late looks like a timely one. A
//! drive that has missed a cycle and answers again therefore receives no frame for one cycle. If an answer
//! arrives in that cycle, the drive is a cycle behind and counts as lost. Otherwise, only one answer was
//! lost, and the drive continues.

mod answers;
mod common_answer;
mod counts;
mod enabling;
mod homing;
mod homing_sequence;
mod line;
mod link;
mod on_trip;
mod phase;
mod plausible;

use crate::bus::Received;
use crate::frame::{DecodeError, Frame};
use crate::protocols::dialogue::Dialogue as _;
pub use crate::protocols::homing_fault::HomingFault;
pub use crate::protocols::setting::WrongSetting;
use crate::table::Table;
pub use answers::LOST_AFTER;
use common_answer::CommonAnswer;
pub use counts::Counts;
pub use homing::HomingState;
pub(crate) use homing::{EASED, RUNAWAY, STILL};
pub use link::Link;
use motorium_drive::JointSetpoint;
pub use on_trip::OnTrip;
pub use phase::Phase;

/// Adapter that commands the drives of one robot.
#[derive(Clone, Debug)]
pub struct Adapter {
    links: Vec<Link>,
    /// Per bus; `None` where drives answer one by one.
    common: Vec<Option<CommonAnswer>>,
    on_trip: OnTrip,
    tripped: bool,
    /// `true` if no drive is ever enabled.
    is_observer: bool,
    is_homing_allowed: bool,
    cycle_ns: u64,
    cycles: u64,
    stray: u64,
    enabled_in: Option<u64>,
    wrong: Option<(usize, WrongSetting)>,
    /// Drive that was not enabled again because its joint was outside of its range.
    out_of_range: Option<(usize, WrongSetting)>,
}

impl Adapter {
    /// Creates an adapter for the drives of a table. `order` contains the table index of each joint's drive.
    /// `damping` is the velocity gain of each joint after a trip (N m s/rad or N s/m).
    pub fn new(table: &Table, order: &[usize], damping: &[f64], on_trip: OnTrip) -> Self {
        let links =
            order.iter().zip(damping).map(|(index, damping)| Link::new(table, *index, *damping)).collect();
        let common = table.buses.iter().map(|bus| bus.fast_read.then(CommonAnswer::default)).collect();
        Self {
            links,
            common,
            on_trip,
            tripped: false,
            is_observer: false,
            is_homing_allowed: true,
            cycle_ns: 1_000_000,
            cycles: 0,
            stray: 0,
            enabled_in: None,
            wrong: None,
            out_of_range: None,
        }
    }

    /// Turns the adapter into an observer: drives are checked and report their positions, but are never
    /// enabled.
    #[must_use]
    pub fn observer(mut self) -> Self {
        self.links.iter_mut().for_each(|link| link.is_observed = true);
        Self { is_observer: true, ..self }
    }

    /// Sets the position gain (N m/rad or N/m) that holds each joint between its homing and its first
    /// command. Default 0: the joint is damped.
    #[must_use]
    pub fn with_stiffness(mut self, stiffness: &[f64]) -> Self {
        self.links.iter_mut().zip(stiffness).for_each(|(link, stiffness)| link.stiffness = *stiffness);
        self
    }

    /// Returns the drives, in the order of the joints.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Returns the number of completed cycles.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Returns the first cycle in which all drives followed commands; `None` before that cycle.
    pub fn enabled_in(&self) -> Option<u64> {
        self.enabled_in
    }

    /// Returns the number of frames from devices that are not in the table.
    pub fn stray(&self) -> u64 {
        self.stray
    }

    /// Returns `true` from a trip until the adapter is resumed.
    pub fn has_tripped(&self) -> bool {
        self.tripped
    }

    /// Returns the first drive with a setting that differs from the table, and the setting.
    pub fn wrong_setting(&self) -> Option<(usize, WrongSetting)> {
        self.wrong
    }

    /// Trips the adapter for an external reason, such as the controller leaving a bus.
    pub fn trip(&mut self) {
        self.tripped |= !self.is_observer;
    }

    /// Processes a frame received on a bus.
    pub fn take(&mut self, bus: usize, received: &Received) {
        let Received { frame, time_ns } = received;
        if CommonAnswer::is_part(frame)
            && let Some(common) = &mut self.common[bus]
        {
            common.push(frame);
            while let Some(next) = self.common[bus].as_mut().and_then(CommonAnswer::next) {
                match next {
                    Ok(frame) => self.take_one(bus, &Received { frame, time_ns: *time_ns }),
                    Err(_) => self.stray += 1,
                }
            }
            return;
        }
        self.take_one(bus, received);
    }

    /// Processes a frame of one drive.
    fn take_one(&mut self, bus: usize, received: &Received) {
        let Received { frame, time_ns } = received;
        let mut refused = None;
        for (index, link) in self.links.iter_mut().enumerate() {
            if link.bus != bus || !link.dialogue.is_from(frame) {
                continue;
            }
            match link.take(frame, *time_ns) {
                Ok(taken) => {
                    self.tripped |= taken.trips && !self.is_observer;
                    if taken.has_restarted && !self.tripped {
                        link.begin_anew();
                    }
                    if let Some(wrong) = taken.wrong {
                        self.wrong.get_or_insert((index, wrong));
                    }
                    return;
                }
                Err(DecodeError::Device { .. }) => {}
                Err(_) => refused = Some(index),
            }
        }
        match refused {
            Some(index) => self.links[index].counts.refused += 1,
            None => self.stray += 1,
        }
    }

    /// Ends the cycle. Queried drives without an answer count as missing. Pass `false` for `counts` in cycles
    /// in which the drives could not answer.
    pub fn end_cycle(&mut self, counts: bool) {
        self.cycles += 1;
        for link in &mut self.links {
            let is_missing = link.answers.asked && !link.has_answered() && counts;
            // while some servos of a line are being checked, servos are queried in turn
            let is_due = link.dialogue.member().is_none();
            link.answers.count(is_missing, is_due, &mut link.counts);
            if is_missing
                && link.answers.silent == LOST_AFTER
                && matches!(link.phase, Phase::Homing | Phase::Enabled | Phase::Enabling)
            {
                link.lose(self.cycles);
                self.tripped = true;
            }
            if link.answers.is_lost() {
                link.forget_homing();
                // after a trip the operator decides, and all drives are checked again
                if !self.tripped {
                    link.begin_anew();
                }
            }
            link.answers.end_cycle();
        }
        self.advance_homing();
        let ready = |link: &Link| match link.phase {
            Phase::Disabled => link.fresh && link.answers.is_present() && link.is_homed(),
            Phase::Enabling | Phase::Enabled => link.is_homed(),
            Phase::Checking(_) | Phase::Homing | Phase::Fault => false,
        };
        let is_ready = !self.is_observer && self.links.iter().all(ready);
        if is_ready && !self.tripped && !self.refuse_out_of_range() {
            for link in self.links.iter_mut().filter(|link| link.phase == Phase::Disabled) {
                link.phase = Phase::Enabling;
            }
        }
        if self.enabled_in.is_none() && self.links.iter().all(|link| link.phase == Phase::Enabled) {
            self.enabled_in = Some(self.cycles);
        }
    }

    /// Returns `true` if all drives queried in this cycle have answered.
    pub fn has_all_answers(&self) -> bool {
        !self.links.iter().any(|link| link.answers.is_awaited())
    }

    /// Accepts answers on this bus at any time after their commands. Required for buses without bit times.
    pub fn without_bit_times(&mut self, bus: usize) {
        for link in self.links.iter_mut().filter(|link| link.bus == bus) {
            link.answers.soonest_ns = 0;
        }
    }

    /// Sets the length of a cycle, used for the interpolation in some drives and for the homing timeouts.
    /// Default 1 ms.
    pub fn set_cycle(&mut self, cycle_ns: u64) {
        self.cycle_ns = cycle_ns;
        for link in &mut self.links {
            link.dialogue.set_cycle(cycle_ns);
        }
    }

    /// Returns `true` if every joint's position is known and no drive is lost.
    pub fn is_complete(&self) -> bool {
        self.is_known() && self.links.iter().all(|link| !link.answers.is_lost())
    }

    /// Returns `true` if every joint's position is known: its drive has answered, and its homing, if any, is
    /// complete.
    pub fn is_known(&self) -> bool {
        self.links.iter().all(|link| link.reading.received_ns.is_some() && link.is_homed())
    }

    /// Returns the receive time of the oldest joint state, ns; `None` if a joint has no state yet.
    pub fn oldest_ns(&self) -> Option<u64> {
        self.links.iter().map(Link::received_ns).min().flatten()
    }

    /// Sets the command of a joint.
    pub fn set(&mut self, joint: usize, setpoint: JointSetpoint) {
        self.links[joint].setpoint = setpoint;
    }

    /// Appends the frames of this cycle for one bus to `frames`. The caller reports the number of accepted
    /// frames to [`sent`](Self::sent).
    pub fn write(&mut self, bus: usize, frames: &mut Vec<Frame>) {
        for link in self.links.iter_mut().filter(|link| link.bus == bus) {
            if link.answers.end_probe(&mut link.counts) {
                link.lose(self.cycles);
                self.tripped = true;
            }
        }
        let trip = self.tripped.then_some(self.on_trip);
        if self.tripped {
            self.links.iter_mut().for_each(|link| link.let_go(self.on_trip));
        } else {
            for link in self.links.iter_mut().filter(|link| link.bus == bus) {
                link.answers.probe(link.phase == Phase::Enabled);
            }
        }
        let (mut is_line, mut synchronised) = (false, None);
        let (before, cycle) = (frames.len(), self.cycles);
        for (index, link) in self.links.iter_mut().enumerate().filter(|(_, link)| link.bus == bus) {
            link.answers.asked_by = None;
            if link.answers.is_probed {
                continue;
            }
            let order = link.order(trip);
            link.count_clamped(&order);
            is_line |= link.dialogue.member().is_some();
            let waits = link.dialogue.is_synchronised(&order);
            if waits {
                synchronised = Some(index);
            }
            link.dialogue.write(&order, frames);
            link.answers.asked_by = Some(if waits { usize::MAX } else { frames.len() - before });
        }
        if is_line {
            let common = self.common[bus].as_mut();
            line::write(&mut self.links, common, bus, (trip, cycle), frames);
        }
        if let Some(index) = synchronised {
            self.links[index].dialogue.synchronise(frames);
            let whole = frames.len() - before;
            for link in self.links.iter_mut().filter(|link| link.bus == bus) {
                link.answers.asked_by = link.answers.asked_by.map(|by| by.min(whole));
            }
        }
    }

    /// Records that the first `count` frames of a bus were sent at `now_ns`. Answers that arrive between two
    /// cycles are late.
    pub fn sent(&mut self, bus: usize, count: usize, now_ns: u64) {
        for link in self.links.iter_mut().filter(|link| link.bus == bus) {
            link.answers.sent(count, now_ns, &mut link.counts);
        }
    }

    /// Resumes operation after a trip: lost or disabled drives are checked and enabled again.
    pub fn resume(&mut self) {
        (self.tripped, self.out_of_range) = (false, None);
        for link in &mut self.links {
            // a drive that does not report its state may have disabled itself in the meantime
            let is_well = link.phase == Phase::Enabled
                && link.is_homed()
                && link.answers.is_present()
                && link.dialogue.reports_state()
                && self.on_trip == OnTrip::Damp;
            if is_well {
                // hold the current position, not the one from before the joint was damped
                link.hold();
            } else {
                link.dialogue.restart();
                link.start();
            }
        }
    }
}
