//! False zero crossings: sign changes between sheets.
//!
//! Between two sheets a voxel can lie in front of one and behind the other, so that a sign changes in free space. No surface lies
//! between two neighbours whose distances add up to more than 2 voxels. The farther one becomes unobserved. Both become unobserved if
//! both are farther than any cell of a surface reaches. Stricter rules tear surfaces at junctions and folds; looser ones leave pieces
//! in free space.

use crate::caps::{Blocks, VoxelAt};
use isv_volume::{BlockIndex, CODES_PER_VOXEL, Grid, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Distances that add up to more than this many codes leave no surface between two neighbours.
const APART: u32 = 2 * CODES_PER_VOXEL as u32;

/// No cell of a surface has a corner farther than this many codes from it: 1.75 voxels, more than the diagonal of a cell.
const NEEDED: u16 = 7 * CODES_PER_VOXEL as u16 / 4;

impl Blocks {
    /// Makes voxels beside false crossings unobserved.
    pub(crate) fn mask_false_crossings(&mut self, grid: &Grid) {
        if self.of_sheets.is_empty() {
            return;
        }
        let index = BlockIndex::new(&self.coords);
        let mut of_sheets = vec![false; self.coords.len()];
        self.of_sheets.iter().for_each(|block| of_sheets[*block as usize] = true);
        let around = |block: &u32| {
            // A block of sheets looks across all faces to those after it.
            let is_done = |before: u32| of_sheets[before as usize];
            let changes = self.sign_changes(grid.edge, &index, *block, APART, is_done);
            changes.into_iter().flat_map(|change| {
                let [a, b] = change.distances;
                let is_masked = if a.min(b) > NEEDED { [true; 2] } else { [a > b, a <= b] };
                change.pair.into_iter().zip(is_masked).filter(|(_, masked)| *masked).map(|(at, _)| at)
            })
        };
        let found: Vec<VoxelAt> = self.of_sheets.par_iter().flat_map_iter(around).collect();
        let found = BTreeSet::from_iter(found);
        for &(block, voxel) in &found {
            let mask = self.masks.entry(block).or_insert_with(|| VoxelMask::empty(grid.edge));
            mask.insert(voxel as usize);
        }
        self.drop_unobserved(&found, grid);
    }
}
