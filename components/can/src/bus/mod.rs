//! Bits of frames, the time budget of a cycle, and the bus interface with its implementations: simulated
//! buses, SocketCAN, and serial lines.

pub mod bits;
pub mod budget;
pub mod offered;
pub mod real;
pub mod report;
pub mod servo_line;
pub mod simulated;
pub mod slcan;
pub mod socket;
mod terminal;
pub(crate) mod time;

use crate::frame::Frame;

/// Frame received from a bus, with its receive time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// Content of the frame.
    pub frame: Frame,
    /// Receive time of the last bit, ns.
    pub time_ns: u64,
}

/// A bus as seen by one node. Frames are exchanged in whole batches, without blocking or allocating.
///
/// ```
/// use motorium_can::{Bus, Frame, Id, Rates, Received, SimulatedBus};
///
/// let mut bus = SimulatedBus::new(Rates { nominal: 1_000_000, fast: 1_000_000 }, 2, 16);
/// let hello = Frame::classic(Id::Standard(0x141), &[1, 2]);
/// assert_eq!(bus.port(0, 0).send(&[hello]), 1);
/// let mut inbox = [Received::default(); 4];
/// assert_eq!(bus.port(1, 50_000).receive(&mut inbox), 0, "its bits are still on the way");
/// assert_eq!(bus.port(1, 100_000).receive(&mut inbox), 1);
/// assert_eq!(inbox[0].frame, hello);
/// ```
pub trait Bus {
    /// Sends frames in the given order, and returns the number of accepted frames. The remaining frames are
    /// not queued, because newer commands will replace them.
    fn send(&mut self, frames: &[Frame]) -> usize;

    /// Fills `frames` with received frames in order of arrival, and returns their number.
    fn receive(&mut self, frames: &mut [Received]) -> usize;
}
