//! Sends and receives batches of frames in one system call, with the kernel's receive timestamps.

#![allow(unsafe_code)] // sendmmsg, recvmmsg and ppoll are libc calls that no safe crate offers for CAN

use core::mem::{MaybeUninit, zeroed};
use core::ptr::null_mut;
use std::io;
use std::os::fd::{AsRawFd, BorrowedFd};

use libc::{c_int, c_void, canfd_frame, iovec, mmsghdr, timespec};

use super::raw;
use crate::frame::Frame;

/// Frames per system call.
pub(super) const BATCH: usize = 32;
/// Size of a classic frame in the kernel's format, bytes; a CAN FD frame has 72.
const CLASSIC: usize = size_of::<libc::can_frame>();

/// Buffer for the control messages of a frame: three timestamps and a count, each with a header. It has the
/// alignment of a header.
#[repr(C, align(8))]
#[derive(Clone, Copy)]
struct Control([u8; 128]);

/// Frame as delivered by the kernel.
#[derive(Clone, Copy)]
pub(super) struct Arrival {
    pub(super) frame: canfd_frame,
    /// `true` for a CAN FD frame.
    pub(super) is_fd: bool,
    /// Receive time in the kernel, ns on the wall clock; 0 if unavailable.
    pub(super) wall_ns: u64,
    /// Receive time in the controller, ns on its hardware clock; 0 if unavailable.
    pub(super) hardware_ns: u64,
    /// Number of frames dropped so far because the socket buffer was full.
    pub(super) overflows: Option<u32>,
}

/// Buffers of a socket, allocated once.
pub(super) struct Batch {
    frames: Box<[canfd_frame; BATCH]>,
    vectors: Box<[iovec; BATCH]>,
    controls: Box<[Control; BATCH]>,
    headers: Box<[mmsghdr; BATCH]>,
}

impl Batch {
    pub(super) fn new() -> Self {
        // SAFETY: these are plain structures of numbers and pointers, for which zero is a valid value.
        let (frame, vector, header): (canfd_frame, iovec, mmsghdr) =
            unsafe { (zeroed(), zeroed(), zeroed()) };
        Self {
            frames: Box::new([frame; BATCH]),
            vectors: Box::new([vector; BATCH]),
            controls: Box::new([Control([0; 128]); BATCH]),
            headers: Box::new([header; BATCH]),
        }
    }

    /// Points the headers at the buffers. With `control`, includes the control buffers needed for receiving.
    fn point(&mut self, count: usize, length: impl Fn(usize) -> usize, control: bool) {
        for i in 0..count {
            self.vectors[i] =
                iovec { iov_base: (&raw mut self.frames[i]).cast::<c_void>(), iov_len: length(i) };
            let header = &mut self.headers[i].msg_hdr;
            (header.msg_name, header.msg_namelen) = (null_mut(), 0);
            (header.msg_iov, header.msg_iovlen) = (&raw mut self.vectors[i], 1 as _);
            (header.msg_control, header.msg_controllen) = if control {
                ((&raw mut self.controls[i]).cast::<c_void>(), size_of::<Control>() as _)
            } else {
                (null_mut(), 0 as _)
            };
            (header.msg_flags, self.headers[i].msg_len) = (0, 0);
        }
    }

    /// Sends up to [`BATCH`] frames in the given order. Returns the number of accepted frames, or the error
    /// if none was accepted.
    pub(super) fn send(&mut self, socket: BorrowedFd<'_>, frames: &[Frame]) -> io::Result<usize> {
        let count = frames.len().min(BATCH);
        for (place, frame) in self.frames.iter_mut().zip(frames) {
            *place = raw::to_kernel(frame);
        }
        let is_fd = |i: usize| frames[i].form != crate::frame::Form::Classic;
        self.point(count, |i| if is_fd(i) { size_of::<canfd_frame>() } else { CLASSIC }, false);
        // SAFETY: `count` headers have just been pointed at buffers of this value, which live throughout the
        // call; the kernel only reads the frames.
        let sent = unsafe {
            libc::sendmmsg(socket.as_raw_fd(), self.headers.as_mut_ptr(), count as _, libc::MSG_DONTWAIT)
        };
        usize::try_from(sent).map_err(|_| io::Error::last_os_error())
    }

    /// Receives up to [`BATCH`] available frames. Returns the error `WouldBlock` if there are none.
    pub(super) fn receive(&mut self, socket: BorrowedFd<'_>, most: usize) -> io::Result<usize> {
        let count = most.min(BATCH);
        self.point(count, |_| size_of::<canfd_frame>(), true);
        // SAFETY: as in `send`; the kernel writes at most the given lengths into the frames and the control
        // buffers.
        let received = unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                self.headers.as_mut_ptr(),
                count as _,
                libc::MSG_DONTWAIT,
                null_mut(),
            )
        };
        usize::try_from(received).map_err(|_| io::Error::last_os_error())
    }

    /// Returns the received frame; `None` if its length is invalid.
    pub(super) fn arrival(&self, index: usize) -> Option<Arrival> {
        let length = self.headers[index].msg_len as usize;
        let is_fd = length == size_of::<canfd_frame>();
        if length != CLASSIC && !is_fd {
            return None;
        }
        let mut arrival =
            Arrival { frame: self.frames[index], is_fd, wall_ns: 0, hardware_ns: 0, overflows: None };
        let header = &self.headers[index].msg_hdr;
        // SAFETY: the kernel has filled the control buffer of this header and set its length; the macros stay
        // within that length. Each part is read only up to its own length, and unaligned.
        unsafe {
            let mut part = libc::CMSG_FIRSTHDR(header);
            while let Some(found) = part.as_ref() {
                let data = libc::CMSG_DATA(part);
                let holds = |bytes: usize| found.cmsg_len >= libc::CMSG_LEN(bytes as u32) as usize;
                match (found.cmsg_level, found.cmsg_type) {
                    (libc::SOL_SOCKET, libc::SO_TIMESTAMPING) if holds(size_of::<[timespec; 3]>()) => {
                        let [kernel, _, hardware] = data.cast::<[timespec; 3]>().read_unaligned();
                        (arrival.wall_ns, arrival.hardware_ns) = (nanoseconds(kernel), nanoseconds(hardware));
                    }
                    (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) if holds(size_of::<u32>()) => {
                        arrival.overflows = Some(data.cast::<u32>().read_unaligned());
                    }
                    _ => {}
                }
                part = libc::CMSG_NXTHDR(header, part);
            }
        }
        Some(arrival)
    }
}

fn nanoseconds(time: timespec) -> u64 {
    u64::try_from(time.tv_sec).unwrap_or(0) * 1_000_000_000 + u64::try_from(time.tv_nsec).unwrap_or(0)
}

/// Poll set of several sockets.
pub(crate) struct Waiting {
    sockets: Vec<libc::pollfd>,
}

impl Waiting {
    /// Creates a poll set with room for `sockets` sockets.
    pub(crate) fn with_capacity(sockets: usize) -> Self {
        Self { sockets: Vec::with_capacity(sockets) }
    }

    /// Waits until one of the sockets is readable, a signal arrives, or `timeout_ns` has elapsed. Without
    /// sockets, it sleeps.
    pub(crate) fn wait<'a>(&mut self, sockets: impl Iterator<Item = BorrowedFd<'a>>, timeout_ns: u64) {
        self.sockets.clear();
        let polled =
            |fd: BorrowedFd<'_>| libc::pollfd { fd: fd.as_raw_fd(), events: libc::POLLIN, revents: 0 };
        self.sockets.extend(sockets.map(polled));
        let timeout = timespec {
            tv_sec: (timeout_ns / 1_000_000_000) as _,
            tv_nsec: (timeout_ns % 1_000_000_000) as _,
        };
        // SAFETY: the descriptors, whose number is passed, and the time live throughout the call. An error
        // means that a signal arrived; the caller checks the clock anyway.
        unsafe {
            libc::ppoll(
                self.sockets.as_mut_ptr(),
                self.sockets.len() as _,
                &raw const timeout,
                core::ptr::null(),
            );
        }
    }
}

/// Clears the pending error that the kernel would return from the next call on the socket.
pub(super) fn take_error(socket: BorrowedFd<'_>) {
    let mut error = MaybeUninit::<c_int>::zeroed();
    let mut length = size_of::<c_int>() as libc::socklen_t;
    // SAFETY: the buffer has the length passed to the call, and lives throughout the call.
    unsafe {
        libc::getsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_ERROR,
            error.as_mut_ptr().cast(),
            &raw mut length,
        );
    }
}

/// Sends one raw classic frame.
pub(super) fn send_raw(socket: BorrowedFd<'_>, frame: &canfd_frame) -> io::Result<()> {
    // SAFETY: a CAN FD frame begins like a classic one, and only the length of a classic frame is read.
    let sent = unsafe { libc::write(socket.as_raw_fd(), core::ptr::from_ref(frame).cast(), CLASSIC) };
    if sent < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}
