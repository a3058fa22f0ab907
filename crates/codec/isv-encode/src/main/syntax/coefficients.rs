//! Quantized coefficients, block after block.

use isv_decode::main::syntax::coefficients::{
    CoefficientModels, CountContext, UNARY_MAGNITUDES, nonzero_lower,
};
use isv_decode::main::{COEFFICIENTS, MainParameters};
use isv_entropy::{DecisionSink, MAGNITUDE_LIMIT};

/// Writes the levels of a block.
pub(crate) fn write(
    models: &mut CoefficientModels,
    parameters: &MainParameters,
    sink: &mut impl DecisionSink,
    context: &CountContext,
    levels: &[i32],
) {
    write_around_dc(models, parameters, sink, context, levels, |_| ());
}

/// Writes the levels of a block. Calls `around_dc` before and after the place and level of the DC coefficient, index 0. Where a
/// block has no levels, it is called only before.
pub(crate) fn write_around_dc<S: DecisionSink>(
    models: &mut CoefficientModels,
    parameters: &MainParameters,
    sink: &mut S,
    context: &CountContext,
    levels: &[i32],
    mut around_dc: impl FnMut(&S),
) {
    let count = levels.iter().filter(|level| **level != 0).count();
    for n in 0..COEFFICIENTS.min(count + 1) {
        sink.put_mixed(models.count(n, context), n == count);
    }
    let mut remaining = count;
    around_dc(sink);
    for k in 0..COEFFICIENTS {
        if remaining == 0 {
            break;
        }
        let certain = COEFFICIENTS - k == remaining;
        let sum = parameters.index_sum(k);
        if !certain {
            let lower = nonzero_lower(parameters, levels, k);
            sink.put_mixed(models.place(context.spatial, k, sum, remaining, lower), levels[k] != 0);
        }
        if levels[k] != 0 {
            write_level(models, sink, context.spatial, k, count, sum, levels[k]);
            remaining -= 1;
        }
        if k == 0 {
            around_dc(sink);
        }
    }
}

fn write_level(
    models: &mut CoefficientModels,
    sink: &mut impl DecisionSink,
    spatial: usize,
    k: usize,
    count: usize,
    sum: usize,
    level: i32,
) {
    let magnitude = level.unsigned_abs();
    for m in 1..=magnitude.min(UNARY_MAGNITUDES) {
        sink.put_mixed(models.magnitude(spatial, m, k, count, sum), m == magnitude);
    }
    if magnitude > UNARY_MAGNITUDES {
        write_exp_golomb(sink, magnitude - UNARY_MAGNITUDES - 1);
    }
    sink.put_raw(u32::from(level < 0), 1);
}

/// An Exp-Golomb code of order 0.
fn write_exp_golomb(sink: &mut impl DecisionSink, value: u32) {
    let exponent = (value + 1).ilog2();
    for _ in 0..exponent {
        sink.put_raw(1, 1);
    }
    if exponent < MAGNITUDE_LIMIT.ilog2() {
        sink.put_raw(0, 1);
    }
    sink.put_raw(value + 1 - (1 << exponent), exponent);
}
