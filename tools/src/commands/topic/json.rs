//! JSON output of topics and samples.

use serde::Serialize;

use super::content::Content;

/// A topic as JSON.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) name: String,
    #[serde(rename = "type")]
    pub(super) type_name: String,
    pub(super) pattern: String,
    pub(super) writer: String,
    pub(super) readers: Vec<String>,
    /// Publications a second of the run's clock; `null` with fewer than two.
    pub(super) rate_hz: Option<f64>,
    pub(super) published: u64,
    pub(super) dropped: u64,
    /// Time since the last publication on the run's clock; `null` when there was none.
    pub(super) age_ns: Option<u64>,
}

/// One sample as JSON.
#[derive(Debug, Serialize)]
pub(super) struct Line<'a> {
    pub(super) topic: &'a str,
    pub(super) sequence: u64,
    /// Since the run began, s.
    pub(super) time_s: f64,
    pub(super) publish_time_ns: u64,
    pub(super) source_time_ns: u64,
    pub(super) age_ns: u64,
    pub(super) publisher: Option<&'a str>,
    pub(super) restart_count: u32,
    /// Names of the joints, where the arrays of the value have an entry for each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) joints: Option<&'a [String]>,
    /// Index of the episode.
    pub(super) episode: u64,
    pub(super) value: &'a Content<'a>,
}
