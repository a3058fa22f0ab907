//! The colour of a decoded surface as a texture of tiles: fine enough for pictures and measurements, at once, with no seams.

use glam::DVec3;
use isv_decode::colour::{ColourFrame, surface_colours};
use isv_volume::{Appearance, Grid, Image, Material, TriangleMesh, Wrap};
use std::sync::Arc;

/// Texels along the legs of a triangle and one beyond: samples lie a third of a leg apart.
const SIDE: usize = 5;
/// Size of the tile that two triangles share, in texels.
const TILE: [usize; 2] = [SIDE + 1, SIDE];

/// Gives a mesh that was extracted from a frame's volume the frame's colour. Each triangle has texels of its own, so that nothing
/// bleeds into it from others.
pub(crate) fn add_tile_texture(mesh: &mut TriangleMesh, colour: &ColourFrame, grid: &Grid) {
    let tiles = mesh.triangles.len().div_ceil(2).max(1);
    let across = ((tiles * TILE[1]) as f64 / TILE[0] as f64).sqrt().ceil().max(1.0) as usize;
    let down = tiles.div_ceil(across);
    let (width, height) = (across * TILE[0], down * TILE[1]);
    let mut texels = Vec::new();
    let mut places = Vec::new();
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
                places.push(py as usize * width + px as usize);
                texels.push(a + (b - a) * (x as f64 / legs) + (c - a) * (y as f64 / legs));
            }
        }
        coordinates.push([[0.5, 0.5], [0.5 + legs, 0.5], [0.5, 0.5 + legs]].map(|texel| {
            let [x, y] = place(texel);
            [(x / width as f64) as f32, (y / height as f64) as f32]
        }));
    }
    let colours = surface_colours::<DVec3>(colour, grid, &texels);
    let mut pixels = vec![[128; 3]; width * height];
    places.into_iter().zip(colours).for_each(|(place, colour)| pixels[place] = colour);
    let image = Image::new(width as u32, height as u32, pixels).map(Arc::new);
    let material = Material { texture: image, wrap: [Wrap::Clamp; 2], ..Material::default() };
    mesh.appearance = Some(Arc::new(Appearance {
        texture_coordinates: coordinates,
        materials: vec![material],
        ..Appearance::default()
    }));
}
