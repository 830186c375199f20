//! One step of the checks.

use crate::context::Context;
use crate::failure::Failure;
use crate::outcome::Outcome;

/// Fraction of the machine that a step uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Machine {
    /// Nothing else runs meanwhile. Earlier steps have ended, later ones have not started.
    Alone,
    /// In parallel to others.
    Shared,
    /// In parallel to others at lower priority, and invisible to the real-time tests.
    Aside,
}

/// One step.
#[derive(Clone, Copy)]
pub(crate) struct Step {
    pub(crate) name: &'static str,
    /// One line for `--list`.
    pub(crate) about: &'static str,
    /// Earlier steps that must have passed.
    pub(crate) needs: &'static [&'static str],
    /// Optional tools: without them the step leaves something out, and reports it.
    pub(crate) tools: &'static [&'static str],
    pub(crate) machine: Machine,
    /// Steps of a lane run one after the other; lanes run in parallel.
    pub(crate) lane: &'static str,
    pub(crate) action: fn(&Context<'_>) -> Result<Outcome, Failure>,
}
