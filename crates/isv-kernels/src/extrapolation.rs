//! Extrapolation of the distance field from coded blocks into a block beside them that was not coded.
//!
//! A block that was not coded holds no surface, so all of it lies on one side. Its samples continue those of the nearest
//! block along that block's slope. Blocks of 8 voxels a side only.

use crate::simd::vectorized;
use isv_volume::CODES_PER_VOXEL;

/// Voxels along the edge of a block.
const EDGE: usize = 8;
/// Samples of a block, x fastest.
pub type Block = [i16; EDGE * EDGE * EDGE];
/// The coded blocks around a block: entry `(dz + 1) * 9 + (dy + 1) * 3 + (dx + 1)` is the one at offset `(dx, dy, dz)`. The
/// entry of the block itself is not looked at.
pub type CodedNeighbours<'a> = [Option<&'a Block>; 27];

/// A distance field grows by one voxel a voxel at most.
const STEEPEST: i16 = CODES_PER_VOXEL as i16;
/// Least magnitude of an extrapolated sample, so that none is zero.
const LEAST: i16 = 5;
/// Magnitudes are below this power of two.
const MAGNITUDE_BITS: u32 = 13;

/// Slots whose blocks are nearer than this slot's to every voxel of the middle block, by slot: those whose offset agrees with
/// this one's wherever it is not zero.
const NEARER: [u32; 27] = nearer_slots();

const fn offset(slot: usize) -> [i32; 3] {
    [slot as i32 % 3 - 1, slot as i32 / 3 % 3 - 1, slot as i32 / 9 - 1]
}

const fn nearer_slots() -> [u32; 27] {
    let mut table = [0; 27];
    let mut slot = 0;
    while slot < 27 {
        let mut other = 0;
        while other < 27 {
            let (far, near) = (offset(slot), offset(other));
            let mut axis = 0;
            let mut agrees = other != slot && other != 13;
            while axis < 3 {
                agrees &= near[axis] == 0 || near[axis] == far[axis];
                axis += 1;
            }
            if agrees {
                table[slot] |= 1 << other;
            }
            other += 1;
        }
        slot += 1;
    }
    table
}

/// How the voxels of the middle block lie to a neighbour along one axis.
struct Approach {
    /// The neighbour's nearest coordinate.
    nearest: [usize; EDGE],
    /// The one behind it, seen from the voxel; the same along an axis on which both blocks are level.
    behind: [usize; EDGE],
    /// Voxels from the nearest coordinate to the voxel's own.
    distance: [i16; EDGE],
}

impl Approach {
    #[inline(always)]
    fn new(direction: i32) -> Self {
        let mut approach = Self { nearest: [0; EDGE], behind: [0; EDGE], distance: [0; EDGE] };
        for c in 0..EDGE {
            let (nearest, behind, distance) = match direction {
                0 => (c, c, 0),
                1 => (0, 1, EDGE - c),
                _ => (EDGE - 1, EDGE - 2, c + 1),
            };
            approach.nearest[c] = nearest;
            approach.behind[c] = behind;
            approach.distance[c] = distance as i16;
        }
        approach
    }
}

/// Fills a block from its coded neighbours: whether it lies inside.
///
/// - `neighbours`: samples within the truncation; at least one is there.
/// - `truncation`: magnitude of no sample exceeds it; 512 to 4096 codes.
///
/// Every sample has the sign of [`is_inside`]. Its magnitude follows from the neighbour with the nearest voxel by L1 distance
/// (at equal distances, the smaller magnitude): that voxel's sample, plus for each axis the slope there, clamped to one voxel
/// a voxel, times the distance along the axis.
pub fn extrapolate(neighbours: &CodedNeighbours, truncation: i16, out: &mut Block) -> bool {
    let inside = is_inside(neighbours);
    let present = present_slots(neighbours);
    vectorized(
        #[inline(always)]
        || {
            let sign = if inside { -1 } else { 1 };
            let mut nearest = [i32::MAX; EDGE * EDGE * EDGE];
            for (slot, neighbour) in neighbours.iter().enumerate().filter(|(slot, _)| *slot != 13) {
                let Some(block) = neighbour.filter(|_| present & NEARER[slot] == 0) else { continue };
                if offset(slot)[0] == 0 {
                    continue_field::<false>(block, offset(slot), sign, truncation, &mut nearest);
                } else {
                    continue_field::<true>(block, offset(slot), sign, truncation, &mut nearest);
                }
            }
            for (sample, key) in out.iter_mut().zip(&nearest) {
                *sample = sign * (key & ((1 << MAGNITUDE_BITS) - 1)) as i16;
            }
        },
    );
    inside
}

/// Which entries are there, one bit a slot.
fn present_slots(neighbours: &CodedNeighbours) -> u32 {
    neighbours.iter().enumerate().map(|(slot, block)| u32::from(block.is_some()) << slot).sum()
}

/// Offers one neighbour's continuation to all voxels. A voxel keeps the least `distance << 13 | magnitude`.
#[inline(always)]
fn continue_field<const ALONG_X: bool>(
    block: &Block,
    offset: [i32; 3],
    sign: i16,
    truncation: i16,
    nearest: &mut [i32; EDGE * EDGE * EDGE],
) {
    let [ax, ay, az] = offset.map(Approach::new);
    let row = |y: usize, z: usize| -> &[i16; EDGE] {
        block[(z * EDGE + y) * EDGE..][..EDGE].try_into().expect("a row of samples")
    };
    for (index, keys) in nearest.as_chunks_mut::<EDGE>().0.iter_mut().enumerate() {
        let (y, z) = (index % EDGE, index / EDGE);
        let samples = row(ay.nearest[y], az.nearest[z]);
        let behind_y = row(ay.behind[y], az.nearest[z]);
        let behind_z = row(ay.nearest[y], az.behind[z]);
        for x in 0..EDGE {
            let at = if ALONG_X { ax.nearest[0] } else { x };
            let sample = samples[at];
            let slope = |behind: i16| (sample - behind).clamp(-STEEPEST, STEEPEST);
            let mut value =
                sample + slope(behind_y[at]) * ay.distance[y] + slope(behind_z[at]) * az.distance[z];
            if ALONG_X {
                value += slope(samples[ax.behind[0]]) * ax.distance[x];
            }
            let magnitude = i32::from((sign * value).clamp(LEAST, truncation));
            let distance = i32::from(ax.distance[x] + ay.distance[y] + az.distance[z]);
            keys[x] = keys[x].min(distance << MAGNITUDE_BITS | magnitude);
        }
    }
}

/// Whether a block lies inside: the samples of its face neighbours that touch it, each clamped to one voxel, sum to less than
/// zero. Without face neighbours, those of edge neighbours count once and those of corner neighbours eight times.
#[must_use]
pub fn is_inside(neighbours: &CodedNeighbours) -> bool {
    let rank = |slot: usize| offset(slot).iter().filter(|d| **d != 0).count();
    let sum_of = |wanted: usize| -> i32 {
        let slots = (0..27).filter(|slot| rank(*slot) == wanted);
        slots.filter_map(|slot| Some(touching_sum(neighbours[slot]?, offset(slot)))).sum()
    };
    let has_faces = (0..27).any(|slot| rank(slot) == 1 && neighbours[slot].is_some());
    let votes = if has_faces { sum_of(1) } else { sum_of(2) + EDGE as i32 * sum_of(3) };
    votes < 0
}

/// Sum of a neighbour's samples that touch the middle block, each clamped to one voxel.
fn touching_sum(block: &Block, offset: [i32; 3]) -> i32 {
    let [xs, ys, zs] = offset.map(|direction| match direction {
        0 => 0..EDGE,
        1 => 0..1,
        _ => EDGE - 1..EDGE,
    });
    let mut sum = 0;
    for z in zs {
        for y in ys.clone() {
            for x in xs.clone() {
                sum += i32::from(block[(z * EDGE + y) * EDGE + x].clamp(-STEEPEST, STEEPEST));
            }
        }
    }
    sum
}
