//! Hints to the processor to fetch cache lines ahead of their use.

#![allow(unsafe_code)] // instructions that neither fault nor change memory

/// Bytes of a cache line.
const LINE: usize = 64;
/// Bytes fetched ahead at most: beyond, the processor finds the pattern itself.
const MOST: usize = 1024;

/// Fetches the first cache lines of a range of addresses for reading. Any address may be named.
#[inline]
pub fn prefetch_read(address: *const u8, bytes: usize) {
    lines(address, bytes, |line| {
        // SAFETY: a prefetch neither faults nor changes memory.
        #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
        unsafe {
            use core::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            _mm_prefetch::<_MM_HINT_T0>(line as *const i8);
        }
        let _ = line;
    });
}

/// Fetches the first cache lines of a range of addresses for writing. Any address may be named.
#[inline]
pub fn prefetch_write(address: *const u8, bytes: usize) {
    lines(address, bytes, |line| {
        // SAFETY: a prefetch neither faults nor changes memory; processors without this one ignore it.
        // Written out, for the compiler makes a prefetch for reading of it unless the processor is known.
        #[cfg(all(target_arch = "x86_64", not(feature = "portable")))]
        unsafe {
            core::arch::asm!("prefetchw [{}]", in(reg) line, options(nostack, preserves_flags, readonly));
        }
        let _ = line;
    });
}

#[inline]
fn lines(address: *const u8, bytes: usize, each: impl Fn(usize)) {
    let first = address as usize / LINE;
    let last = (address as usize).saturating_add(bytes.clamp(1, MOST) - 1) / LINE;
    (first..=last).for_each(|line| each(line * LINE));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_address_may_be_prefetched() {
        prefetch_read(core::ptr::null(), 1_000);
        prefetch_write(usize::MAX as *const u8, 8);
    }
}
