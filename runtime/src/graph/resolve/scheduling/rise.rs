//! Priorities that rise along a trigger chain.

use super::classes::HIGHEST_PRIORITY;
use crate::plan::SchedulingClass;

/// Raises every component above the one that triggers it on its own core, as far as there is room below the next
/// priority that something else has, and returns by how much each was raised.
///
/// A component that has published then hands over the core at once, and accounts for its step and goes to sleep when
/// all that it has triggered is through: neither is part of the latency of a chain. A priority that the graph gives
/// stays.
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
    // A component that wakes others on another core does so as soon as it publishes: its step would be cut in two there.
    let hands_over_here = |writer: usize| {
        let triggered = (0..classes.len()).filter(|reader| triggered_by[*reader] == Some(writer));
        cores[writer].is_some() && triggered.clone().all(|reader| cores[reader] == cores[writer])
    };
    let depth = |mut component: usize| {
        let mut depth = 0_u8;
        // Triggers that go round in circles are reported elsewhere.
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

    /// A chain of components on core 1.
    fn chain(priorities: &[u8]) -> Vec<u8> {
        let triggered_by: Vec<Option<usize>> =
            (0..priorities.len()).map(|index| index.checked_sub(1)).collect();
        let count = priorities.len();
        rise(&fifo(priorities), &vec![false; count], &vec![Some(1); count], &triggered_by).1
    }

    #[test]
    fn those_who_are_triggered_are_more_urgent_than_those_who_trigger_them() {
        assert_eq!(chain(&[80, 80, 80, 80]), [0, 1, 2, 3]);
        let (classes, _) = rise(&fifo(&[80, 80]), &[false; 2], &[Some(1); 2], &[None, Some(0)]);
        assert_eq!(classes, fifo(&[80, 81]));
    }

    #[test]
    fn a_chain_does_not_reach_the_priority_of_a_faster_one() {
        let triggered_by = [None, Some(0), Some(1), Some(2), None, Some(4)];
        let (classes, rises) =
            rise(&fifo(&[75, 75, 75, 75, 78, 78]), &[false; 6], &[Some(1); 6], &triggered_by);
        assert_eq!(rises, [0, 1, 2, 2, 0, 1]);
        assert_eq!(classes, fifo(&[75, 76, 77, 77, 78, 79]));
    }

    #[test]
    fn the_highest_priorities_are_left_to_the_kernel() {
        assert_eq!(chain(&[97, 97, 97]), [0, 1, 1]);
        assert_eq!(chain(&[98, 98]), [0, 0]);
    }

    #[test]
    fn a_priority_that_the_graph_gives_stays_and_what_it_triggers_rises_from_there() {
        let given = [false, true, false];
        let (classes, rises) = rise(&fifo(&[80, 40, 40]), &given, &[Some(1); 3], &[None, Some(0), Some(1)]);
        assert_eq!((classes, rises), (fifo(&[80, 40, 41]), vec![0, 0, 1]));
    }

    #[test]
    fn on_another_core_a_chain_begins_anew() {
        let cores = [Some(1), Some(0), Some(0)];
        assert_eq!(rise(&fifo(&[80; 3]), &[false; 3], &cores, &[None, Some(0), Some(1)]).1, [0, 0, 1]);
        let anywhere = [None; 3];
        assert_eq!(rise(&fifo(&[80; 3]), &[false; 3], &anywhere, &[None, Some(0), Some(1)]).1, [0, 0, 0]);
    }

    #[test]
    fn nobody_rises_above_a_component_that_wakes_another_core_too() {
        let cores = [Some(1), Some(1), Some(0), Some(1)];
        let triggered_by = [None, Some(0), Some(0), Some(1)];
        assert_eq!(rise(&fifo(&[80; 4]), &[false; 4], &cores, &triggered_by).1, [0, 0, 0, 1]);
    }

    #[test]
    fn triggers_that_go_round_in_circles_come_to_an_end() {
        let circle = [Some(1), Some(0)];
        let (classes, _) = rise(&fifo(&[80; 2]), &[false; 2], &[Some(1); 2], &circle);
        assert_eq!(classes.len(), 2);
    }

    #[test]
    fn what_is_not_scheduled_by_priority_does_not_rise() {
        let classes = [SchedulingClass::Normal, SchedulingClass::Normal];
        assert_eq!(rise(&classes, &[false; 2], &[Some(1); 2], &[None, Some(0)]).1, [0, 0]);
    }
}
