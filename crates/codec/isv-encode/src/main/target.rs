//! What a frame's blocks are to become, and how much each voxel matters.

use super::lanes::{codes, load, mask, sum};
use super::pursuit::SIGN_MARGIN;
use super::settings::Band;
use super::tools::Tools;
use fearless_simd::{Simd, dispatch, f32x8, prelude::*};
use isv_kernels::block8::{Block, SAMPLES};
use isv_kernels::signs::inside;
use isv_kernels::simd;
use isv_volume::{BlockCoord, BlockIndex, BlockSet, CODES_PER_VOXEL, SparseVolume};
use rayon::prelude::*;

/// Samples of a block in voxels.
pub(crate) type Field = [f32; SAMPLES];
/// One bit for each voxel of a block, a word a z.
pub(crate) type Bits = [u64; 8];

/// Weight of voxels at the ends of edges that the surface crosses: marching cubes reads those and no others.
const CROSSED: f32 = 1.0;
/// Weight of all other observed voxels.
const FAR: f32 = 0.001;
/// Weight of all other observed voxels where signs are not guarded.
const FAR_UNGUARDED: f32 = 0.01;
/// Weight of unobserved voxels.
const UNOBSERVED: f32 = 0.0005;
/// Weight of every voxel when the whole band is wanted.
const WHOLE_BAND: f32 = 0.25;
/// Voxels this near to the surface, in voxels, tell of its motion, with at least this weight.
const NEAR: f32 = 1.5;
const NEAR_WEIGHT: f32 = 0.3;

/// The samples that a block turns to a neighbour lie on the surface if they are nearer to it than this on average, in codes. Where that
/// neighbour is not coded its side is what they vote for (`docs/spec/format.md`, 7.10.8), which must not be left to rounding.
const FACE_ON_SURFACE: i32 = CODES_PER_VOXEL / 2;
/// [`FACE_ON_SURFACE`] of a face that was observed in part. It is what coding moves a surface by, as blocks at rims cost bits.
const PART_ON_SURFACE: i32 = CODES_PER_VOXEL / 4;

/// [`SIGN_MARGIN`] in codes.
const SIGN_MARGIN_CODES: f32 = SIGN_MARGIN * CODES_PER_VOXEL as f32;
/// Voxels in a code.
pub(super) const SCALE: f32 = 1.0 / CODES_PER_VOXEL as f32;

/// The blocks of a volume that are coded, in Morton order: those that the surface touches, or all. Blocks in cells that stay as
/// they are (skip cells) are not among them.
#[derive(Debug)]
pub(crate) struct Targets<'a> {
    volume: &'a SparseVolume,
    coords: Vec<BlockCoord>,
    marks: Vec<Marks>,
    band: Band,
    /// Weight of observed voxels that are not at the ends of crossed edges.
    elsewhere: f32,
    /// Whether those only have to keep their sign.
    only_sign: bool,
}

/// What is known of a block before its samples are looked at.
#[derive(Clone, Copy, Debug)]
struct Marks {
    /// Index of the block in the volume.
    block: u32,
    /// Observed voxels with an observed face neighbour of the other sign.
    crossed: Bits,
    unobserved: Bits,
}

/// What one block is to become.
#[derive(Clone, Debug)]
pub(crate) struct BlockTarget {
    pub samples: Field,
    /// Weight of each voxel's squared error.
    pub weights: Field,
    /// Voxels whose samples do not matter as long as they keep their sign.
    pub only_sign: Bits,
}

/// Eight voxels along x of which some tell of motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearRow {
    /// Which row of the block: `8 z + y`.
    pub row: usize,
    /// Their samples in voxels.
    pub samples: [f32; 8],
    /// Their weights, 0 where they tell nothing.
    pub weights: [f32; 8],
}

/// How far a prediction is from its block's target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PredictionError {
    /// Weighted squared error in voxels.
    pub weighted: f32,
    /// Whether all voxels of which only the sign matters are on their side, and by [`SIGN_MARGIN`] or their own distance.
    pub signs_hold: bool,
}

impl BlockTarget {
    /// Target of no block.
    pub(crate) const NONE: Self =
        Self { samples: [0.0; SAMPLES], weights: [0.0; SAMPLES], only_sign: [0; 8] };

    /// Weighted squared error in voxels of samples in codes.
    pub(crate) fn weighted_error(&self, samples: &Block) -> f32 {
        dispatch!(simd::level(), simd => self.weighted_error_vectorized(simd, samples))
    }

    #[inline(always)]
    fn weighted_error_vectorized<S: Simd>(&self, simd: S, samples: &Block) -> f32 {
        let mut sums = f32x8::splat(simd, 0.0);
        for row in 0..64 {
            let error = load(simd, &self.samples, row) - codes(simd, eight(samples, row)) * SCALE;
            sums += load(simd, &self.weights, row) * error * error;
        }
        sum(sums)
    }
}

impl<'a> Targets<'a> {
    /// The targets of a volume. `skipped`: blocks in cells of 4x4x4 blocks that stay as they are.
    pub(crate) fn new(volume: &'a SparseVolume, band: Band, tools: Tools, skipped: &BlockSet) -> Self {
        let all = BlockSet::from_coords(volume.coords());
        let open = all.outside_cells_of(skipped);
        // Those beside them tell which of their voxels are crossed.
        let near = if skipped.is_empty() { all.clone() } else { open.dilated().intersection(&all) };
        let index = BlockIndex::from_set(&near);
        let numbers = (0..).zip(near.marks_in(&all)).filter_map(|(block, near)| near.then_some(block));
        let numbers: Vec<u32> = numbers.collect();
        let signs = numbers.par_iter().map(|block| Signs::of_block(volume, *block as usize));
        let signs: Vec<Signs> = signs.collect();
        let marks = |((block, own), open): ((&u32, &Signs), bool)| {
            if !open {
                return None;
            }
            let coord = volume.coords()[*block as usize];
            let crossed = crossed_voxels(coord, own, &signs, &index);
            let wanted = crossed != [0; 8] || band == Band::Full || is_beside_surface(coord, &signs, &index);
            let unobserved = own.observed.map(|word| !word);
            wanted.then_some(Marks { block: *block, crossed, unobserved })
        };
        let marks = numbers.par_iter().zip(&signs).zip(open.marks_in(&near)).filter_map(marks);
        let marks: Vec<Marks> = marks.collect();
        let coords = marks.iter().map(|marks| volume.coords()[marks.block as usize]).collect();
        let elsewhere = match band {
            Band::Full => WHOLE_BAND,
            Band::Surface if !tools.weights => CROSSED,
            Band::Surface if !tools.signs => FAR_UNGUARDED,
            Band::Surface => FAR,
        };
        let only_sign = band == Band::Surface && tools.weights && tools.signs;
        Self { volume, coords, marks, band, elsewhere, only_sign }
    }

    /// Coordinates of the blocks.
    pub(crate) fn coords(&self) -> &[BlockCoord] {
        &self.coords
    }

    /// The number of the one at a coordinate.
    pub(crate) fn find(&self, coord: BlockCoord) -> Option<usize> {
        self.coords.binary_search_by_key(&coord.morton(), |coord| coord.morton()).ok()
    }

    /// Which blocks of the volume they are.
    pub(crate) fn band(&self) -> Band {
        self.band
    }

    /// The volume that they are of.
    pub(crate) fn source(&self) -> &SparseVolume {
        self.volume
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.coords.len()
    }

    /// What a block is to become.
    pub(crate) fn block(&self, block: usize) -> BlockTarget {
        let mut target = BlockTarget::NONE;
        self.spread(block, &mut target);
        target
    }

    /// [`Self::block`] in memory that is there.
    pub(crate) fn spread(&self, block: usize, target: &mut BlockTarget) {
        dispatch!(simd::level(), simd => self.spread_vectorized(simd, block, target));
    }

    #[inline(always)]
    fn spread_vectorized<S: Simd>(&self, simd: S, block: usize, target: &mut BlockTarget) {
        let (marks, samples) = (&self.marks[block], self.samples(block));
        for row in 0..64 {
            let values = codes(simd, eight(samples, row)) * SCALE;
            values.store_slice(&mut target.samples[8 * row..8 * row + 8]);
            let weights = marks.weights(simd, row, self.elsewhere);
            weights.store_slice(&mut target.weights[8 * row..8 * row + 8]);
        }
        for z in 0..8 {
            target.only_sign[z] = if self.only_sign { !marks.crossed[z] & !marks.unobserved[z] } else { 0 };
        }
    }

    /// How far samples in codes are from what a block is to become; the same as by way of [`Self::block`].
    pub(crate) fn prediction_error(&self, block: usize, prediction: &Block) -> PredictionError {
        dispatch!(simd::level(), simd => self.prediction_error_vectorized(simd, block, prediction))
    }

    #[inline(always)]
    fn prediction_error_vectorized<S: Simd>(
        &self,
        simd: S,
        block: usize,
        prediction: &Block,
    ) -> PredictionError {
        let (marks, samples) = (&self.marks[block], self.samples(block));
        let mut sums = f32x8::splat(simd, 0.0);
        let mut astray = 0;
        for row in 0..64 {
            let (code, predicted) = (codes(simd, eight(samples, row)), codes(simd, eight(prediction, row)));
            let error = code * SCALE - predicted * SCALE;
            sums += marks.weights(simd, row, self.elsewhere) * error * error;
            let right = code.simd_lt(0.0).select(-predicted, predicted);
            let in_danger = right.simd_lt(code.abs().min(SIGN_MARGIN_CODES)).to_bitmask() as u32;
            astray |= in_danger & !row_bits(&marks.crossed, row) & !row_bits(&marks.unobserved, row);
        }
        PredictionError { weighted: sum(sums), signs_hold: !self.only_sign || astray == 0 }
    }

    /// The rows of a block that tell of motion, or each `every`th of them, which is a power of two; added to `out`.
    pub(crate) fn near_rows(&self, block: usize, every: usize, out: &mut Vec<NearRow>) {
        dispatch!(simd::level(), simd => self.near_rows_vectorized(simd, block, every, out));
    }

    #[inline(always)]
    fn near_rows_vectorized<S: Simd>(&self, simd: S, block: usize, every: usize, out: &mut Vec<NearRow>) {
        let (marks, samples) = (&self.marks[block], self.samples(block));
        let elsewhere = f32x8::splat(simd, self.near_weight());
        let zero = f32x8::splat(simd, 0.0);
        for row in 0..64 {
            if (row % 8 + 2 * (row / 8)) & (every - 1) != 0 {
                continue;
            }
            let [crossed, unobserved] = [row_bits(&marks.crossed, row), row_bits(&marks.unobserved, row)];
            let values = codes(simd, eight(samples, row)) * SCALE;
            let close = values.abs().simd_lt(NEAR);
            if (close.to_bitmask() as u32 | crossed) & !unobserved == 0 {
                continue;
            }
            let weights =
                mask(simd, crossed).select(f32x8::splat(simd, CROSSED), close.select(elsewhere, zero));
            let weights = mask(simd, unobserved).select(zero, weights);
            let mut near = NearRow { row, samples: [0.0; 8], weights: [0.0; 8] };
            values.store_slice(&mut near.samples);
            weights.store_slice(&mut near.weights);
            out.push(near);
        }
    }

    /// Weight of voxels that are near the surface but not at the ends of crossed edges, where motion is searched for.
    pub(super) fn near_weight(&self) -> f32 {
        self.elsewhere.max(NEAR_WEIGHT)
    }

    /// The voxels of a block that are at the ends of crossed edges.
    pub(super) fn crossed(&self, block: usize) -> &Bits {
        &self.marks[block].crossed
    }

    /// The voxels of a block that were not observed.
    pub(super) fn unobserved(&self, block: usize) -> &Bits {
        &self.marks[block].unobserved
    }

    /// The samples of a block, in codes.
    pub(super) fn samples(&self, block: usize) -> &Block {
        let block = self.marks[block].block as usize;
        self.volume.block(block).try_into().expect("blocks of an edge of 8")
    }

    /// Weighted squared error in voxels of a decoded volume that has these blocks.
    pub(crate) fn weighted_error(&self, decoded: &SparseVolume) -> f32 {
        let index = decoded.index();
        let block_error = |n: usize| -> f32 {
            let block = index.get(self.coords[n]).expect("targets are coded") as usize;
            self.block(n).weighted_error(decoded.block(block).try_into().expect("blocks of an edge of 8"))
        };
        let errors: Vec<f32> = (0..self.len()).into_par_iter().map(block_error).collect();
        errors.iter().sum()
    }
}

impl Marks {
    /// The weights of a row of voxels, where those that are observed and not crossed have this one.
    #[inline(always)]
    fn weights<S: Simd>(&self, simd: S, row: usize, elsewhere: f32) -> f32x8<S> {
        let weight = |weight: f32| f32x8::splat(simd, weight);
        let [crossed, unobserved] = [row_bits(&self.crossed, row), row_bits(&self.unobserved, row)];
        let seen = mask(simd, crossed).select(weight(CROSSED), weight(elsewhere));
        mask(simd, unobserved).select(weight(UNOBSERVED), seen)
    }
}

/// The samples of row `8 z + y`.
#[inline(always)]
fn eight(samples: &Block, row: usize) -> &[i16; 8] {
    samples[8 * row..8 * row + 8].try_into().expect("eight samples")
}

/// The bits of row `8 z + y`.
#[inline(always)]
fn row_bits(bits: &Bits, row: usize) -> u32 {
    (bits[row / 8] >> (8 * (row % 8))) as u32 & 255
}

/// Which voxels of a block lie inside, and which are observed.
#[derive(Clone, Copy, Debug)]
struct Signs {
    inside: Bits,
    observed: Bits,
    /// Which of its faces lie on the surface ([`FACE_ON_SURFACE`]): along each axis a bit for the lower and one for the upper.
    faces_on_surface: u8,
}

impl Signs {
    /// Signs of a block that is not there: nothing was observed.
    const NONE: Self = Self { inside: [0; 8], observed: [0; 8], faces_on_surface: 0 };

    fn of_block(volume: &SparseVolume, block: usize) -> Self {
        let samples = volume.block(block).try_into().expect("blocks of an edge of 8");
        let inside = inside(samples);
        let mut observed = [!0; 8];
        if let Some(mask) = volume.unobserved(block) {
            observed.iter_mut().zip(mask.words()).for_each(|(observed, unobserved)| *observed = !unobserved);
        }
        Self { inside, observed, faces_on_surface: faces_on_surface(samples, &observed) }
    }
}

/// Faces of a block that lie on the surface where they were observed, as bits of [`Signs::faces_on_surface`]. Of a sheet that ends
/// within a face, the rest tells nothing.
fn faces_on_surface(samples: &Block, observed: &Bits) -> u8 {
    let mut faces = 0;
    for (axis, stride) in [1, 8, 64].into_iter().enumerate() {
        let [row, plane] = [[8, 64], [1, 64], [1, 8]][axis];
        for (upper, start) in [0, 7 * stride].into_iter().enumerate() {
            let distance = |i: usize| {
                let voxel = start + i % 8 * row + i / 8 * plane;
                (observed[voxel / 64] >> (voxel % 64) & 1 == 1).then(|| i32::from(samples[voxel]).abs())
            };
            let is_near = |corner: usize| distance(corner).is_none_or(|d| d < 3 * FACE_ON_SURFACE);
            // A field that is almost linear and of one sign is nowhere farther off than twice its mean.
            if [0, 7, 56, 63].into_iter().all(is_near) {
                let (count, sum) = (0..64).filter_map(distance).fold((0, 0), |(n, sum), d| (n + 1, sum + d));
                let most = if count == 64 { FACE_ON_SURFACE } else { PART_ON_SURFACE };
                faces |= u8::from(sum < count * most) << (2 * axis + upper);
            }
        }
    }
    faces
}

/// Whether a neighbour turns a face to the block at a coordinate that lies on the surface.
fn is_beside_surface(coord: BlockCoord, signs: &[Signs], index: &BlockIndex) -> bool {
    (0..6).any(|side| {
        let step = if side % 2 == 0 { -1 } else { 1 };
        let beside = coord.offset(std::array::from_fn(|axis| if axis == side / 2 { step } else { 0 }));
        // The lower neighbour turns its upper face here.
        index.get(beside).is_some_and(|block| signs[block as usize].faces_on_surface >> (side ^ 1) & 1 == 1)
    })
}

/// The observed voxels of a block with an observed face neighbour of the other sign.
///
/// Neighbours along x and y are a shift away, along z the next word.
fn crossed_voxels(coord: BlockCoord, own: &Signs, signs: &[Signs], index: &BlockIndex) -> Bits {
    let mut crossed = [0; 8];
    for (axis, stride) in [1u32, 8, 64].into_iter().enumerate() {
        let at = |by: i32| coord.offset(std::array::from_fn(|a| if a == axis { by } else { 0 }));
        let beside = |by: i32| index.get(at(by)).map_or(&Signs::NONE, |block| &signs[block as usize]);
        let (before, after) = (beside(-1), beside(1));
        // Lanes that have a neighbour below in the block.
        let inner: u64 = [!0x0101_0101_0101_0101, !0xff, 0][axis];
        for z in 0..8 {
            let below = |part: fn(&Signs) -> &Bits| match axis {
                2 => {
                    if z > 0 {
                        part(own)[z - 1]
                    } else {
                        part(before)[7]
                    }
                }
                _ => part(own)[z] << stride & inner | part(before)[z] >> (7 * stride) & !inner,
            };
            let above = |part: fn(&Signs) -> &Bits| match axis {
                2 => {
                    if z < 7 {
                        part(own)[z + 1]
                    } else {
                        part(after)[0]
                    }
                }
                _ => {
                    part(own)[z] >> stride & (inner >> stride)
                        | part(after)[z] << (7 * stride) & !(inner >> stride)
                }
            };
            let differs =
                |[inside, observed]: [u64; 2]| (own.inside[z] ^ inside) & own.observed[z] & observed;
            crossed[z] |= differs([below(|s| &s.inside), below(|s| &s.observed)]);
            crossed[z] |= differs([above(|s| &s.inside), above(|s| &s.observed)]);
        }
    }
    crossed
}
