//! Cutting a surface into charts: connected parts of a block's surface that face about the same way.

use super::patch::closest;
use glam::DVec3;
use isv_spatial::DisjointSets;
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use std::sync::LazyLock;

/// Smallest cosine between a face and the direction that its chart is seen from.
const FACING: f64 = 0.64;
/// Weight of directions that a block had in the frame before: charts stay what they were if that is nearly as good.
const KEPT: f64 = 1.25;
/// Voxels along the edge of a block.
const BLOCK: f64 = 8.0;
/// Cells along a side of the raster in which faces that cover each other are found, at most.
const RASTER: f64 = 512.0;

/// A plane that charts are projected onto: two axes in it, and the direction that it is seen from.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) towards: DVec3,
}

/// Views from the faces, edges and corners of a cube.
static VIEWS: LazyLock<Vec<View>> = LazyLock::new(|| {
    let places = (0..27).map(|n| DVec3::from([n % 3, n / 3 % 3, n / 9].map(|c| f64::from(c - 1))));
    let views = places.filter(|place| *place != DVec3::ZERO).map(|place| {
        let towards = place.normalize();
        let right = towards.any_orthonormal_vector();
        View { right, up: towards.cross(right), towards }
    });
    views.collect()
});

/// The block that charts belong to, and the number of the view that shows them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ChartKey {
    pub(super) block: [i32; 3],
    pub(super) view: u8,
}

impl ChartKey {
    /// The plane of the chart.
    pub(super) fn view(self) -> &'static View {
        &VIEWS[usize::from(self.view)]
    }

    /// A point in metres as seen: right and up from the middle of the block, in voxels.
    pub(super) fn project(self, point_m: DVec3, voxel_m: f64) -> [f64; 2] {
        let middle = DVec3::from(self.block.map(|b| (f64::from(b) + 0.5) * BLOCK));
        let from_middle = point_m / voxel_m - 0.5 - middle;
        [from_middle.dot(self.view().right), from_middle.dot(self.view().up)]
    }

    /// A face as seen.
    pub(super) fn project_face(self, mesh: &TriangleMesh, face: u32, voxel_m: f64) -> [[f64; 2]; 3] {
        mesh.corners(face as usize).map(|corner| self.project(corner, voxel_m))
    }
}

/// Faces that one part of the texture shows.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    pub(super) key: ChartKey,
    pub(super) faces: Vec<u32>,
    /// Lowest and highest corner as seen, in voxels from the middle of the block.
    pub(super) extent: [[f64; 2]; 2],
}

/// Cuts a mesh into charts, block by block: each face is in one. `was_there` says whether the frame before had charts of a key.
pub(super) fn cut(
    mesh: &TriangleMesh,
    voxel_m: f64,
    was_there: impl Fn(ChartKey) -> bool + Sync,
) -> Vec<Chart> {
    let block_of = |face: usize| {
        let [a, b, c] = mesh.corners(face);
        let block = (((a + b + c) / 3.0 / voxel_m - 0.5) / BLOCK).floor();
        block.to_array().map(|b| b as i32)
    };
    let mut faces: Vec<([i32; 3], u32)> =
        (0..mesh.triangles.len()).into_par_iter().map(|face| (block_of(face), face as u32)).collect();
    faces.par_sort_unstable();
    let blocks: Vec<&[([i32; 3], u32)]> = faces.chunk_by(|a, b| a.0 == b.0).collect();
    let of_block = |faces: &&[([i32; 3], u32)]| {
        let block = faces[0].0;
        let mut charts = Vec::new();
        for (view, faces) in by_view(mesh, faces, |view| was_there(ChartKey { block, view })) {
            let key = ChartKey { block, view };
            for part in connected(mesh, &faces) {
                add_flat(&mut charts, mesh, voxel_m, key, part);
            }
        }
        charts
    };
    blocks.par_iter().flat_map_iter(of_block).collect()
}

/// The faces of a block by the view that shows them: the view that shows most, then the one that shows most of the rest.
fn by_view(
    mesh: &TriangleMesh,
    faces: &[([i32; 3], u32)],
    was_there: impl Fn(u8) -> bool,
) -> Vec<(u8, Vec<u32>)> {
    let mut rest: Vec<(u32, DVec3, f64)> = faces
        .iter()
        .map(|(_, face)| {
            let normal = mesh.area_vector(*face as usize);
            (*face, normal, normal.length())
        })
        .collect();
    let weights: Vec<f64> =
        (0..VIEWS.len()).map(|view| if was_there(view as u8) { KEPT } else { 1.0 }).collect();
    let mut found: Vec<(u8, Vec<u32>)> = Vec::new();
    while !rest.is_empty() {
        let shows = |view: &View, normal: DVec3, area: f64| {
            let facing = normal.dot(view.towards);
            (facing > 0.0 && facing >= FACING * area).then_some(area)
        };
        let (mut best, mut most) = (0, 0.0);
        for (number, view) in VIEWS.iter().enumerate() {
            let area: f64 = rest.iter().filter_map(|(_, normal, area)| shows(view, *normal, *area)).sum();
            if area * weights[number] > most {
                (best, most) = (number, area * weights[number]);
            }
        }
        // Faces without area have no direction: they go with the first.
        if most == 0.0 {
            let faces = rest.iter().map(|(face, ..)| *face);
            match found.first_mut() {
                Some((_, first)) => first.extend(faces),
                None => found.push((0, faces.collect())),
            }
            break;
        }
        let view = &VIEWS[best];
        let (shown, others) =
            rest.into_iter().partition(|(_, normal, area)| shows(view, *normal, *area).is_some());
        rest = others;
        let shown: Vec<(u32, DVec3, f64)> = shown;
        found.push((best as u8, shown.into_iter().map(|(face, ..)| face).collect()));
    }
    found
}

/// Faces in parts that share vertices, in order of their first face.
fn connected(mesh: &TriangleMesh, faces: &[u32]) -> Vec<Vec<u32>> {
    let mut corners: Vec<(u32, u32)> = Vec::with_capacity(3 * faces.len());
    for (number, face) in (0..).zip(faces) {
        corners.extend(mesh.triangles[*face as usize].map(|vertex| (vertex, number)));
    }
    corners.sort_unstable();
    let mut joined = DisjointSets::new(faces.len() as u32);
    for pair in corners.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        joined.join(pair[0].1, pair[1].1);
    }
    let mut parts: Vec<Vec<u32>> = Vec::new();
    let mut part_of = vec![usize::MAX; faces.len()];
    for (number, face) in (0..).zip(faces) {
        let root = joined.find(number) as usize;
        if part_of[root] == usize::MAX {
            part_of[root] = parts.len();
            parts.push(Vec::new());
        }
        parts[part_of[root]].push(*face);
    }
    parts
}

/// Adds faces as charts in which none covers another.
fn add_flat(charts: &mut Vec<Chart>, mesh: &TriangleMesh, voxel_m: f64, key: ChartKey, faces: Vec<u32>) {
    let mut rest = faces;
    while !rest.is_empty() {
        let seen: Vec<[[f64; 2]; 3]> =
            rest.iter().map(|face| key.project_face(mesh, *face, voxel_m)).collect();
        let extent = extent(&seen);
        let size = [0, 1].map(|axis| extent[1][axis] - extent[0][axis]);
        let scale = (RASTER / size[0].max(size[1]).max(1e-9)).min(BLOCK / 2.0);
        let side = size.map(|voxels| (voxels * scale) as usize + 1);
        let mut covered = vec![false; side[0] * side[1]];
        let (mut flat, mut hidden) = (Vec::new(), Vec::new());
        for (face, corners) in rest.iter().zip(&seen) {
            let corners = corners.map(|corner| [0, 1].map(|axis| (corner[axis] - extent[0][axis]) * scale));
            let inside = cells_inside(&corners, side);
            if inside.iter().any(|cell| covered[*cell]) {
                hidden.push(*face);
            } else {
                inside.into_iter().for_each(|cell| covered[cell] = true);
                flat.push(*face);
            }
        }
        let extent = match hidden.is_empty() {
            true => extent,
            false => {
                let seen: Vec<_> = flat.iter().map(|face| key.project_face(mesh, *face, voxel_m)).collect();
                self::extent(&seen)
            }
        };
        charts.push(Chart { key, faces: flat, extent });
        rest = hidden;
    }
}

/// Lowest and highest corner of faces.
fn extent(faces: &[[[f64; 2]; 3]]) -> [[f64; 2]; 2] {
    let mut extent = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for corner in faces.iter().flatten() {
        for axis in 0..2 {
            extent[0][axis] = extent[0][axis].min(corner[axis]);
            extent[1][axis] = extent[1][axis].max(corner[axis]);
        }
    }
    extent
}

/// The cells of a raster whose middles are inside a face, and not only at its edge.
fn cells_inside(corners: &[[f64; 2]; 3], side: [usize; 2]) -> Vec<usize> {
    let range = |axis: usize| {
        let along = corners.map(|corner| corner[axis]);
        let low = along.iter().copied().fold(f64::INFINITY, f64::min).max(0.0) as usize;
        let high = along.iter().copied().fold(0.0, f64::max) as usize + 1;
        low..high.min(side[axis])
    };
    let mut cells = Vec::new();
    for y in range(1) {
        for x in range(0) {
            let near = closest(corners, [x as f64 + 0.5, y as f64 + 0.5]);
            if near.squared == 0.0 && near.weights.iter().all(|weight| *weight > 1e-6) {
                cells.push(y * side[0] + x);
            }
        }
    }
    cells
}
