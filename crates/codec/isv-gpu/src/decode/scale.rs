//! Levels and their scale as kernels take them.

use isv_kernels::dct::BlockTransform;
use isv_kernels::quant::Quantizer;

/// Bits of a level's position in its block.
const POSITION_BITS: u32 = 9;
/// Largest magnitude of a level's value. Larger ones saturate a coefficient in blocks of 8, as this one does. The unit of these
/// coefficients is 2^7 sixteenths of a code at most, and a step is one or more.
const VALUE_LIMIT: i32 = (1 << 22) - 1;

/// The position in its block and the value of a level, in one word.
pub(super) fn pack_level(position: u16, value: i32) -> u32 {
    (value.clamp(-VALUE_LIMIT - 1, VALUE_LIMIT) << POSITION_BITS).cast_unsigned() | u32::from(position)
}

/// `Scale` of `residual.wgsl`: the quantizers of the lowest coefficient and of all others.
pub(crate) fn scale(transform: &BlockTransform, lowest: &Quantizer, others: &Quantizer) -> [u32; 8] {
    let [along_z, along_y, along_x] = transform.inverse_shifts();
    debug_assert!(lowest.unit_shift() <= 7, "a saturated level saturates its coefficient");
    let signed = [lowest.step(), others.step(), lowest.level_limit(), others.level_limit()];
    let [a, b, c, d] = signed.map(i32::cast_unsigned);
    [along_z, along_y, along_x, lowest.unit_shift(), a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_kernels::quant::StepSize;
    use isv_volume::{BlockEdge, Truncation};

    /// Tries all truncations and the smallest step.
    #[test]
    fn values_that_do_not_fit_saturate_as_they_should() {
        for voxels in Truncation::RANGE {
            let transform = BlockTransform::new(BlockEdge::E8, Truncation::from_voxels(voxels).unwrap());
            let quantizer = Quantizer::new(StepSize::new(1).unwrap(), transform.coefficient_exponent());
            for value in [i32::MIN, -VALUE_LIMIT - 2, VALUE_LIMIT + 1, i32::MAX] {
                let packed = pack_level(77, value);
                assert_eq!(packed & 511, 77);
                let kept = packed.cast_signed() >> POSITION_BITS;
                assert_eq!(quantizer.dequantize(kept), quantizer.dequantize(value), "{voxels}, {value}");
            }
        }
    }
}
