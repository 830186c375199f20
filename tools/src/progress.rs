//! A bar on a terminal while something takes long; nothing elsewhere.

use std::io::{IsTerminal as _, Write as _};
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::out::errln;

/// Time between two pictures of a bar, at least.
const REDRAW: Duration = Duration::from_millis(100);
/// Cells of a bar.
const CELLS: usize = 40;

/// A bar on standard error; its clones are the same bar.
#[derive(Clone)]
pub(crate) struct Progress(Arc<Inner>);

struct Inner {
    /// The words before the bar, which may be none.
    title: Mutex<String>,
    steps: u64,
    done: AtomicU64,
    began: Instant,
    /// Time of the last picture; `None` where nothing is shown.
    drawn: Option<Mutex<Instant>>,
}

impl Progress {
    /// A bar of so many steps behind a title, which may be empty.
    pub(crate) fn new(title: &str, steps: u64) -> Self {
        let began = Instant::now();
        let drawn = std::io::stderr().is_terminal().then(|| Mutex::new(began));
        Self(Arc::new(Inner {
            title: Mutex::new(title.into()),
            steps,
            done: AtomicU64::new(0),
            began,
            drawn,
        }))
    }

    /// A bar that is never shown.
    pub(crate) fn hidden() -> Self {
        let (began, done) = (Instant::now(), AtomicU64::new(0));
        Self(Arc::new(Inner { title: Mutex::default(), steps: 0, done, began, drawn: None }))
    }

    /// Counts steps that are done.
    pub(crate) fn add(&self, steps: u64) {
        self.0.done.fetch_add(steps, Relaxed);
        self.draw();
    }

    /// Sets the number of steps that are done.
    pub(crate) fn set(&self, steps: u64) {
        self.0.done.store(steps, Relaxed);
        self.draw();
    }

    /// Number of the steps that are done.
    pub(crate) fn position(&self) -> u64 {
        self.0.done.load(Relaxed)
    }

    /// Sets the words before the bar.
    pub(crate) fn title(&self, title: String) {
        *self.0.title.lock().unwrap_or_else(PoisonError::into_inner) = title;
    }

    /// Prints a line on standard error, above the bar if there is one.
    pub(crate) fn say(&self, words: &str) {
        self.clear();
        errln!("{words}");
    }

    /// Takes the bar off the terminal.
    pub(crate) fn clear(&self) {
        if self.0.drawn.is_some() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }

    fn draw(&self) {
        let Some(drawn) = &self.0.drawn else { return };
        let mut drawn = drawn.lock().unwrap_or_else(PoisonError::into_inner);
        if drawn.elapsed() < REDRAW {
            return;
        }
        *drawn = Instant::now();
        let title = self.0.title.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let line = line(&title, self.position(), self.0.steps, self.0.began.elapsed());
        let _ = write!(std::io::stderr(), "\r{line}\x1b[K");
    }
}

fn line(title: &str, done: u64, steps: u64, passed: Duration) -> String {
    let share = (done as f64 / steps.max(1) as f64).min(1.0);
    let full = (share * CELLS as f64) as usize;
    let gap = if title.is_empty() { "" } else { " " };
    let (bar, rest) = ("█".repeat(full), "░".repeat(CELLS - full));
    let passed = passed.as_secs_f64();
    let whole = if share > 0.0 { format!(" of {:.0} s", passed / share) } else { " s".to_string() };
    format!("{title}{gap}{bar}{rest} {:.0} %, {passed:.0}{whole}", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_full_as_steps_are_done_and_never_fuller() {
        let cells = |done, steps| {
            let line = line("fitting", done, steps, Duration::from_secs(3));
            (line.matches('█').count(), line.matches('░').count(), line)
        };
        let (full, empty, line) = cells(250, 1000);
        assert_eq!((full, empty), (10, 30));
        assert!(line.starts_with("fitting █") && line.ends_with("░ 25 %, 3 of 12 s"), "{line}");
        assert_eq!(cells(0, 0).0, 0);
        assert_eq!((cells(7, 5).0, cells(7, 5).1), (40, 0));
    }
}
