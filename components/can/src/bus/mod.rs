//! Buses: the bits of frames, the budget of a cycle, the [`Bus`] trait, and simulated, kernel and serial
//! buses.

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

/// A frame that was received, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// The frame.
    pub frame: Frame,
    /// Time at which its last bit was received, ns.
    pub time_ns: u64,
}

/// A bus as a participant uses it: whole batches, never waiting, without allocation.
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
    /// Sends frames in this order and returns the number accepted. The others are discarded, because newer
    /// commands follow.
    fn send(&mut self, frames: &[Frame]) -> usize;

    /// Moves received frames into `frames`, in their order, and returns their number.
    fn receive(&mut self, frames: &mut [Received]) -> usize;
}
