//! One of the two processes of a measurement.

use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use motorium::os::{Request, apply, futex_wait, futex_wake, prefault_stack};
use motorium::plan::SchedulingClass;

use super::board::Board;
use super::floors::{Futex, Plain, cache_line};
use super::link::{Link, ping, pong};
use super::plain::PlainBlocking;
use super::stock::Stock;
use super::topics::{Topics, Waits};
use super::{Assignment, Carrier, SIDES};
use crate::payload::{Payload, PayloadVisitor, with_payload};

/// Marks a part in its command line.
pub(crate) const PART: &str = "--bench-part";

/// Plays the part of one side.
pub(crate) fn run_part(side: &str, folder: &Path) -> Result<(), String> {
    let side = SIDES.iter().position(|name| *name == side).ok_or("there is no such side")?;
    let text = std::fs::read(folder.join("assignment.json")).map_err(|error| error.to_string())?;
    let assignment: Assignment = serde_json::from_slice(&text).map_err(|error| error.to_string())?;
    let throw = &assignment.throw;
    let board = Board::open(&folder.join("board"), throw.rounds).map_err(|error| error.to_string())?;
    let play = Play { assignment: &assignment, board: &board, side };
    match throw.carrier {
        Carrier::CacheLine => {
            play.meet();
            cache_line(&board, side, throw.rounds as u64, throw.warm_up as u64);
            Ok(())
        }
        Carrier::Plain => play.throw(&mut Plain { board: &board, side, sent: 0, heard: 0 }),
        Carrier::Futex => play.throw(&mut Futex { board: &board, side, heard: 0 }),
        Carrier::Blocking | Carrier::Polling | Carrier::Stock | Carrier::PlainBlocking => {
            with_payload(throw.bytes, play)
                .ok_or_else(|| format!("there is no payload of {} bytes", throw.bytes))?
        }
    }
}

struct Play<'a> {
    assignment: &'a Assignment,
    board: &'a Board,
    side: usize,
}

impl PayloadVisitor for Play<'_> {
    type Output = Result<(), String>;

    fn visit<P: Payload>(self) -> Self::Output {
        let Assignment { throw, exchange } = self.assignment;
        let waits = match throw.carrier {
            Carrier::Polling if throw.cores[0] == throw.cores[1] => Waits::Yielding,
            Carrier::Polling => Waits::Spinning,
            _ => Waits::Blocking,
        };
        if throw.carrier == Carrier::PlainBlocking {
            let plain = PlainBlocking::<P>::open(exchange, self.board, self.side);
            return self.throw(&mut plain.map_err(|error| error.to_string())?);
        }
        if throw.carrier == Carrier::Stock {
            return self.throw(&mut Stock::<P>::open(exchange, self.side)?);
        }
        let topics = Topics::<P>::open(exchange, self.side, waits);
        self.throw(&mut topics.map_err(|error| error.to_string())?)
    }
}

impl Play<'_> {
    fn throw(&self, link: &mut dyn Link) -> Result<(), String> {
        self.meet();
        let throw = &self.assignment.throw;
        if self.side == 0 { ping(link, self.board, throw) } else { pong(link, self.board, throw) }
    }

    /// Takes the place that was asked for, and waits until the other side is ready too.
    fn meet(&self) {
        let throw = &self.assignment.throw;
        self.board.touch(self.side);
        let class = if throw.fifo > 0 { SchedulingClass::Fifo(throw.fifo) } else { SchedulingClass::Normal };
        let request = Request { class, cores: vec![throw.cores[self.side]], lock_memory: throw.fifo > 0 };
        // What was denied shows in what is read back, and is told with the figures.
        let (applied, _) = apply(&request);
        prefault_stack();
        let mine = self.board.side(self.side);
        mine.fifo.store(u32::from(applied.fifo_priority), Relaxed);
        mine.ready.store(1, Release);
        futex_wake(&mine.ready);
        let other = self.board.side(1 - self.side);
        while other.ready.load(Acquire) == 0 {
            futex_wait(&other.ready, 0, Some(Duration::from_millis(20)));
        }
    }
}
