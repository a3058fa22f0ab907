//! The texels of a chart.

use super::UNUSED;
use super::atlas::Place;
use super::charts::Chart;
use glam::DVec3;
use isv_decode::colour::{ColourFrame, colours_near};
use isv_volume::{Grid, Rgb, TriangleMesh};

/// Distance from a chart within which texels lie on the surface as it goes on (texels, and voxels).
const AROUND: f64 = 1.5;
const AROUND_VOXELS: f64 = 1.0;
/// Smallest cosine between the surface and the direction of view: steeper ones would throw texels far off.
const STEEPEST: f64 = 0.4;

/// Source of texels.
#[derive(Clone, Copy)]
pub(super) struct Surface<'a> {
    pub(super) mesh: &'a TriangleMesh,
    /// Normals of vertices.
    pub(super) normals: &'a [DVec3],
    pub(super) colour: &'a ColourFrame,
    pub(super) grid: &'a Grid,
}

/// The texels of a chart, row by row, and where the corners of its faces are in them.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub(super) pixels: Vec<Rgb>,
    pub(super) corners: Vec<[[f64; 2]; 3]>,
}

/// The point of a triangle that is closest to another point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Closest {
    /// Squared distance; 0 inside.
    pub(super) squared: f64,
    /// Weights of the triangle's corners.
    pub(super) weights: [f64; 3],
}

impl Patch {
    /// Draws a chart at its place. `density`: texels a voxel.
    pub(super) fn new(chart: &Chart, place: &Place, density: f64, surface: &Surface) -> Self {
        let Surface { mesh, grid, .. } = surface;
        let voxel_m = grid.voxel_size.metres();
        let low = place.low.map(f64::from);
        let of_face = |face: &u32| {
            chart
                .key
                .project_face(mesh, *face, voxel_m)
                .map(|corner| [0, 1].map(|axis| corner[axis] * density - low[axis]))
        };
        let corners: Vec<[[f64; 2]; 3]> = chart.faces.iter().map(of_face).collect();
        let nearest = nearest_faces(&corners, place.size, AROUND.min(AROUND_VOXELS * density));
        let (mut texels, mut points) = (Vec::new(), Vec::new());
        for (texel, found) in nearest.iter().enumerate() {
            let Some((number, closest)) = found else { continue };
            let [x, y] = middle(texel, place.size);
            let corners = &corners[*number as usize];
            let onto = [0, 1].map(|axis| (0..3).map(|c| closest.weights[c] * corners[c][axis]).sum::<f64>());
            let aside = [x - onto[0], y - onto[1]].map(|texels| texels / density * voxel_m);
            texels.push(texel);
            points.push(surface.point(chart, chart.faces[*number as usize], closest.weights, aside));
        }
        let colours = colours_near(surface.colour, surface.grid, &points);
        let mut known: Vec<Option<Rgb>> = vec![None; nearest.len()];
        for (texel, colour) in texels.into_iter().zip(colours) {
            known[texel] = colour;
        }
        Self { pixels: filled(known, place.size), corners }
    }
}

impl Surface<'_> {
    /// A point of a face, or `aside` of it, in metres, where its surface goes on.
    fn point(&self, chart: &Chart, face: u32, weights: [f64; 3], aside: [f64; 2]) -> DVec3 {
        let corners = self.mesh.triangles[face as usize].map(|vertex| vertex as usize);
        let mean = |of: &[DVec3]| (0..3).map(|c| weights[c] * of[corners[c]]).sum::<DVec3>();
        let point = mean(&self.mesh.vertices);
        if aside == [0.0; 2] {
            return point;
        }
        let view = chart.key.view();
        let in_plane = aside[0] * view.right + aside[1] * view.up;
        let normal = mean(self.normals).normalize_or(view.towards);
        point + in_plane - normal.dot(in_plane) / normal.dot(view.towards).max(STEEPEST) * view.towards
    }
}

/// Middle of a texel.
fn middle(texel: usize, size: [u32; 2]) -> [f64; 2] {
    let width = size[0] as usize;
    [(texel % width) as f64 + 0.5, (texel / width) as f64 + 0.5]
}

/// The nearest face of each texel, if one is as near as `around`, and its closest point.
fn nearest_faces(faces: &[[[f64; 2]; 3]], size: [u32; 2], around: f64) -> Vec<Option<(u32, Closest)>> {
    let mut nearest: Vec<Option<(u32, Closest)>> = vec![None; (size[0] * size[1]) as usize];
    for (number, corners) in faces.iter().enumerate() {
        let range = |axis: usize| {
            let along = corners.map(|corner| corner[axis]);
            let low = along.iter().copied().fold(f64::INFINITY, f64::min) - around - 0.5;
            let high = along.iter().copied().fold(0.0, f64::max) + around + 0.5;
            low.max(0.0) as u32..(high as u32).min(size[axis])
        };
        for y in range(1) {
            for x in range(0) {
                let place = &mut nearest[(y * size[0] + x) as usize];
                if place.is_some_and(|(_, other)| other.squared == 0.0) {
                    continue;
                }
                let closest = closest(corners, [f64::from(x) + 0.5, f64::from(y) + 0.5]);
                let is_nearer = place.as_ref().is_none_or(|(_, other)| closest.squared < other.squared);
                if closest.squared <= around * around && is_nearer {
                    *place = Some((number as u32, closest));
                }
            }
        }
    }
    nearest
}

/// The point of a triangle that is closest to another, whether the triangle has an area or not.
pub(super) fn closest(corners: &[[f64; 2]; 3], point: [f64; 2]) -> Closest {
    let [a, b, c] = *corners;
    let cross =
        |o: [f64; 2], p: [f64; 2], q: [f64; 2]| (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0]);
    let area = cross(a, b, c);
    if area.abs() > 1e-12 {
        let weights = [cross(point, b, c), cross(point, c, a), cross(point, a, b)].map(|part| part / area);
        if weights.iter().all(|weight| *weight >= 0.0) {
            return Closest { squared: 0.0, weights };
        }
    }
    let edges = [0, 1, 2].map(|first| {
        let second = (first + 1) % 3;
        let (from, to) = (corners[first], corners[second]);
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0] * along[0] + along[1] * along[1];
        let dot = (point[0] - from[0]) * along[0] + (point[1] - from[1]) * along[1];
        let part = if length > 0.0 { (dot / length).clamp(0.0, 1.0) } else { 0.0 };
        let off = [0, 1].map(|axis| from[axis] + part * along[axis] - point[axis]);
        let mut weights = [0.0; 3];
        weights[first] = 1.0 - part;
        weights[second] = part;
        Closest { squared: off[0] * off[0] + off[1] * off[1], weights }
    });
    let [first, rest @ ..] = edges;
    rest.into_iter().fold(first, |best, edge| if edge.squared < best.squared { edge } else { best })
}

/// Texels of which some are known, the others the mean of those around them, from the known ones outwards.
fn filled(mut texels: Vec<Option<Rgb>>, [width, height]: [u32; 2]) -> Vec<Rgb> {
    let (width, height) = (width as usize, height as usize);
    let mut front: Vec<usize> = (0..texels.len()).filter(|texel| texels[*texel].is_some()).collect();
    let around = |texel: usize| {
        let (x, y) = (texel % width, texel / width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        rows.flat_map(move |y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x))
    };
    while !front.is_empty() {
        let mut next: Vec<usize> =
            front.iter().flat_map(|texel| around(*texel)).filter(|texel| texels[*texel].is_none()).collect();
        next.sort_unstable();
        next.dedup();
        let colours: Vec<Rgb> = next
            .iter()
            .map(|texel| {
                let (mut sums, mut count) = ([0u32; 3], 0);
                for known in around(*texel).filter_map(|other| texels[other]) {
                    count += 1;
                    (0..3).for_each(|channel| sums[channel] += u32::from(known[channel]));
                }
                sums.map(|sum| ((sum + count / 2) / count.max(1)) as u8)
            })
            .collect();
        next.iter().zip(colours).for_each(|(texel, colour)| texels[*texel] = Some(colour));
        front = next;
    }
    texels.into_iter().map(|texel| texel.unwrap_or(UNUSED)).collect()
}
