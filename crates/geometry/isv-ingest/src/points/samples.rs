//! The samples of bricks, and blocks of them.

use crate::caps::Blocks;
use crate::points::bricks::{BRICK, BRICK_VOXELS, Bricks, FIRST};
use crate::points::closest::ClosestSites;
use crate::points::ends::NearField;
use crate::points::sites::Site;
use crate::sampler::code;
use isv_volume::{BlockCoord, BlockEdge, Grid, VoxelMask};
use rayon::prelude::*;

/// Close to the surface the blended distance holds, beyond the distance to the closest site: between these, in voxels, they
/// are mixed.
const BLEND: [f32; 2] = [1.0, 1.75];

/// A site's normal tells the side of a voxel if its direction is at most this cosine from the tangent plane.
const CLEAR: f32 = 0.9;

/// From a site this far towards a voxel, in voxels, the field close to the surface tells its side.
const STEP: f32 = 1.2;

/// Up to this far beside the last site, in voxels, a voxel is seen.
const BESIDE: f32 = 0.6;

/// Mean squared distance of the surface's closest point from its closest site, in squared voxels.
const SITE_GAP_SQ: f32 = 0.12;

/// What samples are made from.
pub(crate) struct Source {
    pub(crate) grid: Grid,
    /// Unsigned distance up to which a voxel is in the band.
    pub(crate) width: f32,
    pub(crate) sites: Bricks<Site>,
    pub(crate) sign: Sign,
}

/// Source of the sign of a sample.
pub(crate) enum Sign {
    /// The side of the closest point's plane.
    Oriented(NearField),
    /// Eq. 9: the offset in voxels.
    Offset(f32),
}

/// The samples of a brick.
struct BrickSamples {
    coord: BlockCoord,
    /// Codes.
    samples: [i16; BRICK_VOXELS],
    unobserved: VoxelMask,
    /// Voxels that are observed and in the band.
    in_band: VoxelMask,
}

/// Samples bricks, given in Morton order and as many as make whole blocks.
pub(crate) fn sample(source: &Source, bricks: &[BlockCoord]) -> Blocks {
    let mut blocks = Blocks::default();
    for chunk in bricks.chunks(4096) {
        let parts: Vec<Option<BrickSamples>> = chunk
            .par_iter()
            .map_init(ClosestSites::default, |work, coord| sample_brick(source, *coord, work))
            .collect();
        match source.grid.edge {
            BlockEdge::E4 => parts.iter().flatten().for_each(|part| push_octants(&mut blocks, part)),
            BlockEdge::E8 => parts.into_iter().flatten().for_each(|part| push_whole(&mut blocks, part)),
            BlockEdge::E16 => parts.chunks(8).for_each(|octants| push_joined(&mut blocks, octants)),
        }
    }
    blocks
}

fn sample_brick(source: &Source, coord: BlockCoord, work: &mut ClosestSites) -> Option<BrickSamples> {
    // In a block of eight bricks each needs the sign of sites that are in reach of another.
    let margin = if source.grid.edge == BlockEdge::E16 { BRICK as f32 * 3f32.sqrt() } else { 0.0 };
    if !work.find(&source.sites, coord, source.width + margin) {
        return None;
    }
    let empty = || VoxelMask::empty(BlockEdge::E8);
    let mut out = BrickSamples { coord, samples: [0; BRICK_VOXELS], unobserved: empty(), in_band: empty() };
    match &source.sign {
        Sign::Offset(offset) => {
            for (sample, d) in out.samples.iter_mut().zip(&work.distances) {
                *sample = code(&source.grid, d - offset);
            }
        }
        Sign::Oriented(field) => sign(source, field, work, &mut out),
    }
    for (voxel, d) in work.distances.iter().enumerate() {
        if *d <= source.width && !out.unobserved.contains(voxel) {
            out.in_band.insert(voxel);
        }
    }
    Some(out)
}

/// Signs the distances of a brick, and finds which voxels are unobserved.
fn sign(source: &Source, field: &NearField, work: &ClosestSites, out: &mut BrickSamples) {
    let near = field.bricks.position(out.coord);
    for voxel in 0..BRICK_VOXELS {
        let at = near.map(|brick| (brick as u32, voxel as u16));
        let close = at.map_or(f32::INFINITY, |at| field.distance(at));
        if at.is_some_and(|at| close.is_finite() && !field.is_seen(at)) {
            out.unobserved.insert(voxel);
            out.samples[voxel] = code(&source.grid, close);
            continue;
        }
        let mut value = close;
        if close.abs() > BLEND[0] {
            let far = side(field, work, out.coord, voxel);
            if far.is_beyond && close.is_infinite() {
                out.unobserved.insert(voxel);
                value = far.height;
            } else {
                let distance = (work.distances[voxel].powi(2) - SITE_GAP_SQ).max(0.0).sqrt();
                let share = ((close.abs() - BLEND[0]) / (BLEND[1] - BLEND[0])).min(1.0);
                let sign = if close.is_finite() { close } else { far.height };
                let distance = distance.copysign(sign);
                value = if share < 1.0 { close + share * (distance - close) } else { distance };
            }
        }
        out.samples[voxel] = code(&source.grid, value);
    }
}

/// Place of a voxel, seen from its closest site.
struct Side {
    /// Height over the site's plane, with the sign of the voxel's side.
    height: f32,
    /// Whether the voxel lies beyond the end of the surface.
    is_beyond: bool,
}

fn side(field: &NearField, work: &ClosestSites, coord: BlockCoord, voxel: usize) -> Side {
    let site = &work.sites[work.closest[voxel] as usize];
    let place = [voxel % BRICK, voxel / BRICK % BRICK, voxel / BRICK / BRICK].map(|x| x as f32 + FIRST);
    let from_site = glam::Vec3::from(place) - glam::Vec3::from(site.at);
    let height = from_site.dot(site.normal.into());
    let distance = work.distances[voxel];
    let beside_sq = distance * distance - height * height;
    let is_beyond = site.is_end && beside_sq > BESIDE * BESIDE;
    if height.abs() > CLEAR * distance || is_beyond {
        return Side { height, is_beyond };
    }
    let p = glam::Vec3::from(site.at) + from_site * (STEP / distance.max(STEP));
    let cell = (p - FIRST + 0.5).floor().as_ivec3();
    let brick = coord.offset((cell.div_euclid(glam::IVec3::splat(BRICK as i32))).to_array());
    let local = cell.rem_euclid(glam::IVec3::splat(BRICK as i32)).to_array().map(|x| x as usize);
    let at = field
        .bricks
        .position(brick)
        .map(|b| (b as u32, BlockEdge::E8.voxel_index(local[0], local[1], local[2]) as u16));
    let near = at.map_or(f32::INFINITY, |at| field.distance(at));
    Side { height: if near.is_finite() { height.abs().copysign(near) } else { height }, is_beyond }
}

/// A brick as a block.
fn push_whole(blocks: &mut Blocks, part: BrickSamples) {
    if part.in_band.is_empty() {
        return;
    }
    if !part.unobserved.is_empty() {
        blocks.masks.insert(blocks.coords.len() as u32, part.unobserved);
    }
    blocks.coords.push(part.coord);
    blocks.samples.extend_from_slice(&part.samples);
}

/// A brick as eight blocks.
fn push_octants(blocks: &mut Blocks, part: &BrickSamples) {
    for octant in 0..8 {
        let [dx, dy, dz] = [0, 1, 2].map(|axis| octant >> axis & 1);
        let voxels = (0..64).map(|v| {
            let [x, y, z] = [v % 4 + 4 * dx, v / 4 % 4 + 4 * dy, v / 16 + 4 * dz];
            BlockEdge::E8.voxel_index(x, y, z)
        });
        if !voxels.clone().any(|v| part.in_band.contains(v)) {
            continue;
        }
        let mut mask = VoxelMask::empty(BlockEdge::E4);
        voxels
            .clone()
            .enumerate()
            .filter(|(_, v)| part.unobserved.contains(*v))
            .for_each(|(i, _)| mask.insert(i));
        if !mask.is_empty() {
            blocks.masks.insert(blocks.coords.len() as u32, mask);
        }
        let [x, y, z] = part.coord.to_array();
        blocks.coords.push(BlockCoord::from([2 * x + dx as i32, 2 * y + dy as i32, 2 * z + dz as i32]));
        blocks.samples.extend(voxels.map(|v| part.samples[v]));
    }
}

/// Eight bricks as a block.
fn push_joined(blocks: &mut Blocks, octants: &[Option<BrickSamples>]) {
    if octants.iter().flatten().all(|part| part.in_band.is_empty()) {
        return;
    }
    let start = blocks.samples.len();
    blocks.samples.resize(start + BlockEdge::E16.block_voxels(), 0);
    let mut mask = VoxelMask::empty(BlockEdge::E16);
    for (octant, part) in octants.iter().enumerate() {
        let part = part.as_ref().expect("a brick beside one in the band has sites in reach");
        for voxel in 0..BRICK_VOXELS {
            let place = [voxel % BRICK, voxel / BRICK % BRICK, voxel / BRICK / BRICK];
            let [x, y, z] = [0, 1, 2].map(|axis| place[axis] + BRICK * (octant >> axis & 1));
            let to = BlockEdge::E16.voxel_index(x, y, z);
            blocks.samples[start + to] = part.samples[voxel];
            if part.unobserved.contains(voxel) {
                mask.insert(to);
            }
        }
    }
    if !mask.is_empty() {
        blocks.masks.insert(blocks.coords.len() as u32, mask);
    }
    let [x, y, z] = octants[0].as_ref().expect("as above").coord.to_array();
    blocks.coords.push(BlockCoord::from([x >> 1, y >> 1, z >> 1]));
}
