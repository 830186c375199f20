//! Lines of serial servos: unmodified packets on a serial line of the computer.

use std::fs::File;
use std::os::fd::{AsFd, BorrowedFd};

use super::socket::{Condition, OpenError, SocketCounts};
use super::terminal::{self, Terminal};
use super::time::monotonic_ns;
use super::{Bus, Received};
use crate::frame::{Form, Frame, Id};
use crate::servo::{EVERYBODY, LONGEST, Reader};

/// Line of serial servos. Each packet is a frame of the form [`Packet`](crate::Form::Packet), with the servo
/// number as its identifier.
///
/// ```no_run
/// use motorium_can::servo::{EVERYBODY, Instruction, LONGEST, Protocol, write};
/// use motorium_can::{Bus, Frame, ServoBus};
///
/// let mut line = ServoBus::open("/dev/ttyACM0", 1_000_000)?;
/// let mut packet = [0; LONGEST];
/// let ask = Instruction::ReadMany { register: 56, count: 2, servos: &[1, 2, 3] };
/// let length = write(Protocol::One, EVERYBODY, &ask, &mut packet).unwrap();
/// line.send(&[Frame::packet(EVERYBODY, &packet[..length]).unwrap()]);
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
#[derive(Debug)]
pub struct ServoBus {
    speed: u32,
    line: Terminal,
    reader: Reader,
    /// Packet longer than a frame, and the range of its bytes that has not been delivered yet.
    long: Box<[u8; LONGEST]>,
    left: (usize, usize),
}

/// Largest number of bytes waiting to be written.
const ROOM: usize = 4096;

/// Returns the terminal constant for a speed; `None` for an unsupported speed.
fn speed_of(speed: u32) -> Option<libc::speed_t> {
    Some(match speed {
        9_600 => libc::B9600,
        19_200 => libc::B19200,
        38_400 => libc::B38400,
        57_600 => libc::B57600,
        115_200 => libc::B115200,
        500_000 => libc::B500000,
        1_000_000 => libc::B1000000,
        2_000_000 => libc::B2000000,
        3_000_000 => libc::B3000000,
        4_000_000 => libc::B4000000,
        _ => return None,
    })
}

fn open(path: &str, speed: u32) -> Result<File, OpenError> {
    let unknown = OpenError::NoSpeed { name: path.into(), speed };
    terminal::open(path, speed_of(speed).ok_or(unknown)?)
}

impl ServoBus {
    /// Opens a serial line at a speed of `speed` bit/s.
    ///
    /// # Errors
    /// Returns an error if the line does not exist, cannot be opened, or does not support the speed.
    pub fn open(path: &str, speed: u32) -> Result<Self, OpenError> {
        let line = Terminal::new(path, open(path, speed)?, ROOM);
        let long = Box::new([0; LONGEST]);
        Ok(Self { speed, line, reader: Reader::default(), long, left: (0, 0) })
    }

    /// Returns the path of the line.
    pub fn name(&self) -> &str {
        self.line.path()
    }

    /// Returns the condition of the line: present or gone.
    pub fn condition(&self) -> Condition {
        self.line.condition
    }

    /// Returns the counters of the line.
    pub fn counts(&self) -> &SocketCounts {
        &self.line.counts
    }

    /// Returns `true` for a pseudo-terminal, on which bytes have no duration.
    pub fn is_virtual(&self) -> bool {
        self.line.is_virtual()
    }

    /// Returns the next part of a packet that is longer than a frame.
    fn part(&mut self) -> Option<Frame> {
        let (from, to) = self.left;
        let part = &self.long[from..to.min(from + Form::Packet.capacity())];
        self.left.0 += part.len();
        if part.is_empty() { None } else { Frame::packet(EVERYBODY, part) }
    }

    /// Restricts reception to packets from or to servos with these numbers.
    pub fn receive_only(&mut self, ids: &[Id]) {
        self.line.receive_only(ids);
    }
}

impl AsFd for ServoBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.line.as_fd()
    }
}

impl Bus for ServoBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        let Self { speed, line, reader, .. } = self;
        if line.look_again(|path| open(path, *speed)) {
            *reader = Reader::default();
        }
        // an incomplete common answer will not be completed any more
        if !frames.is_empty() {
            reader.drop_common();
        }
        // the rest of a partly written packet is sent first
        if !line.condition.can_send() || !line.flush() {
            return 0;
        }
        let mut count = 0;
        for frame in frames {
            if frame.data().len() > line.room() {
                break;
            }
            line.push(frame.data());
            count += 1;
        }
        line.flush();
        if line.condition.can_send() { count } else { 0 }
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        let (mut count, time_ns) = (0, monotonic_ns());
        while self.line.condition.can_send() && count < frames.len() {
            if let Some(frame) = self.part() {
                frames[count] = Received { frame, time_ns };
                count += 1;
                continue;
            }
            let Some(byte) = self.line.next_byte() else { break };
            let Some((servo, packet)) = self.reader.push_raw(byte) else { continue };
            match Frame::packet(servo, packet) {
                Some(frame) if self.line.wants(frame.id) => {
                    frames[count] = Received { frame, time_ns };
                    count += 1;
                }
                Some(_) => {}
                // the common answer of several servos
                None if servo == EVERYBODY => {
                    self.long[..packet.len()].copy_from_slice(packet);
                    self.left = (0, packet.len());
                }
                None => self.line.counts.other += 1,
            }
        }
        count
    }
}
