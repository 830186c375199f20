//! Adaptive polling before sleeping.

use std::cell::Cell;

/// Maximum number of waits without polling after an unsuccessful poll.
const LARGEST_PAUSE: u32 = 64;

/// An adaptive back-off: the more rarely polling succeeds, the more rarely it is tried.
#[derive(Debug, Default)]
pub(crate) struct Backoff {
    /// Number of waits to skip before the next poll.
    pause: Cell<u32>,
    /// Number of waits to skip after the next unsuccessful poll.
    next_pause: Cell<u32>,
}

impl Backoff {
    /// Returns `true` if the next wait may poll.
    pub(crate) fn may_poll(&self) -> bool {
        let pause = self.pause.get();
        self.pause.set(pause.saturating_sub(1));
        pause == 0
    }

    /// Adapts to the result of a poll.
    pub(crate) fn learn(&self, found: bool) {
        if found {
            self.next_pause.set(0);
        } else {
            let pause = (2 * self.next_pause.get()).clamp(1, LARGEST_PAUSE);
            self.next_pause.set(pause);
            self.pause.set(pause);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsuccessful_polls_become_rare() {
        let backoff = Backoff::default();
        let polls = |waits: u32, found: bool| {
            let poll = |_: &u32| {
                let polls = backoff.may_poll();
                if polls {
                    backoff.learn(found);
                }
                polls
            };
            (0..waits).filter(poll).count()
        };
        let first = polls(1_000, false);
        assert!((10..30).contains(&first), "{first} polls in the first thousand");
        let later = polls(10_000, false);
        assert!((150..=160).contains(&later), "{later} of ten thousand");
        assert!(polls(1_000, true) > 900);
    }
}
