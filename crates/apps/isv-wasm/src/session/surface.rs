//! The surface of a frame as graphics hardware takes it.

use isv_decode::colour::{ColourFrame, surface_colours};
use isv_surface::{SurfaceExtractor, SurfaceOptions, TooManyVertices};
use isv_volume::{Rgb, SparseVolume};

/// A triangle mesh in single precision.
#[derive(Debug, Default)]
pub(crate) struct Surface {
    extractor: SurfaceExtractor,
    options: SurfaceOptions,
    /// Positions in metres.
    pub(crate) vertices: Vec<[f32; 3]>,
    /// Unit normals pointing outside, one a vertex; empty where they are not wanted.
    pub(crate) normals: Vec<[f32; 3]>,
    /// sRGB colours, one a vertex; empty where there is no colour.
    pub(crate) colours: Vec<Rgb>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// Becomes the surface of a volume, in its colour if there is any; empty if that has more vertices than `limit`.
    pub(crate) fn extract(
        &mut self,
        volume: &SparseVolume,
        colour: Option<&ColourFrame>,
        normals: bool,
        limit: usize,
    ) -> Result<(), TooManyVertices> {
        self.vertices.clear();
        self.normals.clear();
        self.colours.clear();
        self.triangles.clear();
        let options = SurfaceOptions { normals };
        if self.options != options {
            self.options = options;
            self.extractor = SurfaceExtractor::new(options);
        }
        let mesh = self.extractor.extract_within(volume, limit)?;
        self.vertices.extend(mesh.vertices.iter().map(|vertex| vertex.as_vec3().to_array()));
        self.normals.extend(mesh.normals.iter().map(|normal| normal.as_vec3().to_array()));
        self.triangles.extend_from_slice(&mesh.triangles);
        if let Some(colour) = colour {
            self.colours = surface_colours(colour, volume.grid(), &mesh.vertices);
        }
        Ok(())
    }
}
