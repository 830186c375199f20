//! Receiving and sending on kernel interfaces and simulated buses, for tools.

use core::time::Duration;
use std::io;
use std::os::fd::{AsFd as _, BorrowedFd};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socketcan::dump::CanDumpRecord;
use socketcan::{CanFdSocket, Socket as _, SocketOptions as _};

use super::{Record, since_1970_us};
use crate::bus::Bus as _;
use crate::bus::offered::{Place, Traffic, UnixBus};
use crate::bus::socket::look_up;
use crate::{Condition, OpenError};

/// Listener on interfaces of the kernel and simulated buses (`unix:NAME`), for tools. Its methods may block
/// and allocate.
///
/// ```
/// use motorium_can::bus::offered::{Offer, Place};
/// use motorium_can::{Frame, Id, Listener, Rates, Received};
///
/// let name = format!("listened-{}", std::process::id());
/// let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
/// let mut offer = Offer::open(Place::Socket(&name), rates, false, false)?;
/// let mut listener = Listener::open([format!("unix:{name}").as_str()])?;
/// offer.receive(&mut [Received::default()]); // which admits the listener
/// let frame = Frame::classic(Id::Standard(0x123), &[1, 2]);
/// offer.deliver(&Received { frame, time_ns: 0 });
/// offer.flush();
/// let record = listener.next(core::time::Duration::from_secs(5))?.ok_or("no record")?;
/// assert_eq!(record.frame(), Some(frame));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Listener {
    sources: Vec<Source>,
}

/// Opens the simulated bus with this name; returns `None` for a kernel interface.
fn simulated(name: &str) -> Result<Option<Box<UnixBus>>, OpenError> {
    match Place::from_interface(name) {
        Some(Place::Socket(socket)) => UnixBus::open(socket).map(|bus| Some(Box::new(bus))),
        Some(Place::Terminal(_)) => Err(OpenError::NotShared(name.to_string())),
        None if name.starts_with('/') => Err(OpenError::NotShared(name.to_string())),
        None => Ok(None),
    }
}

/// Source of records.
enum Source {
    Kernel(String, CanFdSocket),
    Simulated(Box<UnixBus>),
}

impl Source {
    fn open(name: &str) -> Result<Self, OpenError> {
        if let Some(bus) = simulated(name)? {
            return Ok(Self::Simulated(bus));
        }
        let refused = |error| OpenError::Refused(name.to_string(), error);
        look_up(name)?;
        let socket = CanFdSocket::open(name).map_err(refused)?;
        socket.set_nonblocking(true).map_err(refused)?;
        socket.set_error_filter_accept_all().map_err(refused)?;
        socket.set_recv_timestamp(true).map_err(refused)?;
        Ok(Self::Kernel(name.to_string(), socket))
    }

    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Kernel(_, socket) => socket.as_fd(),
            Self::Simulated(bus) => bus.as_fd(),
        }
    }

    /// Returns the next record, if available.
    fn next(&mut self) -> io::Result<Option<Record>> {
        match self {
            Self::Kernel(name, socket) => match socket.read_frame_with_timestamp() {
                Ok((frame, time)) => {
                    let (t_us, device) = (since_1970_us(time), name.clone());
                    Ok(Some(Record(CanDumpRecord { t_us, device, frame, direction: None })))
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(None),
                Err(error) => Err(io::Error::new(error.kind(), format!("`{name}`: {error}"))),
            },
            Self::Simulated(bus) => {
                let refused =
                    |bus: &UnixBus, why: &str| Err(io::Error::other(format!("`{}`: {why}", bus.name())));
                match bus.next() {
                    Some(Traffic::Frame(received)) => match Record::of_simulated(bus.name(), &received) {
                        Some(record) => Ok(Some(record)),
                        None => refused(
                            bus,
                            "this bus is a line of serial servos, whose packets are not CAN frames",
                        ),
                    },
                    Some(Traffic::Report(report)) => Ok(Record::of_report(bus.name(), &report)),
                    None if bus.condition() == Condition::Gone => {
                        refused(bus, "the program that simulates this bus has ended")
                    }
                    None => Ok(None),
                }
            }
        }
    }
}

impl Listener {
    /// Listens on these interfaces.
    ///
    /// # Errors
    /// Returns an error if an interface is missing or down, if it is a line that only one program can open,
    /// or if the kernel refuses.
    pub fn open<'a>(interfaces: impl IntoIterator<Item = &'a str>) -> Result<Self, OpenError> {
        Ok(Self { sources: interfaces.into_iter().map(Source::open).collect::<Result<_, _>>()? })
    }

    /// Returns the next record if one arrives within `timeout`.
    ///
    /// # Errors
    /// Returns an error if an interface has gone down or disappeared.
    pub fn next(&mut self, timeout: Duration) -> io::Result<Option<Record>> {
        if let Some(record) = self.take()? {
            return Ok(Some(record));
        }
        let mut polled: Vec<PollFd<'_>> = self
            .sources
            .iter()
            .map(|source| PollFd::from_borrowed_fd(source.as_fd(), PollFlags::IN))
            .collect();
        let timeout = Timespec { tv_sec: timeout.as_secs() as i64, tv_nsec: timeout.subsec_nanos().into() };
        match poll(&mut polled, Some(&timeout)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => self.take(),
            Err(error) => Err(error.into()),
        }
    }

    fn take(&mut self) -> io::Result<Option<Record>> {
        for source in &mut self.sources {
            if let Some(record) = source.next()? {
                return Ok(Some(record));
            }
        }
        Ok(None)
    }
}

/// Sender of records on an interface of the kernel or a simulated bus (`unix:NAME`), for tools.
pub struct Sender {
    name: String,
    line: Line,
}

/// Channel through which records are sent.
enum Line {
    Kernel(CanFdSocket),
    Simulated(Box<UnixBus>),
}

impl Sender {
    /// Opens an interface for sending.
    ///
    /// # Errors
    /// Returns an error if the interface is missing or down, if it is a line that only one program can open,
    /// or if the kernel refuses.
    pub fn open(name: &str) -> Result<Self, OpenError> {
        let line = match simulated(name)? {
            Some(bus) => Line::Simulated(bus),
            None => {
                look_up(name)?;
                let refused = |error| OpenError::Refused(name.to_string(), error);
                Line::Kernel(CanFdSocket::open(name).map_err(refused)?)
            }
        };
        Ok(Self { name: name.to_string(), line })
    }

    /// Sends the frame of a record, regardless of the interface that it came from.
    ///
    /// # Errors
    /// Returns an error that explains the cause if the interface does not accept the frame.
    pub fn send(&mut self, record: &Record) -> io::Result<()> {
        let name = &self.name;
        let socket = match &mut self.line {
            Line::Kernel(socket) => socket,
            Line::Simulated(bus) => {
                let frame = record.frame().ok_or_else(|| {
                    io::Error::other(format!("`{name}` is a simulated bus, which accepts only data frames"))
                })?;
                return match bus.send(&[frame]) {
                    0 => Err(io::Error::other(format!(
                        "`{name}` did not accept the frame: the bus is {}",
                        bus.condition().name()
                    ))),
                    _ => Ok(()),
                };
            }
        };
        socket.write_frame(&record.0.frame).map_err(|error| {
            let why = match error.raw_os_error() {
                Some(libc::ENOBUFS) => format!(
                    "the queue of `{name}` is full: no node acknowledges (power, bitrate, termination?), or frames are sent too fast"
                ),
                Some(libc::ENETDOWN) => format!("`{name}` went down: `sudo ip link set {name} up`"),
                Some(libc::EINVAL) => format!("`{name}` does not accept this frame: is it CAN FD on a classic interface?"),
                _ => format!("`{name}`: {error}"),
            };
            io::Error::new(error.kind(), why)
        })
    }
}
