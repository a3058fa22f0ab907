//! Surfaces as voxels, as codecs of point clouds take them.

use crate::ToolError;
use glam::DVec3;
use isv_volume::{Appearance, PointCloud, Rgb, TriangleMesh};

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

/// Points of a [`Lattice`], as codecs of point clouds take them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Voxels {
    /// Coordinates on the lattice, each once, in order.
    pub places: Vec<[i32; 3]>,
    /// sRGB of each place; empty without colours.
    pub colours: Vec<Rgb>,
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

    /// The voxels that a surface passes through. Samples half a step apart on each triangle are rounded to the lattice. The voxels of
    /// a mesh with an appearance have the mean colour of their samples; sRGB values are averaged as they are.
    ///
    /// # Errors
    /// [`ToolError::Mesh`] for a mesh that cannot be worked with, [`ToolError::TooManySamples`] for a lattice that is too fine.
    pub fn voxels(&self, mesh: &TriangleMesh) -> Result<Voxels, ToolError> {
        mesh.validate()?;
        let samples: f64 = mesh.triangles.iter().map(|t| samples_of(&self.corners(mesh, t))).sum();
        let farthest =
            mesh.vertices.iter().map(|v| (*v - self.origin).abs().max_element()).fold(0.0, f64::max);
        if samples > MOST_SAMPLES || farthest / self.step_m > MOST_STEPS {
            return Err(ToolError::TooManySamples { samples, step_m: self.step_m, limit: MOST_SAMPLES });
        }
        let mut places = Vec::new();
        let mut of_triangle = Vec::new();
        for triangle in &mesh.triangles {
            for_samples(&self.corners(mesh, triangle), |place, _| of_triangle.push(place));
            of_triangle.sort_unstable();
            of_triangle.dedup();
            places.append(&mut of_triangle);
        }
        places.sort_unstable();
        places.dedup();
        let appearance = mesh.appearance.as_deref();
        let colours = appearance.map_or(Vec::new(), |appearance| self.colours(mesh, appearance, &places));
        Ok(Voxels { places, colours })
    }

    /// Mean colours of the samples at each of the places, which are all those of the mesh.
    fn colours(&self, mesh: &TriangleMesh, appearance: &Appearance, places: &[[i32; 3]]) -> Vec<Rgb> {
        let mut sums = vec![([0.0; 3], 0u32); places.len()];
        for (face, triangle) in mesh.triangles.iter().enumerate() {
            for_samples(&self.corners(mesh, triangle), |place, weights| {
                let (sum, count) = &mut sums[places.binary_search(&place).expect("a place of the mesh")];
                let colour = appearance.colour(face, *triangle, weights);
                (0..3).for_each(|c| sum[c] += f64::from(colour[c]));
                *count += 1;
            });
        }
        sums.iter().map(|(sum, count)| sum.map(|sum| (sum / f64::from(*count)).round() as u8)).collect()
    }

    /// Corners of a triangle on the lattice.
    fn corners(&self, mesh: &TriangleMesh, triangle: &[u32; 3]) -> [DVec3; 3] {
        triangle.map(|v| (mesh.vertices[v as usize] - self.origin) / self.step_m)
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

/// Visits the samples of a triangle: the place that each is rounded to, and the weights of the corners there.
fn for_samples(corners: &[DVec3; 3], mut visit: impl FnMut([i32; 3], [f32; 3])) {
    let [a, b, c] = *corners;
    let parts = parts(corners) as u32;
    for i in 0..=parts {
        for j in 0..=parts - i {
            let [u, v] = [i, j].map(|n| f64::from(n) / f64::from(parts));
            let sample = a + u * (b - a) + v * (c - a);
            let weights = [1.0 - u - v, u, v].map(|weight| weight as f32);
            visit(sample.round().to_array().map(|x| x as i32), weights);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::Bvh;
    use std::sync::Arc;

    #[test]
    fn voxels_lie_on_the_surface_and_cover_it() {
        let mesh = isv_testkit::sphere(0.5, 24);
        let lattice = Lattice::spanning(mesh.bounds().unwrap(), 6);
        let Voxels { places: voxels, colours } = lattice.voxels(&mesh).unwrap();
        assert!(colours.is_empty());
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

    #[test]
    fn voxels_have_the_mean_colour_of_their_part_of_the_surface() {
        let mut mesh = isv_testkit::sphere(0.5, 24);
        let (low, high) = mesh.bounds().unwrap();
        // Black at the one side, white at the other.
        let grey = |v: &DVec3| ((v.x - low.x) / (high.x - low.x) * 255.0).round() as u8;
        let vertex_colours = mesh.vertices.iter().map(|v| [grey(v); 3]).collect();
        mesh.appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
        let lattice = Lattice::spanning((low, high), 6);
        let voxels = lattice.voxels(&mesh).unwrap();
        assert_eq!(voxels.colours.len(), voxels.places.len());
        for (place, colour) in voxels.places.iter().zip(&voxels.colours) {
            let expected = f64::from(place[0]) / 63.0 * 255.0;
            assert!(colour.iter().all(|c| (f64::from(*c) - expected).abs() < 4.0), "{place:?}: {colour:?}");
        }
    }
}
