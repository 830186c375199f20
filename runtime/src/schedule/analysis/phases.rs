//! Response times with known phases: tasks with known offsets on a common clock are not all released
//! together.
//!
//! Every job of one hyperperiod is examined in every busy window that may contain it. A worst-case window
//! opens when some release is as late as possible (K. Tindell, *Adding time-offsets to schedulability
//! analysis*, 1994). Opening it earlier than the latest release that it contains only adds time in which all
//! of its work can finish.

use super::window::{Bound, Demand, Level, Opening, ceil_div, floor_div, keep_worst};

/// Maximum number of windows examined for one task; with more, phases are ignored.
const MOST_WINDOWS: i64 = 20_000;

/// Returns the bounds of all stages of a task with known offsets; `None` if there is no bound, or too many
/// windows.
pub(in crate::schedule) fn bounds(tasks: &[Demand], index: usize) -> Option<Vec<Bound>> {
    let level = Level::for_task(tasks, index)?;
    let own = level.own();
    // phases are of little use if work may be long after its release
    if level.all().any(Demand::suspends) {
        return None;
    }
    let offset = own.offset?;
    let on_grid = || level.all().filter_map(|task| Some((task, task.offset?)));
    if on_grid().count() < 2 {
        return None;
    }
    let longest = level.longest()?;
    let hyperperiod = on_grid().try_fold(1, |lcm: i64, (task, _)| least_common_multiple(lcm, task.period))?;
    let jobs = hyperperiod / own.period;
    let windows: i64 = 1 + on_grid().map(|(task, _)| longest / task.period + 1).sum::<i64>();
    if jobs.checked_mul(windows)? > MOST_WINDOWS {
        return None;
    }
    let late = own.jitter?;
    let mut bounds = vec![None; own.stages.len()];
    for job in 0..jobs {
        let due = offset + job * own.period;
        let released = due + late;
        let mut openings = vec![released];
        for (task, offset) in on_grid() {
            // each release as late as possible
            let first = offset + task.jitter?;
            let from = ceil_div(due - longest - first, task.period);
            let to = floor_div(released - first, task.period);
            openings.extend((from..=to).map(|n| first + n * task.period));
        }
        openings.sort_unstable();
        openings.dedup();
        for opening in openings {
            let before = floor_div(released - opening, own.period);
            let ends = level.run(Opening::At(opening), due, before)?;
            keep_worst(&mut bounds, Opening::At(opening), due, ends);
        }
    }
    bounds.into_iter().collect()
}

/// Returns the least common multiple; `None` on overflow.
pub(in crate::schedule) fn least_common_multiple(a: i64, b: i64) -> Option<i64> {
    (a / greatest_common_divisor(a, b)).checked_mul(b)
}

/// Returns the greatest common divisor of two positive numbers.
pub(in crate::schedule) fn greatest_common_divisor(a: i64, b: i64) -> i64 {
    let (mut a, mut b) = (a, b);
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}
