//! The loop in lockstep, which runs a tick of simulated time whenever the component has the turn.

use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Relaxed};
use std::time::Duration;

use super::Failure;
use super::rounds::Rounds;
use super::stepper::Stepper;
use super::timing::Timing;
use crate::os::monotonic_ns;
use crate::plan::Plan;
use crate::region::Region;
use crate::transport::Connect;

/// Longest time between two checks of the run's command.
const LOOK: Duration = Duration::from_millis(100);

/// Steps whenever it is the component's turn and then passes the turn, until the run ends.
pub(super) fn run(
    stepper: &mut Stepper,
    ports: &[Rc<dyn Connect>],
    (plan, region): (&Plan, &Region),
    index: usize,
) -> Result<(), Failure> {
    let (block, turn) = (&region.components()[index], &region.header().turn);
    let rounds = Rounds::new(plan, |component| region.components()[component].played.load(Relaxed) == 0);
    stepper.open_accounts();
    loop {
        let calls = block.tick_calls();
        if turn.now().holder != Some(index) {
            if stepper.context().must_leave() {
                return Ok(());
            }
            block.await_call(calls, LOOK);
            continue;
        }
        if stepper.context().must_leave() {
            turn.give_back(index);
            return Ok(());
        }
        if block.tick_resets.load(Acquire) != 0 {
            let header = region.header();
            // Nobody begins another episode while a component has the turn for its reset.
            if let Some(start) = header.episode_start() {
                ports.iter().for_each(|port| port.begin_episode());
                stepper.reset(start.index, start.seed)?;
            }
            turn.give_back(index);
        } else {
            let time_ns = block.tick_time_ns.load(Acquire);
            let began = monotonic_ns();
            stepper.step(Timing::lockstep(time_ns, stepper.period_ns()))?;
            stepper.account_lockstep(monotonic_ns() - began);
            rounds.pass_on(region, index, time_ns);
        }
    }
}
