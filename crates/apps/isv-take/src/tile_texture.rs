//! The colour of a decoded surface as a texture of tiles: fine enough for pictures and measurements, at once, with no seams.

use glam::DVec3;
use isv_decode::colour::{ColourFrame, surface_colours};
use isv_volume::{Appearance, Grid, Image, Material, Rgb, TriangleMesh, Wrap};
use std::sync::Arc;

/// Texels along the legs of a triangle and one beyond: samples lie a third of a leg apart.
const SIDE: usize = 5;
/// Size of the tile that two triangles share, in texels.
const TILE: [usize; 2] = [SIDE + 1, SIDE];

/// Gives a mesh that was extracted from a frame's volume the frame's colour. Each triangle has texels of its own, so that nothing
/// bleeds into it from others.
pub(crate) fn add_tile_texture(mesh: &mut TriangleMesh, colour: &ColourFrame, grid: &Grid) {
    let tiles = Tiles::new(mesh);
    let points: Vec<DVec3> = tiles.texels.iter().map(|texel| texel.point).collect();
    let colours = surface_colours::<DVec3>(colour, grid, &points);
    tiles.paint(mesh, colours);
}

/// Texel of a triangle, and the point of its plane that it shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Texel {
    pub(crate) point: DVec3,
    pub(crate) face: usize,
    /// Weights of the triangle's corners; of a texel beyond it, one is below 0.
    pub(crate) weights: [f32; 3],
    /// Index of its pixel.
    place: usize,
}

/// The tiles of a mesh, two triangles each, in one texture.
#[derive(Debug)]
pub(crate) struct Tiles {
    /// Width and height of the texture in texels.
    size: [usize; 2],
    texels: Vec<Texel>,
    coordinates: Vec<[[f32; 2]; 3]>,
}

impl Tiles {
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        let tiles = mesh.triangles.len().div_ceil(2).max(1);
        let across = ((tiles * TILE[1]) as f64 / TILE[0] as f64).sqrt().ceil().max(1.0) as usize;
        let down = tiles.div_ceil(across);
        let (width, height) = (across * TILE[0], down * TILE[1]);
        let mut texels = Vec::new();
        let mut coordinates = Vec::with_capacity(mesh.triangles.len());
        for face in 0..mesh.triangles.len() {
            let tile = face / 2;
            let corner = [tile % across * TILE[0], tile / across * TILE[1]];
            let is_mirrored = face % 2 != 0;
            // Texels count from the corner of the tile that the triangle's first vertex lies at.
            let place = |[x, y]: [f64; 2]| match is_mirrored {
                true => [(corner[0] + TILE[0]) as f64 - x, (corner[1] + TILE[1]) as f64 - y],
                false => [corner[0] as f64 + x, corner[1] as f64 + y],
            };
            let legs = (SIDE - 2) as f64;
            let [a, b, c] = mesh.corners(face);
            for y in 0..SIDE {
                for x in 0..SIDE - y {
                    let [px, py] = place([x as f64 + 0.5, y as f64 + 0.5]);
                    let (u, v) = (x as f64 / legs, y as f64 / legs);
                    texels.push(Texel {
                        point: a + (b - a) * u + (c - a) * v,
                        face,
                        weights: [1.0 - u - v, u, v].map(|weight| weight as f32),
                        place: py as usize * width + px as usize,
                    });
                }
            }
            coordinates.push([[0.5, 0.5], [0.5 + legs, 0.5], [0.5, 0.5 + legs]].map(|texel| {
                let [x, y] = place(texel);
                [(x / width as f64) as f32, (y / height as f64) as f32]
            }));
        }
        Self { size: [width, height], texels, coordinates }
    }

    /// All texels that have a colour, triangle by triangle.
    pub(crate) fn texels(&self) -> &[Texel] {
        &self.texels
    }

    /// Gives the mesh a texture of the texels' colours.
    pub(crate) fn paint(self, mesh: &mut TriangleMesh, colours: Vec<Rgb>) {
        let [width, height] = self.size;
        let mut pixels = vec![[128; 3]; width * height];
        self.texels.iter().zip(colours).for_each(|(texel, colour)| pixels[texel.place] = colour);
        let image = Image::new(width as u32, height as u32, pixels).map(Arc::new);
        let material = Material { texture: image, wrap: [Wrap::Clamp; 2], ..Material::default() };
        mesh.appearance = Some(Arc::new(Appearance {
            texture_coordinates: self.coordinates,
            materials: vec![material],
            ..Appearance::default()
        }));
    }
}
