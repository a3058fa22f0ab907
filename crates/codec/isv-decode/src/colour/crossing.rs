//! Cells of a volume that have corners inside and outside.

use super::morton::interleave;
use isv_kernels::signs::inside;
use isv_volume::SparseVolume;
use rayon::prelude::*;

/// Blocks that a thread works on at a time.
const CHUNK: usize = 256;
/// The first voxel of each row of a layer.
const FIRST: u64 = 0x0101_0101_0101_0101;

/// A bit a voxel: a word for each layer along z, x fastest.
type Layers = [u64; 8];

/// The voxels of a volume's blocks, a bit each.
pub(super) struct VoxelBits {
    /// Voxels inside the surface.
    inside: Vec<Layers>,
    /// Voxels that were observed.
    observed: Vec<Layers>,
}

impl VoxelBits {
    /// Takes the bits of a volume.
    ///
    /// # Panics
    /// If blocks have another edge than 8.
    pub(super) fn new(volume: &SparseVolume) -> Self {
        let count = volume.block_count();
        let of_block = |block| inside(volume.block(block).try_into().expect("blocks of an edge of 8"));
        let inside = (0..count).into_par_iter().with_min_len(CHUNK).map(of_block).collect();
        let mut observed = vec![[!0; 8]; count];
        for (block, mask) in volume.unobserved_masks() {
            for (layer, unobserved) in observed[*block as usize].iter_mut().zip(mask.words()) {
                *layer = !unobserved;
            }
        }
        Self { inside, observed }
    }
}

/// A layer of voxels and the next voxels along x, y and both. `slots`: the block and those after it along these axes; nothing is set
/// where there is no block.
#[inline(always)]
fn shifted(slots: [Option<&Layers>; 4], z: usize) -> [u64; 4] {
    let [own, along_x, along_y, along_both] = slots.map(|layers| layers.map_or(0, |layers| layers[z]));
    let next_x = own >> 1 & !(FIRST << 7) | (along_x & FIRST) << 7;
    let next_y = own >> 8 | along_y << 56;
    let row_beyond = along_y >> 1 & 0x7f | (along_both & 1) << 7;
    [own, next_x, next_y, next_x >> 8 | row_beyond << 56]
}

/// The cells of a block, in Morton order, whose corners differ in sign and are all observed; `None` if there are none. `octet`: the
/// block, and those after it.
pub(super) fn crossed_cells(bits: &VoxelBits, octet: &[Option<u32>; 8]) -> Option<[u64; 8]> {
    let layers = |of: &'_ [Layers], first: usize, z: usize| {
        shifted([0, 1, 2, 3].map(|slot| octet[first + slot].map(|block| &of[block as usize])), z)
    };
    let (mut any, mut all, mut known) = ([0; 9], [0; 9], [0; 9]);
    for z in 0..9 {
        let (first, z_in) = (z / 8 * 4, z % 8);
        let inside = layers(&bits.inside, first, z_in);
        any[z] = inside[0] | inside[1] | inside[2] | inside[3];
        all[z] = inside[0] & inside[1] & inside[2] & inside[3];
        let observed = layers(&bits.observed, first, z_in);
        known[z] = observed[0] & observed[1] & observed[2] & observed[3];
    }
    let mut crossed = [0u64; 8];
    let mut any_crossed = false;
    for z in 0..8 {
        let mut rest = (any[z] | any[z + 1]) & !(all[z] & all[z + 1]) & known[z] & known[z + 1];
        any_crossed |= rest != 0;
        while rest != 0 {
            let voxel = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let place = interleave([voxel & 7, voxel >> 3, z]);
            crossed[place >> 6] |= 1 << (place & 63);
        }
    }
    any_crossed.then_some(crossed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::morton::position;

    #[test]
    fn cells_are_those_of_their_corners() {
        let mut random = isv_testkit::Random::new(5);
        for missing in 0..8u32 {
            let mut words = || -> Vec<Layers> {
                (0..8).map(|_| [0; 8].map(|_| (random.signed() * 9e18) as i64 as u64)).collect()
            };
            let (inside, observed) =
                (words(), words().iter().map(|w| w.map(|w| w | w >> 3 | w << 7)).collect());
            let bits = VoxelBits { inside, observed };
            let octet: [Option<u32>; 8] = std::array::from_fn(|slot| {
                let slot = slot as u32;
                (slot == 0 || slot != missing).then_some(slot)
            });
            let bit = |of: &[Layers], [x, y, z]: [usize; 3]| {
                let block = octet[x / 8 + 2 * (y / 8) + 4 * (z / 8)]?;
                Some(of[block as usize][z % 8] >> (8 * (y % 8) + x % 8) & 1 != 0)
            };
            let found = crossed_cells(&bits, &octet).unwrap();
            for place in 0..512 {
                let corner = |c: usize| [0, 1, 2].map(|axis| position(place)[axis] + (c >> axis & 1));
                let is_known = (0..8).all(|c| bit(&bits.observed, corner(c)) == Some(true));
                let inside = (0..8).filter(|c| bit(&bits.inside, corner(*c)) == Some(true)).count();
                let is_crossed = is_known && (1..8).contains(&inside);
                assert_eq!(found[place >> 6] >> (place & 63) & 1 != 0, is_crossed, "{missing} {place}");
            }
        }
    }
}
