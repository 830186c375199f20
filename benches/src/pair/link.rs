//! The two sides of a throw, for anything that can send and receive.

use motorium::os::{monotonic_ns, sleep_until};

use super::Throw;
use super::board::Board;

/// Sent instead of a time: the measurement is over.
const OVER: u64 = 0;
/// Sent instead of a time: rest, so that the system does not stop real-time threads for taking all of a core.
const REST: u64 = 1;
/// Both sides work at most this long without a rest, ns.
const WORK_NS: u64 = 400_000_000;
/// How long they rest, ns: with the work above well below the usual limit of 95 %.
const REST_NS: u64 = 40_000_000;

/// One side's way to send to the other and to receive from it.
pub(super) trait Link {
    /// Sends a payload, all of it holding this time.
    fn send(&mut self, time_ns: u64) -> Result<(), String>;

    /// Waits for a payload, reads all of it, and returns the time it holds.
    fn receive(&mut self) -> Result<u64, String>;
}

/// The side that begins.
pub(super) fn ping(link: &mut dyn Link, board: &Board, throw: &Throw) -> Result<(), String> {
    let mut start = monotonic_ns();
    let mut rested = start;
    for round in 0..throw.warm_up + throw.rounds {
        if throw.pace_ns > 0 {
            let release = start + throw.pace_ns;
            sleep_until(release.saturating_sub(throw.pace_ns / 10));
            while monotonic_ns() < release {
                core::hint::spin_loop();
            }
            start = monotonic_ns();
        } else if start - rested > WORK_NS {
            link.send(REST)?;
            sleep_until(start + REST_NS);
            start = monotonic_ns();
            rested = start;
        }
        link.send(start)?;
        let sent = link.receive()?;
        let now = monotonic_ns();
        if round >= throw.warm_up {
            board.record(0, now - sent);
        }
        start = now;
    }
    link.send(OVER)
}

/// The side that answers.
pub(super) fn pong(link: &mut dyn Link, board: &Board, throw: &Throw) -> Result<(), String> {
    let mut round = 0;
    loop {
        let sent = link.receive()?;
        let now = monotonic_ns();
        match sent {
            OVER => return Ok(()),
            REST => sleep_until(now + REST_NS / 2),
            sent => {
                // Answered before it is recorded: recording is no part of the way back.
                link.send(now)?;
                if round >= throw.warm_up {
                    board.record(1, now - sent);
                }
                round += 1;
            }
        }
    }
}
