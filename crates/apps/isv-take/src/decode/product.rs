//! What a decoded frame is turned into.

use super::placement::Placed;
use super::reduction::Reduction;
use super::{Form, ProductError};
use crate::MemoryLimit;
use crate::baked_texture::TextureBaker;
use crate::device::DecodedVolume;
use crate::distances::with_distances;
use isv_decode::colour::{ColourFrame, surface_colours};
use isv_format::Profile;
use isv_ingest::coded_field;
use isv_simplify::Budget;
use isv_surface::{PointDensity, SurfaceOptions, sample_evenly};
use isv_volume::{Appearance, BlockSet, ColourSample, Grid, PointCloud, SparseVolume, TriangleMesh};
use std::sync::Arc;

/// A frame in the form that the user wants.
#[derive(Debug)]
pub(super) enum Product {
    Mesh(TriangleMesh),
    Points(PointCloud),
    Volume {
        volume: SparseVolume,
        /// Colours of its surface, if the stream has any.
        colours: Vec<ColourSample>,
    },
}

/// How to make products.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recipe {
    pub(super) form: Form,
    /// Whether meshes get normals; points always do.
    pub(super) normals: bool,
    pub(super) density: PointDensity,
    /// Profile of the stream.
    pub(super) profile: Profile,
    /// Grid of the stream.
    pub(super) grid: Grid,
    /// What meshes may have, if that is limited.
    pub(super) budget: Option<Budget>,
    pub(super) placed: Placed,
    pub(super) memory: MemoryLimit,
    /// Whether colour becomes a texture, by [`Self::finish`], and not colours of vertices.
    pub(super) bakes: bool,
}

impl Recipe {
    /// Which surface it is made from, if from any; points always have normals.
    pub(super) fn surface(&self) -> Option<SurfaceOptions> {
        match self.form {
            Form::Mesh => Some(SurfaceOptions { normals: self.normals && self.budget.is_none() }),
            Form::Points => Some(SurfaceOptions { normals: true }),
            Form::Volume => None,
        }
    }

    /// Makes the product of a volume, and its surface if that was extracted already. It still lies as the stream has it:
    /// [`Self::finish`] comes after this.
    ///
    /// `coded_blocks`: as [`StreamFrame`](crate::stream::StreamFrame) has them.
    pub(super) fn make(
        &self,
        volume: DecodedVolume,
        coded_blocks: Option<&BlockSet>,
        surface: Option<TriangleMesh>,
        colour: Option<&ColourFrame>,
    ) -> Result<(Product, Option<Reduction>), ProductError> {
        let (mut product, reduction) = match (self.product(volume, coded_blocks, surface)?, &self.budget) {
            (Product::Mesh(mesh), Some(budget)) => {
                let (mesh, reduction) = Reduction::make(&mesh, budget, self.normals)?;
                (Product::Mesh(mesh), Some(reduction))
            }
            (product, _) => (product, None),
        };
        if let Some(colour) = colour.filter(|_| !self.bakes) {
            self.colour(&mut product, colour);
        }
        Ok((product, reduction))
    }

    /// Bakes the texture of a product, if it gets one, and turns it to where the output has it. Frames come in order: a texture is laid out
    /// as that of the frame before, as far as it can be.
    pub(super) fn finish(
        &self,
        mut product: Product,
        colour: Option<&ColourFrame>,
        baker: Option<&mut TextureBaker>,
    ) -> Result<Product, ProductError> {
        if let (Product::Mesh(mesh), Some(colour), Some(baker)) = (&mut product, colour, baker) {
            baker.bake(mesh, colour, &self.grid)?;
        }
        Ok(self.placed.turn(product))
    }

    /// Gives vertices and points their colours.
    fn colour(&self, product: &mut Product, colour: &ColourFrame) {
        match product {
            Product::Mesh(mesh) => {
                let vertex_colours = surface_colours(colour, &self.grid, &mesh.vertices);
                mesh.appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
            }
            Product::Points(points) => {
                points.colours = surface_colours(colour, &self.grid, &points.positions);
            }
            Product::Volume { colours, .. } => *colours = colour.to_samples(&self.grid),
        }
    }

    /// The product as the stream has it: in metres, Y up.
    fn product(
        &self,
        volume: DecodedVolume,
        coded_blocks: Option<&BlockSet>,
        surface: Option<TriangleMesh>,
    ) -> Result<Product, ProductError> {
        let Some(options) = self.surface() else {
            let volume = volume.into_sparse()?;
            let volume = match self.profile {
                // Distances may be coded away from the surface too: --band full.
                Profile::Main => match coded_blocks.and_then(|coded| coded_field(&volume, coded)) {
                    Some(field) => field,
                    None => with_distances(&volume, self.memory)?,
                },
                Profile::Paper(_) => volume,
            };
            return Ok(Product::Volume { volume, colours: Vec::new() });
        };
        let mesh = match surface {
            Some(mesh) => mesh,
            None => self.memory.surface(&volume.into_sparse()?, options)?,
        };
        Ok(match self.form {
            Form::Points => Product::Points(sample_evenly(&mesh, self.density)?),
            _ => Product::Mesh(mesh),
        })
    }
}
