//! Leaves: cubes of 8^3 voxels, z fastest.

use super::ALL_VALUES;
use super::sign::{Ends, spread_signs};
use super::tree::path;
use crate::Unit;
use isv_volume::{BlockIndex, CODES_PER_VOXEL, Grid, SparseVolume};

/// Voxels along an edge.
const SIDE: usize = 8;
const VOXELS: usize = SIDE.pow(3);
const MASK_BYTES: usize = VOXELS / 8;
/// Bytes of a leaf's values: its mask again, a byte that says that all values are there, and the values.
pub(super) const VALUE_BYTES: usize = MASK_BYTES + 1 + VOXELS * size_of::<f32>();

/// A volume seen as leaves.
pub(super) struct Leaves<'a> {
    volume: &'a SparseVolume,
    /// The unit of values.
    unit: Unit,
    index: BlockIndex,
    /// First voxels of the leaves, in the order of the tree.
    origins: Vec<[i32; 3]>,
}

/// Values of a leaf's voxels, and which of them are active.
pub(super) struct Leaf {
    values: [f32; VOXELS],
    active: [u8; MASK_BYTES],
}

/// The voxels that a block and a leaf share: a cube.
struct Shared {
    block: usize,
    /// First voxel, in the block and in the leaf.
    in_block: [usize; 3],
    in_leaf: [usize; 3],
}

impl<'a> Leaves<'a> {
    pub(super) fn new(volume: &'a SparseVolume, unit: Unit) -> Self {
        let edge = volume.grid().edge.voxels();
        let mut origins = Vec::with_capacity(volume.block_count());
        for coord in volume.coords() {
            for part in cubes(edge, SIDE) {
                let voxel: [i32; 3] =
                    std::array::from_fn(|axis| coord.to_array()[axis] * edge as i32 + part[axis] as i32);
                origins.push(voxel.map(|v| v & -(SIDE as i32)));
            }
        }
        // Blocks of 4 share leaves.
        origins.sort_unstable_by_key(|origin| path(*origin));
        origins.dedup();
        Self { volume, unit, index: volume.index(), origins }
    }

    pub(super) fn grid(&self) -> &Grid {
        self.volume.grid()
    }

    pub(super) fn origins(&self) -> &[[i32; 3]] {
        &self.origins
    }

    /// The edge of a voxel in the unit of values.
    pub(super) fn voxel_size(&self) -> f64 {
        self.grid().voxel_size.metres() / self.unit.metres()
    }

    /// The truncation distance in the unit of values.
    pub(super) fn background(&self) -> f32 {
        self.distance(self.grid().truncation.codes())
    }

    pub(super) fn leaf(&self, origin: [i32; 3]) -> Leaf {
        let mut leaf = Leaf { values: [self.background(); VOXELS], active: [0; MASK_BYTES] };
        let mut known = [None; VOXELS];
        for shared in self.shared(origin) {
            self.copy(&shared, &mut leaf, &mut known);
        }
        if known.contains(&None) {
            let inside = spread_signs(SIDE, &known);
            for voxel in (0..VOXELS).filter(|voxel| known[*voxel].is_none() && inside[*voxel]) {
                leaf.values[voxel] = -self.background();
            }
        }
        leaf
    }

    /// What the blocks have of a leaf.
    fn shared(&self, origin: [i32; 3]) -> impl Iterator<Item = Shared> {
        let edge = self.grid().edge.voxels();
        cubes(SIDE, edge).filter_map(move |in_leaf| {
            let first: [i32; 3] = std::array::from_fn(|axis| origin[axis] + in_leaf[axis] as i32);
            let block = self.index.get(first.map(|v| v.div_euclid(edge as i32)).into())? as usize;
            Some(Shared { block, in_block: first.map(|v| v.rem_euclid(edge as i32) as usize), in_leaf })
        })
    }

    fn copy(&self, shared: &Shared, leaf: &mut Leaf, known: &mut [Option<Ends>; VOXELS]) {
        let edge = self.grid().edge;
        let limit = self.grid().truncation.codes();
        let (samples, unobserved) = (self.volume.block(shared.block), self.volume.unobserved(shared.block));
        for at in cubes(edge.voxels().min(SIDE), 1) {
            let [x, y, z] = std::array::from_fn(|axis| shared.in_block[axis] + at[axis]);
            let from = edge.voxel_index(x, y, z);
            let [x, y, z] = std::array::from_fn(|axis| shared.in_leaf[axis] + at[axis]);
            let to = (x * SIDE + y) * SIDE + z;
            let code = samples[from];
            if code.abs() < limit && unobserved.is_none_or(|mask| !mask.contains(from)) {
                leaf.values[to] = self.distance(code);
                leaf.active[to / 8] |= 1 << (to % 8);
            } else if code < 0 {
                leaf.values[to] = -self.background();
            }
            known[to] = Some(Ends { first_inside: code < 0, last_inside: code < 0 });
        }
    }

    /// A distance in the unit of values.
    fn distance(&self, code: i16) -> f32 {
        (f64::from(code) / f64::from(CODES_PER_VOXEL) * self.voxel_size()) as f32
    }
}

/// First voxels of the cubes of edge `step` that fill one of edge `side`; the one itself if it is not larger.
fn cubes(side: usize, step: usize) -> impl Iterator<Item = [usize; 3]> {
    let count = (side / step).max(1);
    (0..count.pow(3)).map(move |i| [i % count, i / count % count, i / count / count].map(|c| c * step))
}

impl Leaf {
    /// The active voxels, one bit each, lowest first.
    pub(super) fn active(&self) -> &[u8] {
        &self.active
    }

    pub(super) fn ends(&self) -> Ends {
        Ends { first_inside: self.values[0] < 0.0, last_inside: self.values[VOXELS - 1] < 0.0 }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(VALUE_BYTES);
        bytes.extend(self.active);
        bytes.push(ALL_VALUES);
        self.values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes
    }
}
