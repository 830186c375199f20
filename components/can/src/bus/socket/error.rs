//! Errors of opening an interface, with advice on the next step.

use std::io;

/// Error returned when an interface cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The kernel does not support CAN sockets.
    #[error("this kernel has no CAN sockets: {0}")]
    NoCan(io::Error),
    /// The interface does not exist.
    #[error("the CAN interface `{name}` does not exist: {}", there_is(.found))]
    Missing {
        /// Requested name.
        name: String,
        /// Existing interfaces.
        found: Vec<String>,
    },
    /// The interface is down.
    #[error("the CAN interface `{0}` is down")]
    Down(String),
    /// The interface does not support CAN FD frames.
    #[error("the CAN interface `{0}` supports classic frames only, but the bus has a data bitrate")]
    Classic(String),
    /// The bitrate of the interface differs from the bitrate of the bus.
    #[error("the CAN interface `{name}` has {found} bit/s, but the bus has {expected} bit/s")]
    Bitrate {
        /// Name of the interface.
        name: String,
        /// Bitrate of the interface.
        found: u32,
        /// Bitrate of the bus.
        expected: u32,
    },
    /// The serial line does not exist.
    #[error("the serial line `{0}` does not exist")]
    NoLine(String),
    /// The interface is a serial line or terminal, which cannot be shared between programs.
    #[error("`{0}` is a serial line, which only one program can use")]
    NotShared(String),
    /// No program offers a simulated bus by this name.
    #[error("no program offers the simulated bus `unix:{0}`")]
    NotOffered(String),
    /// The adapter on a serial line does not support the bitrate.
    #[error("the adapter on `{name}` does not support {rate} bit/s")]
    NoBitrate {
        /// Serial line.
        name: String,
        /// Requested bitrate.
        rate: u32,
    },
    /// The serial line does not support the speed.
    #[error("the serial line `{name}` does not support a speed of {speed} bit/s")]
    NoSpeed {
        /// Serial line.
        name: String,
        /// Requested speed.
        speed: u32,
    },
    /// The kernel or the adapter on the serial line refused.
    #[error("`{0}` cannot be opened: {1}")]
    Refused(String, io::Error),
}

fn there_is(found: &[String]) -> String {
    if found.is_empty() { "found none".into() } else { format!("found {}", found.join(", ")) }
}

impl OpenError {
    /// Returns advice on the next step.
    pub fn advice(&self) -> String {
        match self {
            Self::NoCan(_) => {
                "load it: `sudo modprobe can_raw`; a container needs access to the CAN support of its host".into()
            }
            Self::Missing { name, .. } if name.starts_with("vcan") => format!(
                "create it: `sudo modprobe vcan && sudo ip link add {name} type vcan && sudo ip link set {name} mtu 72 up`"
            ),
            Self::Missing { .. } => {
                "plug in the adapter, or name another interface: `ip -details link show type can` lists them".into()
            }
            Self::Down(name) if name.starts_with("vcan") => {
                format!("bring it up: `sudo ip link set {name} up`")
            }
            Self::Down(name) => {
                format!(
                    "bring it up with the bitrate of the drives: `sudo ip link set {name} up type can bitrate 1000000`"
                )
            }
            Self::Classic(name) => format!(
                "leave `data_bitrate` out, or bring it up as CAN FD: `sudo ip link set {name} up type can bitrate 1000000 dbitrate 5000000 fd on`"
            ),
            Self::Bitrate { name, expected, .. } => format!(
                "set it: `sudo ip link set {name} down && sudo ip link set {name} up type can bitrate {expected}`, or correct the table of the bus"
            ),
            Self::NoLine(_) => {
                "plug in the adapter: `ls /dev/serial/by-id` lists the available lines".into()
            }
            Self::NotShared(name) => format!(
                "attach the kernel driver with `motorium can attach {}`, and name its interface",
                name.strip_prefix("pty:").unwrap_or(name)
            ),
            Self::NotOffered(_) => {
                "start the graph whose `can.drive_sim` has this bus in its drive table, in real time".into()
            }
            Self::NoBitrate { .. } => {
                "slcan supports 10, 20, 50, 100, 125, 250, 500, 800 and 1000 kbit/s, and 2 and 5 Mbit/s for data".into()
            }
            Self::NoSpeed { .. } => {
                "write 9600, 19200, 38400, 57600, 115200, 500000, 1000000, 2000000, 3000000 or 4000000".into()
            }
            Self::Refused(name, error) if name.starts_with('/') => match error.kind() {
                io::ErrorKind::PermissionDenied => {
                    "join the group that owns serial lines (`sudo usermod -aG dialout $USER`), and log in again".into()
                }
                io::ErrorKind::ResourceBusy => "stop the program that uses the line: `sudo fuser -v` shows this program".into(),
                io::ErrorKind::InvalidInput => {
                    "choose a bitrate that the adapter supports, and check that no other program uses the adapter".into()
                }
                _ => "check that it is a serial line: `ls /dev/serial/by-id` lists the available ones".into(),
            },
            Self::Refused(..) => {
                "look for the cause in `dmesg`, and check that this user may open CAN sockets".into()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn serial_line_advice_matches_the_error() {
        for (kind, words) in [
            (io::ErrorKind::PermissionDenied, "dialout"),
            (io::ErrorKind::ResourceBusy, "fuser"),
            (io::ErrorKind::IsADirectory, "check that it is a serial line"),
        ] {
            let advice = OpenError::Refused("/dev/ttyACM0".into(), kind.into()).advice();
            assert!(advice.contains(words), "{kind}: {advice}");
        }
    }
}
