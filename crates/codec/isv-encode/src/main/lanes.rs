//! Rows of eight voxels as vectors of eight lanes.

use super::target::Field;
use fearless_simd::{Simd, f32x8, i16x8, mask32x8, prelude::*};

/// A row of a field.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, field: &Field, row: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &field[8 * row..8 * row + 8])
}

/// Samples in codes.
#[inline(always)]
pub(super) fn codes<S: Simd>(simd: S, samples: &[i16; 8]) -> f32x8<S> {
    let (low, high) = simd.widen_i16x8(i16x8::from_slice(simd, samples));
    simd.cvt_f32_i32x8(simd.combine_i32x4(low, high))
}

/// The lanes whose bits are set.
#[inline(always)]
pub(super) fn mask<S: Simd>(simd: S, bits: u32) -> mask32x8<S> {
    mask32x8::from_bitmask(simd, u64::from(bits))
}

/// The sum of all lanes, from the first to the last.
#[inline(always)]
pub(super) fn sum<S: Simd>(lanes: f32x8<S>) -> f32 {
    lanes.as_slice().iter().sum()
}
