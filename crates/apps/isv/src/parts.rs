//! The surface of a scene in parts.

use crate::{Error, Frame, Mesh};
use isv_surface::SurfaceOptions;
use isv_volume::BlockCoord;

/// The surface of one frame after another, in parts, of which those are extracted again that changed.
///
/// A part is what 4x4x4 blocks hold. Its mesh stands alone: vertices at the border of two parts are in both. In a scene
/// of which little moves, an update costs what moves, and a renderer keeps the meshes of all other parts.
///
/// ```no_run
/// # fn main() -> Result<(), isv::Error> {
/// let mut reader = isv::Reader::open("street.isv")?;
/// let mut surface = isv::SurfaceParts::new();
/// while let Some(frame) = reader.next_frame()? {
///     let changes = surface.update(&frame)?;
///     for place in changes.changed {
///         let mesh = surface.mesh(place, &frame).expect("a part that changed is there");
///         println!("{place:?}: {} triangles", mesh.triangles.len());
///     }
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct SurfaceParts {
    parts: isv_surface::SurfaceParts,
}

/// The parts that an update changed, by their places, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PartChanges {
    /// Parts that are new or were extracted again.
    pub changed: Vec<[i32; 3]>,
    /// Parts that hold nothing of the surface any more.
    pub removed: Vec<[i32; 3]>,
}

impl Default for SurfaceParts {
    fn default() -> Self {
        Self::new()
    }
}

impl SurfaceParts {
    /// Creates the surface of nothing, whose parts will have normals.
    #[must_use]
    pub fn new() -> Self {
        Self { parts: isv_surface::SurfaceParts::new(SurfaceOptions { normals: true }) }
    }

    /// Creates the surface of nothing, whose parts will have no normals, which saves the time to find them.
    #[must_use]
    pub fn without_normals() -> Self {
        Self { parts: isv_surface::SurfaceParts::new(SurfaceOptions { normals: false }) }
    }

    /// Takes the surface of a frame in place of the last one. Frames of one reader share what stands still, which is not looked at.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a surface that there is no memory for. The parts are what they were.
    pub fn update(&mut self, frame: &Frame) -> Result<PartChanges, Error> {
        let changes = frame.update_parts(&mut self.parts)?;
        let [changed, removed] = [changes.changed, changes.removed]
            .map(|parts| parts.into_iter().map(BlockCoord::to_array).collect());
        Ok(PartChanges { changed, removed })
    }

    /// The places of all parts, in order: the lowest block of each, in blocks.
    pub fn places(&self) -> impl Iterator<Item = [i32; 3]> {
        self.parts.iter().map(|(corner, _)| corner.to_array())
    }

    /// The mesh of a part, with the colours of a frame if it has any. `frame`: the one of the last update. Colours may change where
    /// the surface does not.
    #[must_use]
    pub fn mesh(&self, place: [i32; 3], frame: &Frame) -> Option<Mesh> {
        let mesh = self.parts.part(place.into())?;
        Some(frame.coloured((**mesh).clone()))
    }
}
