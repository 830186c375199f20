//! The two sides of a ping-pong, for every transport.

use motorium::os::{monotonic_ns, sleep_until};

use super::PingPong;
use super::shared_buffer::SharedBuffer;

/// Sent instead of a time to end the measurement.
const OVER: u64 = 0;
/// Sent instead of a time to request a pause, so that the system does not throttle real-time threads for
/// using a whole core.
const PAUSE: u64 = 1;
/// Maximum working time of both sides without a pause, ns.
const WORK_NS: u64 = 400_000_000;
/// Length of the pause, ns. Together with the working time above, the load stays well below the usual limit
/// of 95 %.
const PAUSE_NS: u64 = 40_000_000;

/// One side's connection to the other.
pub(super) trait Link {
    /// Sends a payload whose numbers all contain this time.
    fn send(&mut self, time_ns: u64) -> Result<(), String>;

    /// Waits for a payload, reads it completely, and returns its time.
    fn receive(&mut self) -> Result<u64, String>;
}

/// Runs the side that starts.
pub(super) fn ping(link: &mut dyn Link, buffer: &SharedBuffer, ping_pong: &PingPong) -> Result<(), String> {
    let mut start = monotonic_ns();
    let mut paused = start;
    for round in 0..ping_pong.warm_up + ping_pong.rounds {
        if ping_pong.pace_ns > 0 {
            let release = start + ping_pong.pace_ns;
            sleep_until(release.saturating_sub(ping_pong.pace_ns / 10));
            while monotonic_ns() < release {
                core::hint::spin_loop();
            }
            start = monotonic_ns();
        } else if start - paused > WORK_NS {
            link.send(PAUSE)?;
            sleep_until(start + PAUSE_NS);
            start = monotonic_ns();
            paused = start;
        }
        link.send(start)?;
        let sent = link.receive()?;
        let now = monotonic_ns();
        if round >= ping_pong.warm_up {
            buffer.record(0, now - sent);
        }
        start = now;
    }
    link.send(OVER)
}

/// Runs the side that answers.
pub(super) fn pong(link: &mut dyn Link, buffer: &SharedBuffer, ping_pong: &PingPong) -> Result<(), String> {
    let mut round = 0;
    loop {
        let sent = link.receive()?;
        let now = monotonic_ns();
        match sent {
            OVER => return Ok(()),
            PAUSE => sleep_until(now + PAUSE_NS / 2),
            sent => {
                // Answer before recording: recording is not part of the return path.
                link.send(now)?;
                if round >= ping_pong.warm_up {
                    buffer.record(1, now - sent);
                }
                round += 1;
            }
        }
    }
}
