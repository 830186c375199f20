//! The lane of a component in a timeline.

use schemars::JsonSchema;
use serde::Serialize;

use crate::schedule::Activity;

/// The segments of one component.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Lane {
    /// Name of the component.
    pub component: String,
    /// Its `SCHED_FIFO` priority.
    pub priority: u8,
    /// Releases by the clock or a trigger, ns from the start.
    pub releases_ns: Vec<u64>,
    /// Intervals in which it runs on the core, in order.
    pub segments: Vec<Segment>,
    /// Ends of steps after the next release, ns.
    pub late_ns: Vec<u64>,
}

/// A time for which a component runs on the core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Segment {
    /// From, ns.
    pub start_ns: u64,
    /// To, ns.
    pub end_ns: u64,
    /// The activity.
    pub activity: Activity,
}
