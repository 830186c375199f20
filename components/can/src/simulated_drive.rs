//! Simulated drives that answer on a bus, each with an inner loop, a watchdog and a temperature.

use crate::SimulatedDrive;
use crate::frame::{Frame, Id};
use crate::protocols::simulation::{Mark, Overrides, Simulated, Zero};
use crate::table::Table;

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
#[derive(Debug)]
pub struct AnySimulatedDrive(Box<dyn Simulated>);

impl AnySimulatedDrive {
    /// Creates the drive of table entry `index`.
    pub fn new(table: &Table, index: usize, overrides: Overrides) -> Self {
        let setup = table.setup(index);
        let mut drive = setup.entry.protocol.definition().simulated(&setup, overrides);
        if setup.entry.is_homed() {
            drive.motor_mut().zero = Zero::PowerOn;
        }
        Self(drive)
    }

    /// Sets the behaviour of the mark that the drive searches for during homing.
    pub fn set_mark(&mut self, mark: Mark) {
        self.0.motor_mut().mark = mark;
    }

    /// Returns the identifiers of the frames that the drive receives.
    pub fn ids(&self) -> Vec<Id> {
        self.0.ids()
    }

    /// Receives a frame on the bus at `now_ns`, and passes each answer frame to `answer`.
    pub fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, now_ns, answer);
    }

    /// Observes a frame of another drive, and passes any frame sent in response to `answer`. Servos that
    /// share one answer packet send their parts of the packet one after the other.
    pub fn observe(&mut self, frame: &Frame, answer: &mut dyn FnMut(Frame)) {
        self.0.observe(frame, answer);
    }

    /// Passes the unsolicited frames that are due by `now_ns` to `send`, each with its time.
    pub fn report(&mut self, now_ns: u64, send: &mut dyn FnMut(Frame, u64)) {
        self.0.report(now_ns, send);
    }

    /// Runs one step of the inner loop at this shaft position \[rad\] and velocity \[rad/s\]. Returns the
    /// torque until the next step, N m.
    pub fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        let position = self.0.motor_mut().encoder(position);
        self.0.step(position, velocity, now_ns)
    }

    /// Cuts the power. The drive is disabled when power returns.
    pub fn cut_power(&mut self) {
        self.0.motor_mut().cut_power();
        self.0.cut_power();
    }

    /// Returns `true` if the drive follows commands.
    pub fn is_enabled(&self) -> bool {
        self.0.is_enabled()
    }

    /// Returns `true` if the drive applies torque: it follows commands, or runs its own homing procedure.
    pub fn has_torque(&self) -> bool {
        self.0.has_torque()
    }

    /// Returns a function that invalidates the device, state or a number in a frame of the drive.
    pub(crate) fn corruption(&self) -> fn(&mut Frame) {
        self.0.corruption()
    }

    /// Returns the number of watchdog trips.
    pub fn watchdog_trips(&self) -> u64 {
        self.0.watchdog_trips()
    }

    /// Returns the temperature, degrees Celsius.
    pub fn temperature(&self) -> f64 {
        self.0.motor().temperature
    }
}

impl From<SimulatedDrive> for AnySimulatedDrive {
    fn from(drive: SimulatedDrive) -> Self {
        Self(Box::new(drive))
    }
}
