//! Interfaces between motorium graphs and their environment: `log.console`, `sensor.udp`.

mod console;
mod udp;

use motorium::worker::Kind;

pub use console::{ConsoleLog, ConsoleLogConfig};
pub use udp::{LocalUsers, UdpSensor, UdpSensorConfig};

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_interfaces::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"log.console"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<ConsoleLog>(), Kind::of::<UdpSensor>()]
}
