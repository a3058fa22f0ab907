//! Meshes of simple shapes.

use crate::Random;
use glam::DVec3;
use isv_volume::TriangleMesh;
use std::collections::BTreeMap;

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

/// A box without its side at `+z`.
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
        appearance: None,
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

/// A mesh with each triangle cut in nine and dented by up to `depth`: as fine and rough as captures of many faces are. Closed
/// where the mesh is.
#[must_use]
pub fn finer(mesh: &TriangleMesh, depth: f64) -> TriangleMesh {
    let mut positions = mesh.vertices.clone();
    // Two points on each edge, found from the lower of its vertices.
    let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut triangles = Vec::with_capacity(9 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
            let key = [from.min(to), from.max(to)];
            let first = *edges.entry(key).or_insert_with(|| {
                let [low, high] = key.map(|v| positions[v as usize]);
                positions.extend([low + (high - low) / 3.0, low + (high - low) * (2.0 / 3.0)]);
                positions.len() as u32 - 2
            });
            if from < to { [first, first + 1] } else { [first + 1, first] }
        });
        let middle = positions.len() as u32;
        positions.push([a, b, c].iter().map(|v| positions[*v as usize]).sum::<DVec3>() / 3.0);
        triangles.extend([[a, ab[0], ca[1]], [b, bc[0], ab[1]], [c, ca[0], bc[1]]]);
        let ring = [ab[0], ab[1], bc[0], bc[1], ca[0], ca[1]];
        triangles.extend((0..6).map(|i| [ring[i], ring[(i + 1) % 6], middle]));
    }
    for position in &mut positions {
        let wave = |a: f64, b: f64, c: f64| (a * 900.0 + b * 700.0 + c * 500.0).sin();
        let DVec3 { x, y, z } = *position;
        *position += DVec3::new(wave(x, y, z), wave(y, z, x), wave(z, x, y)) * (depth / 3.0f64.sqrt());
    }
    TriangleMesh { vertices: positions, triangles, ..TriangleMesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finer_mesh_is_closed_where_the_mesh_is() {
        let cube = cube(0.5);
        let fine = finer(&cube, 0.0);
        assert_eq!(fine.triangles.len(), 9 * cube.triangles.len());
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for [a, b, c] in fine.triangles.iter().copied() {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                *edges.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|balance| *balance == 0), "each edge is taken once each way");
        assert!(fine.vertices.iter().all(|v| (v.abs().max_element() - 0.5).abs() < 1e-12), "all on the cube");
    }
}
