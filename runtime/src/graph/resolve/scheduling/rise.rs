//! Priorities that rise along a trigger chain.

use super::classes::HIGHEST_PRIORITY;
use crate::plan::SchedulingClass;

/// Raises every component above its trigger on the same core, as far as there is space below the next used
/// priority. Returns the increments.
///
/// A publishing component then yields the core immediately. It does its accounting and goes to sleep after
/// all components that it triggered have finished, so neither adds to the latency of a chain. Explicit
/// priorities are not changed.
pub(super) fn rise(
    classes: &[SchedulingClass],
    given: &[bool],
    cores: &[Option<usize>],
    triggered_by: &[Option<usize>],
) -> (Vec<SchedulingClass>, Vec<u8>) {
    let base = |component: usize| match classes[component] {
        SchedulingClass::Fifo(priority) => Some(priority),
        _ => None,
    };
    let room = |priority: u8| {
        let others = (0..classes.len()).filter_map(base).filter(|other| *other > priority);
        others.min().map_or(HIGHEST_PRIORITY, |next| next - 1).saturating_sub(priority)
    };
    // A component that also wakes another core does so when it publishes, which would split its step.
    let hands_over_here = |writer: usize| {
        let triggered = (0..classes.len()).filter(|reader| triggered_by[*reader] == Some(writer));
        cores[writer].is_some() && triggered.clone().all(|reader| cores[reader] == cores[writer])
    };
    let depth = |mut component: usize| {
        let mut depth = 0_u8;
        // Trigger loops are reported elsewhere.
        while let Some(writer) = triggered_by[component]
            && usize::from(depth) < classes.len().min(usize::from(HIGHEST_PRIORITY))
            && !given[component]
            && hands_over_here(writer)
            && base(writer) == base(component)
        {
            component = writer;
            depth += 1;
        }
        depth
    };
    let rises: Vec<u8> = (0..classes.len())
        .map(|component| base(component).map_or(0, |priority| depth(component).min(room(priority))))
        .collect();
    let raised = classes.iter().zip(&rises).map(|(class, rise)| match class {
        SchedulingClass::Fifo(priority) => SchedulingClass::Fifo(priority + rise),
        other => *other,
    });
    (raised.collect(), rises)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fifo(priorities: &[u8]) -> Vec<SchedulingClass> {
        priorities.iter().map(|priority| SchedulingClass::Fifo(*priority)).collect()
    }

    /// Returns the priorities of a chain of components on core 1.
    fn chain(priorities: &[u8]) -> Vec<u8> {
        let triggered_by: Vec<Option<usize>> =
            (0..priorities.len()).map(|index| index.checked_sub(1)).collect();
        let count = priorities.len();
        rise(&fifo(priorities), &vec![false; count], &vec![Some(1); count], &triggered_by).1
    }

    #[test]
    fn triggered_components_rise_above_their_triggers() {
        assert_eq!(chain(&[80, 80, 80, 80]), [0, 1, 2, 3]);
        let (classes, _) = rise(&fifo(&[80, 80]), &[false; 2], &[Some(1); 2], &[None, Some(0)]);
        assert_eq!(classes, fifo(&[80, 81]));
    }

    #[test]
    fn chain_stays_below_a_faster_one() {
        let triggered_by = [None, Some(0), Some(1), Some(2), None, Some(4)];
        let (classes, rises) =
            rise(&fifo(&[75, 75, 75, 75, 78, 78]), &[false; 6], &[Some(1); 6], &triggered_by);
        assert_eq!(rises, [0, 1, 2, 2, 0, 1]);
        assert_eq!(classes, fifo(&[75, 76, 77, 77, 78, 79]));
    }

    #[test]
    fn highest_priorities_are_reserved_for_the_kernel() {
        assert_eq!(chain(&[97, 97, 97]), [0, 1, 1]);
        assert_eq!(chain(&[98, 98]), [0, 0]);
    }

    #[test]
    fn explicit_priority_is_kept_and_its_readers_rise() {
        let given = [false, true, false];
        let (classes, rises) = rise(&fifo(&[80, 40, 40]), &given, &[Some(1); 3], &[None, Some(0), Some(1)]);
        assert_eq!((classes, rises), (fifo(&[80, 40, 41]), vec![0, 0, 1]));
    }

    #[test]
    fn chain_on_another_core_starts_without_a_rise() {
        let cores = [Some(1), Some(0), Some(0)];
        assert_eq!(rise(&fifo(&[80; 3]), &[false; 3], &cores, &[None, Some(0), Some(1)]).1, [0, 0, 1]);
        let anywhere = [None; 3];
        assert_eq!(rise(&fifo(&[80; 3]), &[false; 3], &anywhere, &[None, Some(0), Some(1)]).1, [0, 0, 0]);
    }

    #[test]
    fn no_rise_above_a_writer_that_wakes_another_core() {
        let cores = [Some(1), Some(1), Some(0), Some(1)];
        let triggered_by = [None, Some(0), Some(0), Some(1)];
        assert_eq!(rise(&fifo(&[80; 4]), &[false; 4], &cores, &triggered_by).1, [0, 0, 0, 1]);
    }

    #[test]
    fn trigger_loops_terminate() {
        let circle = [Some(1), Some(0)];
        let (classes, _) = rise(&fifo(&[80; 2]), &[false; 2], &[Some(1); 2], &circle);
        assert_eq!(classes.len(), 2);
    }

    #[test]
    fn only_priority_scheduling_rises() {
        let classes = [SchedulingClass::Normal, SchedulingClass::Normal];
        assert_eq!(rise(&classes, &[false; 2], &[Some(1); 2], &[None, Some(0)]).1, [0, 0]);
    }
}
