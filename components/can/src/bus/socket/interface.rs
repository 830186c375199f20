//! CAN interfaces of the computer, as reported by the kernel (rtnetlink).

use core::fmt;
use std::io;

use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketType};

use crate::bus::report::ErrorState;

/// CAN interface of the computer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Interface {
    /// Name, such as `can0`.
    pub name: String,
    /// Kind of the device, if the kernel reports it: `can` for controllers, `vcan` for virtual buses, `slcan`
    /// for serial lines.
    pub kind: Option<String>,
    /// `true` if the interface is up.
    pub is_up: bool,
    /// `true` if the interface supports CAN FD frames.
    pub is_fd: bool,
    /// Length of the send queue, frames.
    pub queue: u32,
    /// Arbitration bitrate, bit/s; `None` for a virtual bus, or if the bitrate is not set.
    pub bitrate: Option<u32>,
    /// Data bitrate of CAN FD frames, bit/s; `None` if it is not set.
    pub data_bitrate: Option<u32>,
    /// State of the controller; `None` without a controller.
    pub state: Option<ErrorState>,
    /// Time after which a bus-off controller restarts automatically, ms; 0 for never, `None` if not reported.
    pub restart_ms: Option<u32>,
    /// Transmit and receive error counters, if the driver reports them.
    pub counters: Option<[u16; 2]>,
}

impl Interface {
    /// Returns all CAN interfaces, in the kernel's order.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses to list them.
    pub fn all() -> io::Result<Vec<Self>> {
        let socket = rustix::net::socket(AddressFamily::NETLINK, SocketType::RAW, None)?;
        rustix::net::send(&socket, &request(), SendFlags::empty())?;
        let mut found = Vec::new();
        let mut answer = vec![0_u8; 1 << 16];
        loop {
            let (length, _) = rustix::net::recv(&socket, &mut answer[..], RecvFlags::empty())?;
            if length == 0 || read(&answer[..length], &mut found)? {
                return Ok(found);
            }
        }
    }

    /// Returns the interface with this name; `None` if it does not exist.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses to list them.
    pub fn named(name: &str) -> io::Result<Option<Self>> {
        Ok(Self::all()?.into_iter().find(|interface| interface.name == name))
    }

    /// Returns `true` for a virtual bus, which has no bit times, acknowledgement or arbitration.
    pub fn is_virtual(&self) -> bool {
        matches!(self.kind.as_deref(), Some("vcan" | "vxcan"))
    }
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = self.kind.as_deref().unwrap_or("can");
        write!(f, "{} ({kind}, {}", self.name, if self.is_up { "up" } else { "down" })?;
        if let Some(bitrate) = self.bitrate {
            write!(f, ", {} kbit/s", bitrate / 1000)?;
        }
        if let Some(fast) = self.data_bitrate {
            write!(f, " and {} kbit/s", fast / 1000)?;
        }
        f.write_str(")")
    }
}

// Constants of `linux/netlink.h`, `linux/rtnetlink.h`, `linux/if_link.h` and `linux/can/netlink.h`.
const NEW_LINK: u16 = 16;
const GET_LINK: u16 = 18;
const ERROR: u16 = 2;
const DONE: u16 = 3;
const REQUEST_ALL: u16 = 0x301;
const CAN_DEVICE: u16 = 280;
const IS_UP: u32 = 1;
const NAME: u16 = 3;
const MTU: u16 = 4;
const QUEUE: u16 = 13;
const LINK_INFO: u16 = 18;
const KIND: u16 = 1;
const DATA: u16 = 2;
const BIT_TIMING: u16 = 1;
const STATE: u16 = 4;
const RESTART_MS: u16 = 6;
const COUNTERS: u16 = 8;
const DATA_BIT_TIMING: u16 = 9;

/// Returns the request for all links.
fn request() -> [u8; 32] {
    let mut request = [0; 32];
    request[0..4].copy_from_slice(&32_u32.to_ne_bytes());
    request[4..6].copy_from_slice(&GET_LINK.to_ne_bytes());
    request[6..8].copy_from_slice(&REQUEST_ALL.to_ne_bytes());
    request
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_ne_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_ne_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

/// Reads the messages of a datagram. Returns `true` after the last one.
fn read(mut messages: &[u8], found: &mut Vec<Interface>) -> io::Result<bool> {
    while let (Some(length), Some(kind)) = (u32_at(messages, 0), u16_at(messages, 4)) {
        let length = length as usize;
        let Some(body) = messages.get(16..length) else { break };
        match kind {
            DONE => return Ok(true),
            ERROR => {
                let code = u32_at(body, 0).map_or(0, |code| (code as i32).wrapping_neg());
                return Err(io::Error::from_raw_os_error(code));
            }
            NEW_LINK => found.extend(link(body)),
            _ => {}
        }
        messages = messages.get(length.next_multiple_of(4)..).unwrap_or(&[]);
    }
    Ok(false)
}

/// Returns the attributes of a message, or attributes nested in another one.
fn attributes(mut bytes: &[u8]) -> impl Iterator<Item = (u16, &[u8])> {
    core::iter::from_fn(move || {
        let (length, kind) = (usize::from(u16_at(bytes, 0)?), u16_at(bytes, 2)?);
        let value = bytes.get(4..length)?;
        bytes = bytes.get(length.next_multiple_of(4)..).unwrap_or(&[]);
        Some((kind & 0x3fff, value))
    })
}

fn text(value: &[u8]) -> String {
    String::from_utf8_lossy(value.split(|byte| *byte == 0).next().unwrap_or(&[])).into_owned()
}

/// Returns a description of a link, if it is a CAN interface.
fn link(body: &[u8]) -> Option<Interface> {
    if u16_at(body, 2)? != CAN_DEVICE {
        return None;
    }
    let mut interface = Interface { is_up: u32_at(body, 8)? & IS_UP != 0, ..Interface::default() };
    for (kind, value) in attributes(body.get(16..)?) {
        match kind {
            NAME => interface.name = text(value),
            MTU => interface.is_fd = u32_at(value, 0).is_some_and(|mtu| mtu >= 72),
            QUEUE => interface.queue = u32_at(value, 0).unwrap_or(0),
            LINK_INFO => {
                for (kind, value) in attributes(value) {
                    match kind {
                        KIND => interface.kind = Some(text(value)),
                        DATA => controller(value, &mut interface),
                        _ => {}
                    }
                }
            }
            _ => {}
        }
    }
    Some(interface)
}

/// Reads the state of the controller, as reported by its driver.
fn controller(data: &[u8], interface: &mut Interface) {
    let bitrate = |value| u32_at(value, 0).filter(|rate| *rate > 0);
    for (kind, value) in attributes(data) {
        match kind {
            BIT_TIMING => interface.bitrate = bitrate(value),
            DATA_BIT_TIMING => interface.data_bitrate = bitrate(value),
            RESTART_MS => interface.restart_ms = u32_at(value, 0),
            COUNTERS => interface.counters = u16_at(value, 0).zip(u16_at(value, 2)).map(|(tx, rx)| [tx, rx]),
            STATE => {
                interface.state = match u32_at(value, 0) {
                    Some(0) => Some(ErrorState::Active),
                    Some(1) => Some(ErrorState::Warning),
                    Some(2) => Some(ErrorState::Passive),
                    Some(3) => Some(ErrorState::Off),
                    _ => None,
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(kind: u16, value: &[u8]) -> Vec<u8> {
        let mut bytes = ((value.len() + 4) as u16).to_ne_bytes().to_vec();
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(value);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn message(kind: u16, body: &[u8]) -> Vec<u8> {
        let mut bytes = ((body.len() + 16) as u32).to_ne_bytes().to_vec();
        bytes.extend(kind.to_ne_bytes());
        bytes.extend([0; 10]);
        bytes.extend(body);
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        bytes
    }

    fn device(kind: u16, flags: u32, attributes: &[Vec<u8>]) -> Vec<u8> {
        let mut body = vec![0, 0];
        body.extend(kind.to_ne_bytes());
        body.extend(7_i32.to_ne_bytes());
        body.extend(flags.to_ne_bytes());
        body.extend([0; 4]);
        body.extend(attributes.concat());
        message(NEW_LINK, &body)
    }

    #[test]
    fn an_interface_reports_bitrates_and_controller_state() {
        let timing = |rate: u32| rate.to_ne_bytes().into_iter().chain([0; 28]).collect::<Vec<u8>>();
        let data = [
            attribute(BIT_TIMING, &timing(1_000_000)),
            attribute(DATA_BIT_TIMING, &timing(5_000_000)),
            attribute(STATE, &2_u32.to_ne_bytes()),
            attribute(RESTART_MS, &100_u32.to_ne_bytes()),
            attribute(COUNTERS, &[136, 0, 3, 0]),
        ]
        .concat();
        let info = [attribute(KIND, b"can\0"), attribute(DATA, &data)].concat();
        let attributes = [
            attribute(NAME, b"can0\0"),
            attribute(MTU, &72_u32.to_ne_bytes()),
            attribute(QUEUE, &10_u32.to_ne_bytes()),
            attribute(LINK_INFO, &info),
        ];
        let mut datagram = device(1, 1, &[attribute(NAME, b"eth0\0")]);
        datagram.extend(device(CAN_DEVICE, IS_UP | 0x80, &attributes));
        datagram.extend(message(DONE, &[0; 4]));
        let mut found = Vec::new();
        assert!(read(&datagram, &mut found).unwrap(), "the end is seen");
        let expected = Interface {
            name: "can0".into(),
            kind: Some("can".into()),
            is_up: true,
            is_fd: true,
            queue: 10,
            bitrate: Some(1_000_000),
            data_bitrate: Some(5_000_000),
            state: Some(ErrorState::Passive),
            restart_ms: Some(100),
            counters: Some([u16::from_ne_bytes([136, 0]), u16::from_ne_bytes([3, 0])]),
        };
        assert_eq!(found, [expected]);
        assert_eq!(found[0].to_string(), "can0 (can, up, 1000 kbit/s and 5000 kbit/s)");
    }

    #[test]
    fn truncated_messages_cause_no_panic() {
        let info = attribute(LINK_INFO, &attribute(DATA, &attribute(STATE, &[1, 0, 0, 0])));
        let datagram = device(CAN_DEVICE, 0, &[attribute(NAME, b"can0\0"), info]);
        for length in 0..datagram.len() {
            for at in 0..length {
                let mut damaged = datagram[..length].to_vec();
                damaged[at] ^= 0xff;
                let _ = read(&damaged, &mut Vec::new());
            }
        }
    }

    #[test]
    fn the_kernel_lists_its_interfaces() {
        // the number of interfaces depends on the machine
        for interface in Interface::all().unwrap() {
            assert!(!interface.name.is_empty());
        }
        assert_eq!(Interface::named("no-such-interface").unwrap(), None);
    }
}
