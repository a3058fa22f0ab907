//! Points on surfaces: how many, where, and how evenly.

mod volumes;

use glam::DVec3;
use isv_surface::{MAX_POINTS, PointDensity, SamplingError, SurfaceOptions, extract_surface, sample_evenly};
use isv_volume::TriangleMesh;
use std::f64::consts::PI;
use volumes::{grid, sample};

fn sphere(normals: bool) -> TriangleMesh {
    extract_surface(&sample(grid(8), 0.4, |p| p.length() - 0.2), &SurfaceOptions { normals })
}

/// Distance from each point to the nearest other one.
fn nearest_neighbours(points: &[DVec3]) -> Vec<f64> {
    let others = |i: usize| points.iter().enumerate().filter(move |(j, _)| *j != i);
    let nearest = |(i, p): (usize, &DVec3)| others(i).map(|(_, q)| p.distance(*q)).fold(f64::MAX, f64::min);
    points.iter().enumerate().map(nearest).collect()
}

/// Standard deviation over mean.
fn variation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt() / mean
}

#[test]
fn a_sphere_is_covered_evenly() {
    let mesh = sphere(true);
    let points = sample_evenly(&mesh, PointDensity::Spacing(0.01)).unwrap();
    points.validate().unwrap();
    let expected = 4.0 * PI * 0.2f64.powi(2) / 0.01f64.powi(2);
    assert!((points.positions.len() as f64 / expected - 1.0).abs() < 2e-3);
    for octant in 0..8 {
        let inside = |p: &&DVec3| (0..3).all(|axis| (p[axis] > 0.0) == (octant >> axis & 1 != 0));
        let share = points.positions.iter().filter(inside).count() as f64 / expected;
        assert!((share - 0.125).abs() < 0.002, "octant {octant} has {share}");
    }
    for (p, n) in points.positions.iter().zip(&points.normals) {
        assert!((p.length() - 0.2).abs() < 2e-4);
        assert!(n.angle_between(*p).to_degrees() < 1.5);
    }
    // Random points have 0.52; those of a lattice of squares 0.
    let (even, vertices) =
        (variation(&nearest_neighbours(&points.positions)), variation(&nearest_neighbours(&mesh.vertices)));
    println!("variation of the distance to the nearest: {even:.3}, of the mesh's vertices {vertices:.3}");
    assert!(even < 0.40 && even < vertices);
}

#[test]
fn a_count_is_met_exactly_and_threads_change_nothing() {
    let mesh = sphere(false);
    for count in [0, 1, 7, 1000] {
        assert_eq!(sample_evenly(&mesh, PointDensity::Count(count)).unwrap().positions.len(), count);
    }
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| sample_evenly(&mesh, PointDensity::Count(999)).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn points_lie_in_triangles_in_proportion_to_their_area() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 3.0]];
    let mesh = TriangleMesh {
        vertices: corners.map(DVec3::from).to_vec(),
        normals: Vec::new(),
        triangles: vec![[1, 1, 2], [0, 1, 2], [0, 0, 0], [0, 1, 3], [2, 2, 2]],
        appearance: None,
    };
    let points = sample_evenly(&mesh, PointDensity::Count(400)).unwrap();
    let flat = points.normals.iter().filter(|n| **n == DVec3::Z).count();
    assert_eq!((flat, points.normals.iter().filter(|n| **n == DVec3::NEG_Y).count()), (100, 300));
    for (p, n) in points.positions.iter().zip(&points.normals) {
        assert!(p.dot(*n).abs() < 1e-15 && p.min_element() >= 0.0 && p.x + p.y + p.z / 3.0 <= 1.0 + 1e-12);
    }
}

#[test]
fn surfaces_without_area_give_no_points_and_bad_densities_are_refused() {
    let no_points =
        |mesh: &TriangleMesh| sample_evenly(mesh, PointDensity::Spacing(0.1)).unwrap().positions.is_empty();
    assert!(no_points(&TriangleMesh::default()));
    assert!(no_points(&TriangleMesh { triangles: vec![[0, 0, 0]], ..sphere(false) }));
    let sphere = sphere(false);
    for metres in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            sample_evenly(&sphere, PointDensity::Spacing(metres)),
            Err(SamplingError::Spacing { .. })
        ));
    }
    for density in [PointDensity::Spacing(1e-9), PointDensity::Count(MAX_POINTS + 1)] {
        assert!(matches!(sample_evenly(&sphere, density), Err(SamplingError::TooMany { .. })));
    }
}

/// A box has flat faces, on which every voxel edge is met at a right angle or not at all.
#[test]
fn an_axis_aligned_plane_is_covered_as_well() {
    let mesh =
        extract_surface(&sample(grid(4), 0.3, |p| p.abs().max_element() - 0.123), &SurfaceOptions::default());
    let points = sample_evenly(&mesh, PointDensity::Spacing(0.01)).unwrap();
    let inner: Vec<DVec3> = points.positions.iter().copied().filter(|p| p.z > 0.12).collect();
    assert!(inner.len() > 500);
    assert!(variation(&nearest_neighbours(&inner)) < 0.45);
}
