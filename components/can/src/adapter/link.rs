//! One drive from the adapter's point of view.

mod homing;

use super::answers::Answers;
use super::homing::{Homing, HomingState};
use super::phase::{Change, Facts, Report, decide};
use super::{Counts, OnTrip, Phase, WrongSetting};
use crate::bus::bits::{Bits, Rates};
use crate::drive::{Command, Fault, Ranges, State};
use crate::frame::{DecodeError, Frame};
use crate::protocols::AnyDialogue;
use crate::protocols::dialogue::{Dialogue, Order, Response};
use crate::table::{Table, Transmission};
use motorium_drive::JointSetpoint;

/// State of one drive in the adapter: phase, newest reading, homing and counters.
#[derive(Clone, Debug)]
pub struct Link {
    pub(super) dialogue: AnyDialogue,
    pub(super) ranges: Ranges,
    pub(super) gear: Transmission,
    pub(super) bus: usize,
    pub(super) phase: Phase,
    /// Damping of the joint after the adapter has tripped.
    pub(super) damping: f64,
    /// Position gain of the joint while it is held before its first command.
    pub(super) stiffness: f64,
    pub(super) homing: Option<Homing>,
    pub(super) setpoint: JointSetpoint,
    /// Lowest and highest position of the joint, and the margin beyond them within which the drive is still
    /// enabled.
    pub(super) limits: ([f64; 2], f64),
    /// Receive time, ns, of the newest heartbeat, or of the newest state message of a drive whose answers
    /// lack the state.
    pub(super) state_ns: Option<u64>,
    /// `true` if the newest answer reports that the drive is off.
    pub(super) is_off: bool,
    /// `true` if the drive is disabled for the rest of the run.
    pub(super) is_released: bool,
    /// `true` if the drive is only observed, never enabled.
    pub(super) is_observed: bool,
    pub(super) answers: Answers,
    /// `true` if the drive has answered in its current phase.
    pub(super) fresh: bool,
    pub(super) reading: Reading,
    pub(super) fault: Option<Fault>,
    pub(super) counts: Counts,
}

/// Newest reading of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reading {
    pub(super) received_ns: Option<u64>,
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
    pub(super) temperature: Option<f64>,
}

impl Link {
    /// Creates the link to drive `index` of a table. `damping` applies to its joint after the adapter has
    /// tripped.
    pub(super) fn new(table: &Table, index: usize, damping: f64) -> Self {
        let (dialogue, entry) = (AnyDialogue::new(&table.setup(index)), &table.drives[index]);
        let bus = table.bus_of(entry).unwrap_or(0);
        let mut link = Self {
            ranges: table.ranges(index),
            gear: table.transmission(index),
            bus,
            phase: Phase::Disabled,
            damping,
            stiffness: 0.0,
            homing: entry.homing.as_ref().filter(|_| entry.is_homed()).map(Homing::from_entry),
            setpoint: JointSetpoint::default(),
            limits: ([f64::NEG_INFINITY, f64::INFINITY], 0.0),
            state_ns: None,
            is_off: false,
            is_released: false,
            is_observed: false,
            answers: Answers::new(
                dialogue.reports_every_ns().is_some(),
                soonest(&dialogue, &table.rates(bus)),
            ),
            fresh: false,
            reading: Reading::default(),
            fault: None,
            counts: Counts::default(),
            dialogue,
        };
        link.start();
        link
    }

    /// Returns the index of the drive's bus.
    pub fn bus(&self) -> usize {
        self.bus
    }

    /// Returns the phase of the drive.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns the joint position (rad or m), velocity (rad/s or m/s) and effort (N m or N) of the newest
    /// answer.
    pub fn state(&self) -> (f64, f64, f64) {
        (self.reading.position, self.reading.velocity, self.reading.effort)
    }

    /// Returns the temperature in degrees Celsius; `None` if the drive does not report it.
    pub fn temperature(&self) -> Option<f64> {
        self.reading.temperature
    }

    /// Returns the newest fault reported by the drive; `None` without a fault.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Returns `true` once the drive has answered.
    pub fn is_found(&self) -> bool {
        self.answers.is_found
    }

    /// Returns the number of cycles since the newest answer.
    pub fn silent(&self) -> u32 {
        self.answers.silent
    }

    /// Returns the receive time of the newest state, ns; `None` before the first one.
    pub fn received_ns(&self) -> Option<u64> {
        self.reading.received_ns
    }

    /// Returns the counters of the drive.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Enters the first phase: drives with readable settings are checked.
    pub(super) fn start(&mut self) {
        self.phase = if self.dialogue.checks() > 0 { Phase::Checking(0) } else { Phase::Disabled };
        (self.fresh, self.fault) = (false, None);
        // a drive that does not report its state may have lost power in the meantime
        if let Some(homing) = &mut self.homing
            && !(homing.state == HomingState::Homed && self.dialogue.reports_state())
        {
            homing.forget();
        }
        self.answers.forget();
    }

    /// Restarts with a disabled drive that may have lost its configuration, so its settings are checked
    /// again.
    pub(super) fn begin_anew(&mut self) {
        if matches!(self.phase, Phase::Disabled | Phase::Checking(_)) {
            self.dialogue.forget();
            self.start();
            // its last position does not determine its current one
            self.reading.received_ns = None;
        }
    }

    /// Processes a frame from the drive, received at `time_ns`.
    ///
    /// # Errors
    /// Returns an error if the frame cannot be decoded.
    pub(super) fn take(&mut self, frame: &Frame, time_ns: u64) -> Result<Taken, DecodeError> {
        let checking = match self.phase {
            Phase::Checking(setting) => Some(setting),
            _ => None,
        };
        let response = self.dialogue.read(checking, frame)?;
        self.answers.is_found |= matches!(response, Response::Setting(_) | Response::Feedback(_));
        Ok(match response {
            Response::Setting(wrong) => {
                self.answers.settle();
                if let (None, Some(setting)) = (wrong, checking) {
                    let next = setting + 1;
                    let is_last = next >= self.dialogue.checks();
                    self.phase = if is_last { Phase::Disabled } else { Phase::Checking(next) };
                }
                Taken { wrong, ..Taken::default() }
            }
            Response::Waiting => {
                self.answers.settle();
                Taken::default()
            }
            Response::State(state) => {
                self.state_ns = Some(time_ns);
                self.is_off = state != State::Enabled;
                Taken { trips: self.follow(Report::State(state)), ..Taken::default() }
            }
            Response::Alive => {
                self.state_ns = Some(time_ns);
                Taken::default()
            }
            Response::Emergency { fault, is_present } => {
                self.counts.emergencies += 1;
                self.fault = Some(fault);
                let has_torque = matches!(self.phase, Phase::Homing | Phase::Enabling | Phase::Enabled);
                Taken { trips: is_present && has_torque, ..Taken::default() }
            }
            Response::Restarted => {
                self.forget_homing();
                Taken { trips: self.follow(Report::Restarted), has_restarted: true, wrong: None }
            }
            Response::Other => Taken::default(),
            Response::Feedback(feedback) => {
                self.refuse_implausible(&feedback, time_ns)?;
                if !self.answers.sort(time_ns, &mut self.counts) {
                    return Ok(Taken::default());
                }
                self.dialogue.accept(&feedback);
                self.fresh = true;
                self.state_ns.get_or_insert(time_ns);
                self.is_off = feedback.state != State::Enabled;
                self.reading = Reading {
                    received_ns: Some(time_ns),
                    position: self.gear.to_joint(feedback.position),
                    velocity: feedback.velocity / self.gear.ratio,
                    effort: feedback.torque * self.gear.ratio,
                    temperature: feedback.temperature,
                };
                Taken { trips: self.follow(Report::State(feedback.state)), ..Taken::default() }
            }
        })
    }

    /// Records that the drive was lost in this cycle.
    pub(super) fn lose(&mut self, cycle: u64) {
        self.counts.lost += 1;
        self.counts.lost_in = Some(cycle);
    }

    /// Returns the order of this cycle.
    pub(super) fn order(&self, trip: Option<OnTrip>) -> Order {
        if self.is_released {
            return Order::Disable;
        }
        match (trip, self.phase) {
            (Some(OnTrip::Disable), _) => Order::Disable,
            (Some(OnTrip::Damp), Phase::Fault) => Order::Rest,
            (Some(OnTrip::Damp), Phase::Enabled) => {
                self.command(JointSetpoint { kd: self.damping, ..JointSetpoint::default() })
            }
            (_, Phase::Checking(setting)) => Order::Check(setting),
            (_, Phase::Disabled | Phase::Fault) | (Some(_), Phase::Enabling | Phase::Homing) => {
                Order::Disable
            }
            (None, Phase::Homing) => self.homing_order(),
            (None, Phase::Enabling) => Order::Enable,
            (None, Phase::Enabled) => self.command(self.setpoint),
        }
    }

    pub(super) fn command(&self, setpoint: JointSetpoint) -> Order {
        let (ratio, square) = (self.gear.ratio, self.gear.ratio * self.gear.ratio);
        Order::Follow(Command {
            position: self.gear.to_drive(setpoint.position),
            velocity: setpoint.velocity * ratio,
            kp: setpoint.kp / square,
            kd: setpoint.kd / square,
            torque: setpoint.effort / ratio,
        })
    }

    /// Counts a command with a field beyond its range.
    pub(super) fn count_clamped(&mut self, order: &Order) {
        let Order::Follow(command) = order else { return };
        let r = &self.ranges;
        let beyond = |x: f64, range: &crate::Range| x < range.min || x > range.max;
        let holds = command.kp > 0.0 && beyond(command.position, &r.position);
        let is_clamped = holds
            || self.dialogue.takes_gains()
                && (command.kd > 0.0 && beyond(command.velocity, &r.velocity)
                    || beyond(command.kp, &r.kp)
                    || beyond(command.kd, &r.kd)
                    || beyond(command.torque, &r.torque));
        self.counts.clamped += u64::from(is_clamped);
    }

    /// Returns `true` while the adapter moves the joint to its stop.
    fn is_led(&self) -> bool {
        self.homing.as_ref().and_then(|homing| homing.stop.as_ref()).is_some_and(|stop| stop.is_enabled)
    }

    /// Follows a report of the drive. Returns `true` if it trips the adapter.
    fn follow(&mut self, report: Report) -> bool {
        let (is_observed, is_released) = (self.is_observed, self.is_released);
        let facts = Facts { is_observed, is_released, is_led: self.is_led() };
        match decide(self.phase, report, facts) {
            Change::Keep => {}
            Change::Follow => self.phase = Phase::Enabled,
            Change::Lead => {
                if let Some(stop) = self.homing.as_mut().and_then(|homing| homing.stop.as_mut()) {
                    stop.is_enabled = true;
                }
            }
            Change::Recover => self.phase = Phase::Disabled,
            Change::Fail { homing, is_new } => {
                self.forget_homing();
                if self.phase == Phase::Homing {
                    self.end_homing(HomingState::Failed(homing));
                }
                self.phase = Phase::Fault;
                if let Report::State(State::Fault(fault)) = report {
                    self.fault = Some(fault);
                }
                self.counts.faults += u64::from(is_new);
                return is_new;
            }
        }
        false
    }

    /// Returns `true` if the answer of this cycle has arrived or, for a drive that reports unsolicited, if no
    /// report is overdue. A drive with an overdue heartbeat counts as missing, whatever else it sends.
    pub(super) fn has_answered(&self) -> bool {
        let has_reported = match (self.dialogue.reports_every_ns(), self.reading.received_ns) {
            (None, _) => self.answers.answered,
            (Some(_), None) => false,
            (Some(every_ns), Some(received_ns)) => received_ns + every_ns >= self.answers.sent_ns,
        };
        has_reported && !self.is_state_overdue()
    }
}

/// Consequences of a received frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taken {
    /// `true` if the adapter trips.
    pub(super) trips: bool,
    /// `true` if the drive has restarted and lost its configuration.
    pub(super) has_restarted: bool,
    /// Setting that differs from the table.
    pub(super) wrong: Option<WrongSetting>,
}

/// Returns the shortest time from sending a command to the end of its answer, ns.
fn soonest(dialogue: &AnyDialogue, rates: &Rates) -> u64 {
    let (form, command, answer) = dialogue.shortest();
    let bits = |bytes| Bits::nominal(false, form, bytes).ns(rates);
    let pause_ns = Bits { nominal: 3, fast: 0 }.ns(rates);
    (bits(command) + bits(answer)).saturating_sub(pause_ns)
}
