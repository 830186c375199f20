//! Simulated moteus drive.

use super::codec::{Command, Home, Instruction, Mode, Node, Resolution, State};
use crate::frame::{Frame, Id};
use crate::protocols::entries::LoopEntry;
use crate::protocols::simulation::{Motor, Simulated, Watchdog, Zero};
use crate::protocols::spec::DriveSetup;

/// Fault code of an overheated motor.
const OVER_TEMPERATURE: u8 = 38;

/// moteus with a position loop whose gains are scaled by commands, and a watchdog set by each command.
#[derive(Clone, Debug)]
pub(crate) struct Moteus {
    node: Node,
    gains: LoopEntry,
    /// Default watchdog time of the drive, for commands without one.
    own_watchdog_ns: Option<u64>,
    watchdog: Watchdog,
    mode: Mode,
    fault: u8,
    command: Command,
    /// Position held while commands do not specify one.
    held: Option<f64>,
    motor: Motor,
    watchdog_trips: u64,
}

impl Moteus {
    pub(crate) fn new(setup: &DriveSetup<'_>, watchdog_ns: Option<u64>) -> Self {
        Self {
            node: Node::new(setup.entry.node).unwrap_or(Node::FIRST),
            gains: setup.gains,
            own_watchdog_ns: watchdog_ns,
            watchdog: Watchdog::new(watchdog_ns),
            mode: Mode::Stopped,
            fault: 0,
            command: Command::default(),
            held: None,
            motor: Motor::new(setup.ranges.torque.max),
            watchdog_trips: 0,
        }
    }

    fn answer(&mut self, frame: &Frame, now_ns: u64) -> Option<Frame> {
        let is_latched = matches!(self.mode, Mode::Fault | Mode::Timeout);
        match self.node.instruction(frame).ok()? {
            Instruction::Stop => (self.mode, self.fault, self.held) = (Mode::Stopped, 0, None),
            Instruction::Position(command) if !is_latched => {
                self.mode = Mode::Position;
                self.held = command.position.is_nan().then(|| self.held.unwrap_or(self.motor.position));
                self.command = command;
                self.watchdog.fed_ns = now_ns;
                self.watchdog.after_ns = match (command.watchdog * 1e9) as u64 {
                    _ if command.watchdog.is_nan() => None,
                    0 => self.own_watchdog_ns,
                    named_ns => Some(named_ns),
                };
            }
            Instruction::Brake if !is_latched => self.mode = Mode::Brake,
            Instruction::Position(_) | Instruction::Brake | Instruction::Query => {}
        }
        let Motor { position, velocity, torque, temperature, .. } = self.motor;
        let (mode, fault) = (self.mode, self.fault);
        let home = if self.motor.zero == Zero::Absolute { Home::Output } else { Home::Relative };
        let state = State {
            mode,
            position,
            velocity,
            torque,
            voltage: 24.0,
            temperature,
            motor_temperature: Some(temperature),
            home: Some(home),
            fault,
        };
        Some(self.node.reply_frame(&state, Resolution::Int16))
    }
}

impl Simulated for Moteus {
    fn ids(&self) -> Vec<Id> {
        vec![self.node.id()]
    }

    fn is_enabled(&self) -> bool {
        self.mode == Mode::Position
    }

    fn cut_power(&mut self) {
        (self.mode, self.fault, self.held) = (Mode::Stopped, 0, None);
    }

    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        if self.is_enabled() && self.watchdog.has_expired(now_ns) {
            // the time-out stays latched until the drive is stopped
            self.mode = Mode::Timeout;
            self.watchdog_trips += 1;
        }
        if self.is_enabled() && self.motor.is_too_hot() {
            (self.mode, self.fault) = (Mode::Fault, OVER_TEMPERATURE);
        }
        let command = &self.command;
        let (kp, kd) = (self.gains.kp * command.kp_scale, self.gains.kd * command.kd_scale);
        let target = self.held.unwrap_or(command.position);
        let desired = kp * (target - position) + kd * (command.velocity - velocity) + command.torque;
        let limit = if command.max_torque.is_nan() { self.motor.largest } else { command.max_torque.abs() };
        self.motor.apply(self.is_enabled().then_some(desired.clamp(-limit, limit)))
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

    fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        self.answer(frame, now_ns).into_iter().for_each(answer);
    }
}
