//! The figure is the clean, moving person it claims to be.

use glam::DVec3;
use isv_figure::{BOUNDS_M, FigurePaint, PERIOD_S, figure_mesh, head_m, painted_figure_mesh};
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
    // In the light of the stage, which is dimmer in folds.
    let is_skin = |c: &[u8; 3]| c[0] > 140 && (90..200).contains(&c[1]) && c[2] < c[1];
    let is_red = |c: &[u8; 3]| c[0] > 90 && c[1] < 80;
    let is_cream = |c: &[u8; 3]| c.iter().all(|c| *c > 130);
    assert!(share(1.5, 1.7, is_skin) > 0.2, "a face");
    assert!(share(0.55, 0.8, is_red) > 0.3 && share(0.55, 0.8, is_cream) > 0.1, "a skirt with flowers");
    // Laces are light.
    let skin = share(0.0, 0.08, is_skin);
    assert!(skin < 0.05, "shoes: {skin}");
}

#[test]
fn eyes_and_mouth_are_where_a_face_has_them() {
    let mesh = painted_figure_mesh(0.0, VoxelSize::from_metres(0.003).unwrap());
    let colours = &mesh.appearance.as_ref().unwrap().vertex_colours;
    let head = head_m(0.0);
    // Places of a colour in front of the head, relative to its middle.
    let places = |is_it: fn([i32; 3]) -> bool| -> Vec<DVec3> {
        let near = mesh.vertices.iter().zip(colours).map(|(v, c)| (*v - head, c.map(i32::from)));
        near.filter(|(at, c)| at.length() < 0.12 && at.z > 0.05 && is_it(*c)).map(|(at, _)| at).collect()
    };
    let whites = places(|[r, g, b]| b > 150 && r - b < 30 && g - b < 20);
    let lips = places(|[r, g, b]| r > 110 && r - g > 65 && (b - g).abs() < 20);
    let mean = |places: &[DVec3]| places.iter().sum::<DVec3>() / places.len().max(1) as f64;
    for (name, places) in [("whites", &whites), ("lips", &lips)] {
        assert!(places.len() > 20, "{} vertices of {name}", places.len());
    }
    let (left, right): (Vec<DVec3>, Vec<DVec3>) = whites.iter().partition(|at| at.x > mean(&whites).x);
    assert!((0.045..0.08).contains(&mean(&left).distance(mean(&right))), "{} {}", mean(&left), mean(&right));
    let down = mean(&whites).y - mean(&lips).y;
    assert!((0.045..0.085).contains(&down), "the mouth is {down} m below the eyes");
    assert!((mean(&whites).x - mean(&lips).x).abs() < 0.02, "{} {}", mean(&whites), mean(&lips));
}

#[test]
fn a_place_has_the_same_paint_whatever_is_painted_with_it() {
    let mesh = mesh_at(0.3, 0.02);
    let paint = FigurePaint::at(0.3 * PERIOD_S);
    let together = paint.colours(&mesh.vertices);
    let alone: Vec<_> = mesh.vertices.iter().flat_map(|place| paint.colours(&[*place])).collect();
    let differ = together.iter().zip(&alone).filter(|(a, b)| a != b).count();
    assert_eq!(differ, 0, "of {}", alone.len());
    let light = paint.light(&mesh);
    assert!(light.iter().all(|light| (0.2..1.2).contains(light)), "{light:?}");
    let [low, high] = [f32::min, f32::max].map(|of| light.iter().copied().reduce(of).unwrap());
    assert!(low < 0.65 && high > 0.9, "folds are darker: {low} to {high}");
}
