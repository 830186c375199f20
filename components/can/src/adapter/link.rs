//! One drive from the adapter's point of view.

mod homing;

use super::homing::{Homing, HomingState};
use super::{Counts, HomingFault, OnTrip, Phase, WrongSetting};
use crate::bus::bits::{Bits, Rates};
use crate::drive::{Command, Fault, Ranges, State};
use crate::frame::{DecodeError, Frame};
use crate::protocols::AnyDialogue;
use crate::protocols::dialogue::{Dialogue, Order, Response};
use crate::table::{Table, Transmission};
use motorium_drive::JointSetpoint;

/// One drive from the adapter's point of view.
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
    /// Lowest and highest position of the joint, and the distance beyond them at which the drive is still
    /// enabled.
    pub(super) limits: ([f64; 2], f64),
    /// Receive time, ns, of the newest heartbeat, or of the newest state message of a drive whose answers
    /// lack the state.
    pub(super) state_ns: Option<u64>,
    /// The newest answer reports that the drive is off.
    pub(super) is_off: bool,
    /// The drive is disabled for the rest of the run.
    pub(super) is_released: bool,
    /// The drive is only observed, never enabled.
    pub(super) is_observed: bool,
    /// Frames of its bus in this cycle after which it has been asked; `None` if it is not.
    pub(super) asked_by: Option<usize>,
    pub(super) asked: bool,
    pub(super) answered: bool,
    /// The drive has answered at least once.
    pub(super) is_found: bool,
    /// Unanswered frames of past cycles; their answers may still arrive.
    pub(super) owed: u32,
    /// The drive is left out of this cycle; any answer from it belongs to an earlier frame.
    pub(super) is_probed: bool,
    /// Every answer of the drive comes a cycle late.
    pub(super) is_behind: bool,
    pub(super) fresh: bool,
    pub(super) sent_ns: u64,
    /// Shortest time from sending a frame to the end of its answer, ns.
    pub(super) soonest_ns: u64,
    pub(super) received_ns: Option<u64>,
    pub(super) position: f64,
    pub(super) velocity: f64,
    pub(super) effort: f64,
    pub(super) temperature: Option<f64>,
    pub(super) fault: Option<Fault>,
    pub(super) silent: u32,
    pub(super) counts: Counts,
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
            asked_by: None,
            asked: false,
            answered: false,
            is_found: false,
            owed: 0,
            is_probed: false,
            is_behind: false,
            fresh: false,
            sent_ns: 0,
            soonest_ns: soonest(&dialogue, &table.rates(bus)),
            received_ns: None,
            position: 0.0,
            velocity: 0.0,
            effort: 0.0,
            temperature: None,
            fault: None,
            silent: 0,
            counts: Counts::default(),
            dialogue,
        };
        link.start();
        link
    }

    /// Index of the drive's bus.
    pub fn bus(&self) -> usize {
        self.bus
    }

    /// Phase of the drive.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Joint position (rad or m), velocity and effort of the newest answer.
    pub fn state(&self) -> (f64, f64, f64) {
        (self.position, self.velocity, self.effort)
    }

    /// Temperature, degrees Celsius, if the drive reports it.
    pub fn temperature(&self) -> Option<f64> {
        self.temperature
    }

    /// Fault that the drive reported last.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Returns `true` once the drive has answered.
    pub fn is_found(&self) -> bool {
        self.is_found
    }

    /// Number of cycles without an answer.
    pub fn silent(&self) -> u32 {
        self.silent
    }

    /// Time of the newest state, ns.
    pub fn received_ns(&self) -> Option<u64> {
        self.received_ns
    }

    /// Counters of the drive.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Sets the first phase: drives with readable settings are checked.
    pub(super) fn start(&mut self) {
        self.phase = if self.dialogue.checks() > 0 { Phase::Checking(0) } else { Phase::Disabled };
        (self.fresh, self.fault) = (false, None);
        // a drive that does not report its state may have lost its power meanwhile
        if let Some(homing) = &mut self.homing
            && !(homing.state == HomingState::Homed && self.dialogue.reports_state())
        {
            homing.forget();
        }
        (self.owed, self.is_probed, self.is_behind) = (0, false, false);
    }

    /// Restarts with a disabled drive that has lost its configuration, or may have: its settings are checked
    /// again.
    pub(super) fn begin_anew(&mut self) {
        if matches!(self.phase, Phase::Disabled | Phase::Checking(_)) {
            self.dialogue.forget();
            self.start();
            // its last position says nothing about its present one
            self.received_ns = None;
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
        self.is_found |= matches!(response, Response::Setting(_) | Response::Feedback(_));
        Ok(match response {
            Response::Setting(wrong) => {
                // the frame names its request, so no earlier answers are outstanding
                (self.answered, self.owed) = (true, 0);
                if let (None, Some(setting)) = (wrong, checking) {
                    let next = setting + 1;
                    let is_last = next >= self.dialogue.checks();
                    self.phase = if is_last { Phase::Disabled } else { Phase::Checking(next) };
                }
                Taken { wrong, ..Taken::default() }
            }
            Response::Waiting => {
                (self.answered, self.owed) = (true, 0);
                Taken::default()
            }
            Response::State(state) => {
                self.state_ns = Some(time_ns);
                self.is_off = state != State::Enabled;
                Taken { trips: self.follow(state), ..Taken::default() }
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
                Taken { trips: self.follow_restart(), has_restarted: true, wrong: None }
            }
            Response::Other => Taken::default(),
            Response::Feedback(feedback) => {
                self.refuse_implausible(&feedback, time_ns)?;
                if !self.sort(time_ns) {
                    return Ok(Taken::default());
                }
                self.dialogue.accept(&feedback);
                self.fresh = true;
                self.received_ns = Some(time_ns);
                self.state_ns.get_or_insert(time_ns);
                self.is_off = feedback.state != State::Enabled;
                self.position = self.gear.to_joint(feedback.position);
                self.velocity = feedback.velocity / self.gear.ratio;
                self.effort = feedback.torque * self.gear.ratio;
                self.temperature = feedback.temperature;
                Taken { trips: self.follow(feedback.state), ..Taken::default() }
            }
        })
    }

    /// Records that the drive was lost in this cycle.
    pub(super) fn lose(&mut self, cycle: u64) {
        self.counts.lost += 1;
        self.counts.lost_in = Some(cycle);
    }

    /// Order of this cycle.
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

    /// Records that the drive has restarted. Returns `true` if this trips the adapter: it does unless the
    /// drive is disabled.
    fn follow_restart(&mut self) -> bool {
        let lets_go = matches!(self.phase, Phase::Homing | Phase::Enabling | Phase::Enabled);
        if self.phase == Phase::Homing {
            self.end_homing(HomingState::Failed(HomingFault::LetGo));
        }
        if lets_go {
            self.phase = Phase::Fault;
            self.counts.faults += 1;
        }
        lets_go
    }

    /// Processes a reported state. Returns `true` if it trips the adapter.
    pub(super) fn follow(&mut self, state: State) -> bool {
        match (state, self.phase) {
            (State::Fault(fault), phase) => {
                let is_new = phase != Phase::Fault;
                self.forget_homing();
                if phase == Phase::Homing {
                    self.end_homing(HomingState::Failed(HomingFault::Drive));
                }
                (self.phase, self.fault) = (Phase::Fault, Some(fault));
                self.counts.faults += u64::from(is_new);
                is_new
            }
            // Nobody resumes an adapter that only listens.
            (State::Disabled | State::Enabled | State::Unknown, Phase::Fault) if self.is_observed => {
                self.phase = Phase::Disabled;
                false
            }
            (State::Enabled | State::Unknown, Phase::Enabling) => {
                self.phase = Phase::Enabled;
                false
            }
            (State::Enabled | State::Unknown, Phase::Homing) => {
                if let Some(stop) = self.homing.as_mut().and_then(|homing| homing.stop.as_mut()) {
                    stop.is_enabled = true;
                }
                false
            }
            (State::Disabled, Phase::Homing) if self.is_led() && !self.is_released => {
                self.end_homing(HomingState::Failed(HomingFault::LetGo));
                self.phase = Phase::Fault;
                self.counts.faults += 1;
                true
            }
            // The drive disabled itself: its power was cut, or its watchdog tripped unnoticed.
            (State::Disabled, Phase::Enabled) if !self.is_released => {
                self.forget_homing();
                self.phase = Phase::Fault;
                self.counts.faults += 1;
                true
            }
            _ => false,
        }
    }
}

/// Consequences of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Taken {
    /// The adapter trips.
    pub(super) trips: bool,
    /// The drive has restarted and lost its configuration.
    pub(super) has_restarted: bool,
    /// Setting that differs from the table.
    pub(super) wrong: Option<WrongSetting>,
}

/// Shortest time from sending a command to the end of its answer, ns.
fn soonest(dialogue: &AnyDialogue, rates: &Rates) -> u64 {
    let (form, command, answer) = dialogue.shortest();
    let bits = |bytes| Bits::nominal(false, form, bytes).ns(rates);
    let pause_ns = Bits { nominal: 3, fast: 0 }.ns(rates);
    (bits(command) + bits(answer)).saturating_sub(pause_ns)
}
