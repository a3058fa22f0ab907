//! Options of decoding to files.

use super::placement::Placed;
use super::product::Recipe;
use super::{DecodeOptionsError, DecodeTakeError, Form, OutputFormat};
use crate::TextureSide;
use crate::stream::AfterLoss;
use crate::{FrameRange, Length, MemoryLimit, Observer, Up};
use isv_decode::Lod;
use isv_format::StreamHeader;
use isv_io::{Format, GlbEncoding, Unit, is_pipe};
use isv_simplify::Budget;
use isv_surface::PointDensity;
use std::num::NonZero;
use std::path::Path;

/// Options of decoding a stream to files. What is not chosen is decided by the output's name and the stream.
#[derive(Clone, Debug, Default)]
pub struct DecodeOptions {
    /// Product of each frame [default: by the format, else meshes].
    pub form: Option<Form>,
    /// File format [default: that of the output's name, else PLY or arrays].
    pub format: Option<OutputFormat>,
    /// Whether meshes have vertex normals [default: in GLB and USD files].
    pub normals: Option<bool>,
    /// Encoding of meshes in GLB files [default: plain].
    pub glb: Option<GlbEncoding>,
    /// Most faces of each mesh.
    pub target_faces: Option<NonZero<usize>>,
    /// Distance from the decoded surface within which edges of meshes are collapsed.
    pub simplify: Option<Length>,
    /// Number of points of a frame.
    pub points: Option<NonZero<usize>>,
    /// Edge of the square of surface that each point stands for [default: a voxel].
    pub spacing: Option<Length>,
    /// Unit of the output's coordinates.
    pub unit: Unit,
    /// Place of the stream's origin in the output, in its unit.
    pub origin: Option<[f64; 3]>,
    /// Axis of the output that points up.
    pub up: Up,
    /// Level of detail.
    pub lod: Lod,
    /// Frames to decode [default: all].
    pub frames: Option<FrameRange>,
    /// Reaction to damaged or missing packets.
    pub after_loss: AfterLoss,
    /// Memory for frames.
    pub memory: MemoryLimit,
    /// Whether each frame is finished before the next is decoded.
    pub takes_turns: bool,
    /// Whether colour is left out.
    pub drop_colour: bool,
    /// Size of the texture that the colour of meshes is baked into [default: colours of vertices].
    pub texture: Option<TextureSide>,
}

impl DecodeOptions {
    /// Settles form and format for an output, and checks all that can be checked without the stream.
    ///
    /// # Errors
    /// [`DecodeTakeError::Options`] and [`DecodeTakeError::Output`].
    pub fn settle(&self, output: &Path) -> Result<(Form, OutputFormat), DecodeTakeError> {
        let (form, format) = match self.texture {
            Some(_) => OutputFormat::settle_textured(self.form, self.format, output)?,
            None => OutputFormat::settle(self.form, self.format, output)?,
        };
        let wrong = match form {
            Form::Mesh | Form::Volume if self.points.is_some() || self.spacing.is_some() => {
                Some(DecodeOptionsError::NoPoints)
            }
            _ if self.glb.is_some() && format != OutputFormat::Geometry(Format::Glb) => {
                Some(DecodeOptionsError::NoGlb)
            }
            _ if matches!(format, OutputFormat::Usd(_)) && is_pipe(output) => {
                Some(DecodeOptionsError::UsdPipe)
            }
            Form::Points | Form::Volume if self.normals == Some(false) => {
                Some(DecodeOptionsError::NoMeshNormals)
            }
            Form::Points | Form::Volume if self.budget().is_some() => Some(DecodeOptionsError::NoMeshFaces),
            _ if self.texture.is_some() && self.drop_colour => Some(DecodeOptionsError::DroppedTexture),
            _ => None,
        };
        wrong.map_or(Ok((form, format)), |wrong| Err(wrong.into()))
    }

    /// What meshes may have, if that is limited.
    #[must_use]
    pub fn budget(&self) -> Option<Budget> {
        let (faces, max_error_m) = (self.target_faces.map(NonZero::get), self.simplify.map(Length::metres));
        (faces.is_some() || max_error_m.is_some()).then_some(Budget { faces, max_error_m })
    }

    /// Builds the recipe that turns frames of a stream into products.
    pub(super) fn recipe(
        &self,
        header: &StreamHeader,
        form: Form,
        format: OutputFormat,
        stream_up: Up,
        observer: &dyn Observer,
    ) -> Result<Recipe, DecodeTakeError> {
        let voxel_m = header.grid.voxel_size.metres() * f64::from(self.lod.voxels());
        let placed = Placed::new(self, form, format, voxel_m, stream_up, observer)?;
        let density = match self.points {
            Some(count) => PointDensity::Count(count.get()),
            None => PointDensity::Spacing(self.spacing.map_or(voxel_m, Length::metres)),
        };
        Ok(Recipe {
            form,
            // GLB and USD files are for viewers, which shade flat without them.
            normals: self
                .normals
                .unwrap_or(matches!(format, OutputFormat::Geometry(Format::Glb) | OutputFormat::Usd(_))),
            density,
            profile: header.profile,
            grid: header.grid,
            budget: self.budget(),
            placed,
            memory: self.memory,
            bakes: self.texture.is_some(),
        })
    }
}
