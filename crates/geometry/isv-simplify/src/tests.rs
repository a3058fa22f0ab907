//! Shapes before and after.

use super::*;
use isv_spatial::Bvh;
use isv_testkit::{open_box, sphere};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A torus with dents, of `2 * rings * rings` quads: closed, of genus 1, curved both ways.
fn torus(rings: u32) -> TriangleMesh {
    let (around, across) = (2 * rings, rings);
    let vertices = (0..around * across).map(|at| {
        let [u, v] = [at / across * across, at % across * around]
            .map(|part| TAU * f64::from(part) / f64::from(around * across));
        let tube = 0.3 + 0.02 * (5.0 * u).sin() * (3.0 * v).cos();
        let reach = 1.0 + tube * v.cos();
        DVec3::new(reach * u.cos(), tube * v.sin(), -reach * u.sin())
    });
    let at = |u: u32, v: u32| u % around * across + v % across;
    let quads = (0..around * across).map(|place| (place / across, place % across));
    let triangles = quads.flat_map(|(u, v)| {
        let corners = [at(u, v), at(u + 1, v), at(u + 1, v + 1), at(u, v + 1)];
        [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]]
    });
    TriangleMesh {
        vertices: vertices.collect(),
        normals: Vec::new(),
        triangles: triangles.collect(),
        appearance: None,
    }
}

fn by_faces(mesh: &TriangleMesh, faces: usize) -> Simplified {
    simplify(mesh, &Budget { faces: Some(faces), max_error_m: None }).unwrap()
}

fn by_error(mesh: &TriangleMesh, max_error_m: f64) -> Simplified {
    simplify(mesh, &Budget { faces: None, max_error_m: Some(max_error_m) }).unwrap()
}

/// Edges by how many faces run along them one way less those that run the other way: none in a closed, oriented mesh.
fn open_edges(mesh: &TriangleMesh) -> usize {
    let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *edges.entry([*from.min(to), *from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    edges.values().filter(|balance| **balance != 0).count()
}

/// Vertices less edges and faces: 2 of a sphere, 0 of a torus.
fn euler(mesh: &TriangleMesh) -> i64 {
    // In a closed mesh every edge has two faces.
    mesh.vertices.len() as i64 - mesh.triangles.len() as i64 / 2
}

/// Faces whose normal points away from that of the closest face of the mesh as it was.
fn flipped(source: &TriangleMesh, simplified: &TriangleMesh) -> usize {
    let surface = Bvh::new(source);
    let is_flipped = |face: &usize| {
        let [a, b, c] = simplified.corners(*face);
        let closest = surface.closest_point((a + b + c) / 3.0);
        simplified.area_vector(*face).dot(source.area_vector(closest.triangle as usize)) < 0.0
    };
    (0..simplified.triangles.len()).filter(is_flipped).count()
}

#[test]
fn a_closed_surface_stays_closed_and_keeps_its_handle_and_sides() {
    let torus = torus(60);
    assert_eq!((open_edges(&torus), euler(&torus)), (0, 0));
    for faces in [7000, 2000, 500, 200] {
        let Simplified { mesh, error_m } = by_faces(&torus, faces);
        assert!(mesh.triangles.len() <= faces && mesh.triangles.len() * 10 > faces * 9, "{faces}");
        assert_eq!((open_edges(&mesh), euler(&mesh), flipped(&torus, &mesh)), (0, 0, 0), "{faces}");
        assert!(error_m > 0.0 && error_m < 0.1, "{faces}: {error_m}");
        mesh.validate().unwrap();
    }
}

#[test]
fn the_error_stays_within_what_is_allowed_and_is_made_use_of() {
    let source = torus(60);
    let mut last = source.triangles.len();
    for max_error_m in [0.0005, 0.002, 0.01] {
        let Simplified { mesh, error_m } = by_error(&source, max_error_m);
        assert!(error_m <= max_error_m && error_m > 0.3 * max_error_m, "{error_m} of {max_error_m}");
        assert!(mesh.triangles.len() < last, "{} faces with {max_error_m}", mesh.triangles.len());
        // Points within faces, most of which were not looked at.
        let surface = Bvh::new(&source);
        let farthest = (0..mesh.triangles.len()).map(|face| {
            let [a, b, c] = mesh.corners(face);
            surface.distance(0.6 * a + 0.3 * b + 0.1 * c)
        });
        assert!(farthest.fold(0.0, f64::max) <= 1.1 * max_error_m);
        last = mesh.triangles.len();
    }
}

#[test]
fn with_both_limits_the_first_that_is_met_counts() {
    let source = torus(40);
    let both = |faces, max_error_m| {
        simplify(&source, &Budget { faces: Some(faces), max_error_m: Some(max_error_m) })
    };
    let many = both(4000, 0.1).unwrap();
    assert_eq!(many.mesh, by_faces(&source, 4000).mesh, "faces come first");
    let exact = both(10, 0.002).unwrap();
    assert!(exact.error_m <= 0.002 && exact.mesh.triangles.len() > 100);
}

#[test]
fn something_is_left_of_everything() {
    // The faces of a sphere are as good as each other, and vanish together.
    for source in [sphere(1.0, 20), torus(20)] {
        for faces in [1, 2, 3] {
            let left = by_faces(&source, faces).mesh.triangles.len();
            assert!((1..source.triangles.len() / 3).contains(&left), "{left} faces for {faces}");
        }
    }
}

#[test]
fn flat_parts_cost_nothing_and_borders_stay() {
    // A square of 50 x 50 quads with a border.
    let side = 50u32;
    let at = |x: u32, y: u32| y * (side + 1) + x;
    let vertices =
        (0..(side + 1).pow(2)).map(|i| DVec3::new(f64::from(i % (side + 1)), f64::from(i / (side + 1)), 0.0));
    let quads = (0..side * side).map(|i| (i % side, i / side));
    let triangles = quads.flat_map(|(x, y)| {
        [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]]
    });
    let square = TriangleMesh {
        vertices: vertices.collect(),
        normals: Vec::new(),
        triangles: triangles.collect(),
        appearance: None,
    };
    let Simplified { mesh, error_m } = by_error(&square, 0.01);
    assert!(mesh.triangles.len() < 100 && error_m < 0.01, "{} faces, {error_m}", mesh.triangles.len());
    assert_eq!(mesh.bounds(), square.bounds());
    assert!((mesh.area() / square.area() - 1.0).abs() < 1e-4, "{}", mesh.area());
}

#[test]
fn an_open_box_keeps_its_opening() {
    let mut source = open_box(1.0);
    source = isv_testkit::finer(&isv_testkit::finer(&isv_testkit::finer(&source, 0.0), 0.0), 0.0);
    let before = open_edges(&weld(&source));
    let Simplified { mesh, .. } = by_error(&source, 0.01);
    assert!(mesh.triangles.len() < source.triangles.len());
    assert!(open_edges(&mesh) >= 4 && open_edges(&mesh) <= before, "{} of {before}", open_edges(&mesh));
    assert!((mesh.area() / source.area() - 1.0).abs() < 1e-3);
}

#[test]
fn a_mesh_far_away_is_simplified_like_one_at_the_origin() {
    let near = torus(30);
    let mut far = near.clone();
    far.vertices.iter_mut().for_each(|v| *v += DVec3::splat(8_388_608.0));
    let [near, far] = [near, far].map(|mesh| by_error(&mesh, 0.002));
    assert!(near.mesh.triangles.len().abs_diff(far.mesh.triangles.len()) < 20);
    assert!(far.error_m <= 0.002);
}

#[test]
fn what_has_no_more_faces_than_allowed_is_left_alone() {
    let mut sphere = sphere(1.0, 8);
    sphere.normals = sphere.vertices.clone();
    let all = by_faces(&sphere, sphere.triangles.len());
    assert_eq!(all, Simplified { mesh: sphere, error_m: 0.0 });
    let none = TriangleMesh::default();
    assert_eq!(by_faces(&none, 5), Simplified { mesh: none.clone(), error_m: 0.0 });
}

#[test]
fn threads_do_not_change_the_result() {
    let source = torus(40);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| by_error(&source, 0.003))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn what_cannot_be_simplified_is_refused() {
    let mut wild = isv_testkit::cube(1.0);
    wild.vertices[0] = DVec3::splat(1e300);
    let budget = Budget { faces: Some(4), max_error_m: None };
    assert!(matches!(simplify(&wild, &budget), Err(SimplifyError::Simplifier(_))));
    wild.vertices[0] = DVec3::NAN;
    assert!(matches!(simplify(&wild, &budget), Err(SimplifyError::Mesh(_))));
}

#[test]
fn an_error_beyond_the_size_of_the_mesh_allows_as_much_as_its_size() {
    let mesh = torus(24);
    for error_m in [10.0, 1e3, 1e300, f64::INFINITY] {
        let simplified = by_error(&mesh, error_m);
        assert!(simplified.mesh.triangles.len() < mesh.triangles.len() / 10, "{error_m} m");
        assert!(!simplified.mesh.triangles.is_empty());
    }
}
