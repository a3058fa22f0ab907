//! Which blocks are what they would be without loss (`docs/spec/format.md`, section 7.13).
//!
//! The symbols of a resilient frame are right whatever was lost. So its blocks are right too where what they are predicted from
//! is right. An encoder that knows this can make a volume whole again without a keyframe.

use super::symbols::STEPS_PER_BLOCK;
use super::{CausalBlocks, FrameSymbols, MainBlocks, Vector};
use crate::main::extension::ExtensionPlan;
use crate::main::loop_filter::filtered_faces;
use isv_format::MainFrameHeader;
use isv_volume::BlockCoord;

/// Which blocks of a volume of profile `main` are exact: as a decoder without loss has them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExactBlocks {
    /// For each block of the volume.
    exact: Vec<bool>,
    /// Whether it is exact, too, that there is no block where the volume has none.
    beyond: bool,
}

impl ExactBlocks {
    /// Nothing of a volume of so many blocks, which was kept over a loss.
    #[must_use]
    pub fn none(blocks: usize) -> Self {
        Self { exact: vec![false; blocks], beyond: false }
    }

    /// Whether a block of the volume is exact, by its index there.
    ///
    /// # Panics
    /// If the volume has no such block.
    #[must_use]
    pub fn contains(&self, block: usize) -> bool {
        self.exact[block]
    }

    /// How many blocks of the volume are not exact.
    #[must_use]
    pub fn inexact(&self) -> usize {
        self.exact.iter().filter(|exact| !**exact).count()
    }

    /// Whether the volume is exact.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.beyond && self.inexact() == 0
    }

    /// Whether the block at a coordinate is predicted from exact samples of this volume under a vector. `blocks`: of the volume.
    #[must_use]
    pub fn predicts(&self, blocks: MainBlocks, coord: BlockCoord, Vector(vector): Vector) -> bool {
        let vector = vector.map(i32::from);
        let whole = vector.map(|v| (v + STEPS_PER_BLOCK / 2).div_euclid(STEPS_PER_BLOCK));
        let rest: [i32; 3] = std::array::from_fn(|axis| vector[axis] - STEPS_PER_BLOCK * whole[axis]);
        // Along an axis, the block that the whole part leads to, and the one beyond it that the rest reaches into.
        (0..8).all(|corner| {
            let reach: [i32; 3] =
                std::array::from_fn(|axis| if corner >> axis & 1 == 1 { rest[axis].signum() } else { 0 });
            let place = coord.offset(std::array::from_fn(|axis| whole[axis] + reach[axis]));
            match blocks.blocks.index.get(place) {
                Some(block) => self.exact[block as usize],
                None => self.beyond,
            }
        })
    }

    /// Exact blocks of a resilient frame. `plan`: of its extension; `before`: the frame before, and which of its blocks are
    /// exact.
    #[must_use]
    pub fn of_frame(
        header: &MainFrameHeader,
        symbols: &FrameSymbols,
        causal: &CausalBlocks,
        plan: &ExtensionPlan,
        before: (MainBlocks, &Self),
    ) -> Self {
        let coded = coded_blocks(header, symbols, causal, before);
        let mut exact = vec![true; plan.coords().len()];
        for (place, coded) in plan.places().iter().zip(coded) {
            exact[*place as usize] = coded;
        }
        let is_wrong = |n: &u32| plan.coded()[*n as usize] && !exact[*n as usize];
        let extrapolated = (0..exact.len()).filter(|block| !plan.coded()[*block]);
        let wrong: Vec<_> = extrapolated
            .filter(|block| plan.index().neighbourhood(plan.coords()[*block]).iter().flatten().any(is_wrong))
            .collect();
        wrong.into_iter().for_each(|block| exact[block] = false);
        Self { exact, beyond: true }
    }
}

/// The blocks coded in a frame, after the in-loop filter.
fn coded_blocks(
    header: &MainFrameHeader,
    symbols: &FrameSymbols,
    causal: &CausalBlocks,
    (before, exact_before): (MainBlocks, &ExactBlocks),
) -> Vec<bool> {
    let mut exact = Vec::with_capacity(symbols.coords.len());
    for (block, (coord, mode)) in symbols.coords.iter().zip(&symbols.modes).enumerate() {
        exact.push(match mode.vector() {
            Some(vector) => exact_before.predicts(before, *coord, vector),
            None if header.no_spatial_prediction => true,
            None => causal.of(*coord, block).iter().flatten().all(|n| exact[*n as usize]),
        });
    }
    if header.filter > 0 {
        for faces in filtered_faces(symbols) {
            let unfiltered = exact.clone();
            for [lower, upper] in faces {
                let both = unfiltered[lower] && unfiltered[upper];
                exact[lower] &= both;
                exact[upper] &= both;
            }
        }
    }
    exact
}
