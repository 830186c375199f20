//! Functions that are compiled twice: for every processor, and for processors with AVX2 and FMA (registers of
//! four numbers, fused multiply-add).
//!
//! The version is selected at run time. A fused operation rounds once instead of twice, so the last bits of
//! results may differ between processors, but never between runs.

#![allow(
    unsafe_code,
    reason = "code compiled for AVX2 may only run where the processor has it, which is checked here"
)]

/// A computation. `run`, and everything it calls in inner loops, must be `inline(always)`; other functions
/// are compiled for the baseline processor.
pub(crate) trait Work {
    type Output;

    /// With `FUSED`, [`fused`] costs no more than a multiplication.
    fn run<const FUSED: bool>(self) -> Self::Output;
}

/// `a b + c`
#[inline(always)]
pub(crate) fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Runs the computation with the widest available registers.
#[inline(always)]
pub(crate) fn widest<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the processor supports AVX2, as checked above.
        return unsafe { with_avx2(work) };
    }
    work.run::<false>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<W: Work>(work: W) -> W::Output {
    work.run::<true>()
}
