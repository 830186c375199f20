//! Bridges between motorium graphs and programs outside of them.
//!
//! A bridge is a component of the graph: what goes out is a copy, what comes in is checked, limited and stamped by the
//! bridge. No other component meets a value of a foreign program.

mod iceoryx2;

pub use iceoryx2::{Feed, FeedError, Iceoryx2Bridge, Iceoryx2BridgeConfig, InboundConfig};
