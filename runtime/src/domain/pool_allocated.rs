//! Reference counting within one thread, with pooled memory.

#![allow(unsafe_code)] // a reference count and a free list over raw memory

use core::alloc::Layout;
use core::cell::Cell;
use core::fmt::Debug;
use core::mem::ManuallyDrop;
use core::ops::Deref;
use core::ptr::NonNull;
use std::alloc::{alloc, dealloc, handle_alloc_error};

use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::arc_sync_policy::{ArcSyncPolicy, ArcSyncPolicyCreationError, LockGuard};

/// Size and alignment of the memory blocks that are kept for reuse.
const BLOCK: Layout = match Layout::from_size_align(128, 16) {
    Ok(layout) => layout,
    Err(_) => panic!("a constant layout is valid"),
};
/// Number of free blocks kept per thread. One per output port is needed.
const KEPT: usize = 32;

/// Free blocks of one thread.
struct Pool {
    blocks: [Cell<*mut u8>; KEPT],
    count: Cell<usize>,
}

thread_local! {
    static POOL: Pool =
        const { Pool { blocks: [const { Cell::new(core::ptr::null_mut()) }; KEPT], count: Cell::new(0) } };
}

impl Drop for Pool {
    fn drop(&mut self) {
        for block in &self.blocks[..self.count.get()] {
            // SAFETY: every kept block was allocated with `BLOCK` and is owned by the pool only.
            unsafe { dealloc(block.get(), BLOCK) };
        }
    }
}

fn fits(layout: Layout) -> bool {
    layout.size() <= BLOCK.size() && layout.align() <= BLOCK.align()
}

/// Returns memory for a value of this layout, from the pool if possible.
fn take(layout: Layout) -> *mut u8 {
    let reused = POOL.try_with(|pool| {
        let count = pool.count.get();
        (fits(layout) && count > 0).then(|| {
            pool.count.set(count - 1);
            pool.blocks[count - 1].get()
        })
    });
    if let Ok(Some(block)) = reused {
        return block;
    }
    let layout = if fits(layout) { BLOCK } else { layout };
    // SAFETY: the layout's size is not zero: it includes at least a count.
    let memory = unsafe { alloc(layout) };
    if memory.is_null() {
        handle_alloc_error(layout);
    }
    memory
}

/// Returns memory that `take` allocated for the same layout.
fn recycle(memory: *mut u8, layout: Layout) {
    let kept = fits(layout)
        && POOL
            .try_with(|pool| {
                let count = pool.count.get();
                let room = count < KEPT;
                if room {
                    pool.blocks[count].set(memory);
                    pool.count.set(count + 1);
                }
                room
            })
            .unwrap_or(false);
    if !kept {
        let layout = if fits(layout) { BLOCK } else { layout };
        // SAFETY: `take` allocated it with the same layout, and the caller owns it.
        unsafe { dealloc(memory, layout) };
    }
}

/// The value and its number of handles.
struct Shared<T> {
    handles: Cell<usize>,
    value: ManuallyDrop<T>,
}

/// A handle to a reference-counted value that is shared within one thread and allocated from a pool.
pub struct PoolAllocated<T> {
    shared: NonNull<Shared<T>>,
}

impl<T> PoolAllocated<T> {
    fn shared(&self) -> &Shared<T> {
        // SAFETY: the block outlives every handle, including this one. The handle is neither `Send` nor
        // `Sync`, so the count does not change meanwhile.
        unsafe { self.shared.as_ref() }
    }

    /// Drops one handle. Returns `true` for the last one.
    fn release(&self) -> bool {
        let handles = self.shared().handles.get() - 1;
        self.shared().handles.set(handles);
        handles == 0
    }
}

impl<T: Debug> Debug for PoolAllocated<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_tuple("PoolAllocated").field(&*self.shared().value).finish()
    }
}

impl<T> Clone for PoolAllocated<T> {
    fn clone(&self) -> Self {
        self.shared().handles.set(self.shared().handles.get() + 1);
        Self { shared: self.shared }
    }
}

impl<T> Drop for PoolAllocated<T> {
    fn drop(&mut self) {
        if self.release() {
            // SAFETY: this was the last handle, so nothing else refers to the value or its block.
            unsafe { ManuallyDrop::drop(&mut self.shared.as_mut().value) };
            recycle(self.shared.as_ptr().cast(), Layout::new::<Shared<T>>());
        }
    }
}

impl<T: Abandonable> Abandonable for PoolAllocated<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller passes a valid handle that is not used or dropped afterwards.
        let handle = unsafe { this.as_mut() };
        if handle.release() {
            // SAFETY: this is the last handle; the value is abandoned in place, and its block is not touched.
            unsafe { T::abandon_in_place(NonNull::from_mut(&mut *handle.shared.as_mut().value)) };
        }
    }
}

/// Access to the value of a handle. Within one thread no lock is needed.
#[derive(Debug)]
pub struct Access<'parent, T> {
    value: &'parent T,
}

impl<T> Deref for Access<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.value
    }
}

impl<'parent, T: Send + Debug + Abandonable> LockGuard<'parent, T> for Access<'parent, T> {}

impl<T: Send + Debug + Abandonable> ArcSyncPolicy<T> for PoolAllocated<T> {
    type LockGuard<'parent>
        = Access<'parent, T>
    where
        Self: 'parent,
        T: 'parent;

    fn new(value: T) -> Result<Self, ArcSyncPolicyCreationError> {
        let block = take(Layout::new::<Shared<T>>()).cast::<Shared<T>>();
        // SAFETY: the block has the size and alignment of its layout and has no other owner.
        unsafe { block.write(Shared { handles: Cell::new(1), value: ManuallyDrop::new(value) }) };
        NonNull::new(block)
            .map(|shared| Self { shared })
            .ok_or(ArcSyncPolicyCreationError::InsufficientResources)
    }

    fn lock(&self) -> Self::LockGuard<'_> {
        Access { value: &self.shared().value }
    }
}

#[cfg(test)]
mod tests {
    use std::rc::Rc;

    use super::*;

    #[derive(Debug)]
    struct Counted(Rc<Cell<u32>>, [u64; 4]);

    // SAFETY: the tests keep every value on one thread; only the trait requires `Send`.
    unsafe impl Send for Counted {}

    impl Abandonable for Counted {
        unsafe fn abandon_in_place(_: NonNull<Self>) {}
    }

    impl Drop for Counted {
        fn drop(&mut self) {
            self.0.set(self.0.get() + 1);
        }
    }

    fn counted(drops: &Rc<Cell<u32>>) -> PoolAllocated<Counted> {
        PoolAllocated::new(Counted(drops.clone(), [7; 4])).unwrap()
    }

    #[test]
    fn value_is_dropped_once_with_the_last_handle() {
        let drops = Rc::new(Cell::new(0));
        let first = counted(&drops);
        let second = first.clone();
        drop(first);
        assert_eq!(drops.get(), 0);
        assert_eq!(second.lock().1, [7; 4]);
        drop(second);
        assert_eq!(drops.get(), 1);
    }

    #[test]
    fn released_block_is_reused_first() {
        let drops = Rc::new(Cell::new(0));
        let first = counted(&drops);
        let address = first.shared.as_ptr();
        drop(first);
        assert_eq!(counted(&drops).shared.as_ptr(), address);
    }

    #[test]
    fn blocks_beyond_the_pool_are_freed_and_allocated_again() {
        let drops = Rc::new(Cell::new(0));
        for _ in 0..3 {
            let many: Vec<_> = (0..KEPT + 9).map(|_| counted(&drops)).collect();
            drop(many);
        }
        assert_eq!(drops.get(), 3 * (KEPT as u32 + 9));
    }

    #[test]
    fn value_larger_than_a_block_is_allocated_separately() {
        #[derive(Debug)]
        struct Large([u64; 100]);
        impl Abandonable for Large {
            unsafe fn abandon_in_place(_: NonNull<Self>) {}
        }
        let large = PoolAllocated::new(Large([3; 100])).unwrap();
        assert_eq!(large.clone().lock().0[99], 3);
    }

    #[test]
    fn abandoned_handle_does_not_affect_the_others() {
        let drops = Rc::new(Cell::new(0));
        let kept = counted(&drops);
        let mut abandoned = ManuallyDrop::new(kept.clone());
        // SAFETY: the handle is not used afterwards.
        unsafe { PoolAllocated::abandon_in_place(NonNull::from_mut(&mut *abandoned)) };
        drop(kept);
        assert_eq!(drops.get(), 1);
    }
}
