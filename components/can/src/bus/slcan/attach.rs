//! Adapters on serial lines as kernel interfaces: attaches the kernel driver to the line.

#![allow(unsafe_code)] // line disciplines and interface flags need ioctl calls

use std::fs::File;
use std::io::{self, Write as _};
use std::os::fd::AsRawFd as _;

use super::{SETTLE, answers, bitrate};
use crate::bus::socket::OpenError;
use crate::bus::terminal;

/// Adapter on a serial line, which is a kernel interface until this value is dropped.
///
/// ```no_run
/// use motorium_can::Attached;
///
/// let attached = Attached::open("/dev/ttyACM0", 1_000_000)?;
/// attached.bring_up()?;
/// println!("{}", attached.name());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Attached {
    name: String,
    _line: File,
}

/// Number of the slcan line discipline, from `linux/tty.h`.
const N_SLCAN: libc::c_int = 17;
/// Request for the interface name of a line with this discipline, from `linux/sockios.h`.
const SIOCGIFNAME: libc::Ioctl = 0x8910;

fn done(result: libc::c_int) -> io::Result<()> {
    if result < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

impl Attached {
    /// Configures the adapter on a serial line for this bitrate, and attaches the kernel driver to the line.
    ///
    /// # Errors
    /// Returns an error if the line does not exist, if the adapter does not support the bitrate, or if the
    /// kernel lacks the driver or refuses.
    pub fn open(path: &str, rate: u32) -> Result<Self, OpenError> {
        let refused = |error| OpenError::Refused(path.into(), error);
        let bitrate = bitrate(rate).ok_or_else(|| OpenError::NoBitrate { name: path.into(), rate })?;
        let mut line = terminal::open(path, libc::B1000000)?;
        line.write_all(format!("\rC\r{bitrate}O\r").as_bytes()).map_err(refused)?;
        let _ = answers(&mut line, SETTLE, 4);
        let (discipline, mut name) = (N_SLCAN, [0_u8; libc::IFNAMSIZ]);
        // SAFETY: the descriptor is open; the first call reads a number, the second one fills a name of this
        // length.
        let attached = unsafe {
            done(libc::ioctl(line.as_raw_fd(), libc::TIOCSETD, &raw const discipline))
                .and_then(|()| done(libc::ioctl(line.as_raw_fd(), SIOCGIFNAME, name.as_mut_ptr())))
        };
        attached.map_err(|error| match error.raw_os_error() {
            Some(libc::EINVAL) => refused(io::Error::new(
                io::ErrorKind::Unsupported,
                "the kernel has no driver for slcan: `sudo modprobe slcan`",
            )),
            _ => refused(error),
        })?;
        let name = name.split(|byte| *byte == 0).next().unwrap_or_default();
        Ok(Self { name: String::from_utf8_lossy(name).into_owned(), _line: line })
    }

    /// Name of the interface, such as `can0`, or `slcan0` with older kernels.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Brings the interface up.
    ///
    /// # Errors
    /// Returns an error if the kernel refuses, since the call requires network administration privileges.
    pub fn bring_up(&self) -> io::Result<()> {
        let socket = std::net::UdpSocket::bind("0.0.0.0:0")?;
        // SAFETY: a request is a plain structure, valid when zeroed; its name is shorter than its buffer and
        // is terminated by zero. The calls read and fill a request, and the flags are read only after the
        // kernel has filled them.
        unsafe {
            let mut request: libc::ifreq = core::mem::zeroed();
            for (place, byte) in request.ifr_name.iter_mut().zip(self.name.bytes()).take(libc::IFNAMSIZ - 1) {
                *place = byte as libc::c_char;
            }
            done(libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS, &raw mut request))?;
            request.ifr_ifru.ifru_flags |= libc::IFF_UP as libc::c_short;
            done(libc::ioctl(socket.as_raw_fd(), libc::SIOCSIFFLAGS, &raw const request))
        }
    }
}
