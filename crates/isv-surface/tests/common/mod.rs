//! Volumes sampled from functions, and what a good mesh is.

use glam::DVec3;
use isv_volume::{
    BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, SparseVolume, TriangleMesh, Truncation, VolumeBuilder,
    VoxelSize,
};
use std::collections::HashMap;

/// Voxels of 10 mm, truncated at 4 voxels.
pub(crate) fn grid(edge: u32) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.01).unwrap(),
        edge: BlockEdge::from_voxels(edge).unwrap(),
        truncation: Truncation::from_voxels(4).unwrap(),
    }
}

/// Samples a signed distance in metres over the cube of blocks that covers `-half_m..half_m` around the origin; blocks
/// beyond the truncation band are left out.
pub(crate) fn sample(grid: Grid, half_m: f64, distance_m: impl Fn(DVec3) -> f64) -> SparseVolume {
    let reach = (half_m / (grid.voxel_size.metres() * grid.edge.voxels() as f64)).ceil() as i32;
    let limit = f64::from(grid.truncation.codes());
    let mut builder = VolumeBuilder::new(grid);
    for coord in cube(-reach..reach) {
        let samples: Vec<i16> = voxels(grid.edge)
            .map(|voxel| {
                let codes = distance_m(grid.voxel_centre_m(coord, voxel)) / grid.voxel_size.metres()
                    * f64::from(CODES_PER_VOXEL);
                codes.round().clamp(-limit, limit) as i16
            })
            .collect();
        if samples.iter().any(|s| f64::from(s.abs()) < limit) {
            builder.push(coord, samples, None);
        }
    }
    builder.finish()
}

/// All block coordinates of a cube.
pub(crate) fn cube(range: std::ops::Range<i32>) -> impl Iterator<Item = BlockCoord> {
    let axis = move || range.clone();
    let (y_axis, x_axis) = (axis.clone(), axis.clone());
    axis().flat_map(move |z| {
        let x_axis = x_axis.clone();
        y_axis().flat_map(move |y| x_axis().map(move |x| BlockCoord { x, y, z }))
    })
}

/// Voxels of a block in storage order.
pub(crate) fn voxels(edge: BlockEdge) -> impl Iterator<Item = [usize; 3]> {
    let n = edge.voxels();
    (0..n * n * n).map(move |i| [i % n, i / n % n, i / (n * n)])
}

/// How often each directed edge occurs.
pub(crate) fn directed_edges(mesh: &TriangleMesh) -> HashMap<(u32, u32), usize> {
    let mut edges = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for edge in [(*a, *b), (*b, *c), (*c, *a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges
}

/// Directed edges whose opposite is missing: the border of the mesh. Panics if any directed edge occurs twice.
pub(crate) fn border(mesh: &TriangleMesh) -> Vec<(u32, u32)> {
    let edges = directed_edges(mesh);
    assert!(edges.values().all(|n| *n == 1), "an edge is used twice in the same direction");
    edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a))).copied().collect()
}

/// Checks what holds for every mesh: manifold edges, all vertices used, no two in one place.
pub(crate) fn check_mesh(mesh: &TriangleMesh) {
    border(mesh);
    let mut used = vec![false; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
    assert!(used.iter().all(|u| *u), "a vertex has no triangle");
    let mut places: Vec<[u64; 3]> = mesh.vertices.iter().map(|v| v.to_array().map(f64::to_bits)).collect();
    places.sort_unstable();
    assert!(places.windows(2).all(|w| w[0] != w[1]), "two vertices have the same position");
}

/// Vertices - edges + faces of a closed mesh.
pub(crate) fn euler_number(mesh: &TriangleMesh) -> i64 {
    assert!(border(mesh).is_empty(), "the mesh is open");
    mesh.vertices.len() as i64 - directed_edges(mesh).len() as i64 / 2 + mesh.triangles.len() as i64
}

/// Area and enclosed volume.
pub(crate) fn measures(mesh: &TriangleMesh) -> (f64, f64) {
    (0..mesh.triangles.len()).fold((0.0, 0.0), |(area, volume), face| {
        let [a, b, c] = mesh.corners(face);
        (area + (b - a).cross(c - a).length() / 2.0, volume + a.dot(b.cross(c)) / 6.0)
    })
}
