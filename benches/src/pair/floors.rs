//! Floors: time of the machine to move one word between cores, or to switch between processes.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use motorium::os::{futex_wait, futex_wake, monotonic_ns, sleep_until};

use super::link::Link;
use super::shared_buffer::SharedBuffer;

/// A word and a futex: the minimum for a blocking hand-off.
pub(super) struct Futex<'a> {
    pub(super) buffer: &'a SharedBuffer,
    pub(super) side: usize,
    pub(super) seen: u32,
}

impl Link for Futex<'_> {
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        let line = self.buffer.line(self.side);
        line.word.store(time_ns, Relaxed);
        line.futex.store(line.futex.load(Relaxed).wrapping_add(1), Release);
        futex_wake(&line.futex);
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, String> {
        let line = self.buffer.line(1 - self.side);
        while line.futex.load(Acquire) == self.seen {
            futex_wait(&line.futex, self.seen, Some(Duration::from_secs(5)));
        }
        self.seen = self.seen.wrapping_add(1);
        Ok(line.word.load(Relaxed))
    }
}

/// A word and 512 bytes in plain shared memory: the minimum for a polled hop of this size.
pub(super) struct Plain<'a> {
    pub(super) buffer: &'a SharedBuffer,
    pub(super) side: usize,
    pub(super) sent: u64,
    pub(super) seen: u64,
}

impl Link for Plain<'_> {
    fn send(&mut self, time_ns: u64) -> Result<(), String> {
        self.sent += 1;
        let payload = &self.buffer.payload(self.side, self.sent).0;
        payload.iter().for_each(|number| number.store(time_ns, Relaxed));
        self.buffer.line(self.side).word.store(self.sent, Release);
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, String> {
        self.seen += 1;
        while self.buffer.line(1 - self.side).word.load(Acquire) != self.seen {
            core::hint::spin_loop();
        }
        let payload = &self.buffer.payload(1 - self.side, self.seen).0;
        let first = payload[0].load(Relaxed);
        let differ = payload.iter().fold(0, |differ, number| differ | (number.load(Relaxed) ^ first));
        if differ == 0 { Ok(first) } else { Err("a payload was torn".to_string()) }
    }
}

/// Rounds on the cache line between two pauses.
const BURST: u64 = 200_000;

/// Passes the round number back and forth on one cache line per direction; half of every round trip is a
/// sample. The clock is read while the other side works, so it is not part of the latency.
pub(super) fn cache_line(buffer: &SharedBuffer, side: usize, rounds: u64, warm_up: u64) {
    let (mine, theirs) = (buffer.line(side), buffer.line(1 - side));
    let await_round = |round: u64| {
        while theirs.word.load(Acquire) != round {
            core::hint::spin_loop();
        }
    };
    if side == 1 {
        for round in 1..=rounds + warm_up + 1 {
            await_round(round);
            mine.word.store(round, Release);
            if round % BURST == 0 {
                sleep_until(monotonic_ns() + 20_000_000);
            }
        }
        return;
    }
    let mut last = monotonic_ns();
    mine.word.store(1, Release);
    for round in 1..=rounds + warm_up {
        await_round(round);
        let rest = round % BURST == 0;
        if rest {
            sleep_until(monotonic_ns() + 40_000_000);
        }
        mine.word.store(round + 1, Release);
        let now = monotonic_ns();
        if round > warm_up && !rest {
            buffer.record(1, (now - last) / 2);
        }
        last = now;
    }
    await_round(rounds + warm_up + 1);
}
