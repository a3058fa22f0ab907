//! Colours of meshes, points and cameras as samples near a surface, for the codec to fit its own to.

mod depth_map;
mod memory;
mod views;

pub use memory::ColourMemory;
pub use views::{SeenColour, SurfacePoint, level_weights, seen_colours, view_colours};

use glam::DVec3;
use isv_kernels::simd::vectorized;
use isv_volume::{Appearance, ColourSample, PointCloud, TriangleMesh};
use rayon::prelude::*;

/// Triangles that a thread works on at a time.
const CHUNK: usize = 1024;
/// Most samples of a mesh: 4 GiB of them. A surface that would have more is sampled more sparsely.
const MOST_SAMPLES: f64 = 1e8;
/// The two-dimensional sequence of low discrepancy that places samples in triangles: powers of the plastic number (Roberts 2018).
const SEQUENCE: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];

/// Samples the colours of a mesh evenly over its surface, one a `spacing_m` squared (metres); each stands for the same area.
///
/// Empty if the mesh has no appearance or no area. The same mesh gives the same samples.
#[must_use]
pub fn mesh_colours(mesh: &TriangleMesh, spacing_m: f64) -> Vec<ColourSample> {
    let Some(appearance) = mesh.appearance.as_deref() else { return Vec::new() };
    spread_over(
        mesh,
        spacing_m,
        #[inline(always)]
        |face, normal, k| Some(face_colour(mesh, appearance, face, normal, k)),
    )
}

/// Makes something of places that lie evenly on a mesh, one a `spacing_m` squared (metres). `of_place` gets a face, its unit normal and
/// the number of the place, which [`weights_of`] takes, and makes nothing of some. Empty without area.
fn spread_over<T: Send>(
    mesh: &TriangleMesh,
    spacing_m: f64,
    of_place: impl Fn(usize, DVec3, u64) -> Option<T> + Sync,
) -> Vec<T> {
    let mut all = 0.0;
    let ends: Vec<f64> = (0..mesh.triangles.len())
        .map(|face| {
            let area = mesh.area_vector(face).length();
            all += if area.is_finite() { area } else { 0.0 };
            all
        })
        .collect();
    let count = (all / (spacing_m * spacing_m)).min(MOST_SAMPLES);
    if !(count.is_finite() && all > 0.0) {
        return Vec::new();
    }
    // The samples of a triangle are those whose share of the area ends in it.
    let number = |area: f64| (area / all * count) as u64;
    let of_chunk = |(chunk, own): (usize, &[f64])| {
        let first = chunk * CHUNK;
        let before = if first == 0 { 0.0 } else { ends[first - 1] };
        let mut start = number(before);
        let all = own.last().map_or(0, |end| number(*end) - start);
        let mut samples = Vec::with_capacity(all as usize);
        vectorized(
            #[inline(always)]
            || {
                for (face, end) in (first..).zip(own) {
                    let end = number(*end);
                    if end > start {
                        let normal = mesh.area_vector(face).normalize_or_zero();
                        for k in start..end {
                            if let Some(sample) = of_place(face, normal, k) {
                                samples.push(sample);
                            }
                        }
                    }
                    start = end;
                }
            },
        );
        samples
    };
    let chunks: Vec<Vec<T>> = ends.par_chunks(CHUNK).enumerate().map(of_chunk).collect();
    let mut samples = Vec::with_capacity(chunks.iter().map(Vec::len).sum());
    chunks.into_iter().for_each(|chunk| samples.extend(chunk));
    samples
}

/// Weights of a triangle's corners at the place of a number.
#[inline(always)]
fn weights_of(k: u64) -> [f64; 3] {
    let [mut u, mut v] = SEQUENCE.map(|step| (0.5 + k as f64 * step).fract());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    [1.0 - u - v, u, v]
}

/// The colour of a face at a place that a sample's number gives.
#[inline(always)]
fn face_colour(
    mesh: &TriangleMesh,
    appearance: &Appearance,
    face: usize,
    normal: DVec3,
    k: u64,
) -> ColourSample {
    let weights = weights_of(k);
    let corners = mesh.corners(face);
    let position = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
    ColourSample {
        position: position.as_vec3().to_array(),
        normal: normal.as_vec3().to_array(),
        colour: appearance.colour(face, mesh.triangles[face], weights.map(|w| w as f32)),
        weight: 1.0,
    }
}

/// The colours of points; empty if they have none. Points whose normals are not known have zero normals.
#[must_use]
pub fn point_colours(points: &PointCloud) -> Vec<ColourSample> {
    let colours = points.colours.par_iter().enumerate();
    colours
        .map(|(point, colour)| ColourSample {
            position: points.positions[point].as_vec3().to_array(),
            normal: points.normals.get(point).map_or([0.0; 3], |normal| normal.as_vec3().to_array()),
            colour: colour.map(f32::from),
            weight: 1.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::{Image, Material};
    use std::sync::Arc;

    /// A square of a metre in two triangles, with a texture whose left half is black and whose right half is white.
    fn square() -> TriangleMesh {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let image = Image::new(2, 1, vec![[0; 3], [255; 3]]);
        let material = Material { texture: image.map(Arc::new), ..Material::default() };
        let coordinates =
            triangles.iter().map(|t: &[u32; 3]| t.map(|v| corners[v as usize].map(|c| c as f32)));
        let appearance = Appearance {
            texture_coordinates: coordinates.collect(),
            materials: vec![material],
            ..Appearance::default()
        };
        TriangleMesh {
            vertices: corners.iter().map(|[x, y]| DVec3::new(*x, *y, 0.0)).collect(),
            triangles,
            appearance: Some(Arc::new(appearance)),
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn samples_cover_the_surface_evenly() {
        let samples = mesh_colours(&square(), 0.02);
        assert_eq!(samples.len(), 2500);
        for (x, y) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)] {
            let inside = |s: &&ColourSample| {
                let [px, py, _] = s.position;
                (x..x + 0.5).contains(&px) && (y..y + 0.5).contains(&py)
            };
            let count = samples.iter().filter(inside).count();
            assert!((600..650).contains(&count), "{count}");
        }
        assert!(samples.iter().all(|s| s.normal == [0.0, 0.0, 1.0]));
    }

    #[test]
    fn samples_have_the_colour_of_the_texture() {
        for sample in mesh_colours(&square(), 0.02) {
            let expected = ((sample.position[0] - 0.25) * 2.0).clamp(0.0, 1.0) * 255.0;
            assert!((sample.colour[0] - expected).abs() < 0.1, "{sample:?}");
        }
    }

    #[test]
    fn a_mesh_without_colours_or_area_has_no_samples() {
        let plain = TriangleMesh { appearance: None, ..square() };
        assert!(mesh_colours(&plain, 0.02).is_empty());
        let flat = TriangleMesh { vertices: vec![DVec3::ZERO; 4], ..square() };
        assert!(mesh_colours(&flat, 0.02).is_empty());
        let far = TriangleMesh { vertices: vec![DVec3::splat(f64::MAX); 4], ..square() };
        assert!(mesh_colours(&far, 0.02).is_empty());
    }

    #[test]
    fn points_keep_their_colours() {
        let cloud = PointCloud {
            positions: vec![DVec3::X, DVec3::Y],
            colours: vec![[1, 2, 3], [4, 5, 6]],
            ..PointCloud::default()
        };
        let samples = point_colours(&cloud);
        assert_eq!(samples[1].colour, [4.0, 5.0, 6.0]);
        assert_eq!(samples[1].normal, [0.0; 3]);
    }
}
