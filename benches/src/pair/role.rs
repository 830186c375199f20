//! One of the two processes of a measurement.

use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use motorium::os::{Request, apply, futex_wait, futex_wake, prefault_stack};
use motorium::plan::SchedulingClass;

use super::floors::{Futex, Plain, cache_line};
use super::link::{Link, ping, pong};
use super::plain::PlainMemory;
use super::shared_buffer::SharedBuffer;
use super::stock::Stock;
use super::topics::{Topics, Waits};
use super::{Assignment, SIDES, Transport};
use crate::payload::{Payload, PayloadVisitor, with_payload};

/// Argument that starts this program as one side of a ping-pong.
pub(crate) const ROLE: &str = "--bench-role";

/// Runs one side of the measurement in this folder.
pub(crate) fn run_role(side: &str, folder: &Path) -> Result<(), String> {
    let side = SIDES.iter().position(|name| *name == side).ok_or("there is no such side")?;
    let text = std::fs::read(folder.join("assignment.json")).map_err(|error| error.to_string())?;
    let assignment: Assignment = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
    let ping_pong = &assignment.ping_pong;
    let buffer =
        SharedBuffer::open(&folder.join("buffer"), ping_pong.rounds).map_err(|error| error.to_string())?;
    let process = Process { assignment: &assignment, buffer: &buffer, side };
    match ping_pong.transport {
        Transport::CacheLine => {
            process.start_together();
            cache_line(&buffer, side, ping_pong.rounds as u64, ping_pong.warm_up as u64);
            Ok(())
        }
        Transport::Plain => process.exchange(&mut Plain { buffer: &buffer, side, sent: 0, seen: 0 }),
        Transport::Futex => process.exchange(&mut Futex { buffer: &buffer, side, seen: 0 }),
        Transport::Blocking
        | Transport::Polling
        | Transport::Stock
        | Transport::PlainBlocking
        | Transport::PlainChecked
        | Transport::PlainBlockingChecked => with_payload(ping_pong.bytes, process)
            .ok_or_else(|| format!("no payload has {} bytes", ping_pong.bytes))?,
    }
}

struct Process<'a> {
    assignment: &'a Assignment,
    buffer: &'a SharedBuffer,
    side: usize,
}

impl PayloadVisitor for Process<'_> {
    type Output = Result<(), String>;

    fn visit<P: Payload>(self) -> Self::Output {
        let Assignment { ping_pong, topics: folder } = self.assignment;
        let waits = match ping_pong.transport {
            Transport::Polling if ping_pong.cores[0] == ping_pong.cores[1] => Waits::Yielding,
            Transport::Polling => Waits::Spinning,
            _ => Waits::Blocking,
        };
        let plain = match ping_pong.transport {
            Transport::PlainBlocking | Transport::PlainBlockingChecked => Some(Waits::Blocking),
            Transport::PlainChecked => Some(Waits::Spinning),
            _ => None,
        };
        if let Some(waits) = plain {
            let checks = ping_pong.transport != Transport::PlainBlocking;
            let plain = PlainMemory::<P>::open(folder, (self.buffer, self.side), waits, checks);
            return self.exchange(&mut plain.map_err(|error| error.to_string())?);
        }
        if ping_pong.transport == Transport::Stock {
            return self.exchange(&mut Stock::<P>::open(folder, self.side)?);
        }
        let topics = Topics::<P>::open(folder, self.side, waits);
        self.exchange(&mut topics.map_err(|error| error.to_string())?)
    }
}

impl Process<'_> {
    fn exchange(&self, link: &mut dyn Link) -> Result<(), String> {
        self.start_together();
        let ping_pong = &self.assignment.ping_pong;
        if self.side == 0 { ping(link, self.buffer, ping_pong) } else { pong(link, self.buffer, ping_pong) }
    }

    /// Applies the requested scheduling, and waits until the other side is ready.
    fn start_together(&self) {
        let ping_pong = &self.assignment.ping_pong;
        self.buffer.touch(self.side);
        let class =
            if ping_pong.fifo > 0 { SchedulingClass::Fifo(ping_pong.fifo) } else { SchedulingClass::Normal };
        let request =
            Request { class, cores: vec![ping_pong.cores[self.side]], lock_memory: ping_pong.fifo > 0 };
        // Denied requests show in the priority read back, which is reported with the figures.
        let (applied, _) = apply(&request);
        prefault_stack();
        let mine = self.buffer.side(self.side);
        mine.fifo.store(u32::from(applied.fifo_priority), Relaxed);
        mine.ready.store(1, Release);
        futex_wake(&mine.ready);
        let other = self.buffer.side(1 - self.side);
        while other.ready.load(Acquire) == 0 {
            futex_wait(&other.ready, 0, Some(Duration::from_millis(20)));
        }
    }
}
