//! A session driven to the end of its plan, with episodes, pauses and a pace.

use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use super::{Session, SessionError};
use crate::launcher::{Event, Exit, Limit, Options, Report};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, EpisodesPlan, Plan};
use crate::worker::Registry;

/// Maximum time between two checks of a paused run, ns.
const LOOK_NS: u64 = 20_000_000;

impl Session<'_> {
    /// Runs all episodes of the plan, each for the plan's duration. The report returned by
    /// [`stop`](Self::stop) contains the outcome of the run.
    ///
    /// # Errors
    /// A component cannot be reset between two episodes.
    pub fn run(&mut self) -> Result<(), SessionError> {
        let plan = self.launch.plan();
        if plan.episode_driver().is_some() {
            return self.run_driven();
        }
        let (clock, end, seed) =
            (plan.clock, plan.duration_ns.map_or(Duration::MAX, Duration::from_nanos), plan.seed);
        let episodes = plan.episodes.unwrap_or(EpisodesPlan { count: 1, vary_seed: false });
        for index in 0..episodes.count {
            if index > 0 && self.exit.is_none() {
                let seed = episodes.seed(seed, index);
                match clock {
                    ClockKind::Lockstep => self.reset(seed)?,
                    ClockKind::Realtime => drop(self.begin_episode(seed)?),
                }
            }
            while self.exit.is_none() && self.time() < end && !self.is_episode_over() {
                let held = self.launch.region().header().is_paused();
                let went_on = if held { self.step_held() } else { self.run_on(end) };
                if !matches!(went_on, Ok(()) | Err(SessionError::Ended(_))) {
                    return went_on;
                }
            }
        }
        Ok(())
    }

    /// Runs the plan to the end of its duration, while a component begins episodes.
    fn run_driven(&mut self) -> Result<(), SessionError> {
        let end_ns = self.launch.plan().duration_ns.unwrap_or(u64::MAX);
        if self.exit.is_none() {
            self.exit = self.launch.supervise(end_ns, &mut *self.observe);
        }
        Ok(())
    }

    /// Continues towards `end`, but only so far that a pause is noticed soon.
    fn run_on(&mut self, end: Duration) -> Result<(), SessionError> {
        if self.launch.plan().clock == ClockKind::Realtime {
            return self.step_until(end);
        }
        if self.pace.is_some() {
            return self.step_until(end.min(self.time() + Duration::from_millis(5)));
        }
        self.step_until(end.min(self.time() + Duration::from_millis(100)))
    }

    /// Runs the rounds granted to a paused run, or waits for such a grant.
    fn step_held(&mut self) -> Result<(), SessionError> {
        let header = self.launch.region().header();
        let taken = header.rounds_taken.load(Relaxed);
        if header.rounds_granted.load(Relaxed) > taken {
            self.step()?;
            self.launch.region().header().rounds_taken.store(taken + 1, Relaxed);
        } else {
            let exit = self.launch.wait(monotonic_ns() + LOOK_NS, &mut *self.observe);
            self.ended(exit)?;
        }
        let (wall_ns, simulated_ns) = (monotonic_ns(), self.launch.time_ns());
        self.pace = self.pace.map(|pace| pace.anchored(wall_ns, simulated_ns));
        Ok(())
    }

    /// Runs simulated time at its pace until a time, ns.
    pub(super) fn step_paced(&mut self, until_ns: u64) -> Option<Exit> {
        loop {
            let next_ns = self.launch.next_round_ns();
            let Some(pace) = self.pace.filter(|_| next_ns < until_ns && !self.is_episode_over()) else {
                break;
            };
            let (due_ns, now_ns) = (pace.due_ns(next_ns), monotonic_ns());
            if now_ns < due_ns {
                let exit = self.launch.wait(due_ns.min(now_ns + LOOK_NS), &mut *self.observe);
                if exit.is_some() {
                    return exit;
                }
                continue;
            }
            if pace.has_fallen_behind(due_ns, now_ns) {
                self.pace = Some(pace.anchored(now_ns, next_ns));
            }
            let exit = self.launch.run_rounds(Limit { until_ns, rounds: 1 }, &mut *self.observe);
            if exit.is_some() {
                return exit;
            }
        }
        let over = self.is_episode_over();
        // The time until the end of the interval passes, too.
        while let Some(pace) = self.pace.filter(|_| !over && until_ns < u64::MAX) {
            let (due_ns, now_ns) = (pace.due_ns(until_ns), monotonic_ns());
            if now_ns >= due_ns {
                break;
            }
            let exit = self.launch.wait(due_ns.min(now_ns + LOOK_NS), &mut *self.observe);
            if exit.is_some() {
                return exit;
            }
        }
        if over {
            return None;
        }
        self.launch.run_rounds(Limit { until_ns, rounds: u64::MAX }, &mut *self.observe)
    }
}

/// Runs a plan: all its episodes, each for the plan's duration. A signal ends the run early. A failure that
/// the policies of the graph do not tolerate also ends the run early.
///
/// Calls `observe` with every [`Event`] while the graph runs, including a status about 20 times a second.
///
/// # Errors
/// The graph did not start. In this case nothing is left in shared memory. If the graph started and then
/// failed, the function returns `Ok`, and the report contains the failure.
pub fn run(
    plan: Plan,
    registry: &Registry,
    options: &Options,
    observe: &mut dyn FnMut(Event<'_>),
) -> Result<Report, SessionError> {
    let mut session = Session::observed(plan, registry, options, observe)?;
    session.run()?;
    Ok(session.stop())
}
