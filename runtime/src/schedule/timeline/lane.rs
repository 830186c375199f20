//! The lane (row) of a component in a timeline.

use schemars::JsonSchema;
use serde::Serialize;

use crate::schedule::Activity;

/// The row of one component in a timeline: its releases, the intervals in which it runs, and its late steps.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Lane {
    /// Name of the component.
    pub component: String,
    /// `SCHED_FIFO` priority of the component.
    pub priority: u8,
    /// Releases by the clock or a trigger, ns from the start of the timeline.
    pub releases_ns: Vec<u64>,
    /// Intervals in which the component runs on the core, in order.
    pub segments: Vec<Segment>,
    /// End times of late steps, which ended after the next release, ns from the start of the timeline.
    pub late_ns: Vec<u64>,
}

/// An interval in which a component runs on the core.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Segment {
    /// Start of the interval, ns from the start of the timeline.
    pub start_ns: u64,
    /// End of the interval, ns from the start of the timeline.
    pub end_ns: u64,
    /// Activity for which the component uses the core.
    pub activity: Activity,
}
