//! Scenes larger than a thing.

use crate::Random;
use glam::DVec3;
use isv_volume::TriangleMesh;

/// Along an edge of the ground's squares, in metres.
const GROUND_M: f64 = 0.5;
/// From one house to the next, along the street and across it, and how large they are at most.
const PLOT_M: f64 = 12.5;
const HOUSE_M: DVec3 = DVec3::new(9.0, 9.0, 20.0);
/// Cars that drive, and how fast.
const CARS: u32 = 12;
const CAR_M: DVec3 = DVec3::new(4.0, 1.8, 1.5);
const CAR_SPEED_M_S: f64 = 10.0;

/// Rolling waves on a square of water around the origin, all of which moves: `side_m` along an edge, at `t` seconds.
#[must_use]
pub fn waves(side_m: f64, t: f64) -> TriangleMesh {
    let height = |x: f64, y: f64| 0.2 * (0.8 * x + 1.5 * t).sin() * (0.6 * y - 1.1 * t).cos();
    field(side_m, 0.1, height)
}

/// A street of houses on uneven ground in which some cars drive, at `t` seconds. It is a square of `side_m`
/// along an edge around the origin, 20 m high at most.
#[must_use]
pub fn street(side_m: f64, t: f64) -> TriangleMesh {
    let height = |x: f64, y: f64| 0.3 * (0.11 * x).sin() * (0.17 * y).cos();
    let mut mesh = field(side_m, GROUND_M, height);
    let mut random = Random::new(5);
    let plots = (side_m / PLOT_M) as u32;
    for plot in 0..plots * plots {
        let place = |i: u32| (f64::from(i) + 0.5) * PLOT_M - side_m / 2.0;
        let centre = DVec3::new(place(plot % plots), place(plot / plots), 0.0);
        let size = HOUSE_M * (0.75 + 0.25 * random.point());
        add_box(&mut mesh, centre - 0.5 * size.with_z(2.0), centre + 0.5 * size.with_z(2.0 * size.z - 2.0));
    }
    for car in 0..CARS {
        // Between two rows of houses, round and round.
        let lane = (f64::from(car % plots.max(1)) + 1.0) * PLOT_M - side_m / 2.0 - CAR_M.y;
        let along = (17.3 * f64::from(car) + CAR_SPEED_M_S * t).rem_euclid(side_m - CAR_M.x) - side_m / 2.0;
        let lowest = DVec3::new(along, lane.min(side_m / 2.0 - CAR_M.y), 0.5);
        add_box(&mut mesh, lowest, lowest + CAR_M);
    }
    mesh
}

/// A square field of squares about `step_m` along an edge, in triangles that face up.
fn field(side_m: f64, step_m: f64, height: impl Fn(f64, f64) -> f64) -> TriangleMesh {
    let steps = (side_m / step_m).round() as u32;
    let mut mesh = TriangleMesh::default();
    let at = |i: u32| (f64::from(i) / f64::from(steps) - 0.5) * side_m;
    for (y, x) in (0..=steps).flat_map(|y| (0..=steps).map(move |x| (y, x))) {
        mesh.vertices.push(DVec3::new(at(x), at(y), height(at(x), at(y))));
    }
    for (y, x) in (0..steps).flat_map(|y| (0..steps).map(move |x| (y, x))) {
        let corner = |dx: u32, dy: u32| (y + dy) * (steps + 1) + x + dx;
        mesh.triangles.push([corner(0, 0), corner(1, 0), corner(1, 1)]);
        mesh.triangles.push([corner(0, 0), corner(1, 1), corner(0, 1)]);
    }
    mesh
}

/// Adds a box.
fn add_box(mesh: &mut TriangleMesh, lowest: DVec3, highest: DVec3) {
    let unit = crate::cube(1.0);
    let first = mesh.vertices.len() as u32;
    let (centre, half) = ((lowest + highest) / 2.0, (highest - lowest) / 2.0);
    mesh.vertices.extend(unit.vertices.iter().map(|corner| centre + half * *corner));
    mesh.triangles.extend(unit.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
}
