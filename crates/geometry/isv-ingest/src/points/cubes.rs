//! Which cubes of voxels a set of points reaches.

use glam::{DVec3, IVec3};
use isv_volume::{BlockCoord, MortonCode};
use rayon::prelude::*;
use rustc_hash::FxHashSet;

/// Cubes of `edge` voxels, and the bounding box of what is in each.
pub(crate) type Boxes = Vec<(BlockCoord, [DVec3; 2])>;

/// The bounding box of the points of each cube of `edge` voxels that has any, in Morton order of the cubes.
pub(crate) fn boxes(points: &[DVec3], edge: usize) -> Boxes {
    let mut keys: Vec<(MortonCode, u32)> = points
        .par_iter()
        .zip(0..points.len() as u32)
        .map(|(p, i)| (BlockCoord::from((*p / edge as f64).floor().as_ivec3().to_array()).morton(), i))
        .collect();
    keys.par_sort_unstable();
    let bounds = |run: &[(MortonCode, u32)]| {
        let first = points[run[0].1 as usize];
        run.iter().fold([first; 2], |[lo, hi], key| {
            let p = points[key.1 as usize];
            [lo.min(p), hi.max(p)]
        })
    };
    keys.chunk_by(|a, b| a.0 == b.0).map(|run| (run[0].0.coord(), bounds(run))).collect()
}

/// The cubes of `edge` voxels with a voxel centre within `width` voxels of a box, in Morton order; `None` where they are
/// more than `limit`.
pub(crate) fn reached(boxes: &Boxes, edge: usize, width: f64, limit: usize) -> Option<Vec<BlockCoord>> {
    let steps = (width / edge as f64).ceil() as i32;
    let mut found = FxHashSet::default();
    for (coord, [lo, hi]) in boxes {
        for z in -steps..=steps {
            for y in -steps..=steps {
                for x in -steps..=steps {
                    let cube = coord.offset([x, y, z]);
                    let first = IVec3::from_array(cube.to_array()).as_dvec3() * edge as f64 + 0.5;
                    let last = first + (edge - 1) as f64;
                    let gap = (first - *hi).max(*lo - last).max(DVec3::ZERO);
                    if gap.length_squared() <= width * width {
                        found.insert(cube.morton());
                    }
                }
            }
        }
        if found.len() > limit {
            return None;
        }
    }
    let mut codes: Vec<MortonCode> = found.into_iter().collect();
    codes.sort_unstable();
    Some(codes.into_iter().map(MortonCode::coord).collect())
}
