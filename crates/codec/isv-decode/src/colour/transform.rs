//! The weighted Haar transform of a node's children (RAHT), in means and differences.
//!
//! A node's mean and up to seven differences stand for the means of its children. The differences are first along z, then along y
//! in either half, then along x in each quarter. A difference is there where both sides have cells. A difference `d` between
//! sides of weights `a` and `b` is RAHT's orthonormal coefficient `d * sqrt(a b / (a + b))`. All coefficients have one quantizer
//! step.

use super::frame::SAMPLE_BITS;
use super::tree::HALF_WEIGHT;

/// Differences of a node with eight children.
pub const DIFFERENCES: usize = 7;
/// Children on the lower and on the upper side of each difference.
pub const SIDES: [[u8; 2]; DIFFERENCES] =
    [[0x0f, 0xf0], [0x03, 0x0c], [0x30, 0xc0], [0x01, 0x02], [0x04, 0x08], [0x10, 0x20], [0x40, 0x80]];
/// Largest magnitude of a level.
pub const MAX_LEVEL: i32 = 1 << 15;
/// Fractional bits of a quantizer step, in 8-bit steps.
pub const STEP_BITS: u32 = 4;
/// Fractional bits of a root.
const ROOT_BITS: u32 = 20;
/// Largest magnitude of a difference that is dequantized: twice what samples can differ by.
const MAX_DIFFERENCE: i64 = 2 << (8 + SAMPLE_BITS);

/// The differences that a node with these children has, in order.
pub fn differences(children: u8) -> impl Iterator<Item = usize> {
    (0..DIFFERENCES).filter(move |d| SIDES[*d].iter().all(|side| children & side != 0))
}

/// Weights of both sides of a difference, from those of all eight children.
#[must_use]
#[inline(always)]
pub fn side_weights(weights: &[u32; 8], difference: usize) -> [u32; 2] {
    SIDES[difference]
        .map(|side| (0..8).filter(|child| side >> child & 1 != 0).map(|child| weights[child]).sum())
}

/// The weights of a node's children by their slot; 0 where there is none.
#[must_use]
#[inline(always)]
pub fn by_slot(children: u8, weights: &[u32]) -> [u32; 8] {
    let mut by_slot = [0; 8];
    let mut rest = weights.iter();
    for (slot, weight) in by_slot.iter_mut().enumerate() {
        if children >> slot & 1 != 0 {
            *weight = *rest.next().expect("a weight for each child");
        }
    }
    by_slot
}

/// The difference between two sides that a level stands for, in samples. `step`: in 1/16.
#[must_use]
pub fn dequantized(level: i32, step: u32, [lower, upper]: [u32; 2]) -> i32 {
    // Weights count quarter cells; a coefficient counts half cells, four of these.
    let ratio = ((u64::from(HALF_WEIGHT) * u64::from(lower + upper)) << (2 * ROOT_BITS))
        / (u64::from(lower) * u64::from(upper));
    scaled(level, step, ratio.isqrt())
}

/// The mean of a block that a level stands for, in samples. `step`: in 1/16.
#[must_use]
pub fn dequantized_mean(level: i32, step: u32, weight: u32) -> i32 {
    let ratio = (u64::from(HALF_WEIGHT) << (2 * ROOT_BITS)) / u64::from(weight);
    scaled(level, step, ratio.isqrt())
}

fn scaled(level: i32, step: u32, root: u64) -> i32 {
    const SHIFT: u32 = ROOT_BITS + STEP_BITS - SAMPLE_BITS;
    let value = i64::from(level) * i64::from(step) * root as i64;
    ((value + (1 << (SHIFT - 1))) >> SHIFT).clamp(-MAX_DIFFERENCE, MAX_DIFFERENCE) as i32
}

/// Adds a difference to the values of a node's children, whose weighted mean stays what it is.
#[inline(always)]
pub fn add_difference(values: &mut [[i32; 3]; 8], difference: usize, by: [i32; 3], [lower, upper]: [u32; 2]) {
    let all = i64::from(lower + upper);
    let up = by.map(|d| ((i64::from(lower) * i64::from(d) + all / 2).div_euclid(all)) as i32);
    let [low_side, high_side] = SIDES[difference];
    for (child, value) in values.iter_mut().enumerate() {
        for channel in 0..3 {
            if low_side >> child & 1 != 0 {
                value[channel] += up[channel] - by[channel];
            }
            if high_side >> child & 1 != 0 {
                value[channel] += up[channel];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_one_cell_is_orthonormal() {
        // Two half cells: sqrt(4 * 8 / 16) = sqrt 2 samples of 1/64 to a step of 1.
        assert_eq!(dequantized(1, 16, [4, 4]), 91);
        assert_eq!(dequantized(-3, 16, [4, 4]), -272);
        assert_eq!(dequantized_mean(1, 16, 4), 64);
        assert_eq!(dequantized_mean(1, 32, 16), 64);
    }

    #[test]
    fn hostile_levels_saturate() {
        for level in [-MAX_LEVEL, MAX_LEVEL] {
            for weights in [[1, 1], [1, 1 << 15], [1 << 15, 1 << 15]] {
                assert!(dequantized(level, (1 << 16) - 1, weights).abs() <= MAX_DIFFERENCE as i32);
            }
        }
    }

    #[test]
    fn a_difference_keeps_the_mean() {
        let weights = [4, 0, 8, 0, 12, 0, 0, 16];
        let mut values = [[0; 3]; 8];
        let sides = side_weights(&weights, 0);
        assert_eq!(sides, [12, 28]);
        add_difference(&mut values, 0, [400, 0, -400], sides);
        let mean = |channel: usize| (0..8).map(|c| weights[c] as i32 * values[c][channel]).sum::<i32>();
        assert_eq!([mean(0), mean(1), mean(2)], [0, 0, 0]);
        assert_eq!(values[7][0] - values[0][0], 400);
    }

    #[test]
    fn nodes_have_one_difference_less_than_children() {
        for children in 1..=255u8 {
            assert_eq!(differences(children).count() as u32, children.count_ones() - 1);
        }
    }
}
