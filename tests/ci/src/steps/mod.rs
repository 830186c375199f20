//! The actions of the steps.

pub(crate) mod build;
pub(crate) mod graphs;
pub(crate) mod measurements;
pub(crate) mod packages;
pub(crate) mod report;
pub(crate) mod test_programs;
pub(crate) mod tools;
