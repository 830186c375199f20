//! Sleeping on a word of 64 bits: the system's futex on its low half.

#![allow(unsafe_code)] // half of a word is a word

use std::sync::atomic::Ordering::Acquire;
use std::sync::atomic::{AtomicU32, AtomicU64};
use std::time::Duration;

use super::{futex_wait, futex_wake, monotonic_ns};

/// Sleeps while the word's low half equals the low half of `seen`, at most until `CLOCK_MONOTONIC` reaches
/// `until_ns`. Returns early on a signal.
#[inline(always)]
pub(crate) fn futex_sleep(word: &AtomicU64, seen: u64, until_ns: Option<u64>) {
    let left = || until_ns.map(|until| Duration::from_nanos(until.saturating_sub(monotonic_ns())));
    let mut rest = left();
    while rest != Some(Duration::ZERO)
        && !futex_wait(low_half(word), seen as u32, rest)
        && word.load(Acquire) as u32 == seen as u32
    {
        rest = left();
    }
}

/// Wakes all sleepers on the low half of a word.
#[inline(always)]
pub(crate) fn futex_wake_low(word: &AtomicU64) {
    futex_wake(low_half(word));
}

#[inline(always)]
fn low_half(word: &AtomicU64) -> &AtomicU32 {
    let half = (word as *const AtomicU64).cast::<AtomicU32>();
    // SAFETY: the half is inside the word and aligned; only the kernel reads it.
    unsafe { &*half.add(usize::from(cfg!(target_endian = "big"))) }
}
