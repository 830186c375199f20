//! Bridges between motorium graphs and programs outside of them.
//!
//! A bridge is a component of the graph: what goes out is a copy, what comes in is checked, limited and stamped by the
//! bridge. No other component meets a value of a foreign program.

mod iceoryx2;

use motorium::worker::Kind;

pub use iceoryx2::{Feed, FeedError, Iceoryx2Bridge, Iceoryx2BridgeConfig, InboundConfig};

/// The kinds of this crate, for a program that hosts them.
///
/// ```
/// let names: Vec<_> = motorium_bridges::kinds().iter().map(|kind| kind.name).collect();
/// assert!(names.contains(&"bridge.iceoryx2"));
/// ```
pub fn kinds() -> [Kind; 1] {
    [Kind::of::<Iceoryx2Bridge>()]
}
