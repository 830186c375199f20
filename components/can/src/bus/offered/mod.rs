//! Simulated buses that other programs use: over a unix socket, or over a pseudo-terminal as an adapter with
//! slcan would offer them, on which the driver of the kernel can sit, or as a line of serial servos.
//!
//! A [`Place`] names one: `unix:NAME` or `pty:PATH`. The program that simulates the bus opens an [`Offer`]
//! there; the others open it as they open any bus, by [`RealBus`](crate::RealBus).

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

/// The place at which a simulated bus is offered.
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
    /// A unix socket of this user, by its name.
    Socket(&'a str),
    /// A pseudo-terminal, by the path of a link to it.
    Terminal(&'a str),
}

impl<'a> Place<'a> {
    /// The place in the name of an interface; `None` if it names an interface of the kernel or a serial line.
    pub fn from_interface(interface: &'a str) -> Option<Self> {
        let socket = interface.strip_prefix("unix:").map(Place::Socket);
        socket.or_else(|| interface.strip_prefix("pty:").map(Place::Terminal))
    }
}

/// A simulated bus as its simulator offers it to other programs.
#[derive(Debug)]
pub enum Offer {
    /// Over a unix socket.
    Socket(UnixOffer),
    /// Over a pseudo-terminal.
    Terminal(Box<TerminalOffer>),
}

impl Offer {
    /// Offers a bus of these rates; a line of serial servos carries packets as they are.
    ///
    /// # Errors
    /// The address is in use, or the kernel refuses.
    pub fn open(place: Place<'_>, rates: Rates, is_fd: bool, is_servo_line: bool) -> io::Result<Self> {
        Ok(match place {
            Place::Socket(name) => Self::Socket(UnixOffer::open(name)?),
            Place::Terminal(path) => {
                Self::Terminal(Box::new(TerminalOffer::open(path, rates, is_fd, is_servo_line)?))
            }
        })
    }

    /// Receives frames from programs, each with its time, and returns their number. Others remain in the
    /// programs' buffers, as far as the kernel has room.
    pub fn receive(&mut self, frames: &mut [Received]) -> usize {
        match self {
            Self::Socket(offer) => offer.receive(frames),
            Self::Terminal(offer) => offer.receive(frames),
        }
    }

    /// Lets the programs receive a frame, by the next [`flush`](Self::flush).
    pub fn deliver(&mut self, received: &Received) {
        match self {
            Self::Socket(offer) => offer.deliver(received),
            Self::Terminal(offer) => offer.deliver(&received.frame),
        }
    }

    /// Lets them receive a report of their controller, with the number of frames that it had no room for.
    pub fn report(&mut self, report: &Report, unsent: u8) {
        match self {
            Self::Socket(offer) => offer.report(report, unsent),
            Self::Terminal(offer) => offer.report(report),
        }
    }

    /// Takes the interface down, or up again: a terminal is unplugged.
    pub fn set_link_down(&mut self, is_down: bool) {
        match self {
            Self::Socket(offer) if is_down => offer.down(),
            // the report of the controller announces its return
            Self::Socket(_) => {}
            Self::Terminal(offer) => offer.set_link_down(is_down),
        }
    }

    /// Delivers frames to programs; returns the number lost for lack of room.
    pub fn flush(&mut self) -> u64 {
        match self {
            Self::Socket(offer) => offer.flush(),
            Self::Terminal(offer) => offer.flush(),
        }
    }
}
