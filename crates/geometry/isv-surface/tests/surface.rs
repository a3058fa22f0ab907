//! The extracted surface against shapes that are known exactly, and against noise.

mod meshes;
mod volumes;

use glam::DVec3;
use isv_surface::{SurfaceExtractor, SurfaceOptions, extract_surface};
use isv_volume::{SparseVolume, TriangleMesh, VolumeBuilder, VoxelMask};
use meshes::{border, check_mesh, euler_number, measures};
use proptest::prelude::*;
use std::f64::consts::PI;
use volumes::{cube, grid, sample, voxels};

const EDGES: [u32; 3] = [4, 8, 16];
const RADIUS_M: f64 = 0.2;

fn surface(volume: &SparseVolume) -> TriangleMesh {
    let mesh = extract_surface(volume, &SurfaceOptions::default());
    check_mesh(&mesh);
    mesh
}

fn sphere(edge: u32, centre: DVec3) -> SparseVolume {
    sample(grid(edge), 0.4, |p| p.distance(centre) - RADIUS_M)
}

#[test]
fn sphere_is_closed_outward_and_true_to_size() {
    for edge in EDGES {
        for centre in [DVec3::ZERO, DVec3::new(0.043, -0.071, 0.018), DVec3::new(-0.12, -0.1, -0.15)] {
            let mesh = surface(&sphere(edge, centre));
            assert_eq!(euler_number(&mesh), 2);
            let (area, volume) = measures(&mesh);
            let (true_area, true_volume) = (4.0 * PI * RADIUS_M.powi(2), 4.0 / 3.0 * PI * RADIUS_M.powi(3));
            assert!((area / true_area - 1.0).abs() < 2e-3, "area {area}, not {true_area}");
            assert!((volume / true_volume - 1.0).abs() < 2e-3, "volume {volume}, not {true_volume}");
            for v in &mesh.vertices {
                assert!((v.distance(centre) - RADIUS_M).abs() < 1.5e-4);
            }
            for face in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(face);
                assert!((b - a).cross(c - a).dot(a - centre) > 0.0);
            }
        }
    }
}

#[test]
fn torus_has_one_handle() {
    for edge in EDGES {
        let mesh =
            surface(&sample(grid(edge), 0.3, |p| ((p.x.hypot(p.z) - RADIUS_M).hypot(p.y) - 0.06) * 0.99));
        assert_eq!(euler_number(&mesh), 0);
    }
}

#[test]
fn normals_follow_the_sphere() {
    let centre = DVec3::new(0.043, -0.071, 0.018);
    let mesh = extract_surface(&sphere(8, centre), &SurfaceOptions { normals: true });
    assert_eq!(mesh.normals.len(), mesh.vertices.len());
    for (v, n) in mesh.vertices.iter().zip(&mesh.normals) {
        assert!((n.length() - 1.0).abs() < 1e-9);
        assert!(n.angle_between(v - centre).to_degrees() < 1.0);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_mesh() {
    let volume = sphere(8, DVec3::new(0.01, 0.02, 0.03));
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| extract_surface(&volume, &SurfaceOptions { normals: true }))
    };
    let one = with_threads(1);
    assert_eq!(one, with_threads(2));
    assert_eq!(one, with_threads(7));
}

#[test]
fn an_extractor_gives_each_surface_as_if_it_were_the_first() {
    let volumes = [
        sphere(8, DVec3::ZERO),
        noise(8, 3, 40),
        sphere(4, DVec3::new(0.01, 0.02, 0.03)),
        SparseVolume::empty(grid(16)),
        noise(16, 5, 20),
        sphere(8, DVec3::new(0.01, 0.02, 0.03)),
    ];
    for normals in [false, true] {
        let options = SurfaceOptions { normals };
        let mut extractor = SurfaceExtractor::new(options);
        for volume in &volumes {
            assert!(*extractor.extract(volume) == extract_surface(volume, &options));
        }
        assert!(extractor.into_mesh() == extract_surface(&volumes[5], &options));
    }
}

#[test]
fn empty_volume_and_one_sign_give_no_mesh() {
    assert_eq!(surface(&SparseVolume::empty(grid(8))), TriangleMesh::default());
    for code in [-300, 0, 300] {
        let mut builder = VolumeBuilder::new(grid(4));
        cube(-1..1).for_each(|coord| builder.push(coord, vec![code; 64], None));
        assert_eq!(surface(&builder.finish()), TriangleMesh::default());
    }
}

#[test]
fn zero_codes_are_outside_and_do_not_pile_up_vertices() {
    let mut builder = VolumeBuilder::new(grid(8));
    let inside = [[3, 3, 3], [5, 3, 3], [3, 5, 3]];
    let codes = voxels(grid(8).edge).map(|v| if inside.contains(&v) { -200 } else { 0 });
    builder.push([0, 0, 0].into(), codes.collect(), None);
    let mesh = surface(&builder.finish());
    assert_eq!(mesh.vertices.len(), 18);
    assert!(border(&mesh).is_empty());
}

/// Lets voxels of a sphere go unobserved: the triangles must be exactly those of the cells that do not touch them.
#[test]
fn unobserved_voxels_open_the_surface_there_and_nowhere_else() {
    for edge in EDGES {
        let whole = sphere(edge, DVec3::ZERO);
        let voxel_m = whole.grid().voxel_size.metres();
        let hidden = |p: DVec3| p.y > 0.15 || p.distance(DVec3::new(-0.2, 0.0, 0.0)) < 0.05;
        let mut builder = VolumeBuilder::new(*whole.grid());
        for (block, &coord) in whole.coords().iter().enumerate() {
            let mut mask = VoxelMask::empty(whole.grid().edge);
            for (i, voxel) in voxels(whole.grid().edge).enumerate() {
                if hidden(whole.grid().voxel_centre_m(coord, voxel)) {
                    mask.insert(i);
                }
            }
            builder.push(coord, whole.block(block).to_vec(), Some(mask));
        }
        let open = surface(&builder.finish());
        // The cell of a triangle, from its centroid: its lowest corner is a voxel centre.
        let kept = |mesh: &TriangleMesh, face| {
            let lowest = ((mesh.corners(face).iter().sum::<DVec3>() / 3.0 / voxel_m) - 0.5).floor() + 0.5;
            let corners =
                (0..8).map(|c| lowest + DVec3::from_array([c & 1, c >> 1 & 1, c >> 2].map(f64::from)));
            corners.into_iter().all(|corner| !hidden(corner * voxel_m))
        };
        let full = surface(&whole);
        let expected: Vec<_> =
            (0..full.triangles.len()).filter(|f| kept(&full, *f)).map(|f| full.corners(f)).collect();
        let found: Vec<_> = (0..open.triangles.len()).map(|f| open.corners(f)).collect();
        assert!(!border(&open).is_empty());
        assert_eq!(found, expected);
    }
}

#[test]
fn missing_blocks_open_the_surface() {
    let whole = sphere(4, DVec3::ZERO);
    let mut builder = VolumeBuilder::new(*whole.grid());
    for (block, &coord) in whole.coords().iter().enumerate().filter(|(_, c)| c.x < 2) {
        builder.push(coord, whole.block(block).to_vec(), None);
    }
    let mesh = surface(&builder.finish());
    // Cells end at the last voxel centre before x = 2 blocks * 4 voxels.
    let last_m = 7.5 * whole.grid().voxel_size.metres();
    for (a, b) in border(&mesh) {
        assert!([a, b].iter().all(|v| (mesh.vertices[*v as usize].x - last_m).abs() < 1e-9));
    }
    assert!(mesh.vertices.iter().all(|v| v.x < last_m + 1e-9));
}

/// Blocks of noise around the origin, in a shell of outside voxels, so that the surface closes.
fn noise(edge: u32, seed: u64, fill_percent: u64) -> SparseVolume {
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    let mut builder = VolumeBuilder::new(grid(edge));
    for coord in cube(-1..1) {
        let codes = voxels(grid(edge).edge).map(|voxel| {
            let at_border = coord.to_array().iter().zip(voxel).any(|(block, v)| {
                let from_origin = block * edge as i32 + v as i32;
                from_origin == -(edge as i32) || from_origin == edge as i32 - 1
            });
            let magnitude = (random() % 900) as i16;
            if random() % 100 < fill_percent && !at_border { -magnitude } else { magnitude }
        });
        builder.push(coord, codes.collect(), None);
    }
    builder.finish()
}

/// Crossing edges by definition: neighbouring voxels of different sign.
fn count_crossing_edges(volume: &SparseVolume) -> usize {
    let edge = volume.grid().edge.voxels() as i32;
    let index = volume.index();
    let inside = |v: [i32; 3]| {
        let block = index.get(v.map(|c| c.div_euclid(edge)).into())?;
        let [x, y, z] = v.map(|c| c.rem_euclid(edge) as usize);
        Some(volume.block(block as usize)[volume.grid().edge.voxel_index(x, y, z)] < 0)
    };
    let crosses = |v: [i32; 3], axis: usize| {
        let mut next = v;
        next[axis] += 1;
        matches!((inside(v), inside(next)), (Some(a), Some(b)) if a != b)
    };
    cube(-edge..edge).map(|c| (0..3).filter(|axis| crosses(c.to_array(), *axis)).count()).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Noise meets every sign pattern next to every other: manifold, closed, one vertex a crossing edge.
    #[test]
    fn noise_gives_a_closed_manifold(seed: u64, edge in prop::sample::select(&EDGES[..]), fill in 5u64..95) {
        let volume = noise(edge, seed, fill);
        let mesh = surface(&volume);
        prop_assert!(border(&mesh).is_empty());
        prop_assert_eq!(mesh.vertices.len(), count_crossing_edges(&volume));
    }
}
