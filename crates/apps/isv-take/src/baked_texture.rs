//! A decoded frame's colour as one texture of a size that is given: for files that other programs open.
//!
//! ```text
//! TriangleMesh ─ charts: parts of a block's surface that face one way ─ Atlas: their places ─ Patch: texels ─> Appearance
//! ```
//!
//! Charts keep their place in the texture from frame to frame while their block lives and they do not outgrow it. Texels lie on the
//! surface, and their colours are read from the samples there, of which there are more than vertices. Around each chart the surface goes
//! on for 4 texels. So neither bilinear reading nor the first two mip maps show what is beside it. In textures that are small for their
//! surface it goes on for 2 texels, which serve one mip map, or for 1.

mod atlas;
mod charts;
mod patch;
#[cfg(test)]
mod tests;

use atlas::Atlas;
use charts::cut;
use isv_decode::colour::ColourFrame;
use isv_volume::{Appearance, Grid, Image, Material, TriangleMesh, Wrap};
use patch::{Patch, Surface};
use rayon::prelude::*;
use std::sync::Arc;
use thiserror::Error;

/// Colour of texels that no face shows.
const UNUSED: [u8; 3] = [128; 3];

/// Size of a square texture, in texels along a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureSide(u32);

impl TextureSide {
    /// Smallest size.
    pub const MIN: u32 = 64;
    /// Largest size.
    pub const MAX: u32 = 8192;

    /// A size in texels; `None` if it is not from [`Self::MIN`] to [`Self::MAX`].
    #[must_use]
    pub fn from_texels(texels: u32) -> Option<Self> {
        (Self::MIN..=Self::MAX).contains(&texels).then_some(Self(texels))
    }

    /// Texels along a side.
    #[must_use]
    pub fn texels(self) -> u32 {
        self.0
    }
}

/// A surface that does not fit into its texture, however coarse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "{patches} patches of surface do not fit into a texture of {side} x {side} texels: take a larger one"
)]
pub struct TextureTooSmall {
    /// Patches of the surface.
    pub patches: usize,
    /// Texels along a side.
    pub side: u32,
}

/// Bakes the colour of one frame after the other.
#[derive(Debug)]
pub(crate) struct TextureBaker {
    atlas: Atlas,
}

impl TextureBaker {
    /// Creates a baker of textures of a size.
    pub(crate) fn new(side: TextureSide) -> Self {
        Self { atlas: Atlas::new(side.texels()) }
    }

    /// Gives a mesh the frame's colour as a texture, instead of what it had. The mesh lies in the stream's metres, at or near the frame's
    /// surface.
    ///
    /// # Errors
    /// [`TextureTooSmall`]; the mesh then stays as it was.
    pub(crate) fn bake(
        &mut self,
        mesh: &mut TriangleMesh,
        colour: &ColourFrame,
        grid: &Grid,
    ) -> Result<(), TextureTooSmall> {
        let voxel_m = grid.voxel_size.metres();
        let charts = cut(mesh, voxel_m, |key| self.atlas.has(key));
        let places = self.atlas.place(&charts)?;
        let (side, density) = (self.atlas.side(), self.atlas.density());
        let normals = mesh.angle_weighted_normals();
        let surface = Surface { mesh, normals: &normals, colour, grid };
        let patches: Vec<Patch> = charts
            .par_iter()
            .zip(&places)
            .map(|(chart, place)| Patch::new(chart, place, density, &surface))
            .collect();
        let mut pixels = vec![UNUSED; (side * side) as usize];
        let mut coordinates = vec![[[0.0; 2]; 3]; mesh.triangles.len()];
        for ((chart, place), patch) in charts.iter().zip(&places).zip(&patches) {
            let [x, y] = place.at.map(|texel| texel as usize);
            for (row, texels) in patch.pixels.chunks_exact(place.size[0] as usize).enumerate() {
                pixels[(y + row) * side as usize + x..][..texels.len()].copy_from_slice(texels);
            }
            for (face, corners) in chart.faces.iter().zip(&patch.corners) {
                coordinates[*face as usize] = corners.map(|corner| {
                    [0, 1].map(|axis| ((f64::from(place.at[axis]) + corner[axis]) / f64::from(side)) as f32)
                });
            }
        }
        let texture = Image::new(side, side, pixels).map(Arc::new);
        let material = Material { texture, wrap: [Wrap::Clamp; 2], ..Material::default() };
        mesh.appearance = Some(Arc::new(Appearance {
            texture_coordinates: coordinates,
            materials: vec![material],
            ..Appearance::default()
        }));
        Ok(())
    }
}
