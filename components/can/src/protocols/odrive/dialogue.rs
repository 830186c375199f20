//! Dialogue with ODrives: the adapter sends commands at its rate, and the drive sends encoder estimates and
//! heartbeats at its own rates.
//!
//! Only the heartbeat contains state and errors, so a drive counts as enabled only up to 0.1 s after it has
//! been enabled. Errors are cleared only when the adapter is resumed.

use super::codec::{AxisState, ControlMode as Quantity, InputMode, Instruction, Node, Report};
use crate::drive::{Command, Fault, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame, Id};
use crate::protocols::dialogue::{Dialogue, Motion, Order, Response};
use crate::protocols::entries::{ControlMode, HomingProcedure};
use crate::protocols::homing_fault::HomingFault;
use crate::protocols::spec::DriveSetup;

/// Number of cycles after which a request is repeated if the drive has not complied.
const REQUEST_AGAIN_AFTER: u16 = 1000;
/// Number of cycles for sending modes, limits and the first setpoint before the drive is enabled.
const ENABLED_IN: u16 = 3;
/// Duration of an error reset, cycles.
const CLEARS: u8 = 4;
/// Number of cycles for sending the limits before homing is requested.
const HOMES_IN: u16 = 2;
/// Number of heartbeats after which a procedure that was never observed running counts as not started.
const SEEN_WITHIN: u8 = 5;
/// Number of position reports after a homing until one is relative to the mark. The first report may have
/// been queued before the end of the homing.
const FROM_ITS_MARK: u8 = 2;
/// Maximum time between two heartbeats, ns: three periods at 10 Hz, plus half a period for bus delays.
const HEARTBEAT_WITHIN_NS: u64 = 350_000_000;
/// Axis error: the watchdog was not fed.
const WATCHDOG_EXPIRED: u32 = 0x800;

#[derive(Clone, Debug)]
pub(crate) struct Odrive {
    node: Node,
    mode: ControlMode,
    every_ns: u64,
    ranges: Ranges,
    /// Current limit, A; `None` keeps the limits stored in the drive.
    current_limit: Option<f64>,
    /// Number of cycles since the drive was ordered to enable.
    begun: u16,
    /// Remaining cycles of the error reset.
    clears: u8,
    state: State,
    motion: Motion,
    /// Reported torque, or the commanded one until a report arrives.
    torque: f64,
    reports_torque: bool,
    /// Higher of the reported temperatures, degrees Celsius, if the drive is configured to report them.
    temperature: Option<f64>,
    /// Axis state used for homing.
    homes: AxisState,
    homing: Homing,
}

/// Progress of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Homing {
    /// No homing is running.
    None,
    /// The limits have been sent for this number of cycles.
    Preparing(u16),
    /// Homing was requested `heartbeats` heartbeats ago; `was_seen` is `true` once the drive has reported
    /// that homing is running.
    Asked { heartbeats: u8, was_seen: bool },
    /// Homing has ended; `reports` counts the position reports since then.
    Ended { result: Result<(), HomingFault>, reports: u8 },
    /// Homing has ended, and the reported positions are relative to the mark.
    Over(Result<(), HomingFault>),
}

impl Odrive {
    pub(crate) fn new(setup: &DriveSetup<'_>) -> Self {
        let entry = setup.entry;
        Self {
            node: Node::new(entry.node).unwrap_or(Node::FIRST),
            mode: entry.mode.unwrap_or_default(),
            every_ns: entry.report_every.map_or(10_000_000, |every| every.ns),
            ranges: setup.ranges,
            current_limit: entry.current_limit,
            begun: 0,
            clears: 0,
            state: State::Disabled,
            motion: Motion::default(),
            torque: 0.0,
            reports_torque: false,
            temperature: None,
            homes: match entry.homing.as_ref().and_then(|homing| homing.procedure) {
                Some(HomingProcedure::Index) => AxisState::IndexSearch,
                Some(HomingProcedure::Endstop) | None => AxisState::Homing,
            },
            homing: Homing::None,
        }
    }

    /// Returns the message of a homing cycle. The limits are sent throughout: repeating them feeds the
    /// watchdog and has no other effect.
    fn home(&mut self) -> Instruction {
        let limits = Instruction::Limits {
            velocity: self.ranges.velocity.max,
            current: self.current_limit.unwrap_or_default(),
        };
        match &mut self.homing {
            Homing::Preparing(HOMES_IN) => {
                self.homing = Homing::Asked { heartbeats: 0, was_seen: false };
                Instruction::SetState(self.homes)
            }
            Homing::Preparing(cycles) => {
                *cycles += 1;
                limits
            }
            Homing::Asked { .. } => limits,
            Homing::None | Homing::Ended { .. } | Homing::Over(_) => Instruction::SetState(AxisState::Idle),
        }
    }

    /// Updates the homing from a heartbeat.
    fn follow_homing(&mut self, state: AxisState, result: u8) {
        let Homing::Asked { heartbeats, was_seen } = &mut self.homing else { return };
        *heartbeats = heartbeats.saturating_add(1);
        let over = match (state == self.homes, *was_seen) {
            (true, _) => {
                *was_seen = true;
                return;
            }
            // the axis returns to idle or to closed loop automatically
            (false, true) if result == 0 => Ok(()),
            (false, true) => Err(HomingFault::Drive),
            (false, false) if *heartbeats >= SEEN_WITHIN => Err(HomingFault::NotBegun),
            (false, false) => return,
        };
        self.homing = Homing::Ended { result: over, reports: 0 };
    }

    /// Counts a position report.
    fn count_report(&mut self) {
        if let Homing::Ended { result, reports } = &mut self.homing {
            *reports += 1;
            if *reports >= FROM_ITS_MARK {
                self.homing = Homing::Over(*result);
            }
        }
    }

    fn follow(&mut self, command: &Command) -> Instruction {
        let torque = match self.mode {
            ControlMode::Position | ControlMode::Velocity => {
                command.torque.clamp(self.ranges.torque.min, self.ranges.torque.max)
            }
            ControlMode::Torque => self.motion.torque(command, &self.ranges),
        };
        if !self.reports_torque {
            self.torque = torque;
        }
        match self.mode {
            ControlMode::Position | ControlMode::Velocity => {
                let position = self.motion.target(command);
                let velocity = if self.motion.held.is_some() { 0.0 } else { command.velocity };
                Instruction::Position { position, velocity, torque }
            }
            ControlMode::Torque => Instruction::Torque(torque),
        }
    }
}

impl Dialogue for Odrive {
    fn restart(&mut self) {
        self.forget();
        self.clears = CLEARS;
    }

    fn forget(&mut self) {
        (self.begun, self.state, self.homing) = (0, State::Disabled, Homing::None);
    }

    fn begin_homing(&mut self) {
        self.homing = Homing::Preparing(0);
    }

    fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        match self.homing {
            Homing::Over(result) => Some(result),
            _ => None,
        }
    }

    fn is_from(&self, frame: &Frame) -> bool {
        matches!((frame.id, self.node.id(0)), (Id::Standard(id), Id::Standard(base)) if id >> 5 == base >> 5)
    }

    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        let quantity = match self.mode {
            // the table refuses the velocity mode for ODrives
            ControlMode::Position | ControlMode::Velocity => Quantity::Position,
            ControlMode::Torque => Quantity::Torque,
        };
        self.motion.begin(order);
        let velocity = self.ranges.velocity.max;
        let instruction = match (order, self.begun) {
            (Order::Enable, 0) => Instruction::SetModes(quantity, InputMode::Passthrough),
            (Order::Enable, 1) => match self.current_limit {
                Some(current) => Instruction::Limits { velocity, current },
                None => self.follow(&Command::default()),
            },
            // before the drive is enabled, the current position is sent as setpoint, which also feeds the
            // watchdog
            (Order::Enable, ENABLED_IN) => {
                // reports from before the request do not count
                self.state = State::Disabled;
                Instruction::SetState(AxisState::ClosedLoop)
            }
            (Order::Enable, _) => self.follow(&Command::default()),
            (Order::Home, _) if self.clears == 0 => self.home(),
            (Order::Follow(command), _) => self.follow(command),
            (Order::Check(_) | Order::Disable | Order::Rest | Order::Home, _) if self.clears == CLEARS => {
                Instruction::ClearErrors
            }
            (Order::Check(_) | Order::Disable | Order::Rest | Order::Home, _) => {
                Instruction::SetState(AxisState::Idle)
            }
        };
        self.begun = match order {
            Order::Enable if self.begun < REQUEST_AGAIN_AFTER => self.begun + 1,
            _ => 0,
        };
        self.clears = self.clears.saturating_sub(1);
        frames.push(self.node.frame(&instruction));
    }

    fn accept(&mut self, feedback: &Feedback) {
        (self.motion.position, self.motion.velocity) = (feedback.position, feedback.velocity);
        self.count_report();
    }

    fn read(&mut self, _checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        Ok(match self.node.report(frame)? {
            Report::Heartbeat { error, state, result } => {
                if error == 0 {
                    self.follow_homing(state, result);
                }
                self.state = match (error, state) {
                    (0, AxisState::ClosedLoop) => State::Enabled,
                    (0, _) => State::Disabled,
                    // this state was reported before the errors were cleared
                    _ if self.clears > 0 => State::Disabled,
                    (error, _) if error & WATCHDOG_EXPIRED != 0 => State::Fault(Fault::CommunicationLost),
                    (error, _) => State::Fault(Fault::Other(error)),
                };
                Response::State(self.state)
            }
            Report::Encoder { position, velocity } => Response::Feedback(Feedback {
                position,
                velocity,
                torque: self.torque,
                temperature: self.temperature,
                voltage: None,
                state: self.state,
            }),
            Report::Torques { estimate, .. } => {
                (self.torque, self.reports_torque) = (estimate, true);
                Response::Other
            }
            Report::Temperature { transistors, motor } => {
                self.temperature = Some(transistors.max(motor));
                Response::Other
            }
            Report::Supply { .. } | Report::Currents { .. } => Response::Other,
        })
    }

    fn takes_gains(&self) -> bool {
        self.mode == ControlMode::Torque
    }

    fn reports_every_ns(&self) -> Option<u64> {
        Some(self.every_ns)
    }

    fn state_within_ns(&self) -> Option<u64> {
        Some(HEARTBEAT_WITHIN_NS)
    }

    fn shortest(&self) -> (Form, usize, usize) {
        (Form::Classic, 8, 8)
    }
}
