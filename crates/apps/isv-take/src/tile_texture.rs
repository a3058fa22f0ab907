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
pub fn add_tile_texture(mesh: &mut TriangleMesh, colour: &ColourFrame, grid: &Grid) {
    texture_tiles(mesh, |texels| {
        let points: Vec<DVec3> = texels.iter().map(|texel| texel.point).collect();
        surface_colours::<DVec3>(colour, grid, &points)
    });
}

/// Gives a mesh a texture of tiles, whose texels have the colours that `colours` finds for them, in their order.
///
/// The texels of a triangle follow each other, and triangles are in the mesh's order.
pub fn texture_tiles(mesh: &mut TriangleMesh, colours: impl FnOnce(&[Texel]) -> Vec<Rgb>) {
    let tiles = Tiles::new(mesh);
    let texels: Vec<Texel> = (0..tiles.texels(mesh)).map(|number| tiles.texel(mesh, number)).collect();
    let colours = colours(&texels);
    tiles.paint(mesh, colours);
}

/// Texel of a triangle, and the point of its plane that it shows.
#[derive(Clone, Copy, Debug)]
pub struct Texel {
    /// The point (m).
    pub point: DVec3,
    /// Number of the triangle.
    pub face: usize,
    /// Weights of the triangle's corners; of a texel beyond it, one is below 0.
    pub weights: [f32; 3],
    /// Index of its pixel.
    place: usize,
}

/// Texels of a triangle.
const TEXELS: usize = SIDE * (SIDE + 1) / 2;
/// Column and row of each, counted from the corner of the tile that the triangle's first vertex lies at.
const PLACES: [[usize; 2]; TEXELS] = {
    let mut places = [[0; 2]; TEXELS];
    let (mut number, mut y) = (0, 0);
    while y < SIDE {
        let mut x = 0;
        while x < SIDE - y {
            places[number] = [x, y];
            number += 1;
            x += 1;
        }
        y += 1;
    }
    places
};
/// Length of a triangle's legs, in texels.
const LEGS: f64 = (SIDE - 2) as f64;

/// The tiles of a mesh, two triangles each, in one texture.
#[derive(Debug)]
pub(crate) struct Tiles {
    /// Tiles along the width of the texture.
    across: usize,
    /// Width and height of the texture in texels.
    size: [usize; 2],
}

impl Tiles {
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        let tiles = mesh.triangles.len().div_ceil(2).max(1);
        let across = ((tiles * TILE[1]) as f64 / TILE[0] as f64).sqrt().ceil().max(1.0) as usize;
        let down = tiles.div_ceil(across);
        Self { across, size: [across * TILE[0], down * TILE[1]] }
    }

    /// Place in the texture of a place in a triangle's half of its tile, in texels.
    fn place(&self, face: usize, [x, y]: [f64; 2]) -> [f64; 2] {
        let tile = face / 2;
        let corner = [tile % self.across * TILE[0], tile / self.across * TILE[1]];
        match face.is_multiple_of(2) {
            true => [corner[0] as f64 + x, corner[1] as f64 + y],
            false => [(corner[0] + TILE[0]) as f64 - x, (corner[1] + TILE[1]) as f64 - y],
        }
    }

    /// Number of texels that have a colour.
    pub(crate) fn texels(&self, mesh: &TriangleMesh) -> usize {
        TEXELS * mesh.triangles.len()
    }

    /// A texel by its number, triangle by triangle.
    pub(crate) fn texel(&self, mesh: &TriangleMesh, number: usize) -> Texel {
        let (face, [x, y]) = (number / TEXELS, PLACES[number % TEXELS]);
        let [a, b, c] = mesh.corners(face);
        let [u, v] = [x, y].map(|texel| texel as f64 / LEGS);
        let [px, py] = self.place(face, [x, y].map(|texel| texel as f64 + 0.5));
        Texel {
            point: a + (b - a) * u + (c - a) * v,
            face,
            weights: [1.0 - u - v, u, v].map(|weight| weight as f32),
            place: py as usize * self.size[0] + px as usize,
        }
    }

    /// Gives the mesh a texture of the texels' colours.
    pub(crate) fn paint(&self, mesh: &mut TriangleMesh, colours: Vec<Rgb>) {
        let [width, height] = self.size;
        let mut pixels = vec![[128; 3]; width * height];
        for (number, colour) in colours.into_iter().enumerate() {
            pixels[self.texel(mesh, number).place] = colour;
        }
        let of_corner = |face: usize, corner: [f64; 2]| {
            let [x, y] = self.place(face, corner);
            [(x / width as f64) as f32, (y / height as f64) as f32]
        };
        let corners = [[0.5, 0.5], [0.5 + LEGS, 0.5], [0.5, 0.5 + LEGS]];
        let coordinates =
            (0..mesh.triangles.len()).map(|face| corners.map(|corner| of_corner(face, corner))).collect();
        let image = Image::new(width as u32, height as u32, pixels).map(Arc::new);
        let material = Material { texture: image, wrap: [Wrap::Clamp; 2], ..Material::default() };
        mesh.appearance = Some(Arc::new(Appearance {
            texture_coordinates: coordinates,
            materials: vec![material],
            ..Appearance::default()
        }));
    }
}
