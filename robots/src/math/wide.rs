//! The same code compiled twice: for every processor, and for those with registers of four numbers and fused
//! multiplication and addition (AVX2 and FMA).
//!
//! The choice is made while running. Fusing rounds once where two roundings were: results may differ in their
//! last bits from one kind of processor to the other, never from run to run.

#![allow(
    unsafe_code,
    reason = "code compiled for AVX2 may only run where the processor has it, which is checked here"
)]

/// A computation. `run`, and everything it calls in inner loops, must be `inline(always)`; other functions
/// are compiled for the baseline processor.
pub(crate) trait Work {
    type Output;

    /// `FUSED`: [`fused`] costs no more than a multiplication.
    fn run<const FUSED: bool>(self) -> Self::Output;
}

/// `a b + c`
#[inline(always)]
pub(crate) fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Computes with the widest registers there are.
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
