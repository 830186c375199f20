//! Simulated drive of the MIT family.

use super::codec::{Drive, Instruction, Reply};
use super::damiao::{self, Register, Request, Value};
use crate::drive::{Command, Fault, Feedback, State};
use crate::frame::{Frame, Id};
use crate::protocols::simulation::{Motor, Simulated};

/// Default fraction of its full current at which a drive disables itself.
const OVER_CURRENT: f64 = 0.95;

/// Simulated MIT drive, which answers frames from a bus and applies a torque to its shaft.
///
/// Like the published firmware, the drive answers each command with its state at the arrival of the command.
/// The inner loop computes
///
/// ```text
/// tau = clamp(kp (position - q) + kd (velocity - v) + torque, -limit, limit)
/// ```
///
/// where `limit` is the end of the drive's torque range. If no command arrives within the watchdog time, the
/// drive disables itself.
///
/// ```
/// use motorium_can::SimulatedDrive;
/// use motorium_can::drive::Command;
/// use motorium_can::mit::{Drive, Instruction};
///
/// let codec = Drive::mini_cheetah(1);
/// let mut drive = SimulatedDrive::new(codec, Some(20_000_000));
/// assert!(drive.receive(&codec.instruct(&Instruction::Enable), 0).is_some());
/// drive.receive(&codec.command(&Command { torque: 2.0, ..Command::default() }), 1_000_000);
/// assert!((drive.step(0.0, 0.0, 2_000_000) - 2.0).abs() < 0.01);
/// assert_eq!(drive.step(0.0, 0.0, 22_000_000), 0.0, "its watchdog let go");
/// ```
#[derive(Clone, Debug)]
pub struct SimulatedDrive {
    codec: Drive,
    /// Time without a command after which the drive disables itself, ns; `None` for never.
    watchdog_ns: Option<u64>,
    command: Command,
    state: State,
    commanded_ns: u64,
    /// Control mode: register 10 of a Damiao drive.
    control_mode: u32,
    /// Fraction of the full current at which the drive disables itself, followed by the torque at full
    /// current, N m.
    over_current: f64,
    full_torque: Option<f64>,
    motor: Motor,
    watchdog_trips: u64,
}

impl SimulatedDrive {
    /// Creates a disabled drive at rest. `watchdog_ns` is its watchdog time; `None` for no watchdog.
    pub fn new(codec: Drive, watchdog_ns: Option<u64>) -> Self {
        Self {
            codec,
            watchdog_ns,
            command: Command::default(),
            state: State::Disabled,
            commanded_ns: 0,
            control_mode: Register::MIT_MODE,
            over_current: OVER_CURRENT,
            full_torque: None,
            motor: Motor::new(codec.ranges().torque.max),
            watchdog_trips: 0,
        }
    }

    /// Sets the torque \[N m\] of the drive at full current. The drive disables itself at a fraction of this
    /// torque.
    #[must_use]
    pub fn with_full_torque(self, torque: f64) -> Self {
        Self { full_torque: Some(torque), ..self }
    }

    /// Sets the control mode: register 10 of a Damiao drive. Default 1, the MIT mode.
    #[must_use]
    pub fn with_control_mode(self, control_mode: u32) -> Self {
        Self { control_mode, ..self }
    }

    /// Returns the codec of the drive, with the ranges configured in it.
    pub fn codec(&self) -> &Drive {
        &self.codec
    }

    /// Returns `true` if the drive follows commands.
    pub fn is_enabled(&self) -> bool {
        self.state == State::Enabled
    }

    /// Returns the number of watchdog trips.
    pub fn watchdog_trips(&self) -> u64 {
        self.watchdog_trips
    }

    /// Returns the temperature, degrees Celsius.
    pub fn temperature(&self) -> f64 {
        self.motor.temperature
    }

    /// Cuts the power. The drive is disabled when power returns.
    pub fn cut_power(&mut self) {
        (self.state, self.command) = (State::Disabled, Command::default());
        self.over_current = OVER_CURRENT;
    }

    /// Receives a frame on the bus at `now_ns`. Returns the answer if the frame addresses the drive.
    pub fn receive(&mut self, frame: &Frame, now_ns: u64) -> Option<Frame> {
        if self.codec.reply == Reply::Damiao
            && let Ok(request) = Request::decode(frame, self.codec.node)
        {
            return Some(request.answer(self.codec.reply_id, self.register(request.register)));
        }
        if self.codec.reply == Reply::Damiao
            && let Ok((request, share)) = Request::decode_change(frame, self.codec.node)
        {
            self.over_current = share;
            return Some(request.changed(self.codec.reply_id, share));
        }
        let instruction = self.codec.instruction(frame).ok()?;
        let answer = self.codec.answer(&self.feedback());
        match instruction {
            Instruction::Command(command) => self.command = command,
            Instruction::Enable if !matches!(self.state, State::Fault(_)) => {
                (self.state, self.command) = (State::Enabled, Command::default());
            }
            Instruction::Enable | Instruction::SetZero => {}
            // disabling also clears a fault
            Instruction::Disable => (self.state, self.command) = (State::Disabled, Command::default()),
        }
        self.commanded_ns = now_ns;
        // a state change is reported in the answer to the same frame
        match instruction {
            Instruction::Command(_) | Instruction::SetZero => Some(answer),
            Instruction::Enable | Instruction::Disable => Some(self.codec.answer(&self.feedback())),
        }
    }

    fn register(&self, register: Register) -> Value {
        let ranges = self.codec.ranges();
        match register {
            Register::OverCurrent => Value::Number(self.over_current),
            Register::Timeout => Value::Watchdog(self.watchdog_ns),
            Register::ControlMode => Value::Mode(self.control_mode),
            Register::PositionMax => Value::Number(ranges.position.max),
            Register::VelocityMax => Value::Number(ranges.velocity.max),
            Register::TorqueMax => Value::Number(ranges.torque.max),
        }
    }

    fn feedback(&self) -> Feedback {
        Feedback {
            position: self.motor.position,
            velocity: self.motor.velocity,
            torque: self.motor.torque,
            temperature: Some(self.motor.temperature.round_half()),
            voltage: Some(24.0),
            state: self.state,
        }
    }

    /// Runs one step of the inner loop with the shaft at this position \[rad\] and velocity \[rad/s\].
    /// Returns the torque that the drive applies from now on, N m.
    pub fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        let silent_ns = now_ns.saturating_sub(self.commanded_ns);
        if self.is_enabled() && self.watchdog_ns.is_some_and(|watchdog| silent_ns >= watchdog) {
            self.state = State::Fault(Fault::CommunicationLost);
            self.watchdog_trips += 1;
        }
        if self.is_enabled() && self.motor.is_too_hot() {
            self.state = State::Fault(Fault::HotMotor);
        }
        let desired = self.command.torque_at(position, velocity);
        let limit = self.full_torque.map(|torque| torque * self.over_current);
        if self.is_enabled() && limit.is_some_and(|limit| desired.abs() > limit) {
            self.state = State::Fault(Fault::OverCurrent);
        }
        self.motor.apply(self.is_enabled().then_some(desired))
    }
}

impl Simulated for SimulatedDrive {
    fn motor(&self) -> &Motor {
        &self.motor
    }

    fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    fn ids(&self) -> Vec<Id> {
        vec![self.codec.id(), damiao::EVERYBODY]
    }

    fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        self.receive(frame, now_ns).into_iter().for_each(answer);
    }

    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.step(position, velocity, now_ns)
    }

    fn cut_power(&mut self) {
        self.cut_power();
    }

    fn is_enabled(&self) -> bool {
        self.is_enabled()
    }

    fn watchdog_trips(&self) -> u64 {
        self.watchdog_trips
    }
}

trait RoundHalf {
    fn round_half(self) -> f64;
}

impl RoundHalf for f64 {
    /// Rounds to the nearest integer, for numbers that fit into 32 bits.
    fn round_half(self) -> f64 {
        f64::from((self + 0.5) as i32)
    }
}
