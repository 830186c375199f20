//! Real-time processes of other users on the cores of a run, as far as they are visible.

use super::Event;
use crate::os::{Foreign, realtime_of_others};
use crate::plan::{ClockKind, Plan};

/// Maximum number of named processes; further ones are counted.
const NAMED: usize = 3;

/// Warns of real-time threads of other users on the cores of the run. This user's runs are checked with their
/// budgets before the start. For other users only the kernel's thread list is known.
pub(super) fn report(plan: &Plan, observe: &mut dyn FnMut(Event<'_>)) {
    if plan.clock != ClockKind::Realtime {
        return;
    }
    let mut cores: Vec<usize> = plan.components.iter().filter_map(|component| component.core).collect();
    cores.sort_unstable();
    cores.dedup();
    if let Some(text) = describe(&realtime_of_others(&cores)) {
        observe(Event::Warning(&text));
    }
}

/// Describes the neighbours in a line; `None` if there are none.
fn describe(others: &[Foreign]) -> Option<String> {
    let descriptions: Vec<String> = others
        .iter()
        .take(NAMED)
        .map(|other| {
            let Foreign { pid, user, program, class, cores } = other;
            let cores: Vec<String> = cores.iter().map(usize::to_string).collect();
            let noun = if cores.len() == 1 { "core" } else { "cores" };
            format!("`{program}` (process {pid} of user {user}, {class}) on {noun} {}", cores.join(", "))
        })
        .collect();
    let more = match others.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!descriptions.is_empty()).then(|| {
        format!(
            "other users have real-time work on the cores of this run: {}{more}; `motorium check` does not know the \
             budgets of this work, so steps may be late",
            descriptions.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_reported_with_process_user_and_cores() {
        let other = |pid| Foreign {
            pid,
            user: 65_534,
            program: "motorium".to_string(),
            class: "SCHED_FIFO 83".to_string(),
            cores: vec![1],
        };
        assert_eq!(describe(&[]), None);
        let one = describe(&[other(7)]).expect("one");
        assert!(one.contains("`motorium` (process 7 of user 65534, SCHED_FIFO 83) on core 1;"), "{one}");
        let five = describe(&[1, 2, 3, 4, 5].map(other)).expect("five");
        assert!(five.contains("process 3 of") && !five.contains("process 4 of"), "{five}");
        assert!(five.contains(" and 2 more;"), "{five}");
    }
}
