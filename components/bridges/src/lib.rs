//! Bridges between motorium graphs and other programs.
//!
//! A bridge is a component of the graph. It sends copies of outgoing values. It validates, rate-limits and
//! stamps incoming values. Other components never read values of foreign programs directly.

pub mod foxglove;
mod iceoryx2;
pub mod parquet;
pub mod quantities;
pub mod recording;

use motorium::worker::Kind;

pub use iceoryx2::{Feed, Iceoryx2Bridge, Iceoryx2BridgeConfig, InboundConfig, ServiceError};

/// Returns the component kinds of this crate, which a host program registers.
///
/// ```
/// let names: Vec<_> = motorium_bridges::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"bridge.iceoryx2") && names.contains(&"log.record"));
/// ```
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<Iceoryx2Bridge>(), Kind::of::<recording::Record>()]
}
