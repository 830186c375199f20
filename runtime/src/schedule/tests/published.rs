//! Task sets with published response times, and theorems on rate-monotonic priorities.

use proptest::prelude::*;

use crate::schedule::analysis::response::on_core;
use crate::schedule::analysis::window::Demand;

/// Returns tasks with these costs and periods; the priority decreases from the first to the last.
fn tasks(set: &[(i64, i64)]) -> Vec<Demand> {
    let demand = |(index, (cost, period)): (usize, &(i64, i64))| Demand {
        priority: u8::try_from(99 - index).unwrap(),
        period: *period,
        offset: None,
        jitter: Some(0),
        queue: 0,
        stages: vec![*cost],
        waits: vec![0],
        deferral: Some(0),
        yields: false,
        orderly: false,
    };
    set.iter().enumerate().map(demand).collect()
}

fn responses(tasks: Vec<Demand>) -> Vec<Option<i64>> {
    on_core(tasks).into_iter().map(|stages| Some(stages?[0].finish.total)).collect()
}

fn response_times(set: &[(i64, i64)]) -> Vec<Option<i64>> {
    responses(tasks(set))
}

/// Returns the responses of tasks with these costs, waiting times and periods. The deferral of a task is its
/// response minus its cost.
fn with_waits(set: &[(i64, i64, i64)]) -> Vec<Option<i64>> {
    let plain: Vec<(i64, i64)> = set.iter().map(|(cost, _, period)| (*cost, *period)).collect();
    let mut tasks = tasks(&plain);
    for (task, (_, wait, _)) in tasks.iter_mut().zip(set) {
        task.waits[0] = *wait;
    }
    loop {
        let found = responses(tasks.clone());
        let before = tasks.clone();
        for (task, response) in tasks.iter_mut().zip(&found) {
            let late = response.map(|response| response - task.cost());
            task.deferral = if task.suspends() { late } else { Some(0) };
        }
        if tasks == before {
            return found;
        }
    }
}

#[test]
fn waiting_counts_for_the_waiter_and_not_as_core_load() {
    // Counted as work, 60 + 50 of 100 would leave the second task without a bound. A job of the first task
    // that has waited and the next job that has not may both run within one job of the second: 50 + 2 * 10.
    assert_eq!(with_waits(&[(10, 50, 100), (50, 0, 100)]), [Some(60), Some(70)]);
    assert_eq!(response_times(&[(60, 100), (50, 100)])[1], None);
    // a task that is delayed after its wait is late, although it has little work
    assert_eq!(with_waits(&[(50, 0, 100), (10, 50, 100)]), [Some(50), None]);
}

#[test]
fn waiting_task_delays_others_twice_within_its_period() {
    // Nelissen et al. 2015: only the waiting as jitter would result in 12, which a schedule exceeds
    assert_eq!(with_waits(&[(1, 0, 2), (5, 5, 20), (1, 0, 50)]), [Some(1), Some(20), Some(22)]);
}

#[test]
fn burns_and_wellings_three_tasks_of_a_nearly_full_core() {
    // Real-Time Systems and Programming Languages, response time analysis: R = 3, 6, 20
    assert_eq!(response_times(&[(3, 7), (3, 12), (5, 20)]), [Some(3), Some(6), Some(20)]);
}

#[test]
fn burns_and_wellings_three_harmonic_tasks_of_a_full_core() {
    // The same book: utilisation 1, beyond what the utilisation test admits, yet R = 5, 15, 80
    assert_eq!(response_times(&[(5, 20), (10, 40), (40, 80)]), [Some(5), Some(15), Some(80)]);
}

#[test]
fn buttazzo_four_tasks_by_deadline() {
    // Hard Real-Time Computing Systems, response time analysis of a deadline-monotonic set: R4 iterates over
    // 5, 6, 7, 9, 10
    assert_eq!(response_times(&[(1, 4), (1, 5), (2, 6), (1, 11)])[3], Some(10));
}

#[test]
fn lehoczky_two_tasks_whose_worst_job_is_not_the_first() {
    // Fixed priority scheduling of periodic task sets with arbitrary deadlines, 1990: the jobs of the second
    // task take 114, 102, 116, 104, 118, 106 and 94
    assert_eq!(response_times(&[(26, 70), (62, 100)]), [Some(26), Some(118)]);
}

#[test]
fn only_the_lowest_task_of_a_full_core_is_unbounded() {
    assert_eq!(response_times(&[(3, 6), (2, 8), (6, 20)]), [Some(3), Some(5), None]);
}

#[test]
fn equals_with_one_period_wait_for_all_others() {
    let mut equals = tasks(&[(3, 20), (5, 20), (7, 20)]);
    equals.iter_mut().for_each(|task| task.priority = 50);
    assert_eq!(responses(equals), [Some(15); 3]);
}

#[test]
fn fast_task_waits_for_equal_but_not_lower_priority() {
    let mut equals = tasks(&[(1, 10), (6, 100)]);
    equals[1].priority = equals[0].priority;
    assert_eq!(responses(equals), [Some(7), Some(7)]);
    assert_eq!(response_times(&[(1, 10), (6, 100)]), [Some(1), Some(7)]);
}

#[test]
fn task_that_joins_the_queue_later_waits_for_its_equal() {
    let mut equals = tasks(&[(5, 100), (5, 100)]);
    equals[1].priority = equals[0].priority;
    assert_eq!(responses(equals.clone()), [Some(10), Some(10)]);
    (equals[0].offset, equals[1].offset) = (Some(0), Some(2));
    assert_eq!(responses(equals.clone()), [Some(5), Some(8)]);
    // unless the first may be woken so late that it joins after the other
    equals[0].queue = 2;
    assert_eq!(responses(equals), [Some(10), Some(8)]);
}

#[test]
fn phases_that_separate_tasks_remove_interference() {
    let mut apart = tasks(&[(4, 10), (4, 10)]);
    assert_eq!(responses(apart.clone()), [Some(4), Some(8)]);
    (apart[0].offset, apart[1].offset) = (Some(0), Some(5));
    assert_eq!(responses(apart.clone()), [Some(4), Some(4)]);
    // unless one of them may be late
    (apart[0].jitter, apart[0].queue) = (Some(2), 2);
    assert_eq!(responses(apart.clone()), [Some(6), Some(5)]);
    // periods without a common grid coincide eventually
    (apart[0].period, apart[0].jitter, apart[0].queue) = (9, Some(0), 0);
    assert_eq!(responses(apart)[1], Some(8));
}

#[test]
fn task_released_again_early_keeps_its_queue_position() {
    let mut equals = tasks(&[(3, 10), (1, 100)]);
    equals[1].priority = equals[0].priority;
    assert_eq!(responses(equals.clone())[1], Some(4));
    // released late once, and then in time: both jobs run before the other task
    (equals[0].jitter, equals[0].queue) = (Some(9), 9);
    assert_eq!(responses(equals.clone())[1], Some(7));
    // the same on one clock: due at 10 and released at 19, due and released at 20
    (equals[0].offset, equals[1].offset) = (Some(0), Some(19));
    assert_eq!(responses(equals)[1], Some(7));
}

/// Periods with shares of the core that satisfy `fits`, rate-monotonic.
fn rate_monotonic() -> impl Strategy<Value = Vec<(i64, i64)>> {
    proptest::collection::vec((1_000i64..1_000_000, 0.01f64..1.0), 1..9).prop_map(|mut set| {
        set.sort_by_key(|(period, _)| *period);
        // scaled until the product of (share + 1) is 2
        let product = |scale: f64| set.iter().map(|(_, share)| share * scale + 1.0).product::<f64>();
        let (mut low, mut high) = (0.0, 1.0);
        while product(high) < 2.0 {
            high *= 2.0;
        }
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if product(middle) <= 2.0 { low = middle } else { high = middle }
        }
        set.iter().map(|(period, share)| ((*period as f64 * share * low) as i64, *period)).collect()
    })
}

proptest! {
    /// E. Bini, G. Buttazzo, *A hyperbolic bound for the rate monotonic algorithm*, 2001; it contains the
    /// bound of Liu and Layland.
    #[test]
    fn sets_within_the_hyperbolic_bound_are_in_time(set in rate_monotonic()) {
        for (response, (_, period)) in response_times(&set).into_iter().zip(&set) {
            prop_assert!(response.is_some_and(|response| response <= *period), "{response:?} of {set:?}");
        }
    }

    /// More cost, jitter or equals never shorten a response.
    #[test]
    fn more_load_never_shortens_a_response(
        set in proptest::collection::vec((1i64..6, 10i64..60), 2..5),
        changed in 0usize..5,
        jitter in 0i64..20,
    ) {
        let before = responses(tasks(&set));
        let mut worse = tasks(&set);
        let changed = changed % set.len();
        worse[changed].stages[0] += 1;
        (worse[changed].jitter, worse[changed].queue) = (Some(jitter), jitter);
        for (before, after) in before.into_iter().zip(responses(worse)) {
            prop_assert!(after.is_none_or(|after| before.is_some_and(|before| before <= after)));
        }
    }
}
