//! Bridges between motorium graphs and programs outside of them.
//!
//! A bridge is a component of the graph: what goes out is a copy, what comes in is checked, limited and stamped by the
//! bridge. No other component meets a value of a foreign program.

pub mod foxglove;
mod iceoryx2;
pub mod parquet;
pub mod png;
pub mod quantities;
pub mod recording;

use motorium::worker::Kind;

pub use iceoryx2::{Feed, FeedError, Iceoryx2Bridge, Iceoryx2BridgeConfig, InboundConfig};

/// The kinds of this crate, for a program that hosts them.
///
/// ```
/// let names: Vec<_> = motorium_bridges::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"bridge.iceoryx2") && names.contains(&"log.record"));
/// ```
// Not inlined, as `Kind::of` asks for.
#[inline(never)]
pub fn kinds() -> [Kind; 2] {
    [Kind::of::<Iceoryx2Bridge>(), Kind::of::<recording::Record>()]
}
