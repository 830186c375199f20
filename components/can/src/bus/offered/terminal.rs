//! Simulated bus over a pseudo-terminal, which replaces an slcan adapter or a line of serial servos.

#![allow(unsafe_code)] // a pseudo-terminal needs a few libc calls, which no crate of the project offers

use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd as _, FromRawFd as _};
use std::os::unix::fs::symlink;
use std::path::PathBuf;

use crate::bus::Received;
use crate::bus::bits::Rates;
use crate::bus::report::Report;
use crate::bus::slcan::{self, LONGEST, Request};
use crate::bus::terminal::{self, Terminal};
use crate::bus::time::monotonic_ns;
use crate::frame::Frame;
use crate::servo;

/// Output buffer for a program that does not read, bytes.
const ROOM: usize = 8192;
/// Maximum time, ns, for which a step waits for the next line of a batch, and for the whole batch.
///
/// A worker of the kernel driver writes a line only after the previous one has been read. Polling once per
/// step would receive one frame per step, but the microcontroller of an adapter reads lines as fast as they
/// arrive.
const NEXT_LINE_NS: u64 = 60_000;
pub(crate) const BATCH_NS: u64 = 250_000;

/// Pseudo-terminal that offers a simulated bus, with a symbolic link to it.
#[derive(Debug)]
pub struct TerminalOffer {
    link: PathBuf,
    rates: Rates,
    is_fd: bool,
    end: Option<End>,
    encoding: Encoding,
    /// Frames lost for lack of room.
    lost: u64,
}

/// Terminal while it is plugged in.
#[derive(Debug)]
struct End {
    line: Terminal,
    /// Other end, kept open so that programs can connect and disconnect.
    _other: File,
}

/// Encoding of frames on the terminal.
#[derive(Debug)]
enum Encoding {
    /// slcan lines; `true` while the channel is open.
    Slcan(slcan::Reader, bool),
    /// Unmodified servo packets.
    Servos(servo::Reader),
}

impl Encoding {
    fn is_slcan(&self) -> bool {
        matches!(self, Self::Slcan(..))
    }
}

/// Opens a pseudo-terminal and creates the symbolic link `link` to it.
fn plug_in(link: &PathBuf) -> io::Result<End> {
    // SAFETY: the calls open a new descriptor, which the file then owns, and fill a buffer of the length
    // passed to them.
    let (master, path) = unsafe {
        let master = libc::posix_openpt(libc::O_RDWR | libc::O_NOCTTY | libc::O_NONBLOCK | libc::O_CLOEXEC);
        if master < 0 {
            return Err(io::Error::last_os_error());
        }
        let master = File::from_raw_fd(master);
        let fd = master.as_raw_fd();
        let mut name = [0; 64];
        if libc::grantpt(fd) != 0
            || libc::unlockpt(fd) != 0
            || libc::ptsname_r(fd, name.as_mut_ptr(), name.len()) != 0
        {
            return Err(io::Error::last_os_error());
        }
        (master, core::ffi::CStr::from_ptr(name.as_ptr()).to_string_lossy().into_owned())
    };
    // raw mode from the beginning: nothing is echoed before a program opens the terminal
    let other = terminal::open(&path, libc::B1000000).map_err(|error| io::Error::other(error.to_string()))?;
    match link.symlink_metadata() {
        // a link left over from a previous run
        Ok(found) if found.is_symlink() => std::fs::remove_file(link)?,
        Ok(_) => {
            let message = "the path exists and is not a terminal link; it is left unchanged";
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
        }
        Err(_) => {}
    }
    symlink(&path, link)?;
    Ok(End { line: Terminal::new(&path, master, ROOM), _other: other })
}

impl TerminalOffer {
    /// Offers a bus at this path.
    ///
    /// # Errors
    /// Returns an error if the path exists and is not a symbolic link, or if the kernel refuses.
    pub fn open(path: &str, rates: Rates, is_fd: bool, is_servo_line: bool) -> io::Result<Self> {
        let link = PathBuf::from(path);
        let encoding = if is_servo_line {
            Encoding::Servos(servo::Reader::default())
        } else {
            Encoding::Slcan(slcan::Reader::default(), false)
        };
        Ok(Self { end: Some(plug_in(&link)?), link, rates, is_fd, encoding, lost: 0 })
    }

    pub(super) fn receive(&mut self, frames: &mut [Received]) -> usize {
        let Some(End { line, .. }) = &mut self.end else { return 0 };
        let (mut count, mut time_ns) = (0, monotonic_ns());
        let until_ns = time_ns + BATCH_NS;
        while count < frames.len() {
            let Some(byte) = line.next_byte() else {
                let left_ns = until_ns.saturating_sub(time_ns).min(NEXT_LINE_NS);
                // after a first frame, more of its batch may follow
                if self.encoding.is_slcan() && count > 0 && left_ns > 0 && line.wait(left_ns) {
                    time_ns = monotonic_ns();
                    continue;
                }
                break;
            };
            let frame = match &mut self.encoding {
                Encoding::Servos(reader) => {
                    reader.push_raw(byte).and_then(|(servo, packet)| Frame::packet(servo, packet))
                }
                Encoding::Slcan(reader, is_open) => match reader.push_request(byte) {
                    Some(Request::Frame(frame)) => {
                        let is_taken = *is_open && (self.is_fd || frame.form == crate::Form::Classic);
                        if !is_taken {
                            write(line, b"\x07");
                        }
                        is_taken.then_some(frame)
                    }
                    Some(request) => {
                        if request == Request::Version {
                            write(line, b"V1000 simulated");
                        }
                        let is_right = match request {
                            Request::Open | Request::Close => {
                                *is_open = request == Request::Open;
                                true
                            }
                            // a bus has a fixed bitrate
                            Request::Bitrate(rate) => rate == self.rates.nominal,
                            Request::DataBitrate(rate) => self.is_fd && rate == self.rates.fast,
                            Request::Nothing | Request::Version => true,
                            Request::Frame(_) | Request::Other => false,
                        };
                        write(line, if is_right { b"\r" } else { b"\x07" });
                        None
                    }
                    None => None,
                },
            };
            if let Some(frame) = frame {
                frames[count] = Received { frame, time_ns };
                count += 1;
            }
        }
        count
    }

    pub(super) fn deliver(&mut self, frame: &Frame) {
        let Some(End { line, .. }) = &mut self.end else { return };
        let is_written = match &self.encoding {
            Encoding::Servos(_) => write(line, frame.data()),
            Encoding::Slcan(_, true) => {
                let mut text = [0; LONGEST];
                let length = slcan::write(frame, &mut text);
                write(line, &text[..length])
            }
            Encoding::Slcan(_, false) => true,
        };
        self.lost += u64::from(!is_written);
    }

    pub(super) fn report(&mut self, report: &Report) {
        if let (Some(End { line, .. }), Encoding::Slcan(_, true)) = (&mut self.end, &self.encoding) {
            let mut text = [0; LONGEST];
            let length = slcan::write_report(report, &mut text);
            write(line, &text[..length]);
        }
    }

    pub(super) fn set_link_down(&mut self, is_down: bool) {
        if is_down {
            self.end = None;
            let _ = std::fs::remove_file(&self.link);
        } else if self.end.is_none() {
            self.end = plug_in(&self.link).ok();
        }
        if let Encoding::Slcan(reader, is_open) = &mut self.encoding {
            (*reader, *is_open) = (slcan::Reader::default(), false);
        }
    }

    pub(super) fn flush(&mut self) -> u64 {
        if let Some(End { line, .. }) = &mut self.end {
            line.flush();
        }
        core::mem::take(&mut self.lost)
    }
}

/// Appends bytes to the output. Returns `false` if there is no room.
fn write(line: &mut Terminal, bytes: &[u8]) -> bool {
    let fits = bytes.len() <= line.room();
    if fits {
        line.push(bytes);
    }
    fits
}

impl Drop for TerminalOffer {
    fn drop(&mut self) {
        // the link is removed with the terminal, unless it now points to another one
        let is_ours = self.end.as_ref().is_some_and(|end| {
            std::fs::read_link(&self.link).is_ok_and(|path| path.as_os_str() == end.line.path())
        });
        if is_ours {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}
