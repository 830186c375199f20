//! Interfaces between motorium graphs and what is around them: `log.console`, `sensor.udp`.

mod console;
mod udp;

use motorium::worker::Kind;

pub use console::{ConsoleLog, ConsoleLogConfig};
pub use udp::{LocalUsers, UdpSensor, UdpSensorConfig};

/// The kinds of this crate, for a program that hosts them.
///
/// ```
/// let names: Vec<_> = motorium_interfaces::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"log.console"));
/// ```
// Not inlined, as `Kind::of` asks for.
#[inline(never)]
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<ConsoleLog>(), Kind::of::<UdpSensor>()]
}
