//! Buses of the computer: kernel interfaces, adapters on serial lines, and lines of serial servos.

use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use super::bits::Rates;
use super::offered::{Place, UnixBus};
use super::report::Report;
use super::servo_line::ServoBus;
use super::slcan::SlcanBus;
use super::socket::{Condition, OpenError, SocketBus, SocketCounts};
use super::{Bus, Received};
use crate::frame::{Frame, Id};

/// Real or simulated bus that any program on the computer can open.
///
/// ```no_run
/// use motorium_can::{Rates, RealBus};
///
/// let rates = Rates { nominal: 500_000, fast: 500_000 };
/// let kernel = RealBus::open("can0", &rates, false)?;
/// let serial = RealBus::open("/dev/ttyACM0", &rates, false)?;
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
pub enum RealBus {
    /// Interface of the kernel, such as `can0`.
    Socket(Box<SocketBus>),
    /// Adapter on a serial line, such as `/dev/ttyACM0`.
    Serial(Box<SlcanBus>),
    /// Line of serial servos, such as `/dev/ttyACM0`.
    Servos(Box<ServoBus>),
    /// Simulated bus of another program, such as `unix:can0`.
    Simulated(Box<UnixBus>),
}

impl RealBus {
    /// Opens a bus. `unix:NAME` and `pty:PATH` are simulated buses of another program, other paths are serial
    /// lines, and all other names are kernel interfaces.
    ///
    /// # Errors
    /// Returns an error if the bus cannot be opened or if its bitrates differ.
    pub fn open(name: &str, rates: &Rates, is_fd: bool) -> Result<Self, OpenError> {
        let slcan = |path| SlcanBus::open(path, *rates, is_fd).map(|bus| Self::Serial(Box::new(bus)));
        if let Some(place) = Place::from_interface(name) {
            match place {
                Place::Socket(name) => UnixBus::open(name).map(|bus| Self::Simulated(Box::new(bus))),
                Place::Terminal(path) => slcan(path),
            }
        } else if name.starts_with('/') {
            slcan(name)
        } else {
            SocketBus::open_with(name, rates, is_fd).map(|bus| Self::Socket(Box::new(bus)))
        }
    }

    /// Opens a kernel interface, keeping its configured bitrates.
    ///
    /// # Errors
    /// Returns an error if the interface cannot be opened.
    pub fn of_interface(name: &str) -> Result<Self, OpenError> {
        SocketBus::open(name).map(|bus| Self::Socket(Box::new(bus)))
    }

    /// Opens a line of serial servos at this speed, bit/s.
    ///
    /// # Errors
    /// Returns an error if the line cannot be opened or does not support the speed.
    pub fn open_servos(path: &str, speed: u32) -> Result<Self, OpenError> {
        match Place::from_interface(path) {
            Some(Place::Socket(name)) => UnixBus::open(name).map(|bus| Self::Simulated(Box::new(bus))),
            Some(Place::Terminal(path)) => ServoBus::open(path, speed).map(|bus| Self::Servos(Box::new(bus))),
            None => ServoBus::open(path, speed).map(|bus| Self::Servos(Box::new(bus))),
        }
    }

    /// Returns the name of the bus.
    pub fn name(&self) -> &str {
        match self {
            Self::Socket(bus) => bus.name(),
            Self::Serial(bus) => bus.name(),
            Self::Servos(bus) => bus.name(),
            Self::Simulated(bus) => bus.name(),
        }
    }

    /// Returns the condition of the bus.
    pub fn condition(&self) -> Condition {
        match self {
            Self::Socket(bus) => bus.condition(),
            Self::Serial(bus) => bus.condition(),
            Self::Servos(bus) => bus.condition(),
            Self::Simulated(bus) => bus.condition(),
        }
    }

    /// Returns the counters of the bus.
    pub fn counts(&self) -> &SocketCounts {
        match self {
            Self::Socket(bus) => bus.counts(),
            Self::Serial(bus) => bus.counts(),
            Self::Servos(bus) => bus.counts(),
            Self::Simulated(bus) => bus.counts(),
        }
    }

    /// Returns `true` if the bus has reported an error since it was opened, or is not error-active.
    pub fn has_errors(&self) -> bool {
        let SocketCounts { unacknowledged, disturbed, bus_off, queue_full, down, .. } = *self.counts();
        let errors = [unacknowledged, disturbed, bus_off, queue_full, down];
        self.condition() != Condition::Active || errors.iter().any(|count| *count > 0)
    }

    /// Returns `true` for a bus without a wire, on which frames have no duration.
    pub fn is_virtual(&self) -> bool {
        match self {
            Self::Socket(bus) => bus.is_virtual(),
            Self::Serial(bus) => bus.is_virtual(),
            Self::Servos(bus) => bus.is_virtual(),
            // the simulator reproduces bit times
            Self::Simulated(_) => false,
        }
    }

    /// Restricts reception to frames with these identifiers.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses.
    pub fn receive_only(&mut self, ids: &[Id]) -> io::Result<()> {
        match self {
            Self::Socket(bus) => bus.receive_only(ids),
            Self::Serial(bus) => {
                bus.receive_only(ids);
                Ok(())
            }
            Self::Servos(bus) => {
                bus.receive_only(ids);
                Ok(())
            }
            Self::Simulated(bus) => {
                bus.receive_only(ids);
                Ok(())
            }
        }
    }

    /// Sends a report to the participants of a virtual bus of the kernel.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses, or if the bus is not an interface of the kernel.
    pub fn inject(&self, report: &Report) -> io::Result<()> {
        match self {
            Self::Socket(bus) => bus.inject(report),
            Self::Serial(_) | Self::Servos(_) | Self::Simulated(_) => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

impl AsFd for RealBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Socket(bus) => bus.as_fd(),
            Self::Serial(bus) => bus.as_fd(),
            Self::Servos(bus) => bus.as_fd(),
            Self::Simulated(bus) => bus.as_fd(),
        }
    }
}

impl Bus for RealBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        match self {
            Self::Socket(bus) => bus.send(frames),
            Self::Serial(bus) => bus.send(frames),
            Self::Servos(bus) => bus.send(frames),
            Self::Simulated(bus) => bus.send(frames),
        }
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        match self {
            Self::Socket(bus) => bus.receive(frames),
            Self::Serial(bus) => bus.receive(frames),
            Self::Servos(bus) => bus.receive(frames),
            Self::Simulated(bus) => bus.receive(frames),
        }
    }
}
