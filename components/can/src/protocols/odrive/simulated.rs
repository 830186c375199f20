//! Simulated ODrive, which sends encoder estimates and torques at the configured rate, and a heartbeat every
//! 0.1 s.

use super::codec::{AxisState, ControlMode, Instruction, Node, Report};
use crate::frame::{Frame, Id};
use crate::protocols::entries::LoopEntry;
use crate::protocols::simulation::{Mark, Motor, Search, Simulated, Watchdog};
use crate::protocols::spec::DriveSetup;

/// Time between two heartbeats, ns.
const HEARTBEAT_NS: u64 = 100_000_000;
/// Speed of the search for the mark, rad/s.
const SEARCH_SPEED: f64 = 1.5;
/// Axis errors, as in the heartbeat.
const ESTOP_REQUESTED: u32 = 0x4000;
const WATCHDOG_EXPIRED: u32 = 0x800;
const ENDSTOP_PRESSED: u32 = 0x1000;
const MOTOR_TOO_HOT: u32 = 0x4_0000;

/// Drive that applies `kp (position - q) + kd (velocity - v) + torque`. `kp` is the product of position gain
/// and velocity gain; `kd` is the velocity gain.
#[derive(Clone, Debug)]
pub(crate) struct Odrive {
    node: Node,
    /// N m/A at the output shaft.
    torque_constant: f64,
    gains: LoopEntry,
    every_ns: u64,
    control: ControlMode,
    setpoint: [f64; 3],
    error: u32,
    is_enabled: bool,
    /// Running procedure, with its axis state.
    search: Option<(AxisState, Search)>,
    watchdog: Watchdog,
    next_report_ns: u64,
    next_heartbeat_ns: u64,
    motor: Motor,
    watchdog_trips: u64,
}

impl Odrive {
    pub(crate) fn new(setup: &DriveSetup<'_>, watchdog_ns: Option<u64>) -> Self {
        let entry = setup.entry;
        // nodes report with different phases
        let phase_ns = 37_000 * (1 + u64::from(entry.node));
        Self {
            node: Node::new(entry.node).unwrap_or(Node::FIRST),
            torque_constant: entry.torque_constant.unwrap_or(1.0),
            gains: setup.gains,
            every_ns: entry.report_every.map_or(10_000_000, |every| every.ns),
            control: ControlMode::Position,
            setpoint: [0.0; 3],
            error: 0,
            is_enabled: false,
            search: None,
            watchdog: Watchdog::new(watchdog_ns),
            next_report_ns: phase_ns,
            next_heartbeat_ns: phase_ns,
            motor: Motor::new(entry.ranges.torque),
            watchdog_trips: 0,
        }
    }

    fn fail(&mut self, error: u32) {
        self.error |= error;
        (self.is_enabled, self.search) = (false, None);
    }
}

impl Simulated for Odrive {
    fn ids(&self) -> Vec<Id> {
        // messages to the drive use the identifiers of its own reports
        (0..0x20).map(|command| self.node.id(command)).collect()
    }

    fn is_enabled(&self) -> bool {
        self.is_enabled
    }

    fn has_torque(&self) -> bool {
        self.is_enabled || self.search.is_some()
    }

    fn cut_power(&mut self) {
        (self.is_enabled, self.error, self.setpoint) = (false, 0, [0.0; 3]);
        (self.control, self.search) = (ControlMode::Position, None);
    }

    fn receive(&mut self, frame: &Frame, now_ns: u64, _answer: &mut dyn FnMut(Frame)) {
        let Ok(instruction) = self.node.instruction(frame) else { return };
        self.watchdog.fed_ns = now_ns;
        match instruction {
            Instruction::EmergencyStop => self.fail(ESTOP_REQUESTED),
            Instruction::ClearErrors => self.error = 0,
            Instruction::SetModes(control, _) => self.control = control,
            Instruction::SetState(AxisState::ClosedLoop) if self.error == 0 => {
                if !self.is_enabled {
                    // hold the current position
                    self.setpoint = [self.motor.position, 0.0, 0.0];
                }
                self.is_enabled = true;
            }
            Instruction::SetState(AxisState::ClosedLoop) => {}
            Instruction::SetState(AxisState::Homing) if self.motor.mark == Mark::Stuck => {
                self.fail(ENDSTOP_PRESSED);
            }
            Instruction::SetState(state @ (AxisState::Homing | AxisState::IndexSearch))
                if self.error == 0 =>
            {
                self.is_enabled = false;
                self.search = Some((state, Search::new(&self.motor, SEARCH_SPEED, now_ns)));
            }
            Instruction::SetState(_) => (self.is_enabled, self.search) = (false, None),
            Instruction::Position { position, velocity, torque } => {
                self.setpoint = [position, velocity, torque]
            }
            Instruction::Velocity { velocity, torque } => {
                (self.setpoint[1], self.setpoint[2]) = (velocity, torque);
            }
            Instruction::Limits { current, .. } => self.motor.limit(current * self.torque_constant),
            Instruction::Torque(torque) => self.setpoint[2] = torque,
        }
    }

    fn report(&mut self, now_ns: u64, send: &mut dyn FnMut(Frame, u64)) {
        while self.next_report_ns <= now_ns {
            let Motor { position, velocity, torque, .. } = self.motor;
            send(self.node.report_frame(&Report::Encoder { position, velocity }), self.next_report_ns);
            let torques = Report::Torques { target: self.setpoint[2], estimate: torque };
            send(self.node.report_frame(&torques), self.next_report_ns);
            self.next_report_ns += self.every_ns;
        }
        while self.next_heartbeat_ns <= now_ns {
            let state = match self.search {
                Some((state, _)) => state,
                None if self.is_enabled => AxisState::ClosedLoop,
                None => AxisState::Idle,
            };
            let result = u8::from(self.search.is_some());
            let heartbeat = Report::Heartbeat { error: self.error, state, result };
            send(self.node.report_frame(&heartbeat), self.next_heartbeat_ns);
            let motor = self.motor.temperature;
            let temperature = Report::Temperature { transistors: motor, motor };
            send(self.node.report_frame(&temperature), self.next_heartbeat_ns);
            self.next_heartbeat_ns += HEARTBEAT_NS;
        }
    }

    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        let has_torque = self.has_torque();
        if has_torque && self.watchdog.has_expired(now_ns) {
            self.fail(WATCHDOG_EXPIRED);
            self.watchdog_trips += 1;
        }
        if has_torque && self.motor.is_too_hot() {
            self.fail(MOTOR_TOO_HOT);
        }
        let [p, v, torque] = self.setpoint;
        let LoopEntry { kp, kd } = self.gains;
        if let Some((_, search)) = &mut self.search {
            let desired = search.step(&mut self.motor, now_ns).map(|desired| kd * (desired - velocity));
            if desired.is_none() {
                self.search = None;
            }
            return self.motor.apply(desired);
        }
        let desired = match self.control {
            ControlMode::Position => kp * (p - position) + kd * (v - velocity) + torque,
            ControlMode::Velocity => kd * (v - velocity) + torque,
            ControlMode::Torque => torque,
            // voltages are not simulated
            ControlMode::Voltage => 0.0,
        };
        self.motor.apply(self.is_enabled.then_some(desired))
    }

    fn corruption(&self) -> fn(&mut Frame) {
        |frame| {
            let is_heartbeat = matches!(frame.id, Id::Standard(id) if id & 0x1f == 0x01);
            match frame.data_mut() {
                [_, _, _, _, state, ..] if is_heartbeat => *state ^= 0x70,
                [_, _, c, d, ..] => (*c, *d) = (*c | 0x80, *d | 0x7f),
                [first, ..] => *first ^= 0x70,
                [] => {}
            }
        }
    }

    fn motor(&self) -> &Motor {
        &self.motor
    }

    fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    fn watchdog_trips(&self) -> u64 {
        self.watchdog_trips
    }
}
