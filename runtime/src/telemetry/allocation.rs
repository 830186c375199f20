//! A global allocator that counts the allocations of each thread.

#![allow(unsafe_code)] // `GlobalAlloc` is an unsafe trait; every call is forwarded to the system's allocator

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, which also counts the allocations of each thread. [`main!`](crate::main) installs
/// it.
#[derive(Debug, Default, Clone, Copy)]
pub struct CountingAllocator;

/// Number of heap allocations of one thread.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Allocations {
    /// Number of allocations outside calls of [`set_apart`].
    pub own: u64,
    /// Number of allocations within calls of [`set_apart`].
    pub set_apart: u64,
}

thread_local! {
    static OWN: Cell<u64> = const { Cell::new(0) };
    static SET_APART: Cell<u64> = const { Cell::new(0) };
    static APART: Cell<bool> = const { Cell::new(false) };
}

fn count() {
    let counter = if APART.get() { &SET_APART } else { &OWN };
    counter.set(counter.get() + 1);
}

// SAFETY: every call is forwarded unchanged to the system's allocator; the counters are thread-local cells
// that need neither allocation nor destruction.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `GlobalAlloc::alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `GlobalAlloc::alloc_zeroed`'s contract.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps `GlobalAlloc::realloc`'s contract.
        unsafe { System.realloc(memory, layout, size) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps `GlobalAlloc::dealloc`'s contract.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Returns the address of the calling thread's counts.
pub(crate) fn place_of_counts() -> *const u8 {
    OWN.with(|own| core::ptr::from_ref(own).cast())
}

/// Returns the number of heap allocations of the calling thread so far; zero unless [`CountingAllocator`] is
/// installed.
#[inline]
pub fn allocations() -> Allocations {
    Allocations { own: OWN.get(), set_apart: SET_APART.get() }
}

/// Returns `true` if [`CountingAllocator`] is installed in this program.
pub fn counts_allocations() -> bool {
    let before = allocations();
    drop(core::hint::black_box(Box::new(0u64)));
    allocations() != before
}

/// Runs a call to third-party code whose allocations are known and documented, and counts these allocations
/// separately.
pub fn set_apart<R>(call: impl FnOnce() -> R) -> R {
    let outer = APART.replace(true);
    let result = call();
    APART.set(outer);
    result
}
