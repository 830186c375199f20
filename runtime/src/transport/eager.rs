//! Memory shared by a publisher and a subscriber whose cache lines are fetched together, not one after the other.
//!
//! iceoryx2 packs the queues between two ports into a few neighbouring cache lines, and both sides write to most of
//! them. Between two cores every line that is touched has to travel, one after the other: that, and not the
//! instructions, is what a hop across cores takes. The storage is the stock one, so programs with stock iceoryx2 meet
//! this one; it only asks for all of its lines at once whenever a port turns to it.

#![allow(unsafe_code)] // prefetching; and functions of a foreign trait that are unsafe are passed on

use core::cell::Cell;
use core::fmt::Debug;
use core::mem::MaybeUninit;
use core::ptr::NonNull;
use core::time::Duration;

use iceoryx2::prelude::{FileName, Path, ZeroCopySend};
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_bb_memory::bump_allocator::BumpAllocator;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::dynamic_storage::posix_shared_memory::Storage;
use iceoryx2_cal::dynamic_storage::{
    DynamicStorage, DynamicStorageBuilder, DynamicStorageCreateError, DynamicStorageOpenError,
    DynamicStorageOpenOrCreateError,
};
use iceoryx2_cal::named_concept::{
    NamedConcept, NamedConceptBuilder, NamedConceptDoesExistError, NamedConceptListError, NamedConceptMgmt,
    NamedConceptPathHintRemoveError, NamedConceptRemoveError,
};

const LINE: usize = 64;
/// Bytes behind the fixed part that hold the queues of a topic with few readers.
const QUEUES: usize = 256;

/// So many connections that a thread sends over are known to it.
const KNOWN: usize = 4;

thread_local! {
    static LEARNS: Cell<bool> = const { Cell::new(false) };
    /// Where the queues lie that this thread sends over; 0 for none.
    static SENT_OVER: [Cell<usize>; KNOWN] = const { [const { Cell::new(0) }; KNOWN] };
}

/// Notes over which connections a call sends, for [`fetch_sent_over`].
pub(super) fn learn<R>(send: impl FnOnce() -> R) -> R {
    LEARNS.set(true);
    let result = send();
    LEARNS.set(false);
    result
}

fn note(queues: usize) {
    SENT_OVER.with(|known| {
        if known.iter().all(|known| known.get() != queues) {
            (1..KNOWN).rev().for_each(|i| known[i].set(known[i - 1].get()));
            known[0].set(queues);
        }
    });
}

/// Asks for the queues that this thread is going to send over, while it waits for what it reads. Connections that are
/// gone are asked for in vain, which costs nothing and does nothing.
pub(super) fn fetch_sent_over() {
    SENT_OVER.with(|known| {
        for queues in known.iter().map(Cell::get).take_while(|queues| *queues != 0) {
            fetch_to_write(queues, QUEUES);
        }
    });
}

/// Asks the processor for the cache lines of a range, to be written to soon. A hint: any address may be named.
#[inline]
pub(super) fn fetch_to_write(address: usize, bytes: usize) {
    lines(address, bytes, |line| {
        // SAFETY: a prefetch neither faults nor changes memory; processors without this one take it as nothing. Written
        // out, for the compiler makes a prefetch for reading of it unless the processor is known.
        #[cfg(target_arch = "x86_64")]
        unsafe {
            core::arch::asm!("prefetchw [{}]", in(reg) line, options(nostack, preserves_flags, readonly));
        }
        let _ = line;
    });
}

/// Asks the processor for the cache lines of a range, to be read soon. A hint: any address may be named.
#[inline]
pub(super) fn fetch_to_read(address: usize, bytes: usize) {
    lines(address, bytes, |line| {
        // SAFETY: a prefetch neither faults nor changes memory.
        #[cfg(target_arch = "x86_64")]
        unsafe {
            use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(line as *const i8);
        }
        let _ = line;
    });
}

#[inline]
fn lines(address: usize, bytes: usize, each: impl Fn(usize)) {
    let first = address / LINE;
    let last = address.saturating_add(bytes.max(1) - 1) / LINE;
    (first..=last).for_each(|line| each(line * LINE));
}

/// The stock storage, fetched as a whole.
#[derive(Debug)]
pub struct Eager<T: Send + Sync + Debug + ZeroCopySend + 'static>(Storage<T>);

type Inner<T> = Storage<T>;

impl<T: Send + Sync + Debug + ZeroCopySend + 'static> Abandonable for Eager<T> {
    unsafe fn abandon_in_place(mut this: NonNull<Self>) {
        // SAFETY: the caller hands over a valid storage that it will not use or drop any more.
        unsafe { Inner::abandon_in_place(NonNull::from_mut(&mut this.as_mut().0)) };
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend + 'static> NamedConcept for Eager<T> {
    fn name(&self) -> &FileName {
        self.0.name()
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend + 'static> NamedConceptMgmt for Eager<T> {
    type Configuration = <Inner<T> as NamedConceptMgmt>::Configuration;

    unsafe fn remove_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptRemoveError> {
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { Inner::<T>::remove_cfg(name, config) }
    }

    fn does_exist_cfg(
        name: &FileName,
        config: &Self::Configuration,
    ) -> Result<bool, NamedConceptDoesExistError> {
        Inner::<T>::does_exist_cfg(name, config)
    }

    fn list_cfg(config: &Self::Configuration) -> Result<Vec<FileName>, NamedConceptListError> {
        Inner::<T>::list_cfg(config)
    }

    fn default_prefix() -> FileName {
        Inner::<T>::default_prefix()
    }

    fn default_path_hint() -> Path {
        Inner::<T>::default_path_hint()
    }

    fn remove_path_hint(value: &Path) -> Result<(), NamedConceptPathHintRemoveError> {
        Inner::<T>::remove_path_hint(value)
    }
}

impl<T: Send + Sync + Debug + ZeroCopySend + 'static> DynamicStorage<T> for Eager<T> {
    type Builder<'builder> = EagerBuilder<'builder, T>;

    fn does_support_persistency() -> bool {
        Inner::<T>::does_support_persistency()
    }

    fn has_ownership(&self) -> bool {
        self.0.has_ownership()
    }

    fn release_ownership(&self) {
        self.0.release_ownership();
    }

    fn acquire_ownership(&self) {
        self.0.acquire_ownership();
    }

    fn get(&self) -> &T {
        let value = self.0.get();
        // The value itself is written once; what both sides write to lies behind it.
        let queues = core::ptr::from_ref(value) as usize + size_of::<T>();
        fetch_to_write(queues, QUEUES);
        if LEARNS.get() {
            note(queues);
        }
        value
    }

    fn default_suffix() -> FileName {
        <Inner<T> as DynamicStorage<T>>::default_suffix()
    }

    unsafe fn __internal_set_type_name_in_config(config: &mut Self::Configuration, type_name: &str) {
        // SAFETY: the caller keeps the contract of the same function.
        unsafe { Inner::<T>::__internal_set_type_name_in_config(config, type_name) };
    }
}

/// Makes or opens the storage.
#[derive(Debug)]
pub struct EagerBuilder<'builder, T: Send + Sync + Debug + ZeroCopySend + 'static>(
    <Inner<T> as DynamicStorage<T>>::Builder<'builder>,
);

impl<T: Send + Sync + Debug + ZeroCopySend + 'static> NamedConceptBuilder<Eager<T>> for EagerBuilder<'_, T> {
    fn new(name: &FileName) -> Self {
        Self(NamedConceptBuilder::<Inner<T>>::new(name))
    }

    fn config(self, config: &<Eager<T> as NamedConceptMgmt>::Configuration) -> Self {
        Self(NamedConceptBuilder::<Inner<T>>::config(self.0, config))
    }
}

impl<'builder, T: Send + Sync + Debug + ZeroCopySend + 'static> DynamicStorageBuilder<'builder, T, Eager<T>>
    for EagerBuilder<'builder, T>
{
    fn has_ownership(self, value: bool) -> Self {
        Self(self.0.has_ownership(value))
    }

    fn enable_global_access(self, value: bool) -> Self {
        Self(self.0.enable_global_access(value))
    }

    fn supplementary_size(self, value: usize) -> Self {
        Self(self.0.supplementary_size(value))
    }

    fn timeout(self, value: Duration) -> Self {
        Self(self.0.timeout(value))
    }

    fn initializer<F: FnMut(&mut MaybeUninit<T>, &mut BumpAllocator) -> bool + 'builder>(
        self,
        value: F,
    ) -> Self {
        Self(self.0.initializer(value))
    }

    fn create(self) -> Result<Eager<T>, DynamicStorageCreateError> {
        self.0.create().map(Eager)
    }

    fn open(self, access_mode: AccessMode) -> Result<Eager<T>, DynamicStorageOpenError> {
        self.0.open(access_mode).map(Eager)
    }

    fn open_or_create(self) -> Result<Eager<T>, DynamicStorageOpenOrCreateError> {
        self.0.open_or_create().map(Eager)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_knows_the_connections_it_sent_over_last_each_once() {
        [10, 20, 20, 10, 30, 40, 50].into_iter().for_each(note);
        let known = SENT_OVER.with(|known| known.iter().map(Cell::get).collect::<Vec<_>>());
        assert_eq!(known, [50, 40, 30, 20]);
        fetch_sent_over();
    }

    #[test]
    fn a_range_is_all_the_lines_it_touches_and_any_address_may_be_named() {
        let touched = |address, bytes| {
            let seen = Cell::new((usize::MAX, 0, 0));
            lines(address, bytes, |line| {
                let (first, _, count) = seen.get();
                seen.set((first.min(line), line, count + 1));
            });
            seen.get()
        };
        assert_eq!(touched(128, 64), (128, 128, 1));
        assert_eq!(touched(120, 16), (64, 128, 2));
        assert_eq!(touched(64, 0), (64, 64, 1));
        fetch_to_read(0, 1_000);
        fetch_to_write(usize::MAX - 10, 8);
    }
}
