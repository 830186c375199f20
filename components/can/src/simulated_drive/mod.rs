//! Simulated drives: the other end of the wire, each with an inner loop, a watchdog and a temperature.

mod cia402;
mod encoder;
mod mit;
mod moteus;
mod motor;
mod odrive;
mod overrides;
mod search;
mod servo;
mod watchdog;

use crate::frame::{Frame, Id};
use crate::mit::Ranges;
use crate::table::{Protocol, Table};
use crate::{Range, damiao};
pub use encoder::Mark;
use encoder::Zero;
pub use mit::SimulatedDrive;
use motor::Motor;
pub use overrides::Overrides;

/// Simulated drive of any protocol in a drive table.
///
/// ```
/// use motorium_can::{AnySimulatedDrive, Overrides, Table};
///
/// let text = r#"
/// [[bus]]
/// name = "line"
/// kind = "serial"
/// bitrate = 1_000_000
///
/// [[drive]]
/// joint = "elbow"
/// bus = "line"
/// protocol = "feetech"
/// node = 3
/// watchdog = "0 s"
/// ranges = { position = 3.14, velocity = 4.7, torque = 1.9 }
/// "#;
/// let table = Table::parse(text)?;
/// let mut servo = AnySimulatedDrive::new(&table, 0, Overrides::default());
/// assert_eq!(servo.step(0.5, 0.0, 1_000_000), 0.0, "its torque is off");
/// # Ok::<(), motorium_can::TableError>(())
/// ```
#[derive(Clone, Debug)]
pub enum AnySimulatedDrive {
    /// Drive of the MIT family.
    Mit(Box<SimulatedDrive>),
    /// ODrive.
    Odrive(odrive::Odrive),
    /// CiA 402 drive.
    Cia402(Box<cia402::Cia402>),
    /// moteus.
    Moteus(moteus::Moteus),
    /// Servo of Feetech or Dynamixel.
    Servo(Box<servo::Servo>),
}

impl AnySimulatedDrive {
    /// Creates the drive of table entry `index`.
    pub fn new(table: &Table, index: usize, overrides: Overrides) -> Self {
        let entry = &table.drives[index];
        let watchdog_ns = Some(overrides.watchdog_ns.unwrap_or(entry.watchdog.ns)).filter(|ns| *ns > 0);
        let mut drive = match (entry.protocol, table.drive(index)) {
            (_, Some(mut codec)) => {
                if let Some(torque) = overrides.torque {
                    let ranges = Ranges { torque: Range::symmetric(torque), ..*codec.ranges() };
                    codec = codec.with_ranges(ranges);
                }
                let drive = SimulatedDrive::new(codec, watchdog_ns);
                let full = entry.full_current.zip(entry.torque_constant);
                Self::Mit(Box::new(match full {
                    Some((current, constant)) => drive.with_full_torque(current * constant),
                    None => drive,
                }))
            }
            (Protocol::Cia402, _) => Self::Cia402(Box::new(cia402::Cia402::new(table, index, overrides))),
            (Protocol::Moteus, _) => Self::Moteus(moteus::Moteus::new(table, index, watchdog_ns)),
            (Protocol::Feetech | Protocol::Dynamixel, _) => {
                Self::Servo(Box::new(servo::Servo::new(table, index, overrides)))
            }
            _ => Self::Odrive(odrive::Odrive::new(table, index, watchdog_ns)),
        };
        if entry.is_homed() {
            drive.motor_mut().zero = Zero::PowerOn;
        }
        drive
    }

    fn motor_mut(&mut self) -> &mut Motor {
        match self {
            Self::Mit(drive) => &mut drive.motor,
            Self::Odrive(drive) => &mut drive.motor,
            Self::Cia402(drive) => &mut drive.motor,
            Self::Moteus(drive) => &mut drive.motor,
            Self::Servo(drive) => &mut drive.motor,
        }
    }

    /// Sets the condition of the mark that the drive searches when it is homed.
    pub fn set_mark(&mut self, mark: Mark) {
        self.motor_mut().mark = mark;
    }

    /// Identifiers of the frames that the drive receives.
    pub fn ids(&self) -> Vec<Id> {
        match self {
            Self::Mit(drive) => vec![drive.codec().id(), damiao::EVERYBODY],
            Self::Odrive(drive) => drive.ids(),
            Self::Cia402(drive) => drive.ids(),
            Self::Moteus(drive) => drive.ids(),
            Self::Servo(drive) => drive.ids(),
        }
    }

    /// Receives a frame on the bus at `now_ns`, and passes each answer frame to `answer`.
    pub fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        match self {
            Self::Mit(drive) => drive.receive(frame, now_ns).into_iter().for_each(answer),
            Self::Odrive(drive) => drive.receive(frame, now_ns),
            Self::Cia402(drive) => drive.receive(frame, now_ns, answer),
            Self::Moteus(drive) => drive.receive(frame, now_ns).into_iter().for_each(answer),
            Self::Servo(drive) => drive.receive(frame, now_ns).into_iter().for_each(answer),
        }
    }

    /// Observes a frame of another drive, and passes a frame triggered by it to `answer`: servos that answer
    /// together send one after the other.
    pub fn observe(&mut self, frame: &Frame, answer: &mut dyn FnMut(Frame)) {
        if let Self::Servo(drive) = self {
            drive.observe(frame).into_iter().for_each(answer);
        }
    }

    /// Passes the unsolicited frames until `now_ns` to `send`, each with its time.
    pub fn report(&mut self, now_ns: u64, send: &mut dyn FnMut(Frame, u64)) {
        match self {
            Self::Odrive(drive) => drive.report(now_ns, send),
            Self::Cia402(drive) => drive.report(now_ns, send),
            Self::Mit(_) | Self::Moteus(_) | Self::Servo(_) => {}
        }
    }

    /// Runs one step of the inner loop with the shaft at this position \[rad\] and velocity \[rad/s\].
    /// Returns the torque from now on, N m.
    pub fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        let position = self.motor_mut().encoder(position);
        match self {
            Self::Mit(drive) => drive.step(position, velocity, now_ns),
            Self::Odrive(drive) => drive.step(position, velocity, now_ns),
            Self::Cia402(drive) => drive.step(position, velocity, now_ns),
            Self::Moteus(drive) => drive.step(position, velocity, now_ns),
            Self::Servo(drive) => drive.step(position, velocity, now_ns),
        }
    }

    /// Cuts the power: the drive is disabled when it returns.
    pub fn cut_power(&mut self) {
        self.motor_mut().cut_power();
        match self {
            Self::Mit(drive) => drive.cut_power(),
            Self::Odrive(drive) => drive.cut_power(),
            Self::Cia402(drive) => drive.cut_power(),
            Self::Moteus(drive) => drive.cut_power(),
            Self::Servo(drive) => drive.cut_power(),
        }
    }

    /// Returns `true` if the drive follows commands.
    pub fn is_enabled(&self) -> bool {
        match self {
            Self::Mit(drive) => drive.is_enabled(),
            Self::Odrive(drive) => drive.is_enabled(),
            Self::Cia402(drive) => drive.is_enabled(),
            Self::Moteus(drive) => drive.is_enabled(),
            Self::Servo(drive) => drive.is_enabled(),
        }
    }

    /// Returns `true` if the drive applies torque: it follows commands, or runs its own homing procedure.
    pub fn has_torque(&self) -> bool {
        match self {
            Self::Odrive(drive) => drive.has_torque(),
            _ => self.is_enabled(),
        }
    }

    /// Number of watchdog trips.
    pub fn watchdog_trips(&self) -> u64 {
        match self {
            Self::Mit(drive) => drive.watchdog_trips(),
            Self::Odrive(drive) => drive.watchdog_trips,
            Self::Cia402(drive) => drive.watchdog_trips,
            Self::Moteus(drive) => drive.watchdog_trips,
            Self::Servo(drive) => drive.watchdog_trips,
        }
    }

    /// Temperature, degrees Celsius.
    pub fn temperature(&self) -> f64 {
        match self {
            Self::Mit(drive) => drive.temperature(),
            Self::Odrive(drive) => drive.motor.temperature,
            Self::Cia402(drive) => drive.motor.temperature,
            Self::Moteus(drive) => drive.motor.temperature,
            Self::Servo(drive) => drive.motor.temperature,
        }
    }
}
