//! The fixed order of a lockstep tick.

use super::timing::Timing;

/// Returns the position of every component: a triggered component follows its trigger; otherwise file order
/// applies.
pub(super) fn execution_order(timing: &Timing) -> Vec<usize> {
    let count = timing.triggered_by.len();
    let mut order = vec![0; count];
    let mut placed = vec![false; count];
    for position in 0..count {
        let ready = |component: &usize| {
            !placed[*component] && timing.triggered_by[*component].is_none_or(|writer| placed[writer])
        };
        // loops have been rejected, so one component is always ready
        let Some(next) = (0..count).find(ready) else { break };
        placed[next] = true;
        order[next] = position;
    }
    order
}
