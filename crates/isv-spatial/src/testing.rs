//! Shapes and random numbers for this crate's tests.

use glam::DVec3;
use isv_volume::TriangleMesh;

/// SplitMix64: a small seeded generator, so that a failing case can be run again.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in -1..1.
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn point(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// A sphere of `2 * rings * rings` quads around the origin, cut into triangles; the poles hold zero-area faces.
pub(crate) fn sphere(radius: f64, rings: u32) -> TriangleMesh {
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

/// Random triangles, every fifth of them without area.
pub(crate) fn soup(seed: u64, faces: u32) -> TriangleMesh {
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
