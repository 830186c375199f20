//! Models of the shared memory protocols: the production code with loom's atomics, in every interleaving.
//!
//! Each protocol must be correct with its declared orderings, and a model must detect each weakened ordering
//! ([`Site`]). A model that passes without an ordering proves nothing about it.

mod checkpoint;
mod events;
mod notify;
mod pins;
mod tap;

use std::cell::Cell;
use std::sync::atomic::Ordering::{self, Relaxed, SeqCst};

use crate::atomics::{Atomics, Site, Word};
use crate::transport::latest::protocol::{Head, Pin, Words};

thread_local! {
    /// The removed ordering. A thread-local suffices, because loom runs all threads of a model on one system
    /// thread.
    static WEAKENED: Cell<Option<Site>> = const { Cell::new(None) };
}

/// Loom's atomics.
#[derive(Debug)]
pub(crate) enum Modelled {}

macro_rules! modelled {
    ($($value:ty => $word:ty),*) => { $(
        impl Word<$value> for $word {
            fn new(value: $value) -> Self {
                Self::new(value)
            }

            fn load(&self, ordering: Ordering) -> $value {
                self.load(ordering)
            }

            fn store(&self, value: $value, ordering: Ordering) {
                self.store(value, ordering);
            }

            fn swap(&self, value: $value, ordering: Ordering) -> $value {
                self.swap(value, ordering)
            }

            fn fetch_add(&self, value: $value, ordering: Ordering) -> $value {
                self.fetch_add(value, ordering)
            }

            fn fetch_sub(&self, value: $value, ordering: Ordering) -> $value {
                self.fetch_sub(value, ordering)
            }

            fn replace(&self, current: $value, new: $value) -> bool {
                self.compare_exchange(current, new, SeqCst, Relaxed).is_ok()
            }
        }
    )* };
}
modelled!(u32 => loom::sync::atomic::AtomicU32, u64 => loom::sync::atomic::AtomicU64);

impl Atomics for Modelled {
    type U32 = loom::sync::atomic::AtomicU32;
    type U64 = loom::sync::atomic::AtomicU64;

    fn ordering(site: Site, strong: Ordering) -> Ordering {
        if WEAKENED.get() == Some(site) { Relaxed } else { strong }
    }

    fn fence(site: Site) {
        if WEAKENED.get() != Some(site) {
            loom::sync::atomic::fence(SeqCst);
        }
    }

    fn read_fence(site: Site) {
        if WEAKENED.get() != Some(site) {
            loom::sync::atomic::fence(Ordering::Acquire);
        }
    }
}

/// The words of a topic, and a number per slot instead of a value. Loom detects every access that could be
/// concurrent with a write.
struct Topic {
    head: Head<Modelled>,
    pins: Vec<Pin<Modelled>>,
    marks: Vec<loom::sync::atomic::AtomicU64>,
    times: Vec<loom::sync::atomic::AtomicU64>,
    values: Vec<loom::cell::UnsafeCell<u64>>,
}

impl Topic {
    fn new(pins: usize, slots: usize) -> Self {
        use loom::sync::atomic::{AtomicU32, AtomicU64};
        Self {
            head: Head { newest: AtomicU64::new(0), sleepers: AtomicU32::new(0), core: AtomicU32::new(0) },
            pins: (0..pins).map(|_| Pin { slot: AtomicU32::new(0) }).collect(),
            marks: (0..slots).map(|_| AtomicU64::new(0)).collect(),
            times: (0..slots).map(|_| AtomicU64::new(0)).collect(),
            values: (0..slots).map(|_| loom::cell::UnsafeCell::new(0)).collect(),
        }
    }

    #[allow(unsafe_code)]
    fn write(&self, slot: usize, value: u64) {
        // SAFETY: loom checks for concurrent use of the cell; this is the purpose of the model.
        self.values[slot].with_mut(|cell| unsafe { *cell = value });
    }

    #[allow(unsafe_code)]
    fn read(&self, slot: usize) -> u64 {
        // SAFETY: as in `write`.
        self.values[slot].with(|cell| unsafe { *cell })
    }
}

impl Words<Modelled> for Topic {
    fn head(&self) -> &Head<Modelled> {
        &self.head
    }

    fn pins(&self) -> &[Pin<Modelled>] {
        &self.pins
    }

    fn slots(&self) -> usize {
        self.marks.len()
    }

    fn mark(&self, slot: usize) -> &loom::sync::atomic::AtomicU64 {
        &self.marks[slot]
    }

    fn time(&self, slot: usize) -> &loom::sync::atomic::AtomicU64 {
        &self.times[slot]
    }
}

/// Runs a model in every interleaving with at most this number of preemptions.
fn explore(preemptions: usize, model: impl Fn() + Sync + Send + 'static) {
    let mut builder = loom::model::Builder::new();
    builder.preemption_bound = Some(preemptions);
    builder.check(model);
}

/// Asserts that a model passes, and that it fails without each of these orderings.
///
/// A model that detects a fault may abort, so each runs in a separate process: this test again, with the
/// removed ordering in the environment.
fn holds_only_with(sites: &[Site], preemptions: usize, model: fn()) {
    const WEAKENED_SITE: &str = "MOTORIUM_MODEL_WITHOUT";
    if let Ok(site) = std::env::var(WEAKENED_SITE) {
        WEAKENED.set(sites.iter().copied().find(|candidate| format!("{candidate:?}") == site));
        assert!(WEAKENED.get().is_some(), "{site} is no site of this model");
        return explore(preemptions, model);
    }
    explore(preemptions, model);
    let test = std::thread::current().name().map(str::to_string).unwrap_or_default();
    for site in sites {
        let found = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", &test, "--test-threads=1"])
            .env(WEAKENED_SITE, format!("{site:?}"))
            .env("RUST_BACKTRACE", "0")
            .output()
            .unwrap();
        assert!(!found.status.success(), "without the ordering at {site:?} the model found no fault");
        let text =
            String::from_utf8_lossy(&found.stdout).into_owned() + &String::from_utf8_lossy(&found.stderr);
        assert!(!text.contains("is no site of this model"), "{text}");
    }
}
