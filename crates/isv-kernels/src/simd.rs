//! Plain loops, compiled for each instruction set.

use fearless_simd::{Level, Simd, dispatch};

/// Runs a piece of work compiled for the best vector instructions that the machine has (AVX-512, AVX2, SSE4.2, NEON, simd128
/// or none), chosen at run time. What it inlines is compiled with it; integer and floating-point results are those of the
/// plain code, bit for bit, for the compiler neither reorders nor fuses operations.
///
/// `work` and all that it calls must be marked `#[inline(always)]`; what is not inlined is compiled for the baseline.
#[inline(always)]
pub fn vectorized<R>(work: impl FnOnce() -> R) -> R {
    dispatch!(Level::new(), simd => simd.vectorize(work))
}
