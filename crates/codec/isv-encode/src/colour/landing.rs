//! Points of the decoded surface that show colours which were seen near it.

use isv_decode::colour::Reader;
use isv_volume::{BlockCoord, ColourSample, Grid};

/// Finds the point of the decoded surface that shows a colour sample: its position, its normal, and its distance (voxels).
///
/// The position counts 1/256 voxel from the centre of the first voxel of the sample's block, which the reader is turned to. `None`
/// without a near surface that faces the same way.
#[must_use]
#[inline(always)]
pub fn locate(reader: &mut Reader, grid: &Grid, sample: &ColourSample) -> Option<([i32; 3], [i8; 3], f32)> {
    let place = Place::new(grid, sample)?;
    reader.turn_to(place.block);
    land(reader, &place, sample.normal)
}

/// Position at which a colour was seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// The block that it lies in.
    pub(super) block: BlockCoord,
    /// The voxel, from the block's first.
    local: [i32; 3],
    /// In 1/256 voxel, from the centre of the block's first voxel.
    position: [f32; 3],
}

impl Place {
    /// The place of a sample; `None` outside of what blocks can lie in.
    #[inline(always)]
    pub(super) fn new(grid: &Grid, sample: &ColourSample) -> Option<Self> {
        let voxel_m = grid.voxel_size.metres();
        let (mut block, mut local, mut position) = ([0; 3], [0; 3], [0.0; 3]);
        for axis in 0..3 {
            let at = f64::from(sample.position[axis]) / voxel_m - 0.5;
            let voxel = at.floor() as i32;
            block[axis] = voxel >> 3;
            local[axis] = voxel & 7;
            position[axis] = (256.0 * (at - 8.0 * f64::from(block[axis]))) as f32;
        }
        let block = BlockCoord::from(block);
        block.in_range().then_some(Self { block, local, position })
    }
}

/// Finds the point of the decoded surface that shows what was seen at a place, as [`locate`] does. `facing`: the normal there. The
/// reader is turned to the place's block.
#[inline(always)]
pub(super) fn land(reader: &mut Reader, place: &Place, facing: [f32; 3]) -> Option<([i32; 3], [i8; 3], f32)> {
    let Place { local, position, .. } = *place;
    let mut best = nearest_plane(reader, local, position, facing);
    if best.is_none_or(|plane| plane.height > 0.5) {
        best = nearest_around(reader, local, position, facing, best);
    }
    let Landing { onto, normal, height } = best?;
    let mut rounded = [0; 3];
    for axis in 0..3 {
        rounded[axis] = onto[axis].round_ties_even() as i32;
    }
    Some((rounded, normal, height))
}

/// The best of what the planes around a cell offer and what was found in it.
#[inline(never)]
fn nearest_around(
    reader: &mut Reader,
    local: [i32; 3],
    position: [f32; 3],
    facing: [f32; 3],
    found: Option<Landing>,
) -> Option<Landing> {
    let mut best = found;
    for neighbour in (0..27).filter(|n| *n != 13) {
        let step = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
        let voxel = [0, 1, 2].map(|axis| local[axis] + step[axis]);
        let other = nearest_plane(reader, voxel, position, facing);
        best = match (best, other) {
            (Some(a), Some(b)) => Some(if b.height < a.height { b } else { a }),
            (a, b) => a.or(b),
        };
    }
    best
}

/// Point of the decoded surface that shows a colour sample.
#[derive(Clone, Copy, Debug)]
struct Landing {
    /// In 1/256 voxel from the reader's origin.
    onto: [f32; 3],
    normal: [i8; 3],
    /// Distance in voxels, and more where the plane does not stand for the surface any more.
    height: f32,
}

/// The point nearest to a position on the plane of a cell that faces a normal.
#[inline(always)]
fn nearest_plane(
    reader: &mut Reader,
    voxel: [i32; 3],
    position: [f32; 3],
    facing: [f32; 3],
) -> Option<Landing> {
    let surfel = reader.plane(voxel)?;
    let (mut normal, mut from_middle) = ([0.0; 3], [0.0; 3]);
    let (mut agreement, mut height) = (0.0, 0.0);
    for axis in 0..3 {
        normal[axis] = f32::from(surfel.normal[axis]) / 127.0;
        from_middle[axis] = position[axis] - (256 * voxel[axis] + 128) as f32;
        agreement += normal[axis] * facing[axis];
        height += (from_middle[axis] - f32::from(surfel.offset[axis])) * normal[axis];
    }
    if facing != [0.0; 3] && agreement <= 0.0 {
        return None;
    }
    // A plane stands for the surface in its cell and a little beyond.
    let (mut onto, mut beyond) = ([0.0; 3], 0.0);
    for axis in 0..3 {
        onto[axis] = position[axis] - height * normal[axis];
        beyond += ((from_middle[axis] - height * normal[axis]).abs() - 192.0).max(0.0);
    }
    Some(Landing { onto, normal: surfel.normal, height: height.abs() / 256.0 + beyond / 64.0 })
}
