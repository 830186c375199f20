//! A UDP socket that reports the arrival time of each datagram and the number of lost datagrams.

#![allow(unsafe_code)] // `recvmsg` has no safe wrapper that reports the receive times of datagrams

use std::io;
use std::mem::{size_of, zeroed};
use std::net::{Ipv6Addr, SocketAddr, SocketAddrV4, SocketAddrV6, UdpSocket};
use std::os::fd::{AsFd, AsRawFd as _, BorrowedFd};

/// Room for the control messages of a datagram: its receive time, and the number of lost datagrams.
const CONTROL: usize = 128;

/// A non-blocking UDP socket.
#[derive(Debug)]
pub(super) struct Socket(UdpSocket);

/// A datagram whose payload has been received.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Datagram {
    /// Length of the payload, including bytes that did not fit.
    pub(super) length: usize,
    /// Address of the sender; `None` if it is not an internet address.
    pub(super) sender: Option<SocketAddr>,
    /// Time at which the kernel received the datagram, ns on `CLOCK_REALTIME`. The kernel starts stamping
    /// shortly after the first socket on the machine requests it. A datagram that arrived earlier is stamped
    /// when it is read.
    pub(super) received_ns: Option<u64>,
    /// Number of datagrams dropped by the kernel for lack of space since the socket was opened, modulo 2^32.
    pub(super) lost: Option<u32>,
}

/// A control buffer with the alignment of its messages.
#[repr(C, align(8))]
struct Control([u8; CONTROL]);

impl Socket {
    /// Binds a socket to an address.
    pub(super) fn bind(address: SocketAddr) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        for option in [libc::SO_TIMESTAMPNS, libc::SO_RXQ_OVFL] {
            let on: libc::c_int = 1;
            // SAFETY: the option is an integer, which lives throughout the call; the descriptor is open.
            let result = unsafe {
                let value = (&raw const on).cast();
                let length = size_of::<libc::c_int>() as libc::socklen_t;
                libc::setsockopt(socket.as_raw_fd(), libc::SOL_SOCKET, option, value, length)
            };
            if result != 0 {
                return Err(io::Error::last_os_error());
            }
        }
        Ok(Self(socket))
    }

    /// Receives the next datagram; `None` if the queue is empty.
    pub(super) fn receive(&self, payload: &mut [u8]) -> io::Result<Option<Datagram>> {
        // SAFETY: zero is a valid value of these plain structures.
        let (mut from, mut message): (libc::sockaddr_storage, libc::msghdr) = unsafe { (zeroed(), zeroed()) };
        let mut control = Control([0; CONTROL]);
        let mut part = libc::iovec { iov_base: payload.as_mut_ptr().cast(), iov_len: payload.len() };
        message.msg_name = (&raw mut from).cast();
        message.msg_namelen = size_of::<libc::sockaddr_storage>() as libc::socklen_t;
        message.msg_iov = &raw mut part;
        message.msg_iovlen = 1;
        message.msg_control = control.0.as_mut_ptr().cast();
        message.msg_controllen = CONTROL as _;
        // SAFETY: every buffer in the header outlives the call and has the stated length.
        let length = unsafe { libc::recvmsg(self.0.as_raw_fd(), &raw mut message, libc::MSG_TRUNC) };
        let Ok(length) = usize::try_from(length) else {
            let error = io::Error::last_os_error();
            return if error.kind() == io::ErrorKind::WouldBlock { Ok(None) } else { Err(error) };
        };
        let (received_ns, lost) = control_data(&message);
        Ok(Some(Datagram { length, sender: sender(&from), received_ns, lost }))
    }
}

impl AsFd for Socket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

/// Extracts the receive time and the number of lost datagrams from the control messages.
fn control_data(message: &libc::msghdr) -> (Option<u64>, Option<u32>) {
    let (mut received_ns, mut lost) = (None, None);
    // SAFETY: the kernel has filled the control buffer of this header and set its length. The macros stay
    // within that length, and each value is read unaligned from the data of a message of its type.
    unsafe {
        let mut head = libc::CMSG_FIRSTHDR(message);
        while let Some(control) = head.as_ref() {
            let data = libc::CMSG_DATA(control);
            match (control.cmsg_level, control.cmsg_type) {
                (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                    let time = data.cast::<libc::timespec>().read_unaligned();
                    received_ns = Some(time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64);
                }
                (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => lost = Some(data.cast::<u32>().read_unaligned()),
                _ => {}
            }
            head = libc::CMSG_NXTHDR(message, control);
        }
    }
    (received_ns, lost)
}

/// Decodes a socket address of the kernel.
fn sender(from: &libc::sockaddr_storage) -> Option<SocketAddr> {
    // SAFETY: the storage is large and aligned enough for both kinds, which are valid for any bytes; the
    // family selects one.
    unsafe {
        match libc::c_int::from(from.ss_family) {
            libc::AF_INET => {
                let four = &*core::ptr::from_ref(from).cast::<libc::sockaddr_in>();
                let address = u32::from_be(four.sin_addr.s_addr).into();
                Some(SocketAddr::V4(SocketAddrV4::new(address, u16::from_be(four.sin_port))))
            }
            libc::AF_INET6 => {
                let six = &*core::ptr::from_ref(from).cast::<libc::sockaddr_in6>();
                let (address, port) = (Ipv6Addr::from(six.sin6_addr.s6_addr), u16::from_be(six.sin6_port));
                Some(SocketAddr::V6(SocketAddrV6::new(address, port, six.sin6_flowinfo, six.sin6_scope_id)))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime, UNIX_EPOCH};

    use super::*;

    fn pair(address: &str) -> Option<(Socket, UdpSocket, SocketAddr)> {
        let free = UdpSocket::bind((address, 0)).ok()?.local_addr().ok()?;
        let sender = UdpSocket::bind((address, 0)).ok()?;
        sender.connect(free).ok()?;
        let own = sender.local_addr().ok()?;
        Some((Socket::bind(free).unwrap(), sender, own))
    }

    fn now_ns() -> u64 {
        SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64
    }

    /// Waits until the kernel stamps datagrams on arrival, which starts some time after the first request.
    fn wait_for_stamps(socket: &Socket, sender: &UdpSocket) {
        for _ in 0..1_000 {
            sender.send(&[0]).unwrap();
            let after = now_ns();
            std::thread::sleep(Duration::from_millis(2));
            let datagram = socket.receive(&mut [0]).unwrap().unwrap();
            if datagram.received_ns.unwrap() <= after {
                return;
            }
        }
        panic!("the kernel does not stamp datagrams on arrival");
    }

    #[test]
    fn datagrams_have_sender_order_and_arrival_time() {
        let (socket, sender, own) = pair("127.0.0.1").unwrap();
        let mut payload = [0; 4];
        assert_eq!(socket.receive(&mut payload).unwrap(), None, "it does not block");
        wait_for_stamps(&socket, &sender);
        let before = now_ns();
        for bytes in [&[1_u8, 2, 3, 4][..], &[5, 6], &[7; 9]] {
            sender.send(bytes).unwrap();
        }
        let after = now_ns();
        let mut received = Vec::new();
        while let Some(datagram) = socket.receive(&mut payload).unwrap() {
            assert_eq!(datagram.sender, Some(own));
            assert!((before..=after).contains(&datagram.received_ns.unwrap()));
            received.push((datagram.length, payload));
        }
        assert_eq!(received, [(4, [1, 2, 3, 4]), (2, [5, 6, 3, 4]), (9, [7; 4])]);
    }

    #[test]
    fn senders_have_addresses_of_either_family() {
        // the machine may lack IPv6
        for (socket, sender, own) in ["127.0.0.1", "::1"].into_iter().filter_map(pair) {
            sender.send(&[1]).unwrap();
            assert_eq!(socket.receive(&mut [0]).unwrap().unwrap().sender, Some(own));
        }
    }

    #[test]
    fn datagrams_dropped_by_the_kernel_are_counted() {
        let (socket, sender, _) = pair("127.0.0.1").unwrap();
        (0..3_000).for_each(|_| drop(sender.send(&[0; 512])));
        let mut taken = 0_u32;
        while socket.receive(&mut [0; 512]).unwrap().is_some() {
            taken += 1;
        }
        assert!(taken < 3_000);
        sender.send(&[0]).unwrap();
        assert_eq!(socket.receive(&mut [0]).unwrap().unwrap().lost, Some(3_000 - taken));
    }
}
