//! Options of decoding to files.

use crate::job_options::JobOptions;
use crate::{Error, Event};
use isv_decode::Lod;
use isv_io::{GlbEncoding, Unit};
use isv_take::decode::Form;
use isv_take::stream::AfterLoss;
use isv_take::{Cancellation, Device, FrameRange, Length, MemoryLimit, Observer, OpenDevice, Up};
use std::num::NonZero;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Options of decoding a stream to files. What is not chosen is decided by the output's name: meshes, as PLY files in a folder.
///
/// Nothing is checked before the options are used: then each wrong value is an [`Error`] of kind [`ErrorKind::Options`](crate::ErrorKind::Options).
#[derive(Clone, Default)]
pub struct DecodeOptions {
    pub(crate) raw: isv_take::decode::DecodeOptions,
    pub(crate) job: JobOptions,
}

impl DecodeOptions {
    /// The defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Points spread evenly over the surface in place of meshes, each for a square of it with this edge.
    #[must_use]
    pub fn points(mut self, spacing: Length) -> Self {
        (self.raw.form, self.raw.spacing) = (Some(Form::Points), Some(spacing));
        self
    }

    /// Points in place of meshes, so many a frame.
    #[must_use]
    pub fn point_count(mut self, count: usize) -> Self {
        self.raw.form = Some(Form::Points);
        match NonZero::new(count) {
            Some(count) => self.raw.points = Some(count),
            None => self.job.refuse("a frame has at least 1 point".to_owned()),
        }
        self
    }

    /// The fields of signed distances in place of meshes.
    #[must_use]
    pub fn fields(mut self) -> Self {
        self.raw.form = Some(Form::Volume);
        self
    }

    /// Format of the files of a folder, by its usual extension. Meshes are `ply`, `obj`, `stl`, `glb`, `usda`
    /// (text) or `usdc` (binary), points `ply`, `pcd` or `xyz`, fields `npy` or `vdb`.
    #[must_use]
    pub fn format(mut self, extension: &str) -> Self {
        match extension.parse() {
            Ok(format) => self.raw.format = Some(format),
            Err(why) => self.job.refuse(why),
        }
        self
    }

    /// Vertex normals of meshes [default: in GLB and USD files alone].
    #[must_use]
    pub fn normals(mut self, wanted: bool) -> Self {
        self.raw.normals = Some(wanted);
        self
    }

    /// Compresses meshes in GLB files (`EXT_meshopt_compression`).
    #[must_use]
    pub fn meshopt(mut self) -> Self {
        self.raw.glb = Some(GlbEncoding::Meshopt);
        self
    }

    /// Most faces of each mesh: edges are collapsed where that changes the surface least.
    #[must_use]
    pub fn target_faces(mut self, faces: usize) -> Self {
        match NonZero::new(faces) {
            Some(faces) => self.raw.target_faces = Some(faces),
            None => self.job.refuse("a mesh has at least 1 face".to_owned()),
        }
        self
    }

    /// Collapses edges as long as the surface stays within this distance.
    #[must_use]
    pub fn simplify(mut self, distance: Length) -> Self {
        self.raw.simplify = Some(distance);
        self
    }

    /// Unit of the output's coordinates [default: metres].
    #[must_use]
    pub fn units(mut self, unit: Unit) -> Self {
        self.raw.unit = unit;
        self
    }

    /// Place of the stream's origin in the output, in its unit.
    #[must_use]
    pub fn origin(mut self, place: [f64; 3]) -> Self {
        self.raw.origin = self.job.origin(place);
        self
    }

    /// Axis of the output that points up [default: Y].
    #[must_use]
    pub fn up(mut self, axis: Up) -> Self {
        self.raw.up = axis;
        self
    }

    /// Level of detail.
    #[must_use]
    pub fn lod(mut self, lod: Lod) -> Self {
        self.raw.lod = lod;
        self
    }

    /// Frames to decode [default: all].
    #[must_use]
    pub fn frames(mut self, frames: Range<usize>) -> Self {
        match frames.is_empty() {
            false => self.raw.frames = Some(FrameRange { start: frames.start, end: frames.end }),
            true => self.job.refuse(format!("frames {}..{}: none", frames.start, frames.end)),
        }
        self
    }

    /// Sets the reaction to damaged or missing packets.
    #[must_use]
    pub fn after_loss(mut self, after_loss: AfterLoss) -> Self {
        self.raw.after_loss = after_loss;
        self
    }

    /// Device that does the arithmetic [default: the CPU].
    #[must_use]
    pub fn device(mut self, device: Device) -> Self {
        self.job.device = device;
        self
    }

    /// Limits the memory for a frame (bytes), as [`Reader::memory_limit`](crate::Reader::memory_limit) does.
    #[must_use]
    pub fn memory_limit(mut self, bytes: u64) -> Self {
        self.raw.memory = MemoryLimit { bytes: Some(bytes) };
        self
    }

    /// Stops when a request to cancel is made: the frames before it are written.
    #[must_use]
    pub fn cancellation(mut self, cancellation: &Cancellation) -> Self {
        self.job.cancellation = cancellation.clone();
        self
    }

    /// Takes events, such as damage that was met.
    #[must_use]
    pub fn on_event(mut self, handler: impl Fn(&Event) + Send + Sync + 'static) -> Self {
        self.job.events = Some(Arc::new(handler));
        self
    }

    /// Takes the number of frames done, and of all frames if it is known, after each frame.
    #[must_use]
    pub fn on_progress(mut self, handler: impl Fn(usize, Option<usize>) + Send + Sync + 'static) -> Self {
        self.job.progress = Some(Arc::new(handler));
        self
    }

    /// Checks all options for an output.
    ///
    /// # Errors
    /// [`ErrorKind::Options`](crate::ErrorKind::Options) for the first that is wrong, and for a name of a file that is not written.
    pub fn check(&self, output: impl AsRef<Path>) -> Result<(), Error> {
        self.job.check()?;
        self.raw.settle(output.as_ref())?;
        Ok(())
    }

    /// Opens the device; the observer is told if it is not the one that was to be.
    pub(crate) fn open_device(&self, observer: &dyn Observer) -> Result<OpenDevice, isv_take::DeviceError> {
        OpenDevice::open_for(self.job.device, None, self.raw.lod, observer)
    }
}

impl std::fmt::Debug for DecodeOptions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DecodeOptions")
            .field("raw", &self.raw)
            .field("device", &self.job.device)
            .finish_non_exhaustive()
    }
}
