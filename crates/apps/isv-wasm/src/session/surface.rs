//! The surface of a frame as graphics hardware takes it.

use isv_decode::colour::{ColourFrame, surface_colours};
use isv_surface::{SurfaceExtractor, SurfaceOptions, SurfaceParts, TooManyVertices};
use isv_volume::{BlockCoord, Rgb, SparseVolume};

/// A triangle mesh in single precision: a whole surface, or the parts of it that changed, one after the other.
#[derive(Debug, Default)]
pub(crate) struct Surface {
    extractor: SurfaceExtractor,
    options: SurfaceOptions,
    /// Which parts the caller has, of what volume. Their meshes are not kept here.
    parts: SurfaceParts,
    /// Positions in metres.
    pub(crate) vertices: Vec<[f32; 3]>,
    /// Unit normals pointing outside, one a vertex; empty where they are not wanted.
    pub(crate) normals: Vec<[f32; 3]>,
    /// sRGB colours, one a vertex; empty where there is no colour.
    pub(crate) colours: Vec<Rgb>,
    /// Vertex indices of each triangle, counter-clockwise seen from outside. Those of a part count from the part's first vertex.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Parts that changed: x, y and z of the lowest block, then how many vertices and triangles.
    pub(crate) changed: Vec<[i32; 5]>,
    /// Parts that are gone, by the lowest block.
    pub(crate) removed: Vec<[i32; 3]>,
    /// How many parts there are.
    pub(crate) part_count: usize,
    /// Whether there were none before.
    pub(crate) is_fresh: bool,
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
        self.begin(normals);
        let mesh = self.extractor.extract_within(volume, limit)?;
        self.vertices.extend(mesh.vertices.iter().map(|vertex| vertex.as_vec3().to_array()));
        self.normals.extend(mesh.normals.iter().map(|normal| normal.as_vec3().to_array()));
        self.triangles.extend_from_slice(&mesh.triangles);
        if let Some(colour) = colour {
            self.colours = surface_colours(colour, volume.grid(), &mesh.vertices);
        }
        Ok(())
    }

    /// Becomes the parts of a volume's surface that changed since the last call, without colours. All parts are new where normals are
    /// wanted and were not before, or the other way round. With more vertices than `limit` in all parts there are none then, and all
    /// are new at the next call.
    pub(crate) fn extract_parts(
        &mut self,
        volume: &SparseVolume,
        wants_normals: bool,
        limit: usize,
    ) -> Result<(), TooManyVertices> {
        self.begin(wants_normals);
        self.is_fresh = self.part_count == 0;
        self.part_count = 0;
        // Field by field, so that lists are written while parts are found.
        let Self { parts, vertices, normals, triangles, changed, removed, .. } = self;
        let gone = parts.hand_over(volume, limit, |place, mesh| {
            let [x, y, z] = place.to_array();
            changed.push([x, y, z, mesh.vertices.len() as i32, mesh.triangles.len() as i32]);
            vertices.extend(mesh.vertices.iter().map(|vertex| vertex.as_vec3().to_array()));
            normals.extend(mesh.normals.iter().map(|normal| normal.as_vec3().to_array()));
            triangles.extend_from_slice(&mesh.triangles);
        })?;
        removed.extend(gone.into_iter().map(BlockCoord::to_array));
        self.part_count = self.parts.iter().count();
        Ok(())
    }

    /// Forgets the last surface.
    fn begin(&mut self, normals: bool) {
        self.vertices.clear();
        self.normals.clear();
        self.colours.clear();
        self.triangles.clear();
        self.changed.clear();
        self.removed.clear();
        let options = SurfaceOptions { normals };
        if self.options != options {
            self.options = options;
            self.extractor = SurfaceExtractor::new(options);
            self.parts = SurfaceParts::new(options);
            self.part_count = 0;
        }
    }
}
