//! Extrapolation of the distance field from coded blocks into a block beside them that was not coded.
//!
//! A block that was not coded holds no surface, so all of it lies on one side. Its samples continue those of the nearest
//! block along that block's slope. Blocks of 8 voxels a side only.

use crate::block8::{Block, EDGE};
use crate::simd::vectorized;
use isv_volume::CODES_PER_VOXEL;

/// Samples of a block of one z.
type Plane = [i16; EDGE * EDGE];
/// The coded blocks around a block: entry `(dz + 1) * 9 + (dy + 1) * 3 + (dx + 1)` is the one at offset `(dx, dy, dz)`. The
/// entry of the block itself is not looked at.
pub type CodedNeighbours<'a> = [Option<&'a Block>; 27];

/// A distance field grows by one voxel a voxel at most.
const STEEPEST: i16 = CODES_PER_VOXEL as i16;
/// Least magnitude of an extrapolated sample, so that none is zero.
const LEAST: i16 = 5;

/// Slots whose blocks are nearer than this slot's to every voxel of the middle block, by slot. The offset of such a block agrees
/// with this slot's wherever it is not zero.
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

/// How many coordinates of a slot's offset are not zero: 1 for faces, 2 for edges, 3 for corners.
const RANKS: [usize; 27] = [3, 2, 3, 2, 1, 2, 3, 2, 3, 2, 1, 2, 1, 0, 1, 2, 1, 2, 3, 2, 3, 2, 1, 2, 3, 2, 3];

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

/// Fills a block from its coded neighbours; returns whether it lies inside.
///
/// - `neighbours`: samples within the truncation; at least one is there.
/// - `truncation`: magnitude of no sample exceeds it; 512 to 4096 codes.
///
/// Every sample has the sign of the vote of the blocks that touch it (`is_inside`). Its magnitude follows from the neighbour with
/// the nearest voxel by L1 distance (at equal distances, the smaller magnitude). It is that voxel's sample, plus for each axis
/// the slope there, clamped to one voxel a voxel, times the distance along the axis.
pub fn extrapolate(neighbours: &CodedNeighbours, truncation: i16, out: &mut Block) -> bool {
    vectorized(
        #[inline(always)]
        || {
            let inside = is_inside(neighbours);
            let sign = if inside { -1 } else { 1 };
            let present = present_slots(neighbours);
            let furthest = [[i16::MAX; EDGE * EDGE]; EDGE];
            let mut field = NearestField { distances: furthest, magnitudes: furthest };
            for (slot, neighbour) in neighbours.iter().enumerate().filter(|(slot, _)| *slot != 13) {
                let Some(block) = neighbour.filter(|_| present & NEARER[slot] == 0) else { continue };
                let offset = offset(slot);
                match (offset[0] != 0, offset[2] != 0) {
                    (false, false) => field.offer::<false, false>(block, offset, sign, truncation),
                    (false, true) => field.offer::<false, true>(block, offset, sign, truncation),
                    (true, false) => field.offer::<true, false>(block, offset, sign, truncation),
                    (true, true) => field.offer::<true, true>(block, offset, sign, truncation),
                }
            }
            for (sample, magnitude) in out.iter_mut().zip(field.magnitudes.as_flattened()) {
                *sample = sign * magnitude;
            }
            inside
        },
    )
}

/// Which entries are there, one bit a slot.
#[inline(always)]
fn present_slots(neighbours: &CodedNeighbours) -> u32 {
    neighbours.iter().enumerate().map(|(slot, block)| u32::from(block.is_some()) << slot).sum()
}

/// What the voxels of a block have been offered, plane after plane across z: of each, the least magnitude at the least distance.
struct NearestField {
    distances: [Plane; EDGE],
    magnitudes: [Plane; EDGE],
}

impl NearestField {
    /// Offers one neighbour's continuation to all voxels.
    #[inline(always)]
    fn offer<const ALONG_X: bool, const ALONG_Z: bool>(
        &mut self,
        block: &Block,
        offset: [i32; 3],
        sign: i16,
        truncation: i16,
    ) {
        let [ax, ay, az] = offset.map(Approach::new);
        let mut across = [0; EDGE * EDGE];
        for (row, away) in across.as_chunks_mut::<EDGE>().0.iter_mut().zip(ay.distance) {
            for x in 0..EDGE {
                row[x] = ax.distance[x] + away;
            }
        }
        let mut slopes = [0; EDGE * EDGE];
        if ALONG_Z {
            let nearest = |z: usize| nearest_plane::<ALONG_X>(block, &ax, &ay, z);
            add_slopes(&mut slopes, &nearest(az.nearest[0]), &nearest(az.behind[0]), &[1; EDGE * EDGE]);
        }
        let mut level = [0; EDGE * EDGE];
        for z in 0..EDGE {
            if z == 0 || !ALONG_Z {
                level = level_plane::<ALONG_X>(block, &ax, &ay, az.nearest[z]);
            }
            let away = if ALONG_Z { az.distance[z] } else { 0 };
            let (mut distances, mut magnitudes) = (self.distances[z], self.magnitudes[z]);
            for index in 0..EDGE * EDGE {
                let magnitude = (sign * (level[index] + slopes[index] * away)).clamp(LEAST, truncation);
                let distance = across[index] + away;
                let before = if distance < distances[index] { i16::MAX } else { magnitudes[index] };
                let offered = if distance > distances[index] { i16::MAX } else { magnitude };
                magnitudes[index] = before.min(offered);
                distances[index] = distances[index].min(distance);
            }
            (self.distances[z], self.magnitudes[z]) = (distances, magnitudes);
        }
    }
}

/// The neighbour's nearest samples to the voxels of a plane across z that look at its plane `z`.
#[inline(always)]
fn nearest_plane<const ALONG_X: bool>(block: &Block, ax: &Approach, ay: &Approach, z: usize) -> Plane {
    let mut plane = [0; EDGE * EDGE];
    let rows = &block.as_chunks::<{ EDGE * EDGE }>().0[z].as_chunks::<EDGE>().0;
    for (y, out) in plane.as_chunks_mut::<EDGE>().0.iter_mut().enumerate() {
        let row = rows[ay.nearest[y]];
        *out = if ALONG_X { [row[ax.nearest[0]]; EDGE] } else { row };
    }
    plane
}

/// [`nearest_plane`], continued along x and y.
#[inline(always)]
fn level_plane<const ALONG_X: bool>(block: &Block, ax: &Approach, ay: &Approach, z: usize) -> Plane {
    let nearest = nearest_plane::<ALONG_X>(block, ax, ay, z);
    let mut level = nearest;
    let rows = &block.as_chunks::<{ EDGE * EDGE }>().0[z].as_chunks::<EDGE>().0;
    let (mut behind, mut away) = ([0; EDGE * EDGE], [0; EDGE * EDGE]);
    if ay.distance[0] != 0 {
        for y in 0..EDGE {
            let row = rows[ay.behind[y]];
            for x in 0..EDGE {
                behind[y * EDGE + x] = if ALONG_X { row[ax.nearest[0]] } else { row[x] };
                away[y * EDGE + x] = ay.distance[y];
            }
        }
        add_slopes(&mut level, &nearest, &behind, &away);
    }
    if ALONG_X {
        for y in 0..EDGE {
            for x in 0..EDGE {
                behind[y * EDGE + x] = rows[ay.nearest[y]][ax.behind[0]];
                away[y * EDGE + x] = ax.distance[x];
            }
        }
        add_slopes(&mut level, &nearest, &behind, &away);
    }
    level
}

/// Adds the slopes along an axis times the distances along it.
#[inline(always)]
fn add_slopes(plane: &mut Plane, nearest: &Plane, behind: &Plane, away: &Plane) {
    for index in 0..EDGE * EDGE {
        let slope = (nearest[index] - behind[index]).clamp(-STEEPEST, STEEPEST);
        plane[index] += slope * away[index];
    }
}

/// Whether a block lies inside: the samples of its face neighbours that touch it, each clamped to one voxel, sum to less than
/// zero. Without face neighbours, those of edge neighbours count once and those of corner neighbours eight times.
#[inline(always)]
fn is_inside(neighbours: &CodedNeighbours) -> bool {
    let mut sums = [0; 4];
    let mut has_faces = false;
    for (slot, neighbour) in neighbours.iter().enumerate() {
        let rank = RANKS[slot];
        has_faces |= rank == 1 && neighbour.is_some();
        if let Some(block) = neighbour.filter(|_| rank == 1 || !has_faces) {
            sums[rank] += touching_sum(block, offset(slot));
        }
    }
    let votes = if has_faces { sums[1] } else { sums[2] + EDGE as i32 * sums[3] };
    votes < 0
}

/// Sum of a neighbour's samples that touch the middle block, each clamped to one voxel.
#[inline(always)]
fn touching_sum(block: &Block, offset: [i32; 3]) -> i32 {
    let touching = |direction: i32| match direction {
        0 => 0..EDGE,
        1 => 0..1,
        _ => EDGE - 1..EDGE,
    };
    let [xs, ys, zs] = offset.map(touching);
    let vote = |sample: i16| i32::from(sample.clamp(-STEEPEST, STEEPEST));
    let mut sum = 0;
    for z in zs {
        for y in ys.clone() {
            let row = &block.as_chunks::<EDGE>().0[z * EDGE + y];
            sum += if offset[0] == 0 {
                row.iter().map(|sample| vote(*sample)).sum()
            } else {
                vote(row[xs.start])
            };
        }
    }
    sum
}
