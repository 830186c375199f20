//! Texts of an admission: sums of times, problems and advice, without further computation.

pub(in crate::schedule) mod latency;
pub(in crate::schedule) mod load;
pub(in crate::schedule) mod problems;
pub(in crate::schedule) mod task;
mod terms;
pub(in crate::schedule) mod words;
