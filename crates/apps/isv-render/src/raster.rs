//! The rasteriser: triangles to samples, samples to pixels.

use crate::camera::{Camera, Projection};
use crate::normals::{face_normal, vertex_normals};
use crate::occlusion::NO_SURFACE;
use crate::style::{NormalKind, Paint};
use glam::{DVec3, Vec3};
use isv_volume::{Appearance, TriangleMesh};
use rayon::prelude::*;

/// Samples along each side of a pixel.
const SAMPLES: usize = 3;

/// Pixel rows drawn by one task.
const BAND_ROWS: usize = 16;

/// What a camera sees of a mesh, before it is laid over a background.
pub(crate) struct Raster {
    pub(crate) size: [usize; 2],
    /// Row after row.
    pub(crate) pixels: Vec<Pixel>,
    pub(crate) projection: Projection,
}

impl Raster {
    /// Draws a mesh. The same arguments give the same pixels with any number of threads.
    pub(crate) fn new(mesh: &TriangleMesh, camera: &Camera, normals: NormalKind, paint: Paint) -> Self {
        let projection = camera.projection(SAMPLES);
        let scene = Scene::new(mesh, &projection, normals, paint);
        let [width, height] = camera.size;
        let mut pixels = vec![Pixel::EMPTY; width * height];
        let bands = scene.triangles_by_band(height);
        pixels.par_chunks_mut((width * BAND_ROWS).max(1)).zip(&bands).enumerate().for_each(
            |(band, (pixels, triangles))| {
                let samples = scene.draw_band(triangles, band, [width, pixels.len() / width]);
                resolve(pixels, &samples, width);
            },
        );
        Self { size: camera.size, pixels, projection }
    }

    /// Pixels that a metre takes in the middle of the picture.
    pub(crate) fn pixels_a_metre(&self) -> f64 {
        self.projection.pixels_a_metre / SAMPLES as f64
    }

    /// Point of the surface that is seen in the middle of a pixel, or as close to it as any is. None if the
    /// pixel shows no surface.
    pub(crate) fn point(&self, pixel: usize) -> Option<DVec3> {
        let Seen { sample, depth } = self.pixels[pixel].seen?;
        let corner = [pixel % self.size[0], pixel / self.size[0]];
        let within = [sample % SAMPLES, sample / SAMPLES];
        let [x, y] = [0, 1].map(|axis| (corner[axis] * SAMPLES + within[axis]) as f64 + 0.5);
        Some(self.projection.unproject(DVec3::new(x, y, f64::from(depth))))
    }
}

/// What is seen through one sample.
#[derive(Clone, Copy)]
struct Sample {
    depth: f32,
    colour: Vec3,
}

/// The mean of a pixel's samples.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    /// Mean colour of the samples that show the surface.
    pub(crate) colour: Vec3,
    /// Mean depth of the samples that show the surface, or [`NO_SURFACE`].
    pub(crate) depth: f32,
    /// Part of the samples that show the surface.
    pub(crate) coverage: f32,
    /// The sample that stands for the pixel.
    seen: Option<Seen>,
}

/// One sample of a pixel.
#[derive(Clone, Copy)]
struct Seen {
    /// Number of the sample in the pixel, row after row.
    sample: usize,
    depth: f32,
}

/// A mesh ready to be drawn.
struct Scene<'a> {
    mesh: &'a TriangleMesh,
    /// Position of each vertex in samples, and its depth.
    projected: Vec<DVec3>,
    /// Magnification of each vertex by the perspective; empty where the paint shows no colours.
    magnifications: Vec<f32>,
    /// Normals of the vertices; empty for flat shading.
    normals: Vec<DVec3>,
    /// The mesh's colours, if the paint shows them.
    appearance: Option<&'a Appearance>,
    to_camera: Vec3,
    paint: Paint,
}

impl<'a> Scene<'a> {
    fn new(mesh: &'a TriangleMesh, projection: &Projection, normals: NormalKind, paint: Paint) -> Self {
        let projected: Vec<DVec3> = mesh.vertices.par_iter().map(|v| projection.project(*v)).collect();
        let appearance = mesh.appearance.as_deref().filter(|_| paint.shows_colours());
        let magnification = |place: &DVec3| projection.magnification(place.z) as f32;
        Self {
            mesh,
            magnifications: match appearance {
                Some(_) => projected.iter().map(magnification).collect(),
                None => Vec::new(),
            },
            projected,
            normals: match normals {
                NormalKind::Smooth => vertex_normals(mesh),
                NormalKind::Flat => Vec::new(),
            },
            appearance,
            to_camera: projection.to_camera().as_vec3(),
            paint,
        }
    }

    /// For each band of pixel rows, the triangles that may reach into it, in order.
    fn triangles_by_band(&self, height: usize) -> Vec<Vec<u32>> {
        let mut bands = vec![Vec::new(); height.div_ceil(BAND_ROWS)];
        let band_samples = (BAND_ROWS * SAMPLES) as f64;
        for (face, triangle) in self.mesh.triangles.iter().enumerate() {
            let rows = triangle.map(|v| self.projected[v as usize].y / band_samples);
            let [from, to] = [rows[0].min(rows[1]).min(rows[2]), rows[0].max(rows[1]).max(rows[2])];
            // Casts clamp below at 0, and turn NaN into 0.
            let end = (to.floor() as usize + 1).min(bands.len());
            for band in bands.get_mut(from.floor() as usize..end).unwrap_or_default() {
                band.push(face as u32);
            }
        }
        bands
    }

    /// Samples of a band, row after row; `size` is its width and height in pixels.
    fn draw_band(&self, triangles: &[u32], band: usize, size: [usize; 2]) -> Vec<Sample> {
        let [width, height] = size.map(|s| s * SAMPLES);
        let mut samples = vec![Sample { depth: NO_SURFACE, colour: Vec3::ZERO }; width * height];
        let top = (band * BAND_ROWS * SAMPLES) as f64;
        for &face in triangles {
            self.draw_triangle(face as usize, &mut samples, [width, height], top);
        }
        samples
    }

    fn draw_triangle(&self, face: usize, samples: &mut [Sample], [width, height]: [usize; 2], top: f64) {
        let triangle = self.mesh.triangles[face];
        let corners = triangle.map(|v| self.projected[v as usize] - DVec3::new(0.0, top, 0.0));
        let [a, b, c] = corners;
        // Twice the area in samples; rows run down, so counter-clockwise triangles come out negative.
        let area = (b - a).cross(c - a).z;
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let paint = self.paint(face, area < 0.0);
        let span = |axis: usize, limit: usize| {
            let [p, q, r] = corners.map(|v| v[axis]);
            let first = (p.min(q).min(r) - 0.5).ceil().max(0.0) as usize;
            let end = ((p.max(q).max(r) - 0.5).floor() + 1.0).clamp(0.0, limit as f64) as usize;
            first..end
        };
        for y in span(1, height) {
            for x in span(0, width) {
                let at = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0);
                let weight = |p: DVec3, q: DVec3| ((q - p).cross(at - p).z / area) as f32;
                let weights = Vec3::new(weight(b, c), weight(c, a), weight(a, b));
                let depth = weights.dot(Vec3::new(a.z as f32, b.z as f32, c.z as f32));
                let sample = &mut samples[y * width + x];
                if weights.min_element() >= 0.0 && depth > sample.depth {
                    *sample = Sample { depth, colour: paint(weights) };
                }
            }
        }
    }

    /// The colour of a face as a function of the weights of its corners on the screen.
    fn paint(&self, face: usize, front: bool) -> impl Fn(Vec3) -> Vec3 {
        let normals = if self.normals.is_empty() {
            [face_normal(self.mesh.corners(face)); 3]
        } else {
            self.mesh.triangles[face].map(|v| self.normals[v as usize])
        };
        let [a, b, c] = normals.map(DVec3::as_vec3);
        let own = self.own_colour(face);
        let (to_camera, paint) = (self.to_camera, self.paint);
        move |weights| {
            let normal = a * weights.x + b * weights.y + c * weights.z;
            paint.colour(own(weights), normal.normalize_or(to_camera), to_camera, front)
        }
    }

    /// The mesh's colour, 0 to 1, as a function of the weights of a face's corners on the screen; black where it is not shown.
    fn own_colour(&self, face: usize) -> impl Fn(Vec3) -> Vec3 {
        let triangle = self.mesh.triangles[face];
        let shown = self.appearance.map(|appearance| {
            (appearance, Vec3::from_array(triangle.map(|v| self.magnifications[v as usize])))
        });
        move |weights| {
            let Some((appearance, magnification)) = shown else { return Vec3::ZERO };
            // What is linear over a triangle in space is, on the screen, a quotient of two things that are linear there.
            let weights = weights * magnification;
            let weights = weights / weights.element_sum();
            Vec3::from_array(appearance.colour(face, triangle, weights.to_array())) / 255.0
        }
    }
}

/// Averages the samples of each pixel of a band.
fn resolve(pixels: &mut [Pixel], samples: &[Sample], width: usize) {
    for (i, pixel) in pixels.iter_mut().enumerate() {
        let (x, y) = (i % width * SAMPLES, i / width * SAMPLES);
        let rows = (y..y + SAMPLES).map(|row| &samples[row * width * SAMPLES + x..][..SAMPLES]);
        let covered = rows.flatten().enumerate().filter(|(_, s)| s.depth != NO_SURFACE);
        let (mut colour, mut depth, mut count) = (Vec3::ZERO, 0.0, 0.0);
        for (_, sample) in covered.clone() {
            colour += sample.colour;
            depth += sample.depth;
            count += 1.0;
        }
        if count > 0.0 {
            let coverage = count / (SAMPLES * SAMPLES) as f32;
            let seen = covered
                .min_by_key(|(number, _)| from_middle(*number))
                .map(|(sample, s)| Seen { sample, depth: s.depth });
            *pixel = Pixel { colour: colour / count, depth: depth / count, coverage, seen };
        }
    }
}

/// Square of a sample's distance from the middle of its pixel, in samples.
fn from_middle(number: usize) -> usize {
    let middle = SAMPLES / 2;
    (number % SAMPLES).abs_diff(middle).pow(2) + (number / SAMPLES).abs_diff(middle).pow(2)
}

impl Pixel {
    const EMPTY: Self = Self { colour: Vec3::ZERO, depth: NO_SURFACE, coverage: 0.0, seen: None };

    /// Mixes the pixel, under the given light, into an RGBA pixel that is opaque or empty.
    pub(crate) fn blend_over(&self, rgba: &mut [u8], light: f32) {
        let opaque = rgba[3] != 0;
        for (place, channel) in rgba.iter_mut().zip(self.colour.to_array()) {
            let own = channel * light * 255.0;
            let behind = if opaque { f32::from(*place) } else { own };
            *place = (own * self.coverage + behind * (1.0 - self.coverage)).round() as u8;
        }
        if !opaque {
            rgba[3] = (self.coverage * 255.0).round() as u8;
        }
    }
}
