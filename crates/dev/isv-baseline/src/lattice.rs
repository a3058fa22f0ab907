//! Surfaces as voxels, as codecs of point clouds take them.

use crate::ToolError;
use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};

/// Distance of samples on a triangle, in steps of the lattice. At a half no voxel of more than a corner is missed.
const SAMPLE_STEPS: f64 = 0.5;

/// Most samples of a frame: 2 GB of memory.
const MOST_SAMPLES: f64 = 2.5e8;

/// Most steps from the origin along an axis: positions are exact in `f32`.
const MOST_STEPS: f64 = (1 << 22) as f64;

/// A lattice of points, on which a codec of point clouds codes positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The point that has coordinates 0, in metres.
    pub origin: DVec3,
    /// Distance of neighbours, in metres.
    pub step_m: f64,
}

impl Lattice {
    /// Bytes that tell a decoder of it: three coordinates and a step as `f32`.
    pub const BYTES: u64 = 16;

    /// The lattice that spans the longest side of a box in `2^bits - 1` steps.
    #[must_use]
    pub fn spanning((low, high): (DVec3, DVec3), bits: u8) -> Self {
        let extent = (high - low).max_element().max(f64::MIN_POSITIVE);
        Self { origin: low, step_m: extent / f64::from((1u32 << bits) - 1) }
    }

    /// The voxels that a surface passes through, each once, in order. Samples half a step apart on each triangle are rounded
    /// to the lattice.
    ///
    /// # Errors
    /// [`ToolError::Mesh`] for a mesh that cannot be worked with, [`ToolError::TooManySamples`] for a lattice that is too fine.
    pub fn voxels(&self, mesh: &TriangleMesh) -> Result<Vec<[i32; 3]>, ToolError> {
        mesh.validate()?;
        let corners =
            |triangle: &[u32; 3]| triangle.map(|v| (mesh.vertices[v as usize] - self.origin) / self.step_m);
        let samples: f64 = mesh.triangles.iter().map(|t| samples_of(&corners(t))).sum();
        let farthest =
            mesh.vertices.iter().map(|v| (*v - self.origin).abs().max_element()).fold(0.0, f64::max);
        if samples > MOST_SAMPLES || farthest / self.step_m > MOST_STEPS {
            return Err(ToolError::TooManySamples { samples, step_m: self.step_m, limit: MOST_SAMPLES });
        }
        let mut voxels = Vec::new();
        let mut of_triangle = Vec::new();
        for triangle in &mesh.triangles {
            add_samples(&corners(triangle), &mut of_triangle);
            of_triangle.sort_unstable();
            of_triangle.dedup();
            voxels.append(&mut of_triangle);
        }
        voxels.sort_unstable();
        voxels.dedup();
        Ok(voxels)
    }

    /// Points in metres of points on the lattice.
    #[must_use]
    pub fn placed(&self, points: PointCloud) -> PointCloud {
        let positions = points.positions.iter().map(|p| self.origin + *p * self.step_m).collect();
        PointCloud { positions, ..points }
    }
}

/// Parts of a triangle's edges between samples.
fn parts(corners: &[DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let longest = a.distance(*b).max(b.distance(*c)).max(c.distance(*a));
    (longest / SAMPLE_STEPS).ceil().max(1.0)
}

fn samples_of(corners: &[DVec3; 3]) -> f64 {
    let parts = parts(corners);
    (parts + 1.0) * (parts + 2.0) / 2.0
}

fn add_samples(corners: &[DVec3; 3], voxels: &mut Vec<[i32; 3]>) {
    let [a, b, c] = *corners;
    let parts = parts(corners) as u32;
    for i in 0..=parts {
        for j in 0..=parts - i {
            let [u, v] = [i, j].map(|n| f64::from(n) / f64::from(parts));
            let sample = a + u * (b - a) + v * (c - a);
            voxels.push(sample.round().to_array().map(|x| x as i32));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::Bvh;

    #[test]
    fn voxels_lie_on_the_surface_and_cover_it() {
        let mesh = isv_testkit::sphere(0.5, 24);
        let lattice = Lattice::spanning(mesh.bounds().unwrap(), 6);
        let voxels = lattice.voxels(&mesh).unwrap();
        assert!(voxels.iter().flatten().all(|x| (0..64).contains(x)));
        let surface = Bvh::new(&mesh);
        let on_lattice = voxels.iter().map(|v| v.map(f64::from).into()).collect();
        let placed = lattice.placed(PointCloud { positions: on_lattice, ..PointCloud::default() });
        let half_diagonal = 0.5 * lattice.step_m * 3f64.sqrt();
        assert!(placed.positions.iter().all(|p| surface.distance(*p) <= half_diagonal * 1.0001));
        // A sphere passes through 1.5 voxels to a square of surface; those of which samples miss a corner are fewer.
        let squares = mesh.area() / lattice.step_m.powi(2);
        assert!((1.2..1.5).contains(&(voxels.len() as f64 / squares)), "{} of {squares}", voxels.len());
    }

    #[test]
    fn a_lattice_that_is_too_fine_is_refused() {
        let error =
            Lattice { origin: DVec3::ZERO, step_m: 1e-7 }.voxels(&isv_testkit::cube(1.0)).unwrap_err();
        assert!(matches!(error, ToolError::TooManySamples { .. }), "{error}");
    }
}
