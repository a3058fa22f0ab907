//! What a user may choose of encoding.

use crate::job_options::JobOptions;
use crate::{Error, Event};
use isv_encode::{Band, Preset, Refresh};
use isv_format::FrameRate;
use isv_ingest::SignMode;
use isv_io::{InvalidPoints, Unit};
use isv_take::encode::{FusionMode, MainOptions, Normals, ProfileChoice, TimestampSource, VoxelChoice};
use isv_take::metadata::MetadataChoice;
use isv_take::{BitRate, Cancellation, Device, FrameRange, Length, MemoryLimit, Observer, OpenDevice, Up};
use std::num::NonZero;
use std::ops::Range;
use std::sync::Arc;

/// Options of encoding. What is not chosen is decided by the capture, or has the default of the command line.
///
/// Nothing is checked before the options are used, or [`Self::check`] is called: then each wrong value is an [`Error`] of kind
/// [`ErrorKind::Options`](crate::ErrorKind::Options).
#[derive(Clone, Default)]
pub struct EncodeOptions {
    pub(crate) raw: isv_take::encode::EncodeOptions,
    pub(crate) job: JobOptions,
}

impl EncodeOptions {
    /// The defaults: quality 50.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A quality from 0 to 100, the same in all frames. Equal steps look equally different.
    #[must_use]
    pub fn quality(quality: f32) -> Self {
        Self::with_target(MainOptions { quality: Some(quality), ..MainOptions::default() })
    }

    /// A bit rate of geometry and colour, every byte counted: what a channel of that rate carries with a buffer of one second.
    #[must_use]
    pub fn bitrate(rate: BitRate) -> Self {
        Self::with_target(MainOptions { bitrate: Some(rate), ..MainOptions::default() })
    }

    /// An RMS surface error that every frame stays below, against the field that it was made from.
    #[must_use]
    pub fn max_error(error: Length) -> Self {
        Self::with_target(MainOptions { max_error: Some(error), ..MainOptions::default() })
    }

    fn with_target(main: MainOptions) -> Self {
        let raw = isv_take::encode::EncodeOptions { main, ..Default::default() };
        Self { raw, ..Self::default() }
    }

    /// Quality of colour from 0 to 100, for captures with colour [default: 50, or what a bit rate gives].
    #[must_use]
    pub fn colour_quality(mut self, quality: f32) -> Self {
        self.raw.colour.quality = Some(quality);
        self
    }

    /// Leaves colour out. Image files are not opened.
    #[must_use]
    pub fn without_colour(mut self) -> Self {
        self.raw.colour.is_dropped = true;
        self
    }

    /// Meets a bit rate by one step for all frames, which is found by coding the take more than once. Whole takes alone.
    #[must_use]
    pub fn two_passes(mut self) -> Self {
        self.raw.main.passes = Some(2);
        self
    }

    /// Work to take on [default: balanced].
    #[must_use]
    pub fn preset(mut self, preset: Preset) -> Self {
        self.raw.main.preset = Some(preset);
        self
    }

    /// Recovery of decoders from lost packets [default: keyframes].
    #[must_use]
    pub fn refresh(mut self, refresh: Refresh) -> Self {
        self.raw.main.refresh = Some(refresh);
        self
    }

    /// Edge of a voxel. Without it volumes keep their own, meshes get 5 mm, points and depth images what their spacing and noise allow.
    #[must_use]
    pub fn voxel(mut self, edge: Length) -> Self {
        self.raw.voxel = VoxelChoice::Edge(edge);
        self
    }

    /// Chooses the voxel size that serves the target best, by coding samples. Whole takes of meshes alone.
    #[must_use]
    pub fn voxel_by_trial(mut self) -> Self {
        self.raw.voxel = VoxelChoice::Auto;
        self
    }

    /// Frames a second, to a thousandth [default: the capture's, else 30].
    #[must_use]
    pub fn fps(mut self, frames_per_second: impl Into<f64>) -> Self {
        let fps = frames_per_second.into();
        self.raw.frame_rate = FrameRate::nearest(fps);
        if self.raw.frame_rate.is_none() {
            self.job.refuse(format!("{fps} frames a second: a rate is above 0"));
        }
        self
    }

    /// Most frames from a keyframe to the next [default: 30].
    #[must_use]
    pub fn gop(mut self, frames: u32) -> Self {
        match NonZero::new(frames) {
            Some(frames) => self.raw.gop = frames,
            None => self.job.refuse("a group of pictures has at least 1 frame".to_owned()),
        }
        self
    }

    /// Codes every `gop` frames by themselves. The groups of a capture are then the same bytes, however many of them are coded at once.
    #[must_use]
    pub fn fixed_gop(mut self, wanted: bool) -> Self {
        self.raw.fixed_gop = wanted;
        self
    }

    /// Frame of a capture at which the stream's time begins [default: the first that is coded]: for pieces that are joined.
    #[must_use]
    pub fn time_origin(mut self, frame: usize) -> Self {
        self.raw.time_origin = Some(frame);
        self
    }

    /// Gives the stream a place for colour though its first frame may have none.
    #[must_use]
    pub fn expect_colour(mut self) -> Self {
        self.raw.colour.is_expected = true;
        self
    }

    /// Keeps the whole band of distances, by profile `paper`, and not what the surface needs alone.
    #[must_use]
    pub fn full_band(mut self) -> Self {
        self.raw.band = Some(Band::Full);
        self
    }

    /// Codes as the paper describes it (profile `paper`), for comparisons.
    #[must_use]
    pub fn as_in_paper(mut self) -> Self {
        self.raw.profile = Some(ProfileChoice::Paper);
        self
    }

    /// Puts a hash of each decoded frame into the stream.
    #[must_use]
    pub fn checksums(mut self, wanted: bool) -> Self {
        self.raw.checksums = wanted;
        self
    }

    /// Title of the take, for people.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.raw.metadata.title = Some(title.into());
        self
    }

    /// What captured the take, for people.
    #[must_use]
    pub fn capture_device(mut self, device: impl Into<String>) -> Self {
        self.raw.metadata.device = Some(device.into());
        self
    }

    /// Whether the stream says what it is and how it was made [default: where it has colour, a title or a capture device].
    #[must_use]
    pub fn metadata(mut self, choice: MetadataChoice) -> Self {
        self.raw.metadata.choice = choice;
        self
    }

    /// What packets are stamped with [default: the capture's times].
    #[must_use]
    pub fn timestamps(mut self, source: TimestampSource) -> Self {
        self.raw.timestamps = source;
        self
    }

    /// Tells inside from outside of meshes and points [default: by the first frame].
    #[must_use]
    pub fn sign(mut self, mode: SignMode) -> Self {
        self.raw.fields.sign = mode;
        self
    }

    /// Half the thickness of the shell around a surface without inside (voxels) [default: 1.5].
    #[must_use]
    pub fn shell_offset(mut self, voxels: f64) -> Self {
        self.raw.fields.offset_voxels = voxels;
        self
    }

    /// Estimates the normals of points.
    #[must_use]
    pub fn estimate_normals(mut self) -> Self {
        self.raw.fields.normals = Normals::Estimate;
        self
    }

    /// Place that points were seen from, in the capture's unit and coordinates.
    #[must_use]
    pub fn viewpoint(mut self, place: [f64; 3]) -> Self {
        self.raw.fields.viewpoint = Some(place);
        self
    }

    /// Takes a frame of depth images for all that was seen so far: the camera moves and the scene stands still.
    #[must_use]
    pub fn accumulate_depth(mut self) -> Self {
        self.raw.fields.fusion = FusionMode::Accumulate;
        self
    }

    /// Leaves out what depth cameras saw farther away.
    #[must_use]
    pub fn max_depth(mut self, depth: Length) -> Self {
        self.raw.fields.max_depth = Some(depth);
        self
    }

    /// Refuses frames that need more blocks.
    #[must_use]
    pub fn max_blocks(mut self, blocks: usize) -> Self {
        self.raw.fields.max_blocks = blocks;
        self
    }

    /// Unit of the coordinates of a capture's files [default: metres].
    #[must_use]
    pub fn units(mut self, unit: Unit) -> Self {
        self.raw.unit = unit;
        self
    }

    /// Place of a capture's meshes and points, in their unit, that becomes the origin.
    #[must_use]
    pub fn origin(mut self, place: [f64; 3]) -> Self {
        self.raw.origin = self.job.origin(place);
        self
    }

    /// Axis of a capture's files that points up [default: y].
    #[must_use]
    pub fn up(mut self, up: Up) -> Self {
        self.raw.up = up;
        self
    }

    /// Encodes some frames of a capture alone, counted from 0.
    #[must_use]
    pub fn frames(mut self, frames: Range<usize>) -> Self {
        if frames.is_empty() {
            self.job.refuse(format!("frames {}..{}: no frame", frames.start, frames.end));
        } else {
            self.raw.frames = Some(FrameRange { start: frames.start, end: frames.end });
        }
        self
    }

    /// Plays the animation of this name, or of this number from 0, of a glTF file [default: the first that moves anything].
    #[must_use]
    pub fn animation(mut self, name: impl Into<String>) -> Self {
        self.raw.animation = Some(name.into());
        self
    }

    /// Leaves out frames that cannot be read or used; the others keep their times.
    #[must_use]
    pub fn skip_bad_frames(mut self, wanted: bool) -> Self {
        self.raw.skip_bad_frames = wanted;
        self
    }

    /// Leaves out points that are not finite or lie at exactly (0, 0, 0), as cameras write "no reading".
    #[must_use]
    pub fn drop_invalid_points(mut self, wanted: bool) -> Self {
        self.raw.invalid_points = if wanted { InvalidPoints::Drop } else { InvalidPoints::Refuse };
        self
    }

    /// Device that does the arithmetic [default: the CPU].
    #[must_use]
    pub fn device(mut self, device: Device) -> Self {
        self.job.device = device;
        self
    }

    /// Memory for a frame (bytes) that decoders are known to have. Frames that need more are refused.
    #[must_use]
    pub fn memory_limit(mut self, bytes: u64) -> Self {
        self.raw.memory = MemoryLimit { bytes: Some(bytes) };
        self
    }

    /// Stops when a request to cancel is made: a whole take then ends early, with a stream that is sound.
    #[must_use]
    pub fn cancellation(mut self, cancellation: &Cancellation) -> Self {
        self.job.cancellation = cancellation.clone();
        self
    }

    /// Takes events: what was decided, and warnings.
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

    /// Checks all options.
    ///
    /// # Errors
    /// [`ErrorKind::Options`](crate::ErrorKind::Options) for the first that is wrong.
    pub fn check(&self) -> Result<(), Error> {
        self.job.check()?;
        self.raw.header(None, None)?;
        Ok(())
    }

    /// Opens the device; the observer is told if it is not the one that was to be.
    pub(crate) fn open_device(&self, observer: &dyn Observer) -> Result<OpenDevice, isv_take::DeviceError> {
        OpenDevice::open(self.job.device, None, observer)
    }
}

impl std::fmt::Debug for EncodeOptions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("EncodeOptions")
            .field("raw", &self.raw)
            .field("device", &self.job.device)
            .finish_non_exhaustive()
    }
}
