//! The stamps of publications.

use super::Context;
use crate::region::add;
use crate::state::{FUTURE_TOLERANCE_NS, Stamp};

/// The source time of a publication of this step at `now`: the given one, or that of the step's input.
///
/// # Errors
/// The given one is in the future by so many nanoseconds. The publication is counted as refused.
#[inline(always)]
pub(super) fn source_time(context: &Context, given: Option<u64>, now: u64) -> Result<u64, u64> {
    let Some(given) = given else { return Ok(context.causality().source_time_or(now)) };
    if given > now.saturating_add(FUTURE_TOLERANCE_NS) {
        add(&context.block().refused, 1);
        return Err(given - now);
    }
    Ok(given.min(now))
}

/// The stamp of a publication of this step.
pub(super) fn stamp(context: &Context, sequence: u64, now: u64, source_time: u64) -> Stamp {
    Stamp {
        sequence,
        source_time,
        publish_time: now,
        state_time: context.causality().state_time_or(context.clock().step_ns()),
        episode: context.episode(),
        publisher: context.index() as u32,
        restart_count: context.restart_count(),
    }
}
