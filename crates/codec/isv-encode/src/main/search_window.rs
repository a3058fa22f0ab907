//! The frame before around displaced blocks, as the search for motion reads it. The samples are those of
//! [`TemporalPredictor::look_at`](isv_decode::main::reconstruct::TemporalPredictor::look_at). The window serves places that lie
//! close together and are asked for by the dozen.

use isv_decode::main::MainReference;
use isv_kernels::block8::{self, Block};
use isv_kernels::window::WindowRows;
use isv_volume::BlockCoord;

/// Voxels along a block's edge.
const EDGE: i32 = block8::EDGE as i32;
/// Places that a search goes back to: it compares some, and goes on from the best.
const PLACES: usize = 4;

/// 2x2x2 blocks, x fastest.
type Octet<'a> = [&'a Block; 8];

/// A window of the frame before, at the last few places, and what is known of the blocks that it moves over.
#[derive(Debug)]
pub(super) struct SearchWindow<'a> {
    reference: &'a MainReference,
    /// Octets by the parities of their lowest coordinates, each with that coordinate; nothing if a block of it is missing. Those
    /// around a block have all parities, so none takes the place of another.
    octets: [Option<(BlockCoord, Option<Octet<'a>>)>; 8],
    /// The last places.
    places: [Place; PLACES],
    /// The one that is left next.
    oldest: usize,
}

/// A place of the window, and the samples there.
#[derive(Debug, Default)]
struct Place {
    /// The voxel that it began at.
    first: Option<[i32; 3]>,
    rows: WindowRows,
}

impl<'a> SearchWindow<'a> {
    /// Nowhere yet.
    pub(super) fn new(reference: &'a MainReference) -> Self {
        Self { reference, octets: [None; 8], places: Default::default(), oldest: 0 }
    }

    /// The samples at a block displaced by whole voxels, if the frame has all blocks there.
    pub(super) fn look_at(&mut self, coord: BlockCoord, voxels: [i32; 3]) -> Option<&WindowRows> {
        let coord = coord.to_array();
        let first = [0, 1, 2].map(|axis| coord[axis] * EDGE + voxels[axis]);
        if let Some(known) = (0..PLACES).find(|place| self.places[*place].first == Some(first)) {
            return Some(&self.places[known].rows);
        }
        let octet = self.octet(first.map(|c| c.div_euclid(EDGE)).into())?;
        let place = &mut self.places[self.oldest];
        self.oldest = (self.oldest + 1) % PLACES;
        place.rows.load(&octet, first.map(|c| c.rem_euclid(EDGE) as usize));
        place.first = Some(first);
        Some(&place.rows)
    }

    fn octet(&mut self, lowest: BlockCoord) -> Option<Octet<'a>> {
        let known = &mut self.octets[(lowest.x & 1 | (lowest.y & 1) << 1 | (lowest.z & 1) << 2) as usize];
        match known {
            Some((coord, octet)) if *coord == lowest => *octet,
            _ => {
                let octet = octet(self.reference, lowest);
                *known = Some((lowest, octet));
                octet
            }
        }
    }
}

/// The octet from a coordinate on, if all of its blocks are there.
fn octet(reference: &MainReference, lowest: BlockCoord) -> Option<Octet<'_>> {
    let blocks = reference.index().octet(lowest);
    let mut octet = [reference.volume().block(blocks[0]? as usize); 8];
    for (samples, block) in octet.iter_mut().zip(blocks) {
        *samples = reference.volume().block(block? as usize);
    }
    Some(octet.map(|samples| samples.try_into().expect("blocks of an edge of 8")))
}

#[cfg(test)]
mod tests {
    use super::super::probe::reference;
    use super::*;
    use isv_decode::main::Vector;
    use isv_decode::main::reconstruct::TemporalPredictor;
    use isv_kernels::window::ROWS;
    use isv_testkit::ball;
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    #[test]
    fn samples_are_those_of_prediction() {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        let reference = reference(&ball(grid, 0.0));
        let (mut window, mut predictor) = (SearchWindow::new(&reference), TemporalPredictor::new(&reference));
        let (mut found, mut missing) = (0, 0);
        for (n, coord) in reference.volume().coords().iter().enumerate() {
            let voxels = [n * 7 % 23, n * 5 % 19, n * 3 % 29].map(|c| c as i32 - 11);
            let Some(rows) = window.look_at(*coord, voxels) else {
                missing += 1;
                continue;
            };
            found += 1;
            let expected = predictor.look_at(*coord, Vector(voxels.map(|v| 4 * v as i16)), voxels);
            for row in 0..ROWS {
                assert_eq!(
                    [0, 1].map(|x| rows.eight(row, x)),
                    [0, 1].map(|x| expected.eight(row, x)),
                    "{row}"
                );
            }
        }
        assert!(found > 20 && missing > 0, "{found} found, {missing} missing");
    }
}
