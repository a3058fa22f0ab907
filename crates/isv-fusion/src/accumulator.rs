//! A volume that grows image by image.

use crate::blocks::Blocks;
use crate::integrate::BlockSums;
use crate::{FusionError, FusionSettings, limits};
use isv_volume::{BlockCoord, DepthImage, MortonCode, SparseVolume};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Weight after which a voxel forgets as fast as it learns: thirty readings from 1 m, straight on. Something that was
/// moved away is gone after about as many readings as had seen it, and never more than these.
const MOST_WEIGHT: f32 = 30.0;

/// Fuses images taken one after the other, by a camera that moves through a scene that stands still.
///
/// Later images refine what was seen before, extend it, and take away what is no longer there: where they see past a voxel
/// that was behind a surface, and have done so for longer than the surface had been seen, it becomes free space.
#[derive(Clone, Debug)]
pub struct Accumulator {
    settings: FusionSettings,
    blocks: BTreeMap<MortonCode, BlockSums>,
}

impl Accumulator {
    /// An accumulator that has seen nothing.
    #[must_use]
    pub fn new(settings: FusionSettings) -> Self {
        Self { settings, blocks: BTreeMap::new() }
    }

    /// Adds the images of one instant.
    ///
    /// # Errors
    /// See [`FusionError`]; [`FusionSettings::max_blocks`] counts all blocks so far. After an error the accumulator is as
    /// it was before.
    pub fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
        let grid = self.settings.grid;
        let views = limits::checked_views(images, &self.settings)?;
        let known: Vec<BlockCoord> = self.blocks.keys().map(|code| code.coord()).collect();
        for coord in limits::checked_blocks(&views, &self.settings, &known)? {
            self.blocks.entry(coord.morton()).or_insert_with(|| BlockSums::new(grid.edge));
        }
        self.blocks.par_iter_mut().for_each(|(code, sums)| {
            for view in &views {
                sums.integrate(view, &grid, code.coord());
            }
            sums.forget(MOST_WEIGHT);
        });
        Ok(())
    }

    /// The volume of all that was seen so far; empty before the first images.
    #[must_use]
    pub fn volume(&self) -> SparseVolume {
        let coords = self.blocks.keys().map(|code| code.coord()).collect();
        let copy = |sums: &mut BlockSums, coord: BlockCoord| sums.clone_from(&self.blocks[&coord.morton()]);
        Blocks::resolve_all(self.settings.grid, coords, BlockSums::default, copy).finish()
    }
}
