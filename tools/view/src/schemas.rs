//! Names and JSON Schemas of channels that several parts use.

/// Name of the channel of the run's state, which exists independently of the run.
pub(crate) const RUN: &str = "/motorium/run";
/// JSON Schema of the run's state.
pub(crate) const RUN_SCHEMA: &str = include_str!("../schema/run.schema.json");
/// JSON Schema of the position in a recording.
pub(crate) const PLACE_SCHEMA: &str = include_str!("../schema/playback.schema.json");
