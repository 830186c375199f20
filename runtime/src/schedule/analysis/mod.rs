//! The numeric part of the analysis: the static plan, and bounds on response times, latencies and bursts.

pub mod assign;
pub(in crate::schedule) mod global;
pub(in crate::schedule) mod latency;
pub(in crate::schedule) mod load;
pub(in crate::schedule) mod overheads;
pub(in crate::schedule) mod phases;
pub(in crate::schedule) mod response;
pub(in crate::schedule) mod tasks;
pub(in crate::schedule) mod unknown;
pub(in crate::schedule) mod window;

use crate::plan::Plan;
use response::Responses;
use tasks::StaticPlan;
use unknown::Unknown;

/// The analysis of a plan.
#[derive(Debug, Clone, Copy)]
pub(in crate::schedule) struct Analysis<'a> {
    pub plan: &'a Plan,
    pub tasks: &'a StaticPlan,
    pub responses: &'a Responses,
    pub unknown: &'a Unknown,
}
