//! Metadata keys of channels written by motorium.

/// The topic from which a channel is derived.
pub const TOPIC: &str = "topic";
/// The layout of a topic's type as JSON, for channels with all fields of a topic.
pub const LAYOUT: &str = "layout";
