//! Simulated bus over a unix socket: both ends.
//!
//! The abstract name of the socket contains the user ID and leaves no file behind. Each end checks that the
//! other belongs to the same user. Programs on one bus share an interface, as in the kernel: each receives
//! the frames sent by the others.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::io::Errno;
use rustix::net::sockopt::socket_peercred;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketAddrUnix, SocketFlags, SocketType, accept_with, bind, connect,
    listen, recv, send, socket_with,
};

use super::records::{BATCH, Batch, RECORD, Record};
use crate::bus::report::Report;
use crate::bus::socket::{Condition, OpenError, SocketCounts};
use crate::bus::time::{Retry, monotonic_ns};
use crate::bus::{Bus, Received};
use crate::frame::{Frame, Id};

/// Maximum number of programs that share a bus.
const PROGRAMS: usize = 8;

fn address(name: &str) -> io::Result<SocketAddrUnix> {
    let user = rustix::process::getuid().as_raw();
    Ok(SocketAddrUnix::new_abstract_name(format!("motorium-can-{user}-{name}").as_bytes())?)
}

fn new_socket() -> io::Result<OwnedFd> {
    let flags = SocketFlags::NONBLOCK | SocketFlags::CLOEXEC;
    Ok(socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, flags, None)?)
}

/// Returns `true` if the other end of a socket is a program of this user.
fn is_ours(socket: &OwnedFd) -> bool {
    socket_peercred(socket).is_ok_and(|peer| peer.uid == rustix::process::getuid())
}

/// Simulator's end of the bus.
#[derive(Debug)]
pub struct UnixOffer {
    listener: OwnedFd,
    programs: Vec<OwnedFd>,
    batch: Batch,
    unread: Box<[u8; RECORD * BATCH]>,
    /// Range of the records of a message that have not been read yet.
    rest: (usize, usize),
    /// Records lost for lack of room, and invalid records.
    lost: u64,
}

impl UnixOffer {
    /// Offers a bus under this name.
    ///
    /// # Errors
    /// Returns an error if another program already offers the bus, or if the kernel refuses.
    pub fn open(name: &str) -> io::Result<Self> {
        let listener = new_socket()?;
        bind(&listener, &address(name)?).map_err(|error| match error {
            Errno::ADDRINUSE => io::Error::new(
                io::ErrorKind::AddrInUse,
                "another program of this user already offers this bus",
            ),
            error => error.into(),
        })?;
        listen(&listener, PROGRAMS as i32)?;
        Ok(Self {
            listener,
            programs: Vec::with_capacity(PROGRAMS),
            batch: Batch::new(),
            unread: Box::new([0; RECORD * BATCH]),
            rest: (0, 0),
            lost: 0,
        })
    }

    fn admit(&mut self) {
        while self.programs.len() < PROGRAMS {
            let Ok(program) = accept_with(&self.listener, SocketFlags::NONBLOCK | SocketFlags::CLOEXEC)
            else {
                return;
            };
            if is_ours(&program) {
                self.programs.push(program);
            }
        }
    }

    /// Reads the next message of any program. Returns `false` if there is none.
    fn fill(&mut self) -> bool {
        let Self { programs, unread, rest, .. } = self;
        let mut index = 0;
        while index < programs.len() {
            match recv(&programs[index], &mut unread[..], RecvFlags::DONTWAIT) {
                Ok((length @ 1.., _)) => {
                    let bytes = &unread[..length];
                    *rest = (0, length / RECORD);
                    for other in programs.iter().enumerate().filter(|(other, _)| *other != index) {
                        let flags = SendFlags::DONTWAIT | SendFlags::NOSIGNAL;
                        // a program that does not keep up misses frames of the others
                        let _ = send(other.1, bytes, flags);
                    }
                    return true;
                }
                Err(Errno::AGAIN | Errno::INTR) => index += 1,
                // the program has ended
                Ok(_) | Err(_) => drop(programs.swap_remove(index)),
            }
        }
        false
    }

    pub(super) fn receive(&mut self, frames: &mut [Received]) -> usize {
        self.admit();
        let mut count = 0;
        while count < frames.len() {
            if self.rest.0 == self.rest.1 && !self.fill() {
                break;
            }
            let place = RECORD * self.rest.0;
            self.rest.0 += 1;
            match Record::decode(&self.unread[place..place + RECORD]) {
                Some(Record::Frame(received)) => {
                    frames[count] = received;
                    count += 1;
                }
                _ => self.lost += 1,
            }
        }
        count
    }

    fn push(&mut self, record: &Record) {
        if self.batch.is_full() {
            self.send();
        }
        self.batch.push(record);
    }

    fn send(&mut self) {
        if self.batch.count > 0 {
            for program in &self.programs {
                let sent = send(program, self.batch.bytes(), SendFlags::DONTWAIT | SendFlags::NOSIGNAL);
                self.lost += if sent.is_ok() { 0 } else { self.batch.count as u64 };
            }
            self.batch.count = 0;
        }
    }

    pub(super) fn deliver(&mut self, received: &Received) {
        self.push(&Record::Frame(*received));
    }

    pub(super) fn report(&mut self, report: &Report, unsent: u8) {
        self.push(&Record::Report(*report, unsent));
    }

    pub(super) fn down(&mut self) {
        self.push(&Record::Down);
    }

    pub(super) fn flush(&mut self) -> u64 {
        self.send();
        core::mem::take(&mut self.lost)
    }
}

/// Simulated bus of another program, over a unix socket.
///
/// ```
/// use motorium_can::bus::offered::{Offer, Place, UnixBus};
/// use motorium_can::{Bus, Frame, Id, Rates, Received};
///
/// let name = format!("example-{}", std::process::id());
/// let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
/// let mut offer = Offer::open(Place::Socket(&name), rates, false, false)?;
/// let mut bus = UnixBus::open(&name)?;
/// let hello = Frame::classic(Id::Standard(1), &[0xff; 8]);
/// assert_eq!(bus.send(&[hello]), 1);
/// let mut inbox = [Received::default(); 4];
/// assert_eq!((offer.receive(&mut inbox), inbox[0].frame), (1, hello));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct UnixBus {
    name: String,
    socket: OwnedFd,
    batch: Batch,
    unread: Box<[u8; RECORD * BATCH]>,
    rest: (usize, usize),
    filters: Vec<Id>,
    condition: Condition,
    counts: SocketCounts,
    retry: Retry,
}

/// Frame or report from a bus.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Traffic {
    /// Frame.
    Frame(Received),
    /// Report of the controller.
    Report(Report),
}

fn connected(name: &str) -> Result<OwnedFd, OpenError> {
    let refused = |error: io::Error| match error.kind() {
        io::ErrorKind::ConnectionRefused | io::ErrorKind::NotFound => OpenError::NotOffered(name.into()),
        _ => OpenError::Refused(format!("unix:{name}"), error),
    };
    let socket = new_socket().map_err(refused)?;
    connect(&socket, &address(name).map_err(refused)?).map_err(|error| refused(error.into()))?;
    if is_ours(&socket) {
        return Ok(socket);
    }
    Err(refused(io::Error::new(io::ErrorKind::PermissionDenied, "another user offers this bus")))
}

impl UnixBus {
    /// Opens the bus that another program of this user offers under this name.
    ///
    /// # Errors
    /// Returns an error if no program offers the bus, or if the kernel refuses.
    pub fn open(name: &str) -> Result<Self, OpenError> {
        Ok(Self {
            name: format!("unix:{name}"),
            socket: connected(name)?,
            batch: Batch::new(),
            unread: Box::new([0; RECORD * BATCH]),
            rest: (0, 0),
            filters: Vec::new(),
            condition: Condition::Active,
            counts: SocketCounts::default(),
            retry: Retry::default(),
        })
    }

    /// Returns the name of the bus, as in a drive table.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the condition of the bus, from the reports of the simulated controller and the presence of the
    /// program.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Returns the counters of the bus.
    pub fn counts(&self) -> &SocketCounts {
        &self.counts
    }

    /// Restricts reception to frames with these identifiers.
    pub fn receive_only(&mut self, ids: &[Id]) {
        self.filters = ids.to_vec();
    }

    /// Records that the simulating program has ended.
    fn lose(&mut self) {
        if self.condition != Condition::Gone {
            self.counts.down += 1;
            self.condition = Condition::Gone;
            self.retry.begin();
        }
    }

    fn look_again(&mut self) {
        if self.condition == Condition::Gone
            && self.retry.is_due()
            && let Some(Ok(socket)) = self.name.strip_prefix("unix:").map(connected)
        {
            (self.socket, self.condition, self.rest) = (socket, Condition::Active, (0, 0));
        }
    }

    /// Reads the next message. Returns `false` if there is none.
    fn fill(&mut self) -> bool {
        match recv(&self.socket, &mut self.unread[..], RecvFlags::DONTWAIT) {
            Ok((length @ 1.., _)) => {
                self.rest = (0, length / RECORD);
                return true;
            }
            Err(Errno::AGAIN | Errno::INTR) => {}
            Ok(_) | Err(_) => self.lose(),
        }
        false
    }

    /// Returns the next frame or report on the bus, ignoring the filters; `None` if none has arrived.
    pub(crate) fn next(&mut self) -> Option<Traffic> {
        while self.condition != Condition::Gone {
            if self.rest.0 == self.rest.1 && !self.fill() {
                return None;
            }
            let place = RECORD * self.rest.0;
            self.rest.0 += 1;
            match Record::decode(&self.unread[place..place + RECORD]) {
                Some(Record::Frame(received)) => return Some(Traffic::Frame(received)),
                Some(Record::Report(report, unsent)) => {
                    self.take(&report, unsent);
                    return Some(Traffic::Report(report));
                }
                Some(Record::Down) => {
                    self.counts.down += u64::from(self.condition != Condition::Down);
                    self.condition = Condition::Down;
                }
                None => self.counts.other += 1,
            }
        }
        None
    }

    fn take(&mut self, report: &Report, unsent: u8) {
        // the initial state before the first report is not an event
        if *report != (Report { state: Some(crate::ErrorState::Active), ..Report::default() }) {
            self.counts.take(report, self.condition);
        }
        self.counts.queue_full += u64::from(unsent > 0);
        self.condition = report.state.map_or(self.condition, Condition::from);
    }
}

impl AsFd for UnixBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }
}

impl Bus for UnixBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        self.look_again();
        if !self.condition.can_send() {
            return 0;
        }
        let (mut sent, time_ns) = (0, monotonic_ns());
        for frames in frames.chunks(BATCH) {
            self.batch.count = 0;
            for frame in frames {
                self.batch.push(&Record::Frame(Received { frame: *frame, time_ns }));
            }
            match send(&self.socket, self.batch.bytes(), SendFlags::DONTWAIT | SendFlags::NOSIGNAL) {
                Ok(_) => sent += frames.len(),
                Err(Errno::AGAIN | Errno::NOBUFS | Errno::INTR) => {
                    self.counts.queue_full += 1;
                    return sent;
                }
                Err(_) => {
                    self.lose();
                    return sent;
                }
            }
        }
        sent
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        let mut count = 0;
        while count < frames.len() {
            match self.next() {
                Some(Traffic::Frame(received)) => {
                    let id = received.frame.id;
                    if self.filters.is_empty() || self.filters.contains(&id) {
                        frames[count] = received;
                        count += 1;
                    }
                }
                Some(Traffic::Report(_)) => {}
                None => break,
            }
        }
        count
    }
}
