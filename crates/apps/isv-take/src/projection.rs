//! Textures from calibrated cameras: colour images projected onto surfaces (paper Sec. 3.6).

use crate::Up;
use crate::capture::Capture;
use crate::encode::{CaptureError, FrameError};
use crate::tile_texture::Tiles;
use glam::DMat3;
use isv_ingest::{SeenColour, SurfacePoint, seen_colours};
use isv_io::ColourSequence;
use isv_volume::{Appearance, Rgb, TriangleMesh};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Colour where no camera saw the surface, and it has none of its own.
const GREY: Rgb = [128; 3];

/// Colour images of calibrated cameras, to be projected onto the surfaces of a take.
#[derive(Clone, Debug)]
pub struct Projection {
    rig: ColourSequence,
    name: String,
    turn: DMat3,
}

impl Projection {
    /// Opens the colour images of a rig: a folder with `rig.json`, `camera.json` or `depth.txt`, or that file. `up`: the axis of the rig
    /// that points up in the surfaces.
    ///
    /// # Errors
    /// [`CaptureError::Depth`].
    pub fn open(path: &Path, up: Up) -> Result<Self, CaptureError> {
        let (rig, name) = (ColourSequence::open(path)?, path.display().to_string());
        Ok(Self { rig, name, turn: up.to_y_up() })
    }

    /// Turns the cameras, too, where surfaces are turned to have another axis up.
    #[must_use]
    pub fn turned(self, up: Up) -> Self {
        Self { turn: up.to_y_up() * self.turn, ..self }
    }

    /// The frames of the rig that belong to frames of a take: the same numbers. A rig may have just the frames of the range, too.
    ///
    /// # Errors
    /// [`CaptureError::Unequal`] if the rig and the take have different numbers of frames.
    pub fn frames_for(&self, take: &Capture, range: &Range<usize>) -> Result<Range<usize>, CaptureError> {
        let frames = take.counted()?;
        match self.rig.frames() {
            own if own == frames => Ok(range.clone()),
            own if own == range.len() => Ok(0..own),
            own => Err(CaptureError::Unequal {
                name: take.name().to_owned(),
                frames,
                reference: self.name.clone(),
                in_reference: own,
            }),
        }
    }

    /// Textures a mesh by what the cameras saw of it in a frame of the rig, weighted by angle. What is hidden
    /// from a camera, or beside a jump in its depth, does not count. Where no camera saw anything the mesh
    /// keeps its colour, and is grey if it has none.
    ///
    /// `voxel_m`: how far the surface may be wrong (m).
    ///
    /// # Errors
    /// [`FrameError::Depth`] for an image that cannot be read.
    ///
    /// # Panics
    /// If the rig has not so many frames.
    pub fn paint(&self, mesh: &mut TriangleMesh, frame: usize, voxel_m: f64) -> Result<(), FrameError> {
        let views = self.rig.read(frame)?;
        let views: Vec<_> = views.into_iter().map(|view| view.turned(self.turn)).collect();
        let tiles = Tiles::new(mesh);
        let points: Vec<SurfacePoint> = (0..tiles.texels(mesh))
            .into_par_iter()
            .map(|number| {
                let texel = tiles.texel(mesh, number);
                let normal = mesh.area_vector(texel.face).normalize_or_zero();
                SurfacePoint { position: texel.point, normal }
            })
            .collect();
        let seen = seen_colours(mesh, &points, &views, &[], voxel_m);
        let of_own = |own: &Appearance, number: usize| {
            let texel = tiles.texel(mesh, number);
            own.colour(texel.face, mesh.triangles[texel.face], texel.weights).map(to_byte)
        };
        let own = mesh.appearance.as_deref();
        let colour = |(number, seen): (usize, &SeenColour)| match seen.weight > 0.0 {
            true => seen.colour.map(to_byte),
            false => own.map_or(GREY, |own| of_own(own, number)),
        };
        let colours = seen.par_iter().enumerate().map(colour).collect();
        tiles.paint(mesh, colours);
        Ok(())
    }
}

fn to_byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}
