//! Motion vectors, predicted from the blocks before.

use isv_decode::paper::syntax::CausalNeighbours;
use isv_decode::paper::syntax::motion::MotionModels;
use isv_entropy::{IntegerModel, RangeEncoder};
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use std::ops::Range;

/// Writes the vectors of a slice's blocks, `range` of the frame's; blocks without a reference have none.
pub(super) fn write(
    models: &mut MotionModels,
    prediction: Prediction,
    range: &Range<usize>,
    references: &[Option<u32>],
    vectors: &[MotionVector],
    neighbours: &CausalNeighbours,
) -> Vec<u8> {
    if !prediction.has_motion() {
        return Vec::new();
    }
    let mut encoder = RangeEncoder::new();
    let mut last = MotionVector::ZERO;
    for block in 0..range.len() {
        if references[block].is_none() {
            continue;
        }
        let (predicted, spread) = neighbours.predict(range, block, references, vectors, last);
        let models = &mut models.components[spread];
        let vector = &vectors[block];
        for c in 0..3 {
            write_component(&mut models[c], &mut encoder, vector.translation[c], predicted.translation[c]);
        }
        if prediction == Prediction::SixDof {
            for c in 0..3 {
                write_component(&mut models[3 + c], &mut encoder, vector.rotation[c], predicted.rotation[c]);
            }
        }
        last = *vector;
    }
    encoder.finish()
}

fn write_component(model: &mut IntegerModel, encoder: &mut RangeEncoder, value: i8, predicted: i8) {
    model.encode(encoder, i32::from(value) - i32::from(predicted));
}
