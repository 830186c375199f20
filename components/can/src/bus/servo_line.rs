//! Lines of serial servos: packets as they are, on a serial line of the computer.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd, BorrowedFd};

use super::socket::{Condition, OpenError, SocketCounts};
use super::time::monotonic_ns;
use super::{Bus, Received, serial};
use crate::frame::{Frame, Id};
use crate::servo::Reader;

/// A line of serial servos: each packet is a frame of the form [`Packet`](crate::Form::Packet), with the number of its servo for
/// an identifier.
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
    path: String,
    speed: u32,
    file: File,
    reader: Reader,
    text: Vec<u8>,
    bytes: Box<[u8; 1024]>,
    /// Bytes of `bytes` that are yet to be read, from where to where.
    unread: (usize, usize),
    filters: Vec<Id>,
    condition: Condition,
    counts: SocketCounts,
    reopen_ns: u64,
}

/// Time after which a line that has gone is looked for again, ns.
const REOPEN_NS: u64 = 1_000_000_000;

/// The speed as the terminal knows it; `None` for one that it does not know.
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
    serial::open(path, speed_of(speed).ok_or(unknown)?).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => OpenError::NoLine(path.into()),
        _ => OpenError::Refused(path.into(), error),
    })
}

impl ServoBus {
    /// Opens a serial line with this speed, bit/s.
    ///
    /// # Errors
    /// There is no such line, it cannot be opened, or knows no such speed.
    pub fn open(path: &str, speed: u32) -> Result<Self, OpenError> {
        Ok(Self {
            path: path.into(),
            speed,
            file: open(path, speed)?,
            reader: Reader::default(),
            text: Vec::with_capacity(4096),
            bytes: Box::new([0; 1024]),
            unread: (0, 0),
            filters: Vec::new(),
            condition: Condition::Active,
            counts: SocketCounts::default(),
            reopen_ns: 0,
        })
    }

    /// Its path.
    pub fn name(&self) -> &str {
        &self.path
    }

    /// Its condition: whether it is there.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Its counts.
    pub fn counts(&self) -> &SocketCounts {
        &self.counts
    }

    /// True for a pseudo-terminal, on which bytes take no time.
    pub fn is_virtual(&self) -> bool {
        std::fs::canonicalize(&self.path).is_ok_and(|path| path.starts_with("/dev/pts"))
    }

    /// Receives packets of, or for, servos with these numbers only.
    pub fn receive_only(&mut self, ids: &[Id]) {
        self.filters = ids.to_vec();
    }

    /// Notes that the line has gone.
    fn lose(&mut self) {
        if self.condition != Condition::Gone {
            self.counts.down += 1;
            self.condition = Condition::Gone;
            self.reopen_ns = monotonic_ns() + REOPEN_NS;
        }
    }

    /// Looks for a line that has gone, once a second.
    fn look_again(&mut self) {
        let now_ns = monotonic_ns();
        if now_ns < self.reopen_ns {
            return;
        }
        self.reopen_ns = now_ns + REOPEN_NS;
        if let Ok(file) = open(&self.path, self.speed) {
            (self.file, self.condition, self.reader) = (file, Condition::Active, Reader::default());
            self.text.clear();
            self.unread = (0, 0);
        }
    }

    /// Writes what is left of a batch; false if some of it is still left.
    fn flush(&mut self) -> bool {
        while !self.text.is_empty() {
            match self.file.write(&self.text) {
                Ok(0) => return false,
                Ok(count) => drop(self.text.drain(..count)),
                Err(error) => {
                    self.fail(&error);
                    return false;
                }
            }
        }
        true
    }

    fn fail(&mut self, error: &io::Error) {
        match error.kind() {
            io::ErrorKind::WouldBlock => self.counts.queue_full += 1,
            io::ErrorKind::Interrupted => {}
            _ => self.lose(),
        }
    }

    /// Reads what has come; false if nothing has.
    fn fill(&mut self) -> bool {
        match self.file.read(&mut self.bytes[..]) {
            // a line that has hung up
            Ok(0) => self.lose(),
            Ok(count) => {
                self.unread = (0, count);
                return true;
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => self.fail(&error),
        }
        false
    }
}

impl AsFd for ServoBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Bus for ServoBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        if self.condition == Condition::Gone {
            self.look_again();
        }
        // the end of a packet that is begun goes before all others
        if !self.condition.can_send() || !self.flush() {
            return 0;
        }
        let room = self.text.capacity();
        let mut count = 0;
        for frame in frames {
            if self.text.len() + frame.data().len() > room {
                break;
            }
            self.text.extend_from_slice(frame.data());
            count += 1;
        }
        self.flush();
        if self.condition.can_send() { count } else { 0 }
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        let (mut count, time_ns) = (0, monotonic_ns());
        while self.condition.can_send() && count < frames.len() {
            if self.unread.0 == self.unread.1 && !self.fill() {
                break;
            }
            let byte = self.bytes[self.unread.0];
            self.unread.0 += 1;
            let Some(packet) = self.reader.push_raw(byte) else { continue };
            match Frame::packet(packet[2], packet) {
                Some(frame) if self.filters.is_empty() || self.filters.contains(&frame.id) => {
                    frames[count] = Received { frame, time_ns };
                    count += 1;
                }
                Some(_) => {}
                None => self.counts.other += 1,
            }
        }
        count
    }
}
