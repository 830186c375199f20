//! Simulated buses for other programs. A bus is offered over a unix socket or a pseudo-terminal. The
//! pseudo-terminal acts as an slcan adapter, to which the kernel driver can be attached, or as a line of
//! serial servos.
//!
//! A [`Place`] is the address of an offered bus: `unix:NAME` or `pty:PATH`. The program that simulates the
//! bus opens an [`Offer`] at this address. Other programs open the bus with [`RealBus`](crate::RealBus), like
//! any other bus.

mod records;
mod terminal;
mod unix;

use std::io;

use super::Received;
use super::bits::Rates;
use super::report::Report;
pub(crate) use terminal::BATCH_NS;
pub use terminal::TerminalOffer;
pub(crate) use unix::Traffic;
pub use unix::{UnixBus, UnixOffer};

/// Address of a simulated bus.
///
/// ```
/// use motorium_can::bus::offered::Place;
///
/// assert_eq!(Place::from_interface("unix:can0"), Some(Place::Socket("can0")));
/// assert_eq!(Place::from_interface("pty:/tmp/can0"), Some(Place::Terminal("/tmp/can0")));
/// assert_eq!(Place::from_interface("can0"), None, "an interface of the kernel");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place<'a> {
    /// Unix socket of this user, identified by its name.
    Socket(&'a str),
    /// Pseudo-terminal, identified by the path of a symbolic link to it.
    Terminal(&'a str),
}

impl<'a> Place<'a> {
    /// Parses the name of an interface as an address. Returns `None` for an interface of the kernel or a
    /// serial line.
    pub fn from_interface(interface: &'a str) -> Option<Self> {
        let socket = interface.strip_prefix("unix:").map(Place::Socket);
        socket.or_else(|| interface.strip_prefix("pty:").map(Place::Terminal))
    }
}

/// Simulator's end of a simulated bus that is offered to other programs.
#[derive(Debug)]
pub enum Offer {
    /// Over a unix socket.
    Socket(UnixOffer),
    /// Over a pseudo-terminal.
    Terminal(Box<TerminalOffer>),
}

impl Offer {
    /// Offers a bus with these bitrates at `place`. `is_fd` enables CAN FD frames. With `is_servo_line`, a
    /// pseudo-terminal carries unmodified servo packets.
    ///
    /// # Errors
    /// Returns an error if the address is in use, or if the kernel refuses.
    pub fn open(place: Place<'_>, rates: Rates, is_fd: bool, is_servo_line: bool) -> io::Result<Self> {
        Ok(match place {
            Place::Socket(name) => Self::Socket(UnixOffer::open(name)?),
            Place::Terminal(path) => {
                Self::Terminal(Box::new(TerminalOffer::open(path, rates, is_fd, is_servo_line)?))
            }
        })
    }

    /// Fills `frames` with frames sent by the programs on the bus, each with its send time, and returns their
    /// number. Further frames stay queued in the kernel's buffer.
    pub fn receive(&mut self, frames: &mut [Received]) -> usize {
        match self {
            Self::Socket(offer) => offer.receive(frames),
            Self::Terminal(offer) => offer.receive(frames),
        }
    }

    /// Queues a frame for the programs until the next [`flush`](Self::flush).
    pub fn deliver(&mut self, received: &Received) {
        match self {
            Self::Socket(offer) => offer.deliver(received),
            Self::Terminal(offer) => offer.deliver(&received.frame),
        }
    }

    /// Queues a report of the simulated controller for the programs, with the number of frames that did not
    /// fit into its queue.
    pub fn report(&mut self, report: &Report, unsent: u8) {
        match self {
            Self::Socket(offer) => offer.report(report, unsent),
            Self::Terminal(offer) => offer.report(report),
        }
    }

    /// Takes the interface down or brings it up. For a terminal, simulates unplugging or plugging in the
    /// adapter.
    pub fn set_link_down(&mut self, is_down: bool) {
        match self {
            Self::Socket(offer) if is_down => offer.down(),
            // the controller's report announces that the interface is up
            Self::Socket(_) => {}
            Self::Terminal(offer) => offer.set_link_down(is_down),
        }
    }

    /// Sends all queued frames and reports. Returns the number of frames lost because a receiver had no room.
    pub fn flush(&mut self) -> u64 {
        match self {
            Self::Socket(offer) => offer.flush(),
            Self::Terminal(offer) => offer.flush(),
        }
    }
}
