//! Pieces of the decoded surface that float where the source has none.
//!
//! Samples are whatever is cheap where the source was not observed, and beyond its band. A block that was extrapolated has the sign
//! that its neighbours vote for. So crossed cells may appear there that nobody asked for. As masks come after the samples, an
//! encoder that looks at what will be decoded can take such cells out.

use super::target::{Bits, Targets};
use isv_decode::main::crossed_cells::crossed_cells;
use isv_decode::main::extension::{DecodedBlocks, FrameBlocks};
use isv_kernels::simd::vectorized;
use isv_volume::{BlockCoord, BlockEdge, BlockIndex, CODES_PER_VOXEL, VoxelMask};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Distance (voxels) up to which a decoded surface beside the wanted one is not taken for floaters. What a coarse step moved
/// further still hangs together with cells that are vouched for.
const BESIDE: usize = 1;
/// Distance (codes) up to which the source's surface vouches for the decoded one, in a block that is kept of the frame before.
const NEAR: i16 = CODES_PER_VOXEL as i16;

/// Voxels whose masks take out the crossed cells that hang together, face to face, with none where the source's surface is. By block
/// of the extended volume.
///
/// `unobserved`: what is masked anyway. Cells of which every corner is one of a cell that stays are left.
pub(crate) fn floaters(
    extended: &DecodedBlocks,
    unobserved: &BTreeMap<u32, VoxelMask>,
    targets: &Targets,
) -> BTreeMap<u32, VoxelMask> {
    let cells = crossed_cells(extended, unobserved);
    let FrameBlocks { all, coded, unsettled, .. } = extended.sets();
    let (coords, coded) = (extended.volume().coords(), coded.marks_in(all));
    let index = OnceLock::new();
    let stranded = cells.par_iter().map(|(block, cells)| {
        let block = *block as usize;
        let vouched = if coded[block] { vouched(targets, coords[block], &index) } else { [0; 8] };
        stranded_within(bits(cells), &vouched)
    });
    let stranded: Vec<Bits> = stranded.collect();
    if stranded.iter().all(|cells| *cells == [0; 8]) {
        return BTreeMap::new();
    }
    let unsettled = unsettled.marks_in(all);
    let mut crossed = Crossed { cells: &cells, stranded, extended, unsettled };
    crossed.rescue();
    crossed.corners()
}

/// The voxels of a block that was coded where crossed cells may begin. `index`: of the source's blocks, once it is needed.
fn vouched(targets: &Targets, coord: BlockCoord, index: &OnceLock<BlockIndex>) -> Bits {
    if let Some(block) = targets.find(coord) {
        return (0..BESIDE).fold(*targets.crossed(block), |voxels, _| dilated(&voxels));
    }
    let source = targets.source();
    let block = index.get_or_init(|| source.index()).get(coord);
    block.map_or([0; 8], |block| near(source.block(block as usize)))
}

fn bits(mask: &VoxelMask) -> &Bits {
    mask.words().try_into().expect("blocks of an edge of 8")
}

/// The voxels that are [`NEAR`] the surface.
fn near(samples: &[i16]) -> Bits {
    vectorized(
        #[inline(always)]
        || {
            std::array::from_fn(|z| {
                let layer = samples[64 * z..64 * z + 64].iter().enumerate();
                layer.map(|(voxel, code)| u64::from(code.abs() <= NEAR) << voxel).sum()
            })
        },
    )
}

/// The cells of a block that hang together, within the block, with none that is vouched for.
fn stranded_within(cells: &Bits, vouched: &Bits) -> Bits {
    let within = |voxels: &Bits| -> Bits { std::array::from_fn(|z| voxels[z] & cells[z]) };
    let mut firm = within(vouched);
    loop {
        let more = within(&dilated(&firm));
        if more == firm {
            return std::array::from_fn(|z| cells[z] & !firm[z]);
        }
        firm = more;
    }
}

/// Voxels of a block with those at the faces of each.
fn dilated(voxels: &Bits) -> Bits {
    const FIRST_IN_ROW: u64 = 0x0101_0101_0101_0101;
    let at = |z: Option<usize>| z.and_then(|z| voxels.get(z)).copied().unwrap_or(0);
    std::array::from_fn(|z| {
        let layer = voxels[z];
        let along_x = layer << 1 & !FIRST_IN_ROW | layer >> 1 & !(FIRST_IN_ROW << 7);
        layer | along_x | layer << 8 | layer >> 8 | at(z.checked_sub(1)) | at(Some(z + 1))
    })
}

/// The crossed cells of a frame, by their lowest corners, of which some are stranded.
struct Crossed<'a> {
    /// By block of the extended volume, in order.
    cells: &'a [(u32, VoxelMask)],
    /// Cells of each of these blocks that hang together with none that is vouched for.
    stranded: Vec<Bits>,
    extended: &'a DecodedBlocks,
    /// For each block of the extended volume, whether its masks are of this frame.
    unsettled: Vec<bool>,
}

/// What is at a place on the grid.
enum Found {
    /// A crossed cell that stays, or one in a block whose masks are those of an earlier frame.
    Firm,
    /// A stranded one: the place of its block in the list, and its voxel.
    Stranded(usize, usize),
}

impl Crossed<'_> {
    /// Looks at a cell by its lowest corner.
    fn find(&self, (coord, voxel): (BlockCoord, usize)) -> Option<Found> {
        let block = self.extended.index().get(coord)?;
        let Ok(place) = self.cells.binary_search_by_key(&block, |(block, _)| *block) else {
            return (!self.unsettled[block as usize]).then_some(Found::Firm);
        };
        if self.is_stranded(place, voxel) {
            return Some(Found::Stranded(place, voxel));
        }
        self.cells[place].1.contains(voxel).then_some(Found::Firm)
    }

    fn is_stranded(&self, place: usize, voxel: usize) -> bool {
        self.stranded[place][voxel / 64] >> (voxel % 64) & 1 != 0
    }

    fn coord(&self, place: usize) -> BlockCoord {
        self.extended.volume().coords()[self.cells[place].0 as usize]
    }

    fn all_stranded(&self) -> Vec<(usize, usize)> {
        let mut all = Vec::new();
        for (place, words) in self.stranded.iter().enumerate() {
            for (z, word) in words.iter().enumerate() {
                let mut rest = *word;
                while rest != 0 {
                    all.push((place, 64 * z + rest.trailing_zeros() as usize));
                    rest &= rest - 1;
                }
            }
        }
        all
    }

    /// What is at the faces of a cell.
    fn beside(&self, (place, voxel): (usize, usize)) -> impl Iterator<Item = Found> {
        let coord = self.coord(place);
        const FACES: [[i32; 3]; 6] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];
        FACES.into_iter().filter_map(move |step| self.find(at_offset(coord, voxel, step)))
    }

    /// Takes back those that hang together with firm cells of other blocks.
    fn rescue(&mut self) {
        let is_held = |cell: &(usize, usize)| self.beside(*cell).any(|found| matches!(found, Found::Firm));
        let mut held: Vec<_> = self.all_stranded().into_iter().filter(is_held).collect();
        while let Some((place, voxel)) = held.pop() {
            self.stranded[place][voxel / 64] &= !(1 << (voxel % 64));
            let beside = self.beside((place, voxel)).filter_map(|found| match found {
                Found::Stranded(place, voxel) => Some((place, voxel)),
                Found::Firm => None,
            });
            held.extend(beside.collect::<Vec<_>>());
        }
    }

    /// The corners of stranded cells that are corners of no others.
    fn corners(&self) -> BTreeMap<u32, VoxelMask> {
        let mut masks = BTreeMap::new();
        for (place, voxel) in self.all_stranded() {
            for (coord, voxel) in (0..8).map(|corner| at_offset(self.coord(place), voxel, octant(corner))) {
                let is_firm = |cell: i32| {
                    let lowest = at_offset(coord, voxel, octant(cell).map(|step| -step));
                    matches!(self.find(lowest), Some(Found::Firm))
                };
                let block = self.extended.index().get(coord).expect("crossed cells have all corners");
                if self.unsettled[block as usize] && !(0..8).any(is_firm) {
                    masks.entry(block).or_insert_with(|| VoxelMask::empty(BlockEdge::E8)).insert(voxel);
                }
            }
        }
        masks
    }
}

/// The corners of a cube, x in the lowest bit.
fn octant(corner: i32) -> [i32; 3] {
    [corner & 1, corner >> 1 & 1, corner >> 2]
}

/// The voxel at an offset of less than a block from one, with its block.
fn at_offset(block: BlockCoord, voxel: usize, offset: [i32; 3]) -> (BlockCoord, usize) {
    let at = [voxel & 7, voxel >> 3 & 7, voxel >> 6].map(|c| c as i32);
    let to: [i32; 3] = std::array::from_fn(|axis| at[axis] + offset[axis]);
    let [x, y, z] = to.map(|c| (c & 7) as usize);
    (block.offset(to.map(|c| c >> 3)), 64 * z + 8 * y + x)
}

#[cfg(test)]
mod tests {
    use super::super::settings::Band;
    use super::super::tools::Tools;
    use super::*;
    use isv_testkit::volume_of;
    use isv_volume::{BlockEdge, BlockSet, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelSize};

    fn ball() -> SparseVolume {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        };
        volume_of(grid, 3, |[x, y, z]| (x * x + y * y + z * z).sqrt() - 15.3, |_| false)
    }

    /// The blocks that are coded, extended, one sample replaced.
    fn decoded(targets: &Targets, replaced: Option<(usize, usize, i16)>) -> DecodedBlocks {
        let mut builder = VolumeBuilder::new(*targets.source().grid());
        for (block, coord) in targets.coords().iter().enumerate() {
            let mut samples = targets.samples(block).to_vec();
            if let Some((_, voxel, code)) = replaced.filter(|(there, ..)| *there == block) {
                samples[voxel] = code;
            }
            builder.push(*coord, samples, None);
        }
        DecodedBlocks::from_coded(&builder.finish())
    }

    #[test]
    fn specks_go_and_nothing_else() {
        let source = ball();
        let targets = Targets::new(&source, Band::Surface, Tools::ALL, &BlockSet::default());
        let clean = decoded(&targets, None);
        let none = BTreeMap::new();
        assert_eq!(floaters(&clean, &none, &targets), none);
        let expected = crossed_cells(&clean, &none);
        let far = |voxel: &(usize, i16)| voxel.1.abs() > 4 * CODES_PER_VOXEL as i16;
        let mut specks = 0;
        for block in 0..targets.len() {
            // Every seventh, so that each place in a block has its turn, corners among them.
            let samples = targets.samples(block).iter().copied().enumerate().filter(far);
            for (voxel, code) in samples.skip(block % 7).step_by(7) {
                let dirty = decoded(&targets, Some((block, voxel, -code.signum() * 300)));
                let masks = floaters(&dirty, &none, &targets);
                assert!(!masks.is_empty(), "{block} {voxel} {code}");
                assert_eq!(crossed_cells(&dirty, &masks), expected, "{block} {voxel}");
                specks += 1;
            }
        }
        assert!(specks > 200, "{specks}");
    }

    #[test]
    fn what_hangs_together_with_the_surface_stays() {
        let source = ball();
        let targets = Targets::new(&source, Band::Surface, Tools::ALL, &BlockSet::default());
        // The ball of the frame before, as a coarse step may leave it: three voxels off on one side, near on others.
        let moved = volume_of(
            *source.grid(),
            3,
            |[x, y, z]| ((x - 3.0).powi(2) + y * y + z * z).sqrt() - 15.3,
            |_| false,
        );
        assert_eq!(floaters(&DecodedBlocks::from_coded(&moved), &BTreeMap::new(), &targets), BTreeMap::new());
    }
}
