//! Prefetching of cache lines.

#![allow(unsafe_code)] // instructions that neither fault nor change memory

/// Size of a cache line, bytes.
const LINE: usize = 64;
/// Maximum number of prefetched bytes; beyond it, the hardware prefetcher detects the pattern.
const MOST: usize = 1024;

/// Prefetches the first cache lines of a range of addresses for reading. Any address is allowed.
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

/// Prefetches the first cache lines of a range of addresses for writing. Any address is allowed.
#[inline]
pub fn prefetch_write(address: *const u8, bytes: usize) {
    lines(address, bytes, |line| {
        // SAFETY: a prefetch neither faults nor changes memory; processors without this instruction ignore
        // it. It is written in assembly, because the compiler replaces it with a prefetch for reading unless
        // it knows the processor.
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
