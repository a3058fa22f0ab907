//! Leaves: cubes of 8^3 voxels, z fastest.

use super::ALL_VALUES;
use super::sign::{Ends, spread_signs};
use super::tree::path;
use crate::Unit;
use isv_volume::{BlockCoord, BlockIndex, CODES_PER_VOXEL, Grid, SparseVolume};

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

/// Voxels around a leaf that are looked at: those two away decide on what becomes of the outermost ones.
const PAD: i32 = 2;
const PADDED: usize = SIDE + 2 * PAD as usize;

/// What a volume says of a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    /// Observed within the truncation: its sample.
    Near(i16),
    /// Observed, and the truncation or more away: whether it is inside.
    Far(bool),
    /// Not observed; the sign of its sample, if a block has one, says little.
    Unknown(Option<bool>),
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
        let mut leaves = Self { volume, unit, index: volume.index(), origins };
        leaves.add_beyond_open_ends();
        leaves
    }

    /// Adds leaves beside one in which the band ends before it has reached the truncation, as it does at an
    /// open end. The voxels there must be on the side of those beside them.
    fn add_beyond_open_ends(&mut self) {
        // A voxel further the distance grows by one at most, but for what coding has done.
        const CODING: i16 = CODES_PER_VOXEL as i16 / 16;
        let open = self.grid().truncation.codes() - CODES_PER_VOXEL as i16 - CODING;
        let side = SIDE as i32;
        let mut beyond = Vec::new();
        for origin in &self.origins {
            for axis in 0..3 {
                for (face, step) in [(0, -1), (side - 1, 1)] {
                    let mut next = *origin;
                    next[axis] += step * side;
                    if self.origins.binary_search_by_key(&path(next), |origin| path(*origin)).is_ok() {
                        continue;
                    }
                    let ends = (0..side * side).any(|at| {
                        let mut voxel = *origin;
                        voxel[axis] += face;
                        voxel[(axis + 1) % 3] += at % side;
                        voxel[(axis + 2) % 3] += at / side;
                        matches!(self.state(voxel), State::Near(code) if code.abs() < open)
                    });
                    if ends {
                        beyond.push(next);
                    }
                }
            }
        }
        self.origins.extend(beyond);
        self.origins.sort_unstable_by_key(|origin| path(*origin));
        self.origins.dedup();
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

    /// Values of a leaf. Surface is where an edge of two active voxels changes sign, and nowhere else: tools
    /// make none where both ends of an edge are inactive. So an inactive voxel has the sign of the active
    /// ones beside it. An active one that faces an inactive one of the other sign all the same is made
    /// inactive. What is left of a hole in the surface is a change of sign among inactive voxels.
    pub(super) fn leaf(&self, origin: [i32; 3]) -> Leaf {
        let around = Around::new(self, origin);
        let mut leaf = Leaf { values: [self.background(); VOXELS], active: [0; MASK_BYTES] };
        let mut known = [None; VOXELS];
        for to in 0..VOXELS {
            let at = [to / (SIDE * SIDE), to / SIDE % SIDE, to % SIDE].map(|c| c as i32);
            let inside = around.is_inside(at);
            known[to] = inside.map(|inside| Ends { first_inside: inside, last_inside: inside });
            if let State::Near(code) = around.state(at) {
                leaf.values[to] = self.distance(code);
                if !around.faces_other_side(at, code < 0) {
                    leaf.active[to / 8] |= 1 << (to % 8);
                }
            } else if inside == Some(true) {
                leaf.values[to] = -self.background();
            }
        }
        if known.contains(&None) {
            let inside = spread_signs(SIDE, &known);
            for voxel in (0..VOXELS).filter(|voxel| known[*voxel].is_none() && inside[*voxel]) {
                leaf.values[voxel] = -self.background();
            }
        }
        leaf
    }

    /// What the volume says of a voxel.
    fn state(&self, voxel: [i32; 3]) -> State {
        let edge = self.grid().edge;
        let side = edge.voxels() as i32;
        let Some(block) = self.index.get(voxel.map(|v| v.div_euclid(side)).into()) else {
            return State::Unknown(None);
        };
        let [x, y, z] = voxel.map(|v| v.rem_euclid(side) as usize);
        self.state_in(block as usize, edge.voxel_index(x, y, z))
    }

    fn state_in(&self, block: usize, at: usize) -> State {
        let code = self.volume.block(block)[at];
        if self.volume.unobserved(block).is_some_and(|mask| mask.contains(at)) {
            return State::Unknown(Some(code < 0));
        }
        match code.abs() < self.grid().truncation.codes() {
            true => State::Near(code),
            false => State::Far(code < 0),
        }
    }

    /// A distance in the unit of values.
    fn distance(&self, code: i16) -> f32 {
        (f64::from(code) / f64::from(CODES_PER_VOXEL) * self.voxel_size()) as f32
    }
}

/// The voxels of a leaf and those around it.
struct Around {
    states: Vec<State>,
}

impl Around {
    fn new(leaves: &Leaves, origin: [i32; 3]) -> Self {
        let edge = leaves.grid().edge;
        let side = edge.voxels() as i32;
        let mut states = Vec::with_capacity(PADDED.pow(3));
        // Neighbours are mostly in one block.
        let mut last: Option<(BlockCoord, Option<usize>)> = None;
        for i in 0..PADDED.pow(3) {
            let at = [i / (PADDED * PADDED), i / PADDED % PADDED, i % PADDED];
            let voxel: [i32; 3] = std::array::from_fn(|axis| origin[axis] + at[axis] as i32 - PAD);
            let coord: BlockCoord = voxel.map(|v| v.div_euclid(side)).into();
            let block = match last.filter(|(known, _)| *known == coord) {
                Some((_, block)) => block,
                None => leaves.index.get(coord).map(|block| block as usize),
            };
            last = Some((coord, block));
            let [x, y, z] = voxel.map(|v| v.rem_euclid(side) as usize);
            states.push(
                block.map_or(State::Unknown(None), |block| leaves.state_in(block, edge.voxel_index(x, y, z))),
            );
        }
        Self { states }
    }

    /// State of a voxel, counted from the leaf's first.
    fn state(&self, at: [i32; 3]) -> State {
        let [x, y, z] = at.map(|c| (c + PAD) as usize);
        self.states[(x * PADDED + y) * PADDED + z]
    }

    /// The side of a voxel of the leaf or beside it; none where nothing tells.
    fn is_inside(&self, at: [i32; 3]) -> Option<bool> {
        let said = match self.state(at) {
            State::Near(code) => return Some(code < 0),
            State::Far(inside) => return Some(inside),
            State::Unknown(said) => said,
        };
        let mut beside = [false; 2];
        for i in 0..27 {
            let step = [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1];
            if let State::Near(code) = self.state(std::array::from_fn(|axis| at[axis] + step[axis])) {
                beside[usize::from(code < 0)] = true;
            }
        }
        match beside {
            [false, true] => Some(true),
            [true, false] => Some(false),
            // Beside a rim both are: what the sample says is as good as anything, and outside if there is none.
            [true, true] => said.or(Some(false)),
            [false, false] => said,
        }
    }

    /// Whether a voxel of the leaf that is active faces one that is not, and is on the other side.
    fn faces_other_side(&self, at: [i32; 3], inside: bool) -> bool {
        (0..6).any(|face| {
            let mut other = at;
            other[face / 2] += if face % 2 == 0 { -1 } else { 1 };
            !matches!(self.state(other), State::Near(_))
                && self.is_inside(other).is_some_and(|side| side != inside)
        })
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
