//! Printing of a run's events on a separate thread.
//!
//! A terminal stopped with Ctrl-S, an idle pager and an unread pipe block the program that prints to them.
//! The launcher must not block: it supervises a robot. Events pass through a queue; if it is full, they are
//! dropped, counted and reported.

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use crossbeam_channel::{Receiver, Sender, bounded};
use motorium::launcher::{Event, Status};
use motorium::plan::Plan;

use crate::runs::event_line;
use crate::screen::{Plain, Screen};

/// Capacity of the queue of events.
const QUEUE: usize = 1024;
/// Maximum number of queued states: only the newest matter.
const WAITING: u64 = 2;
/// Time for which the end of a run waits for the last lines to be printed.
const LAST_LINES: Duration = Duration::from_secs(1);

/// A printer of events that never blocks its caller.
pub(crate) struct Printer {
    sender: Sender<Message>,
    ended: Receiver<()>,
    /// Number of dropped lines.
    dropped: Arc<AtomicU64>,
    /// Number of states in the queue.
    states: Arc<AtomicU64>,
    wants: Box<dyn FnMut(&Status) -> bool>,
}

enum Message {
    Line(String),
    State(Box<Status>),
}

enum Sink {
    Screen(Box<Screen>),
    Plain(Plain),
}

impl Sink {
    fn line(&mut self, line: &str) {
        match self {
            Self::Screen(screen) => screen.line(line),
            Self::Plain(plain) => plain.line(line),
        }
    }

    fn state(&mut self, status: &Status) {
        match self {
            Self::Screen(screen) => screen.state(status),
            Self::Plain(plain) => plain.state(status),
        }
    }
}

impl Printer {
    /// Creates a printer with a live table on the terminal, below the lines.
    pub(crate) fn screen(plan: &Plan) -> anyhow::Result<Self> {
        Self::start(Sink::Screen(Box::new(Screen::new(plan)?)), Box::new(|_| true))
    }

    /// Creates a printer of plain lines, with a line of the state once a second. With `quiet`, standard
    /// output stays free for JSON.
    pub(crate) fn lines(quiet: bool) -> anyhow::Result<Self> {
        Self::start(Sink::Plain(Plain::new(quiet)), Box::new(once_a_second()))
    }

    fn start(mut sink: Sink, wants: Box<dyn FnMut(&Status) -> bool>) -> anyhow::Result<Self> {
        let (sender, messages) = bounded(QUEUE);
        let (end, ended) = bounded::<()>(0);
        let (dropped, states) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0)));
        let (lost, shown) = (dropped.clone(), states.clone());
        let thread = std::thread::Builder::new().name("printer".to_string());
        let spawned = thread.spawn(move || {
            for message in messages {
                let count = lost.swap(0, Relaxed);
                if count > 0 {
                    sink.line(&format!("({count} lines were dropped: the output was not read)"));
                }
                match message {
                    Message::Line(line) => sink.line(&line),
                    Message::State(status) => {
                        shown.fetch_sub(1, Relaxed);
                        sink.state(&status);
                    }
                }
            }
            // Restores the terminal before the end is printed.
            drop(sink);
            drop(end);
        });
        spawned.map_err(|error| {
            anyhow::anyhow!("starting the thread that prints: {}", motorium::os::named(&error))
        })?;
        Ok(Self { sender, ended, dropped, states, wants })
    }

    /// Queues an event.
    pub(crate) fn show(&mut self, event: &Event<'_>) {
        if let Event::Status(status) = event {
            if (self.wants)(status) && self.states.load(Relaxed) < WAITING {
                self.states.fetch_add(1, Relaxed);
                if self.sender.try_send(Message::State(Box::new((*status).clone()))).is_err() {
                    self.states.fetch_sub(1, Relaxed);
                }
            }
        } else if let Some(line) = event_line(event)
            && self.sender.try_send(Message::Line(line)).is_err()
        {
            self.dropped.fetch_add(1, Relaxed);
        }
    }

    /// Waits until everything is printed, for at most a second.
    pub(crate) fn finish(self) {
        drop(self.sender);
        // Returns immediately when the thread drops its end. Unprinted events are lost with the program.
        let _ = self.ended.recv_timeout(LAST_LINES);
    }
}

/// Selects one state per second.
fn once_a_second() -> impl FnMut(&Status) -> bool {
    const SECOND_NS: u64 = 1_000_000_000;
    let mut next_ns = SECOND_NS;
    move |status| {
        let due = status.elapsed_ns >= next_ns && status.elapsed_ns < u64::MAX / 2;
        if due {
            next_ns = (status.elapsed_ns / SECOND_NS + 1) * SECOND_NS;
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(elapsed_ns: u64) -> Status {
        Status { elapsed_ns, components: vec![], latencies: vec![], edges: vec![] }
    }

    #[test]
    fn one_state_per_second_is_selected() {
        let mut wants = once_a_second();
        let chosen: Vec<u64> = (0..70).map(|n| n * 50).filter(|ms| wants(&status(ms * 1_000_000))).collect();
        assert_eq!(chosen, [1_000, 2_000, 3_000]);
    }
}
