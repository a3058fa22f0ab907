//! The figure is the clean, moving person it claims to be.

use glam::DVec3;
use isv_figure::{BOUNDS_M, PERIOD_S, figure_mesh, painted_figure_mesh};
use isv_volume::{TriangleMesh, VoxelSize};
use std::collections::HashSet;

fn mesh_at(part_of_period: f64, voxel_m: f64) -> TriangleMesh {
    figure_mesh(part_of_period * PERIOD_S, VoxelSize::from_metres(voxel_m).unwrap())
}

#[test]
fn figure_is_closed() {
    for (part, voxel_m) in
        [(0.0, 0.005), (0.2, 0.006), (0.4, 0.006), (0.55, 0.008), (0.7, 0.01), (0.9, 0.015)]
    {
        let mesh = mesh_at(part, voxel_m);
        mesh.validate().unwrap();
        let edges: HashSet<_> =
            mesh.triangles.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]).collect();
        assert_eq!(edges.len(), 3 * mesh.triangles.len(), "an edge is used twice");
        assert!(edges.iter().all(|(a, b)| edges.contains(&(*b, *a))), "open at {part} with {voxel_m} m");
    }
}

#[test]
fn figure_is_a_person_standing_on_the_ground_within_the_bounds() {
    for i in 0..20 {
        let mesh = mesh_at(f64::from(i) / 20.0, 0.012);
        let (low, high) = mesh.bounds().unwrap();
        assert!(low.y.abs() < 0.006, "{low}");
        assert!(low.cmpge(BOUNDS_M.0 - 1e-9).all() && high.cmple(BOUNDS_M.1).all(), "{low} {high}");
        let crown = mesh.vertices.iter().filter(|v| DVec3::new(v.x, 0.0, v.z).length() < 0.15);
        let height = crown.map(|v| v.y).fold(0.0, f64::max);
        assert!((1.68..1.82).contains(&height), "{height}");
    }
}

#[test]
fn the_dance_repeats_and_frames_do_not_depend_on_threads() {
    let now = mesh_at(0.3, 0.012);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(now, one_thread.install(|| mesh_at(0.3, 0.012)));
    let later = mesh_at(1.3, 0.012);
    assert_eq!(now.triangles.len(), later.triangles.len());
    assert_ne!(now.triangles.len(), mesh_at(0.31, 0.012).triangles.len());
}

#[test]
fn the_figure_is_dressed_and_has_a_face() {
    let voxel_size = VoxelSize::from_metres(0.005).unwrap();
    let mesh = painted_figure_mesh(0.0, voxel_size);
    let colours = &mesh.appearance.as_ref().unwrap().vertex_colours;
    assert_eq!(colours.len(), mesh.vertices.len());
    let share = |low: f64, high: f64, is_it: fn(&[u8; 3]) -> bool| {
        let there = mesh.vertices.iter().zip(colours).filter(|(v, _)| (low..high).contains(&v.y));
        let (all, found) =
            there.fold((0, 0), |(all, found), (_, c)| (all + 1, found + usize::from(is_it(c))));
        f64::from(found as u32) / f64::from(all.max(1))
    };
    let is_skin = |c: &[u8; 3]| c[0] > 200 && (130..200).contains(&c[1]) && c[2] < c[1];
    let is_red = |c: &[u8; 3]| c[0] > 140 && c[1] < 80;
    let is_cream = |c: &[u8; 3]| c.iter().all(|c| *c > 180);
    assert!(share(1.5, 1.7, is_skin) > 0.2, "a face");
    assert!(share(0.55, 0.8, is_red) > 0.3 && share(0.55, 0.8, is_cream) > 0.1, "a skirt with flowers");
    assert!(share(0.0, 0.08, is_skin) < 0.01, "shoes");
}
