//! Keys of the metadata of channels that motorium writes.

/// The topic from which a channel is derived.
pub const TOPIC: &str = "topic";
/// The layout of a topic's type, as JSON: of channels with all fields of a topic.
pub const LAYOUT: &str = "layout";
