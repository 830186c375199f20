//! The loop in lockstep: ticks of simulated time, handed out by the launcher.

use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Release};
use std::time::Duration;

use super::Failure;
use super::stepper::{Stepper, Timing};
use crate::component::Component;
use crate::os::{futex_wait, futex_wake, monotonic_ns};
use crate::transport::Connect;

/// Steps whenever the launcher hands out a tick, until the run ends.
pub(super) fn run<C: Component>(stepper: &mut Stepper<C>, ports: &[Rc<dyn Connect>]) -> Result<(), Failure> {
    stepper.open_accounts();
    let mut seen = stepper.context().block().tick_done.load(Acquire);
    loop {
        let block = stepper.context().block();
        let given = block.tick_given.load(Acquire);
        if given == seen {
            if stepper.context().must_leave() {
                return Ok(());
            }
            futex_wait(&block.tick_given, given, Some(Duration::from_millis(100)));
            continue;
        }
        seen = given;
        if block.tick_resets.load(Acquire) != 0 {
            let header = stepper.context().region().header();
            let (index, seed) = (header.episode.load(Acquire), header.episode_seed.load(Acquire));
            ports.iter().for_each(|port| port.begin_episode());
            stepper.reset(index, seed)?;
        } else {
            let time_ns = block.tick_time_ns.load(Acquire);
            let began = monotonic_ns();
            stepper.step(Timing::lockstep(time_ns, stepper.period_ns()))?;
            stepper.account_lockstep(monotonic_ns() - began);
        }
        let block = stepper.context().block();
        block.tick_done.store(given, Release);
        futex_wake(&block.tick_done);
    }
}
