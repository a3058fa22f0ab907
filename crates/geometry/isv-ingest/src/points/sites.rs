//! Points that distances are measured to.

use crate::points::bricks::{BRICK, BRICK_VOXELS, Bricks, FIRST, brick_centre};
use crate::points::ends::{NearField, VoxelAt};
use crate::points::surfels::Merged;
use isv_volume::BlockCoord;
use rayon::prelude::*;

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Site {
    /// Position in voxels relative to the centre of its brick.
    pub(crate) at: [f32; 3],
    /// Unit normal; zero where there is none.
    pub(crate) normal: [f32; 3],
    /// Whether the surface ends here.
    pub(crate) is_end: bool,
}

/// Neighbouring voxels on different sides have distances that add up to at most this many voxels if the surface is between
/// them.
pub(crate) const EXPLAINED: f32 = 1.5;

/// The points where the surface crosses the lines between neighbouring voxels: the vertices that marching cubes would make.
pub(crate) fn crossings(field: &NearField) -> Bricks<Site> {
    let bricks = &field.bricks;
    let lists: Vec<(BlockCoord, Vec<Site>)> = (0..bricks.coords.len())
        .into_par_iter()
        .map(|brick| {
            let edges = (0..BRICK_VOXELS).flat_map(|voxel| [1, 3, 5].map(|side| (voxel, side)));
            let site = |(voxel, side)| crossing(field, (brick as u32, voxel as u16), side);
            (bricks.coords[brick], edges.filter_map(site).collect())
        })
        .collect();
    Bricks::new(lists)
}

/// Point at which the surface crosses the line from a voxel to its upper neighbour along axis `side / 2`.
fn crossing(field: &NearField, at: VoxelAt, side: usize) -> Option<Site> {
    let s = field.distance(at);
    if s.abs() > EXPLAINED {
        return None;
    }
    let next = field.neighbour(at, side)?;
    let t = field.distance(next);
    let crosses = (s < 0.0) != (t < 0.0) && s.abs() + t.abs() <= EXPLAINED;
    if !crosses || !field.is_seen(at) || !field.is_seen(next) {
        return None;
    }
    let share = s / (s - t);
    let voxel = usize::from(at.1);
    let mut position =
        [voxel % BRICK, voxel / BRICK % BRICK, voxel / BRICK / BRICK].map(|x| x as f32 + FIRST);
    position[side / 2] += share;
    let (n, m) = (normal(field, at), normal(field, next));
    let blend = glam::Vec3::from(n).lerp(m.into(), share).normalize_or_zero();
    let beside = |at| (0..6).filter(move |s| s / 2 != side / 2).map(move |s| field.neighbour(at, s));
    let is_end = beside(at).chain(beside(next)).flatten().any(|n| field.is_beyond(n));
    Some(Site { at: position, normal: blend.to_array(), is_end })
}

fn normal(field: &NearField, at: VoxelAt) -> [f32; 3] {
    field.bricks.items[at.0 as usize].normal(usize::from(at.1))
}

/// Points without normals as they are.
pub(crate) fn bare(merged: &[Merged]) -> Bricks<Site> {
    let lists = merged
        .chunk_by(|a, b| a.brick == b.brick)
        .map(|run| {
            let centre = brick_centre(run[0].brick);
            let site = |m: &Merged| Site {
                at: (m.at - centre).as_vec3().to_array(),
                normal: [0.0; 3],
                is_end: false,
            };
            (run[0].brick, run.iter().map(site).collect())
        })
        .collect();
    Bricks::new(lists)
}
