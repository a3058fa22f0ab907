//! Points with normals as surfels: small discs whose size follows from how far apart the points are.

use crate::points::bricks::{Bricks, brick_centre, brick_of};
use crate::points::sign::{SPACING_NEIGHBOURS, spacing};
use glam::{DVec3, IVec3};
use isv_spatial::PointTree;
use isv_volume::{BlockCoord, MortonCode};
use rayon::prelude::*;

/// Points of one side within a cube of this edge, in voxels, become one surfel.
const CELL: f64 = 0.5;
/// Bits of a cell's number that tell cells of one cube of 2 voxels apart; all surfels there have one spacing.
const SPACING_BITS: u32 = 6;
/// Surfels farther apart than this, in voxels, are no surface.
pub(crate) const WIDEST_SPACING: f64 = 3.0;

/// Gaps between surfels are closed up to twice this radius: a hole of three voxels, as in meshes, or of a few spacings.
const REACH_VOXELS: f64 = 1.5;
const REACH_SPACINGS: f64 = 2.0;
/// A surface is certain this close to a surfel.
const CERTAIN_VOXELS: f64 = 0.5;
const CERTAIN_SPACINGS: f64 = 1.2;

/// An oriented disc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surfel {
    /// Position in voxels relative to the centre of its brick.
    pub(crate) at: [f32; 3],
    /// Unit normal.
    pub(crate) normal: [f32; 3],
    /// Up to this radius, in voxels, the surface goes on beyond the last surfel if it finds others there.
    pub(crate) reach: f32,
    /// Within this radius, in voxels, the surface is certain.
    pub(crate) certain: f32,
}

/// Place of a point: its brick, its cell there in Morton order, and its place in the cloud.
type Key = (MortonCode, u16, u32);

/// A point while points are put together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merged {
    /// Position in voxels.
    pub(crate) at: DVec3,
    normal: DVec3,
    pub(crate) brick: BlockCoord,
    cell: u16,
}

/// One point for each side in each cell of half a voxel: the mean of those whose normals agree with that of the first.
/// `normals` is empty, or holds one a point; points whose normal is zero are then left out.
pub(crate) fn merge(points: &[DVec3], normals: &[DVec3]) -> Vec<Merged> {
    let mut keys: Vec<Key> = points
        .par_iter()
        .zip(0..points.len() as u32)
        .filter(|(_, i)| normals.get(*i as usize) != Some(&DVec3::ZERO))
        .map(|(p, i)| (brick_of(*p).morton(), cell_of(*p), i))
        .collect();
    keys.par_sort_unstable();
    let runs: Vec<&[Key]> = keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
    runs.into_par_iter()
        .flat_map_iter(|run| {
            let normal = |key: &Key| normals.get(key.2 as usize).copied().unwrap_or(DVec3::ZERO);
            let first = normal(&run[0]);
            [true, false].into_iter().filter_map(move |side| {
                let (mut at, mut sum, mut count) = (DVec3::ZERO, DVec3::ZERO, 0);
                for key in run.iter().filter(|key| (normal(key).dot(first) >= 0.0) == side) {
                    at += points[key.2 as usize];
                    sum += normal(key).normalize_or_zero();
                    count += 1;
                }
                let (brick, cell) = (run[0].0.coord(), run[0].1);
                let merged =
                    Merged { at: at / f64::from(count), normal: sum.normalize_or_zero(), brick, cell };
                (count > 0 && (normals.is_empty() || merged.normal != DVec3::ZERO)).then_some(merged)
            })
        })
        .collect()
}

/// Number of the cell of half a voxel in its brick, in Morton order.
fn cell_of(p: DVec3) -> u16 {
    let cell = (p / CELL).floor().as_ivec3() & IVec3::splat(15);
    let bit = |axis: usize, b: usize| ((cell[axis] >> b & 1) as u16) << (3 * b + axis);
    (0..4).map(|b| bit(0, b) | bit(1, b) | bit(2, b)).sum()
}

/// The surfels that have enough others near them to be part of a surface, and the median spacing of all in voxels.
pub(crate) fn surfels(merged: &[Merged]) -> (Bricks<Surfel>, f64) {
    let tree = PointTree::new(merged.iter().map(|m| m.at).collect());
    let runs: Vec<&[Merged]> = merged
        .chunk_by(|a, b| (a.brick, a.cell >> SPACING_BITS) == (b.brick, b.cell >> SPACING_BITS))
        .collect();
    let spacings: Vec<f64> = runs
        .par_iter()
        .map_init(Vec::new, |found, run| {
            tree.k_nearest(run[run.len() / 2].at, SPACING_NEIGHBOURS + 1, found);
            spacing(found)
        })
        .collect();
    let mut lists: Vec<(BlockCoord, Vec<Surfel>)> = Vec::new();
    for (run, spacing) in runs.iter().zip(&spacings).filter(|(_, spacing)| **spacing <= WIDEST_SPACING) {
        if lists.last().is_none_or(|last| last.0 != run[0].brick) {
            lists.push((run[0].brick, Vec::new()));
        }
        let list = &mut lists.last_mut().expect("a list was pushed").1;
        list.extend(run.iter().map(|m| surfel(m, *spacing)));
    }
    (Bricks::new(lists), median(spacings))
}

fn surfel(merged: &Merged, spacing: f64) -> Surfel {
    Surfel {
        at: (merged.at - brick_centre(merged.brick)).as_vec3().to_array(),
        normal: merged.normal.as_vec3().to_array(),
        reach: (REACH_SPACINGS * spacing).max(REACH_VOXELS) as f32,
        certain: (CERTAIN_SPACINGS * spacing).max(CERTAIN_VOXELS) as f32,
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
