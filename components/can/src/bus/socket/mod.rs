//! SocketCAN: buses of the kernel.
//!
//! A [`SocketBus`] sends and receives whole batches with one system call each, without blocking or
//! allocating. Received frames carry the controller's timestamp if available, otherwise the kernel's. Reports
//! of the controller determine the bus's [`Condition`] and are counted.

mod batch;
mod condition;
mod error;
mod hardware;
mod interface;
mod raw;

use std::io;
use std::os::fd::{AsFd, BorrowedFd};

use socketcan::{CanFdSocket, CanFilter, Socket, SocketOptions, timestamp};

use super::report::Report;
use super::{Bus, Received};
use crate::bus::time::{Retry, monotonic_ns, realtime_ns};
use crate::frame::{Frame, Id};
use batch::Batch;
pub(crate) use batch::Waiting;
pub use condition::{Condition, SocketCounts};
pub use error::OpenError;
pub use hardware::HardwareClock;
pub use interface::Interface;
use raw::Delivered;

/// Bus of the kernel.
///
/// ```no_run
/// use motorium_can::{Bus, Frame, Id, Received, SocketBus};
///
/// let mut bus = SocketBus::open("can0")?;
/// assert_eq!(bus.send(&[Frame::classic(Id::Standard(1), &[0xff; 8])]), 1);
/// let mut answers = [Received::default(); 8];
/// let count = bus.receive(&mut answers);
/// for answer in &answers[..count] {
///     println!("{:?}", answer.frame);
/// }
/// println!("{}", bus.condition().name());
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
pub struct SocketBus {
    name: String,
    socket: CanFdSocket,
    batch: Batch,
    filters: Vec<CanFilter>,
    is_virtual: bool,
    hardware: HardwareClock,
    condition: Condition,
    counters: [u8; 2],
    counts: SocketCounts,
    overflows: u32,
    retry: Retry,
}

impl SocketBus {
    /// Opens an interface that is up.
    ///
    /// # Errors
    /// Returns an error if the interface does not exist or is down, or if the kernel refuses.
    pub fn open(name: &str) -> Result<Self, OpenError> {
        let interface = look_up(name)?;
        let socket = CanFdSocket::open(name).map_err(|error| match error.raw_os_error() {
            Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => OpenError::NoCan(error),
            _ => OpenError::Refused(name.into(), error),
        })?;
        let bus = Self {
            name: name.into(),
            socket,
            batch: Batch::new(),
            filters: Vec::new(),
            is_virtual: interface.is_virtual(),
            hardware: HardwareClock::default(),
            condition: interface.state.map_or(Condition::Active, Condition::from),
            counters: [0; 2],
            counts: SocketCounts::default(),
            overflows: 0,
            retry: Retry::default(),
        };
        bus.set_options().map_err(|error| OpenError::Refused(name.into(), error))?;
        Ok(bus)
    }

    /// Opens an interface for a bus with these bitrates. The interface's bitrates are compared if the kernel
    /// reports them.
    ///
    /// # Errors
    /// Returns an error if the interface cannot be opened or if its bitrates differ.
    pub fn open_with(name: &str, rates: &crate::Rates, is_fd: bool) -> Result<Self, OpenError> {
        let interface = look_up(name)?;
        if is_fd && !interface.is_fd {
            return Err(OpenError::Classic(name.into()));
        }
        for (found, expected) in [(interface.bitrate, rates.nominal), (interface.data_bitrate, rates.fast)] {
            if let Some(found) = found
                && found != expected
                && (is_fd || expected == rates.nominal)
            {
                return Err(OpenError::Bitrate { name: name.into(), found, expected });
            }
        }
        Self::open(name)
    }

    fn set_options(&self) -> io::Result<()> {
        let socket = &self.socket;
        socket.set_nonblocking(true)?;
        socket.set_error_filter_accept_all()?;
        socket.set_timestamping(
            timestamp::SOF_TIMESTAMPING_RX_SOFTWARE
                | timestamp::SOF_TIMESTAMPING_SOFTWARE
                | timestamp::SOF_TIMESTAMPING_RX_HARDWARE
                | timestamp::SOF_TIMESTAMPING_RAW_HARDWARE
                | timestamp::SOF_TIMESTAMPING_OPT_CMSG,
        )?;
        socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1)?;
        if !self.filters.is_empty() {
            socket.set_filters(&self.filters)?;
        }
        Ok(())
    }

    /// Restricts reception to frames with these identifiers. Reports of the controller are always received.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses.
    pub fn receive_only(&mut self, ids: &[Id]) -> io::Result<()> {
        let filter = |id: &Id| match id {
            Id::Standard(id) => CanFilter::new((*id).into(), libc::CAN_SFF_MASK | libc::CAN_EFF_FLAG),
            Id::Extended(id) => {
                CanFilter::new(id | libc::CAN_EFF_FLAG, libc::CAN_EFF_MASK | libc::CAN_EFF_FLAG)
            }
        };
        self.filters = ids.iter().map(filter).collect();
        self.socket.set_filters(&self.filters)
    }

    /// Returns the name of the interface.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the condition of the bus.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Returns the transmit and receive error counters of the latest report.
    pub fn counters(&self) -> [u8; 2] {
        self.counters
    }

    /// Returns the counters of the bus.
    pub fn counts(&self) -> &SocketCounts {
        &self.counts
    }

    /// Returns `true` for a virtual bus, which has no bit times, acknowledgement or arbitration.
    pub fn is_virtual(&self) -> bool {
        self.is_virtual
    }

    /// Sends a report to the participants of a virtual bus, as if their controller had generated it.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses.
    pub fn inject(&self, report: &Report) -> io::Result<()> {
        batch::send_raw(self.socket.as_fd(), &raw::of_report(report))
    }

    fn take(&mut self, report: &Report) {
        self.counts.take(report, self.condition);
        self.counters = report.counters.unwrap_or(self.counters);
        self.condition = report.state.map_or(self.condition, Condition::from);
    }

    /// Handles a socket error. Returns `true` if the call may be repeated.
    fn fail(&mut self, error: &io::Error) -> bool {
        let condition = match error.raw_os_error() {
            Some(libc::EINTR) => return true,
            Some(libc::ENETDOWN) => Condition::Down,
            Some(libc::ENXIO | libc::ENODEV | libc::EBADF) => Condition::Gone,
            Some(libc::ENOBUFS) => {
                self.counts.queue_full += 1;
                return false;
            }
            _ => return false,
        };
        if self.condition != Condition::Gone && self.condition != condition {
            self.counts.down += u64::from(self.condition != Condition::Down);
            self.condition = condition;
            self.retry.begin();
        }
        false
    }

    /// Checks once per second whether a missing interface, or one that is down, is available again.
    fn look_again(&mut self) {
        if !self.retry.is_due() {
            return;
        }
        if let Ok(mut opened) = Self::open(&self.name) {
            core::mem::swap(&mut opened.filters, &mut self.filters);
            if opened.set_options().is_ok() {
                (opened.counts, opened.retry) = (self.counts, self.retry);
                core::mem::swap(&mut opened.batch, &mut self.batch);
                *self = opened;
            } else {
                core::mem::swap(&mut opened.filters, &mut self.filters);
            }
        }
    }
}

/// Returns the interface with this name if it is up.
pub(crate) fn look_up(name: &str) -> Result<Interface, OpenError> {
    let all = Interface::all().map_err(|error| OpenError::Refused(name.into(), error))?;
    let mut found: Vec<String> = all.iter().map(Interface::to_string).collect();
    found.sort_unstable();
    let Some(interface) = all.into_iter().find(|interface| interface.name == name) else {
        return Err(OpenError::Missing { name: name.into(), found });
    };
    if interface.is_up { Ok(interface) } else { Err(OpenError::Down(name.into())) }
}

impl AsFd for SocketBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl Bus for SocketBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        if matches!(self.condition, Condition::Gone | Condition::Down) {
            self.look_again();
        }
        if !self.condition.can_send() {
            return 0;
        }
        let mut sent = 0;
        let mut tries = 0;
        while sent < frames.len() && tries < 3 {
            match self.batch.send(self.socket.as_fd(), &frames[sent..]) {
                Ok(count) => sent += count,
                Err(error) => {
                    tries += 1;
                    // An error may still be pending from when the interface was down.
                    let is_old = error.raw_os_error() == Some(libc::ENETDOWN) && tries == 1;
                    if is_old {
                        batch::take_error(self.socket.as_fd());
                    } else if !self.fail(&error) {
                        break;
                    }
                }
            }
        }
        sent
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        let mut count = 0;
        while count < frames.len() {
            let arrived = match self.batch.receive(self.socket.as_fd(), frames.len() - count) {
                Ok(arrived) => arrived,
                Err(error) => {
                    if self.fail(&error) {
                        continue;
                    }
                    break;
                }
            };
            // reads both clocks once for the whole batch
            let (now_ns, wall_ns) = (monotonic_ns(), realtime_ns());
            for index in 0..arrived {
                let Some(arrival) = self.batch.arrival(index) else {
                    self.counts.other += 1;
                    continue;
                };
                if let Some(overflows) = arrival.overflows {
                    self.counts.overflows += u64::from(overflows.wrapping_sub(self.overflows));
                    self.overflows = overflows;
                }
                match raw::of_kernel(&arrival.frame, arrival.is_fd) {
                    Delivered::Data(frame) => {
                        let age_ns =
                            if arrival.wall_ns > 0 { wall_ns.saturating_sub(arrival.wall_ns) } else { 0 };
                        let kernel_ns = now_ns.saturating_sub(age_ns);
                        let time_ns = match arrival.hardware_ns {
                            0 => kernel_ns,
                            hardware_ns => self.hardware.to_computer(hardware_ns, kernel_ns),
                        };
                        frames[count] = Received { frame, time_ns };
                        count += 1;
                    }
                    Delivered::Report(report) => self.take(&report),
                    Delivered::Other => self.counts.other += 1,
                }
            }
            if arrived < batch::BATCH {
                break;
            }
        }
        count
    }
}
