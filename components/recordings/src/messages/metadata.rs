//! Metadata keys of channels written by motorium.

/// Key for the name of the topic from which a channel is derived.
pub const TOPIC: &str = "topic";
/// Key for the layout of the topic's type, as JSON. Only channels with all fields of a topic have this key.
pub const LAYOUT: &str = "layout";
