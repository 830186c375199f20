//! Waking up the components that a topic triggers.

use std::cell::Cell;
use std::path::PathBuf;
use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::prelude::SemanticString as _;

use super::bell::Bell;
use super::topic::refused;
use super::{PortError, Shared, slots};
use crate::os::{current_core, monotonic_ns};
use crate::plan::TopicPlan;
use crate::state::Digest;

/// So long a waiter looks at the bell of another core before it sleeps, ns: about what it costs to be woken there.
pub(crate) const LOOK_NS: u64 = 20_000;
/// Looks in vain before it sleeps at once this many times, doubled with every further vain look up to the largest.
const LARGEST_PAUSE: u32 = 64;

/// What wakes the components that a topic triggers.
#[derive(Debug)]
pub(crate) struct Waker(Bell);

/// The waiting side of a topic's wake-up.
///
/// When the publisher runs on another core, waking costs far more than the data: the waiter then looks at the bell
/// for as long as being woken would take before it sleeps. Where that was in vain it tries ever more seldom, so a
/// component that waits for a millisecond at a time spends less than 0.1 % of its core on looking.
#[derive(Debug)]
pub struct Trigger {
    bell: Rc<Bell>,
    heard: Cell<u32>,
    patience: Patience,
}

impl Waker {
    /// Makes the bell of a topic.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let bell = Bell::create(&file(node, topic), slots::bytes(topic));
        Ok(Self(bell.map_err(|error| refused(&topic.name, "making its bell")(&error))?))
    }

    /// Wakes all that wait.
    pub(crate) fn wake(&self) {
        self.0.ring(current_core());
    }
}

impl Trigger {
    pub(super) fn new(bell: Rc<Bell>) -> Self {
        let heard = Cell::new(bell.rings());
        Self { bell, heard, patience: Patience::default() }
    }

    /// Waits for the topic to be published, for the launcher to want something, or for a signal.
    pub fn wait(&self) {
        self.wait_or_sleep();
    }

    /// As [`wait`](Self::wait); whether it went to sleep.
    pub(crate) fn wait_or_sleep(&self) -> bool {
        let heard = self.heard.get();
        let sleeps = self.bell.rings() == heard && !self.look(heard);
        if sleeps {
            self.bell.sleep(heard);
        }
        self.heard.set(self.bell.rings());
        sleeps
    }

    /// Whether there was a publication since the last look or wait; never waits.
    pub fn is_due(&self) -> bool {
        let rings = self.bell.rings();
        self.heard.replace(rings) != rings
    }

    /// Looks for a ring without sleeping, where that may be worth it.
    fn look(&self, heard: u32) -> bool {
        let elsewhere = self.bell.core().is_some_and(|core| core != current_core());
        if !elsewhere || !self.patience.has_some() {
            return false;
        }
        let end = monotonic_ns() + LOOK_NS;
        let mut found = false;
        while !found && monotonic_ns() < end {
            for _ in 0..8 {
                core::hint::spin_loop();
                found |= self.bell.rings() != heard;
            }
        }
        self.patience.learn(found);
        found
    }
}

/// Whether looking is worth it, learnt from how it went.
#[derive(Debug, Default)]
struct Patience {
    /// Waits to let pass without looking.
    pause: Cell<u32>,
    /// Waits that the next vain look costs.
    next_pause: Cell<u32>,
}

impl Patience {
    fn has_some(&self) -> bool {
        let pause = self.pause.get();
        self.pause.set(pause.saturating_sub(1));
        pause == 0
    }

    fn learn(&self, worth_it: bool) {
        if worth_it {
            self.next_pause.set(0);
        } else {
            let pause = (2 * self.next_pause.get()).clamp(1, LARGEST_PAUSE);
            self.next_pause.set(pause);
            self.pause.set(pause);
        }
    }
}

/// Opens the bell of a topic.
pub(crate) fn open_bell(node: &Node<Shared>, topic: &TopicPlan) -> Result<Bell, PortError> {
    Bell::open(&file(node, topic), slots::bytes(topic))
        .map_err(|error| refused(&topic.name, "opening its bell")(&error))
}

/// The file of a topic's bell, in the folder of its domain.
fn file(node: &Node<Shared>, topic: &TopicPlan) -> PathBuf {
    let mut digest = Digest::default();
    digest.write(topic.name.as_bytes());
    let root = String::from_utf8_lossy(node.config().global.root_path().as_bytes()).into_owned();
    PathBuf::from(root).join(format!("bell-{:016x}", digest.finish()))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::SeqCst};
    use std::time::Duration;

    use super::*;

    fn bells<const N: usize>(name: &str) -> (tempfile::TempDir, [PathBuf; N]) {
        let folder = tempfile::tempdir().unwrap();
        let paths = std::array::from_fn(|i| folder.path().join(format!("{name}-{i}")));
        paths.iter().for_each(|path| drop(Bell::create(path, 0).unwrap()));
        (folder, paths)
    }

    #[test]
    fn a_ring_before_the_wait_ends_it_at_once_and_only_once() {
        let (_folder, [path]) = bells("early");
        let (bell, trigger) =
            (Bell::open(&path, 0).unwrap(), Trigger::new(Rc::new(Bell::open(&path, 0).unwrap())));
        bell.ring(0);
        bell.ring(0);
        trigger.wait();
        assert!(!trigger.is_due(), "two rings are one wake-up");
        bell.ring(0);
        assert!(trigger.is_due());
        assert!(!trigger.is_due());
    }

    #[test]
    fn no_ring_is_lost_however_waiting_and_ringing_fall_together() {
        const ROUNDS: u32 = 20_000;
        let (_folder, [there, back]) = bells("to-and-fro");
        let answers = AtomicU32::new(0);
        let stuck = AtomicBool::new(true);
        let ready = std::sync::Barrier::new(2);
        std::thread::scope(|scope| {
            let (ready, answers, stuck) = (&ready, &answers, &stuck);
            let (there, back) = (&there, &back);
            scope.spawn(move || {
                let (trigger, bell) =
                    (Trigger::new(Rc::new(Bell::open(there, 0).unwrap())), Bell::open(back, 0).unwrap());
                ready.wait();
                for round in 0..ROUNDS {
                    trigger.wait();
                    // Sometimes the other side has time to fall asleep, sometimes not.
                    (0..round % 97 * 10).for_each(|_| core::hint::spin_loop());
                    answers.fetch_add(1, SeqCst);
                    bell.ring(0);
                }
            });
            scope.spawn(move || {
                let (trigger, bell) =
                    (Trigger::new(Rc::new(Bell::open(back, 0).unwrap())), Bell::open(there, 0).unwrap());
                ready.wait();
                for round in 0..ROUNDS {
                    bell.ring(0);
                    (0..round % 89 * 10).for_each(|_| core::hint::spin_loop());
                    trigger.wait();
                }
                stuck.store(false, SeqCst);
            });
            // A lost ring leaves both asleep: then this ends the test instead of hanging.
            scope.spawn(move || {
                let mut last = u32::MAX;
                while stuck.load(SeqCst) {
                    let now = answers.load(SeqCst);
                    if now == last {
                        eprintln!("a ring was lost after {now} rounds");
                        std::process::abort();
                    }
                    last = now;
                    (0..200).take_while(|_| stuck.load(SeqCst)).for_each(|_| {
                        std::thread::sleep(Duration::from_millis(50));
                    });
                }
            });
        });
        assert_eq!(answers.load(SeqCst), ROUNDS);
    }

    #[test]
    fn every_waiter_hears_one_ring() {
        let (_folder, [path]) = bells("many");
        let heard = AtomicU32::new(0);
        let ready = std::sync::Barrier::new(9);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let trigger = Trigger::new(Rc::new(Bell::open(&path, 0).unwrap()));
                    ready.wait();
                    trigger.wait();
                    heard.fetch_add(1, SeqCst);
                });
            }
            ready.wait();
            std::thread::sleep(Duration::from_millis(20));
            Bell::open(&path, 0).unwrap().ring(0);
        });
        assert_eq!(heard.load(SeqCst), 8);
    }

    #[test]
    fn a_wake_up_that_comes_late_for_an_older_ring_does_not_end_a_wait() {
        let (_folder, [path]) = bells("late");
        let returned = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let waiter = scope.spawn(|| {
                Trigger::new(Rc::new(Bell::open(&path, 0).unwrap())).wait();
                returned.store(true, SeqCst);
            });
            let bell = Bell::open(&path, 0).unwrap();
            for _ in 0..10 {
                std::thread::sleep(Duration::from_millis(5));
                bell.wake();
            }
            assert!(!returned.load(SeqCst));
            bell.ring(0);
            waiter.join().unwrap();
        });
    }

    #[test]
    fn a_bell_that_was_cut_short_is_refused() {
        let (_folder, [path]) = bells("short");
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(10).unwrap();
        assert!(Bell::open(&path, 0).unwrap_err().to_string().contains("cut short"));
    }

    #[test]
    fn looking_in_vain_becomes_rare_and_a_find_brings_it_back() {
        let patience = Patience::default();
        let looks = |waits: u32, found: bool| {
            let look = |_: &u32| {
                let has_some = patience.has_some();
                if has_some {
                    patience.learn(found);
                }
                has_some
            };
            (0..waits).filter(look).count()
        };
        let first = looks(1_000, false);
        assert!((10..30).contains(&first), "{first} looks in vain of the first thousand");
        let later = looks(10_000, false);
        assert!((150..=160).contains(&later), "{later} of ten thousand");
        assert!(looks(1_000, true) > 900);
    }
}
