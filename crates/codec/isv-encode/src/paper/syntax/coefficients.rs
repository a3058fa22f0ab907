//! Quantized coefficients: one stream an index (Sec. 3.3).

use isv_decode::paper::syntax::coefficients::CoefficientModels;
use isv_entropy::RangeEncoder;

/// Writes a slice: for each index in scan order, its level in each block. Also returns how many of the bits are those of
/// index 0.
pub(super) fn write(
    models: &mut CoefficientModels,
    references: &[Option<u32>],
    levels: &[i32],
) -> (Vec<u8>, f64) {
    let mut encoder = RangeEncoder::new();
    let mut dc_bits = 0.0;
    let count = models.models[0].len();
    for k in 0..count {
        for (block, reference) in references.iter().enumerate() {
            let model = &mut models.models[usize::from(reference.is_some())][k];
            model.encode(&mut encoder, levels[block * count + k]);
        }
        if k == 0 {
            dc_bits = encoder.bits();
        }
    }
    (encoder.finish(), dc_bits)
}
