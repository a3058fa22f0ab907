//! Meshes of simple shapes.

use crate::Random;
use glam::DVec3;
use isv_volume::TriangleMesh;

/// A sphere of `2 * rings * rings` quads around the origin, cut into triangles; the poles hold zero-area faces.
#[must_use]
pub fn sphere(radius: f64, rings: u32) -> TriangleMesh {
    let around = 2 * rings;
    let mut mesh = TriangleMesh::default();
    for ring in 0..=rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for step in 0..around {
            let phi = std::f64::consts::TAU * f64::from(step) / f64::from(around);
            let direction = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            mesh.vertices.push(radius * direction);
        }
    }
    for ring in 0..rings {
        for step in 0..around {
            let corner = |r: u32, s: u32| r * around + s % around;
            let quad = [
                corner(ring, step),
                corner(ring + 1, step),
                corner(ring + 1, step + 1),
                corner(ring, step + 1),
            ];
            mesh.triangles.push([quad[0], quad[1], quad[2]]);
            mesh.triangles.push([quad[0], quad[2], quad[3]]);
        }
    }
    mesh
}

/// The cube `-half..half`.
#[must_use]
pub fn cube(half: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for i in 0..8 {
        let side = |bit: i32| if i >> bit & 1 == 0 { -half } else { half };
        mesh.vertices.push(DVec3::new(side(0), side(1), side(2)));
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        mesh.triangles.push([a, b, c]);
        mesh.triangles.push([a, c, d]);
    }
    mesh
}

/// The same without its side at `+z`.
#[must_use]
pub fn open_box(half: f64) -> TriangleMesh {
    let mut mesh = cube(half);
    mesh.triangles.drain(2..4);
    mesh
}

/// The square `-half..half` in the plane `z = 0`.
#[must_use]
pub fn sheet(half: f64) -> TriangleMesh {
    let corner = |x: f64, y: f64| DVec3::new(x * half, y * half, 0.0);
    TriangleMesh {
        vertices: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// Random triangles, every fifth of them without area.
#[must_use]
pub fn soup(seed: u64, faces: u32) -> TriangleMesh {
    let mut random = Random::new(seed);
    let mut mesh = TriangleMesh::default();
    for face in 0..faces {
        let centre = random.point();
        for _ in 0..3 {
            mesh.vertices.push(centre + 0.1 * random.point());
        }
        let [a, b, c] = [3 * face, 3 * face + 1, 3 * face + 2];
        mesh.triangles.push(if face % 5 == 0 { [a, b, b] } else { [a, b, c] });
    }
    mesh
}
