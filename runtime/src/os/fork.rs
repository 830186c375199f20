//! Handles to shared memory that a forked child must not use.
//!
//! A fork copies a program with all of its handles. The child must neither use nor drop them, because it
//! would release pins, kill processes and remove files of its parent.

#![allow(unsafe_code)] // a handler is registered with libc

use core::mem::ManuallyDrop;
use core::ops::{Deref, DerefMut};
use std::sync::Once;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

/// Number of forks from the first program to this process.
static FORKS: AtomicU32 = AtomicU32::new(0);

extern "C" fn count_fork() {
    FORKS.fetch_add(1, Relaxed);
}

/// A value that belongs to the process that created it. Dropping it in a forked child has no effect.
#[derive(Debug)]
pub(crate) struct Owned<T> {
    value: ManuallyDrop<T>,
    forks: u32,
    pid: u32,
}

/// Error of using a handle in a forked child of the process that created it. Owns no heap memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it belongs to process {owner}, and this process is a fork of it; open it again in this process")]
pub struct OtherProcess {
    /// Id of the process that created the handle.
    pub owner: u32,
}

impl<T> Owned<T> {
    /// Creates a value that belongs to this process.
    pub(crate) fn new(value: T) -> Self {
        static ONCE: Once = Once::new();
        ONCE.call_once(|| {
            // SAFETY: the handler is a plain function that exists as long as the program. It changes one
            // atomic number, which is allowed in a child of a program with several threads. The call only
            // fails without memory; forks are then not detected.
            unsafe { libc::pthread_atfork(None, None, Some(count_fork)) };
        });
        Self { value: ManuallyDrop::new(value), forks: FORKS.load(Relaxed), pid: std::process::id() }
    }

    /// Returns `true` in the process that created the value. Costs one load.
    #[inline]
    pub(crate) fn is_own(&self) -> bool {
        FORKS.load(Relaxed) == self.forks
    }

    /// Refuses a call in a forked child.
    #[inline]
    pub(crate) fn check(&self) -> Result<(), OtherProcess> {
        if self.is_own() { Ok(()) } else { Err(OtherProcess { owner: self.pid }) }
    }
}

impl<T> Deref for Owned<T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        &self.value
    }
}

impl<T> DerefMut for Owned<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        &mut self.value
    }
}

impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        if self.is_own() {
            // SAFETY: the value is dropped once, here, and not used afterwards.
            unsafe { ManuallyDrop::drop(&mut self.value) };
        }
    }
}
