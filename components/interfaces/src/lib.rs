//! Interfaces between motorium graphs and what is around them: `log.console`, `sensor.udp`.

mod console;
mod udp;

pub use console::{ConsoleLog, ConsoleLogConfig};
pub use udp::{UdpSensor, UdpSensorConfig};
