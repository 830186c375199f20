//! Owners of this machine's UDP sockets, to authenticate local senders.
//!
//! UDP carries no credentials, but the kernel lists every socket with its address, its user and its inode.
//! While a socket holds an address, no other user can send from it. A datagram therefore comes from a socket
//! of this user if the socket was listed before the datagram arrived and is still listed under the same
//! inode. The first datagram only introduces its socket: another user's program could have sent it from the
//! same address and exited.

use std::fs::File;
use std::io::{self, Read as _, Seek as _};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

/// The kernel's lists of the UDP sockets of this network namespace.
const LISTS: [&str; 2] = ["/proc/net/udp", "/proc/net/udp6"];
/// Maximum number of remembered senders; a new sender replaces the oldest.
const REMEMBERED: usize = 64;
/// Initial capacity for a list, bytes.
const ROOM: usize = 64 * 1024;

/// Senders on this machine, checked by the owner of their sockets.
#[derive(Debug)]
pub(super) struct Owners {
    user: u32,
    lists: Vec<File>,
    text: Vec<u8>,
    known: Vec<Known>,
    oldest: usize,
}

/// A socket of this user or of root that holds a local address, with the times of two readings of the list,
/// ns on `CLOCK_REALTIME`.
#[derive(Debug, Clone, Copy)]
struct Known {
    address: SocketAddr,
    inode: u64,
    since_ns: u64,
    until_ns: u64,
}

impl Known {
    /// Returns `true` if no other user could have sent from the address at `received_ns`.
    fn covers(&self, received_ns: u64) -> bool {
        self.since_ns < received_ns && received_ns <= self.until_ns
    }
}

/// Ownership of a local datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ownership {
    /// Sent by a socket of this user or of root.
    Own,
    /// The first datagram of a socket of this user or of root.
    Introduced,
    /// Sent by another user, or by a closed socket.
    Foreign,
}

impl Owners {
    /// Opens the kernel's lists.
    pub(super) fn open() -> io::Result<Self> {
        let user = rustix::process::geteuid().as_raw();
        let lists: Vec<File> = LISTS.iter().filter_map(|list| File::open(list).ok()).collect();
        if lists.is_empty() {
            return Err(io::Error::new(io::ErrorKind::NotFound, format!("{} cannot be read", LISTS[0])));
        }
        Ok(Self {
            user,
            lists,
            text: Vec::with_capacity(ROOM),
            known: Vec::with_capacity(REMEMBERED),
            oldest: 0,
        })
    }

    /// Checks the sender of a datagram that was received at `received_ns` and read at `now_ns`, both
    /// `CLOCK_REALTIME`.
    pub(super) fn check(&mut self, sender: SocketAddr, received_ns: u64, now_ns: u64) -> Ownership {
        let known = self.known.iter().position(|known| known.address == sender);
        if let Some(place) = known
            && self.known[place].covers(received_ns)
        {
            return Ownership::Own;
        }
        let Some(inode) = self.find(sender) else { return Ownership::Foreign };
        let introduced = Known { address: sender, inode, since_ns: now_ns, until_ns: now_ns };
        match known {
            Some(place) if self.known[place].inode == inode => {
                let known = &mut self.known[place];
                known.until_ns = now_ns.max(received_ns);
                return if known.covers(received_ns) { Ownership::Own } else { Ownership::Introduced };
            }
            Some(place) => self.known[place] = introduced,
            None if self.known.len() < REMEMBERED => self.known.push(introduced),
            None => {
                self.known[self.oldest] = introduced;
                self.oldest = (self.oldest + 1) % REMEMBERED;
            }
        }
        Ownership::Introduced
    }

    /// Returns the inode of the socket bound to an address, if every candidate is owned by this user or by
    /// root.
    fn find(&mut self, sender: SocketAddr) -> Option<u64> {
        let mut found = None;
        for list in &mut self.lists {
            self.text.clear();
            list.rewind().ok()?;
            list.read_to_end(&mut self.text).ok()?;
            for line in self.text.split(|byte| *byte == b'\n').skip(1).filter(|line| !line.is_empty()) {
                let socket = Listed::parse(line)?;
                if !socket.can_send_from(sender) {
                    continue;
                }
                if socket.user != self.user && socket.user != 0 {
                    return None;
                }
                found = Some(socket.inode);
            }
        }
        found
    }
}

/// One line of a list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Listed {
    address: SocketAddr,
    user: u32,
    inode: u64,
}

impl Listed {
    /// Columns: number, local address, remote address, state, queues, timer, retransmissions, user, timeout,
    /// inode.
    fn parse(line: &[u8]) -> Option<Self> {
        let line = core::str::from_utf8(line).ok()?;
        let mut columns = line.split_ascii_whitespace();
        let (address, port) = columns.nth(1)?.split_once(':')?;
        let user = columns.nth(5)?.parse().ok()?;
        let inode = columns.nth(1)?.parse().ok()?;
        Some(Self {
            address: SocketAddr::new(ip(address)?, u16::from_str_radix(port, 16).ok()?),
            user,
            inode,
        })
    }

    fn can_send_from(&self, sender: SocketAddr) -> bool {
        let (own, sent) = (self.address.ip().to_canonical(), sender.ip().to_canonical());
        self.address.port() == sender.port() && (own.is_unspecified() || own == sent)
    }
}

/// Parses an address from the kernel's list: network-order words in the machine's byte order.
fn ip(text: &str) -> Option<IpAddr> {
    let word = |at: usize| u32::from_str_radix(text.get(at..at + 8)?, 16).ok().map(u32::to_ne_bytes);
    match text.len() {
        8 => Some(Ipv4Addr::from(word(0)?).into()),
        32 => {
            let mut bytes = [0; 16];
            for (part, at) in bytes.chunks_exact_mut(4).zip([0, 8, 16, 24]) {
                part.copy_from_slice(&word(at)?);
            }
            Some(Ipv6Addr::from(bytes).into())
        }
        _ => None,
    }
}

/// Returns `true` if the sender's address belongs to this machine.
pub(super) fn is_of_this_machine(address: IpAddr) -> bool {
    let address = address.to_canonical();
    address.is_loopback() || UdpSocket::bind((address, 0)).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_kernel_are_parsed() {
        let line = b"  461: 0100007F:1F90 00000000:0000 07 00000000:00000000 00:00000000 00000000  3001        0 98765 2 0000 0";
        let listed = Listed::parse(line).unwrap();
        let expected = Listed { address: "127.0.0.1:8080".parse().unwrap(), user: 3001, inode: 98765 };
        assert_eq!(listed, expected);
        assert_eq!(ip("00000000000000000000000001000000"), Some(Ipv6Addr::LOCALHOST.into()));
        assert_eq!((ip("0100"), Listed::parse(b"461: nonsense")), (None, None));
    }

    #[test]
    fn sockets_send_from_their_own_address_and_port() {
        let at = |address: &str| Listed { address: address.parse().unwrap(), user: 0, inode: 1 };
        let sender: SocketAddr = "127.0.0.1:7".parse().unwrap();
        for able in ["127.0.0.1:7", "0.0.0.0:7", "[::]:7", "[::ffff:127.0.0.1]:7"] {
            assert!(at(able).can_send_from(sender), "{able}");
        }
        for unable in ["127.0.0.1:8", "127.0.0.2:7", "[::1]:7"] {
            assert!(!at(unable).can_send_from(sender), "{unable}");
        }
    }

    #[test]
    fn socket_of_this_user_is_introduced_and_then_known() {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let sender = socket.local_addr().unwrap();
        let mut owners = Owners::open().unwrap();
        assert_eq!(owners.check(sender, 5, 10), Ownership::Introduced);
        assert_eq!(owners.check(sender, 9, 11), Ownership::Introduced, "sent before the socket was found");
        assert_eq!(owners.check(sender, 12, 13), Ownership::Own);
        owners.user += 1;
        let expected = if rustix::process::geteuid().is_root() { Ownership::Own } else { Ownership::Foreign };
        assert_eq!(owners.check(sender, 14, 15), expected);
        owners.user -= 1;
        drop(socket);
        assert_eq!(owners.check(sender, 16, 17), Ownership::Foreign, "the socket is closed");
    }

    #[test]
    fn port_taken_over_by_another_socket_is_reintroduced() {
        let mut owners = Owners::open().unwrap();
        let first = UdpSocket::bind("127.0.0.1:0").unwrap();
        let sender = first.local_addr().unwrap();
        owners.check(sender, 1, 2);
        assert_eq!(owners.check(sender, 3, 4), Ownership::Own);
        drop(first);
        let _second = UdpSocket::bind(sender).unwrap();
        assert_eq!(owners.check(sender, 5, 6), Ownership::Introduced);
        assert_eq!(owners.check(sender, 7, 8), Ownership::Own);
    }
}
