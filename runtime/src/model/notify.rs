//! Models of waiting for a publication and waking the waiters.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use loom::sync::atomic::{AtomicU32, AtomicU64};
use loom::sync::{Arc, Condvar, Mutex};
use loom::thread;

use super::{Modelled, Topic, holds_only_with};
use crate::atomics::Site;
use crate::transport::latest::notify::{Futex, interrupt, notify, sleep};
use crate::transport::latest::protocol::{Newest, announce, newest, newest_with_time};

/// The kernel's futex: compares the word and puts the thread to sleep atomically, under a lock that wakers
/// acquire.
struct Kernel {
    lock: Mutex<()>,
    asleep: Condvar,
}

impl Futex<Modelled> for Kernel {
    fn sleep(&self, word: &AtomicU64, seen: u64) {
        let guard = self.lock.lock().unwrap();
        if word.load(Relaxed) as u32 == seen as u32 {
            drop(self.asleep.wait(guard).unwrap());
        }
    }

    fn wake(&self, _: &AtomicU64) {
        let _guard = self.lock.lock().unwrap();
        self.asleep.notify_all();
    }
}

fn kernel() -> Kernel {
    Kernel { lock: Mutex::new(()), asleep: Condvar::new() }
}

/// Waits for a publication after `seen`.
fn wait(topic: &Topic, kernel: &Kernel, seen: Newest) -> Newest {
    loop {
        let now = newest(&topic.head);
        if now.number() != seen.number() {
            return now;
        }
        sleep(&topic.head, kernel, now);
    }
}

fn a_publication_wakes() {
    let shared = Arc::new((Topic::new(0, 1), kernel()));
    let waiter = {
        let shared = shared.clone();
        thread::spawn(move || {
            let (topic, kernel) = &*shared;
            let mut seen = Newest::default();
            while seen.number() < 2 {
                seen = wait(topic, kernel, seen);
            }
        })
    };
    let (topic, kernel) = &*shared;
    for number in 1..=2 {
        announce(topic, Newest::new(number, 0), number);
        notify(&topic.head, kernel);
    }
    waiter.join().unwrap();
}

/// A command wakes a thread that waits for a publication.
fn an_interrupt_wakes() {
    let shared = Arc::new((Topic::new(0, 1), kernel(), AtomicU32::new(0)));
    let waiter = {
        let shared = shared.clone();
        thread::spawn(move || {
            let (topic, kernel, command) = &*shared;
            loop {
                let seen = newest(&topic.head);
                if command.load(Acquire) == 1 {
                    return;
                }
                sleep(&topic.head, kernel, seen);
            }
        })
    };
    let publisher = {
        let shared = shared.clone();
        thread::spawn(move || {
            let (topic, kernel, _) = &*shared;
            announce(topic, Newest::new(1, 0), 1);
            notify(&topic.head, kernel);
        })
    };
    let (topic, kernel, command) = &*shared;
    command.store(1, Release);
    interrupt(&topic.head, kernel);
    publisher.join().unwrap();
    waiter.join().unwrap();
}

/// A waiter reads the newest number with the time of the same publication.
fn number_and_time_belong_together() {
    let topic = Arc::new(Topic::new(0, 2));
    let reader = {
        let topic = topic.clone();
        thread::spawn(move || {
            for _ in 0..2 {
                let (seen, time_ns) = newest_with_time(&*topic);
                assert_eq!(time_ns, 10 * seen.number());
            }
        })
    };
    for number in 1..=3 {
        announce(&*topic, Newest::new(number, number as usize % 2), 10 * number);
    }
    reader.join().unwrap();
}

#[test]
fn no_publication_is_lost_by_a_waiter() {
    holds_only_with(&[Site::Notify, Site::Sleep], 3, a_publication_wakes);
}

#[test]
fn no_interrupt_is_lost() {
    holds_only_with(&[Site::Notify, Site::Sleep], 2, an_interrupt_wakes);
}

#[test]
fn number_and_time_of_one_publication_are_read_together() {
    holds_only_with(
        &[Site::Publish, Site::Time, Site::Look, Site::TimeRead],
        3,
        number_and_time_belong_together,
    );
}
