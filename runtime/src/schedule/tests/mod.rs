//! Scheduling compared with published examples, theorems, and a simulation that shares no code with the
//! analysis.

mod admission;
mod deadlines;
pub(crate) mod graphs;
mod published;
mod simulated;
mod stepwise;
mod timelines;
