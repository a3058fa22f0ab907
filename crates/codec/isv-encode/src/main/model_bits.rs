//! What the levels of one block cost under the models as they are, contexts and all.

use super::level_costs::{COUNTS, LevelCosts};
use super::syntax::coefficients;
use isv_decode::main::syntax::coefficients::{CoefficientModels, CountContext, nonzero_lower};
use isv_decode::main::{COEFFICIENTS, MainParameters};
use isv_entropy::{BitCount, DecisionSink};

/// The models of a slice as one block sees them.
#[derive(Debug)]
pub(crate) struct ModelBits<'a> {
    pub parameters: &'a MainParameters,
    /// Nothing learns from being asked.
    pub models: &'a mut CoefficientModels,
    pub context: CountContext,
    /// Costs by what was coded lately: of magnitudes, and of places before anything is known of the block's levels.
    pub usual: &'a LevelCosts,
}

impl ModelBits<'_> {
    /// Bits of a block's levels, exactly.
    pub(crate) fn of(&mut self, levels: &[i32; COEFFICIENTS]) -> f32 {
        let mut bits = BitCount::default();
        coefficients::write(self.models, self.parameters, &mut bits, &self.context, levels);
        bits.0
    }

    /// Costs of changes of one level, if the others are these.
    pub(crate) fn costs_near(&mut self, levels: &[i32; COEFFICIENTS]) -> LevelCosts {
        let costs = self.usual.clone().with_counts(self.counts());
        match levels.iter().filter(|level| **level != 0).count() {
            0 => costs,
            count => costs.with_places(self.places(levels, count)),
        }
    }

    /// Bits of each number of levels.
    fn counts(&mut self) -> [f32; COUNTS] {
        let mut before = BitCount::default();
        let mut counts = [0.0; COUNTS];
        for (n, bits) in counts.iter_mut().enumerate() {
            let mut end = before;
            end.put_mixed(self.models.count(n, &self.context), true);
            before.put_mixed(self.models.count(n, &self.context), false);
            *bits = end.0;
        }
        counts
    }

    /// Bits that "there is a level" takes more than "there is none" at each place.
    fn places(&mut self, levels: &[i32; COEFFICIENTS], count: usize) -> [f32; COEFFICIENTS] {
        let spatial = self.context.spatial;
        // Of the other levels, those that are still to come.
        let mut others = count;
        std::array::from_fn(|k| {
            others -= usize::from(levels[k] != 0);
            let (sum, lower) = (self.parameters.index_sum(k), nonzero_lower(self.parameters, levels, k));
            let [mut some, mut none] = [BitCount::default(); 2];
            some.put_mixed(self.models.place(spatial, k, sum, others + 1, lower), true);
            if others > 0 {
                none.put_mixed(self.models.place(spatial, k, sum, others, lower), false);
            }
            some.0 - none.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_decode::main::{BlockMode, CausalBlocks};
    use isv_entropy::RangeEncoder;
    use isv_volume::{BlockCoord, BlockEdge, Grid, Truncation, VoxelSize};

    /// Levels that an alternating walk over the places gives.
    fn levels(of: usize) -> [i32; COEFFICIENTS] {
        std::array::from_fn(|k| if k % (of + 3) == of { 1 + (k % 3) as i32 } else { 0 })
    }

    #[test]
    fn bits_are_those_that_the_range_coder_writes() {
        let voxel_size = VoxelSize::from_metres(0.005).unwrap();
        let truncation = Truncation::DEFAULT;
        let parameters = MainParameters::new(Grid { voxel_size, edge: BlockEdge::E8, truncation });
        let coords = [BlockCoord::from([0, 0, 0])];
        let causal = CausalBlocks::new(&coords, std::iter::once(0..1));
        let context = CountContext::new(coords[0], 0, BlockMode::Spatial, &causal, |_| 0, None);
        let (mut models, mut encoder) = (CoefficientModels::default(), RangeEncoder::new());
        for of in (0..40).map(|n| n % 7) {
            coefficients::write(&mut models, &parameters, &mut encoder, &context, &levels(of));
        }
        let usual = LevelCosts::new(&parameters.scan);
        // What is written teaches the models from level to level, what is counted does not.
        for of in 0..7 {
            let mut bits = ModelBits { parameters: &parameters, models: &mut models, context, usual: &usual };
            let (before, predicted) = (encoder.bits(), bits.of(&levels(of)));
            coefficients::write(&mut models, &parameters, &mut encoder, &context, &levels(of));
            let written = (encoder.bits() - before) as f32;
            assert!(
                (predicted - written).abs() < 0.05 * written,
                "{predicted} bits predicted, {written} written"
            );
        }
    }
}
