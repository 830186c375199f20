//! The loop in real time, which steps at absolute times or at another component's publications.

use std::sync::atomic::Ordering::Relaxed;

use super::Failure;
use super::grid::Grid;
use super::margin::Margin;
use super::rest::Rest;
use super::stepper::Stepper;
use super::timing::Timing;
use crate::os::{monotonic_ns, sleep_until, yield_core};
use crate::region::add;
use crate::transport::Trigger;

/// Gap between two readings of the clock above which a spinning thread counts as preempted, ns. Readings are
/// about 10 ns apart.
const STALL_NS: u64 = 10_000;

/// Steps at `start + phase + n * period` until the run ends.
pub(super) fn run_periodic(
    stepper: &mut Stepper,
    period_ns: u64,
    phase_ns: u64,
    mut margin: Margin,
    mut rest: Rest,
) -> Result<(), Failure> {
    let origin = stepper.context().clock().start_ns() + phase_ns;
    // A component that joins late starts at a release in the future.
    let mut grid = Grid::new(origin, period_ns, monotonic_ns());
    let mut last_end = 0;
    stepper.open_accounts();
    loop {
        let wake_ns = wait_until(stepper, grid.release_ns(), &mut margin, &mut rest);
        let Some(wake_ns) = wake_ns else { return Ok(()) };
        if stepper.context().has_stepped_last() {
            stepper.context().await_end();
            return Ok(());
        }
        let (release_ns, deadline_ns) = (grid.release_ns(), grid.deadline_ns());
        let timing = Timing { release_ns, wake_ns, deadline_ns, behind: last_end > release_ns };
        let end = stepper.step(timing)?;
        stepper.account(timing, end);
        last_end = end;
        let next = grid.advance(end, stepper.on_overrun());
        if next.skipped > 0 {
            add(&stepper.context().block().skipped, next.skipped);
        }
    }
}

/// Sleeps, then spins, until a release. Returns the time of waking, or `None` when the run ends.
fn wait_until(stepper: &mut Stepper, release_ns: u64, margin: &mut Margin, rest: &mut Rest) -> Option<u64> {
    // Under SCHED_DEADLINE a yield gives up the rest of the period, and the components it has woken run after
    // it anyway.
    let mut let_others_run = stepper.context().block().deadline.load(Relaxed) != 0;
    let mut spinning: Option<(u64, u64)> = None;
    loop {
        if stepper.context().must_leave() {
            return None;
        }
        let now = monotonic_ns();
        if let Some((_, last)) = &mut spinning {
            if now - *last > STALL_NS {
                stepper.context().block().stalled(now - *last);
            }
            *last = now;
        }
        if rest.is_due(now) {
            rest.take();
            stepper.slept();
            spinning = None;
            continue;
        }
        if now >= release_ns && let_others_run {
            stepper.spun(margin.ns(), spinning.map_or(0, |(began, _)| now - began));
            return Some(now);
        }
        let sleep_to = release_ns.saturating_sub(margin.ns());
        if now < sleep_to {
            sleep_until(sleep_to);
            stepper.slept();
            let woken = monotonic_ns();
            rest.slept(woken);
            if woken >= sleep_to {
                margin.woke(woken - sleep_to);
            }
            spinning = None;
        } else if !let_others_run {
            // Components that it has just woken on this core must run, even if this thread is behind schedule
            // and does not sleep, or was preempted before its sleep and then found the release already past.
            yield_core();
            let_others_run = true;
        } else {
            if spinning.is_none() {
                spinning = Some((now, now));
                stepper.context().first_lines().fetch();
                stepper.look_for_episode();
            }
            core::hint::spin_loop();
        }
    }
}

/// Steps whenever a topic is published, until the run ends. With `longest_wait_ns`, as in an actuator, a step
/// also begins after that time without a publication, and immediately when the run is stopping.
pub(super) fn run_triggered(
    stepper: &mut Stepper,
    trigger: &Trigger,
    longest_wait_ns: Option<u64>,
    mut rest: Rest,
) -> Result<(), Failure> {
    let period_ns = stepper.period_ns();
    if stepper.context().restart_count() > 0 {
        // Publications during its restart do not count as lost.
        trigger.is_due();
    }
    let mut seen = trigger.first_seen();
    let mut last_end = 0;
    let mut until_ns = longest_wait_ns.map(|longest| monotonic_ns() + longest);
    stepper.open_accounts();
    loop {
        stepper.look_for_episode();
        // Ends on a publication, a command of the launcher or a signal; shared memory shows which.
        let slept = trigger.wait_until(until_ns);
        stepper.context().first_lines().fetch();
        let wake_ns = stepper.woke(monotonic_ns(), slept, &mut rest);
        if stepper.context().must_leave() {
            return Ok(());
        }
        if stepper.context().has_stepped_last() {
            stepper.context().await_end();
            return Ok(());
        }
        let (published, mut release_ns) = trigger.newest();
        if published == seen {
            let overdue = until_ns.is_some_and(|until| wake_ns >= until);
            if !overdue && (until_ns.is_none() || !stepper.context().must_turn_safe()) {
                continue;
            }
            // Without a publication the step is due now: its command has become stale, or the run is
            // stopping.
            release_ns = wake_ns;
        }
        // Publications that arrived during the last step count as one wake-up, and only the newest sample is
        // read.
        let skipped = published.saturating_sub(seen).saturating_sub(1);
        if skipped > 0 {
            add(&stepper.context().block().skipped, skipped);
        }
        seen = published;
        let behind = last_end > release_ns;
        let timing = Timing { release_ns, wake_ns, deadline_ns: release_ns + period_ns, behind };
        let end = stepper.step(timing)?;
        last_end = end;
        until_ns = longest_wait_ns.map(|longest| wake_ns + longest);
        stepper.account(timing, end);
    }
}
