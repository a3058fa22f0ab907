//! Inputs: everything that frames can come from.

mod files;
mod kinds;
mod matching;
mod pipe;
mod size;

use crate::encode::{CaptureError, FrameError, TimestampSource};
use crate::metadata::Metadata;
use crate::stream::{self, DecodeSettings};
use crate::tile_texture::add_tile_texture;
use crate::{FrameRange, Input, MemoryError, MemoryLimit, Observer, OpenDevice, Up};
use isv_decode::Lod;
use isv_decode::colour::ColourFrame;
use isv_format::FrameRate;
use isv_io::{Colours, DenseOptions, Geometry, InvalidPoints, ReadOptions, Unit};
use isv_surface::SurfaceOptions;
use isv_volume::{ColourView, DepthImage, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use kinds::Kind;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

pub use kinds::Remark;
pub use matching::matching_ranges;

/// Frames, one after the other, each of them or what is wrong with it.
pub type Frames<T> = Box<dyn Iterator<Item = Result<T, FrameError>> + Send>;

/// What a frame is before it becomes a volume.
#[derive(Debug)]
pub enum Content {
    /// A mesh or points.
    Geometry(Geometry),
    /// What depth cameras saw at one time.
    Depth(Vec<DepthImage>),
    /// A volume already.
    Volume(SparseVolume),
    /// A volume that was decoded in profile `main`, which is one at its surface alone.
    Decoded(SparseVolume),
}

impl Content {
    /// Whether it has colours that can be coded.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        match self {
            Self::Geometry(Geometry::Mesh(mesh)) => mesh.appearance.is_some(),
            Self::Geometry(Geometry::Points(points)) => !points.colours.is_empty(),
            Self::Depth(_) | Self::Volume(_) | Self::Decoded(_) => false,
        }
    }
}

/// What all frames of a capture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContentKind {
    /// [`Content::Geometry`]
    Geometry,
    /// [`Content::Depth`]
    Depth,
    /// [`Content::Volume`]
    Volume,
}

impl ContentKind {
    /// The frames in a sentence.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Geometry => "meshes and points",
            Self::Depth => "depth images",
            Self::Volume => "volumes",
        }
    }
}

/// A frame of a capture.
#[derive(Debug)]
pub struct CapturedFrame {
    /// Number of the frame in the capture.
    pub number: usize,
    /// The file it came from, or the capture and its number; for messages.
    pub name: String,
    /// When it is shown, if the capture is a stream, which says so.
    pub timestamp_ns: Option<u64>,
    /// What it is.
    pub content: Content,
    /// Colour of a frame of a stream, if it has any and it is wanted.
    pub colour: Option<Arc<ColourFrame>>,
    /// Colour images of a frame of depth images, if it has any and they are wanted.
    pub views: Vec<ColourView>,
}

impl CapturedFrame {
    /// Creates a frame without a time and without a colour beside its content.
    #[must_use]
    pub fn new(number: usize, name: String, content: Content) -> Self {
        Self { number, name, timestamp_ns: None, content, colour: None, views: Vec::new() }
    }

    /// Whether it has colours that can be coded.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        self.colour.is_some() || !self.views.is_empty() || self.content.has_colour()
    }

    /// Whether nothing was captured. Depth images and volumes always count as something.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        match &self.content {
            Content::Geometry(Geometry::Mesh(mesh)) => mesh.triangles.is_empty(),
            Content::Geometry(Geometry::Points(points)) => points.positions.is_empty(),
            Content::Depth(_) | Content::Volume(_) | Content::Decoded(_) => false,
        }
    }

    /// The frame with another origin, where it is one of meshes or points.
    fn relative_to(self, origin_m: [f64; 3]) -> Self {
        let content = match self.content {
            Content::Geometry(geometry) => Content::Geometry(geometry.relative_to(origin_m)),
            other => other,
        };
        Self { content, ..self }
    }

    /// The frame turned from an axis that points up to Y up, unless it is a volume: those are Y up already.
    fn with_y_up(self, up: Up) -> Self {
        if up == Up::Y {
            return self;
        }
        let content = match self.content {
            Content::Geometry(geometry) => Content::Geometry(geometry.turned(up.to_y_up())),
            Content::Depth(images) => {
                let turned = images.into_iter().map(|image| image.turned(up.to_y_up()));
                Content::Depth(turned.collect())
            }
            volume @ (Content::Volume(_) | Content::Decoded(_)) => volume,
        };
        let views = self.views.into_iter().map(|view| view.turned(up.to_y_up())).collect();
        Self { content, views, ..self }
    }
}

/// What a user says of a capture that does not say so itself.
#[derive(Clone)]
pub struct Hints {
    /// Unit of coordinates.
    pub unit: Unit,
    /// Edge of a voxel.
    pub voxel_size: Option<VoxelSize>,
    /// Distance from the surface up to which a volume has distances.
    pub truncation: Option<Truncation>,
    /// Frames a second, at which an animation is sampled.
    pub frame_rate: FrameRate,
    /// Name or number, counted from 0, of the animation of a glTF file that plays; the first that moves anything.
    pub animation: Option<String>,
    /// The place of meshes and points, in metres, that is to be the origin.
    pub origin_m: [f64; 3],
    /// Treatment of points that are nowhere.
    pub invalid_points: InvalidPoints,
    /// Whether frames of one shape may be of different scales.
    pub mixed_scales: bool,
    /// The axis of meshes, points and depth cameras that points up.
    pub up: Up,
    /// How dense fields are read.
    pub dense: DenseOptions,
    /// Treatment of colours.
    pub colours: Colours,
    /// Memory for the frames of streams.
    pub memory: MemoryLimit,
    /// Observer of what happens while frames are read.
    pub observer: Arc<dyn Observer>,
}

impl Hints {
    /// How files of meshes and points are read.
    pub(crate) fn read_options(&self) -> ReadOptions {
        ReadOptions::new(self.unit).with_invalid_points(self.invalid_points).with_colours(self.colours)
    }

    /// Creates hints of a unit alone.
    #[must_use]
    pub fn in_unit(unit: Unit, memory: MemoryLimit, observer: Arc<dyn Observer>) -> Self {
        Self {
            unit,
            voxel_size: None,
            truncation: None,
            frame_rate: FrameRate::DEFAULT,
            animation: None,
            origin_m: [0.0; 3],
            invalid_points: InvalidPoints::Refuse,
            mixed_scales: false,
            up: Up::Y,
            dense: DenseOptions::default(),
            colours: Colours::Drop,
            memory,
            observer,
        }
    }

    /// With a place in the capture's unit as the origin.
    #[must_use]
    pub fn with_origin(self, origin: Option<[f64; 3]>) -> Self {
        Self { origin_m: origin.unwrap_or_default().map(|x| x * self.unit.metres()), ..self }
    }
}

/// Decodes streams among the captures on the CPU, at full resolution.
fn stream_settings(hints: &Hints, frames: Option<FrameRange>) -> DecodeSettings {
    let (memory, observer) = (hints.memory, Arc::clone(&hints.observer));
    let colour = hints.colours == Colours::Keep;
    DecodeSettings { frames, lod: Lod::Full, colour, device: OpenDevice::CPU, memory, observer }
}

/// Edge of a voxel where neither the user nor the capture says.
#[must_use]
pub fn default_voxel_size() -> VoxelSize {
    VoxelSize::from_nanometres(5_000_000).expect("5 mm is in range")
}

/// When the frames of a capture are shown.
#[derive(Clone, Debug)]
pub struct CaptureTimes {
    rate: FrameRate,
    /// Time of each frame, counted from the first; `None` where frames follow each other at the rate.
    stated_ns: Option<Vec<u64>>,
}

impl CaptureTimes {
    /// When a frame is shown, counted from the capture's first (ns); the end of time behind the last of those whose times are stated.
    #[must_use]
    pub fn of_ns(&self, frame: usize) -> u64 {
        match &self.stated_ns {
            Some(stated) => stated.get(frame).copied().unwrap_or(u64::MAX),
            None => self.rate.timestamp_ns(frame as u64),
        }
    }
}

/// An input of frames.
pub struct Capture {
    input: Input,
    name: String,
    /// How many, if that is known before they came.
    frames: Option<usize>,
    kind: Kind,
    origin_m: [f64; 3],
    up: Up,
    colours: Colours,
    memory: MemoryLimit,
}

impl Capture {
    /// Finds the frames of a folder, a pattern, a file or standard input.
    ///
    /// # Errors
    /// See [`CaptureError`].
    pub fn open(input: &Input, hints: &Hints) -> Result<Self, CaptureError> {
        let (frames, kind) = Kind::open(input, hints)?;
        Ok(Self {
            input: input.clone(),
            name: input.name(),
            frames,
            kind,
            origin_m: hints.origin_m,
            up: hints.up,
            colours: hints.colours,
            memory: hints.memory,
        })
    }

    /// The input.
    #[must_use]
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// How many frames there are, unless they come from a pipe.
    #[must_use]
    pub fn frames(&self) -> Option<usize> {
        self.frames
    }

    /// How many frames there are, where that must be known.
    ///
    /// # Errors
    /// [`CaptureError::Uncounted`].
    pub fn counted(&self) -> Result<usize, CaptureError> {
        self.frames.ok_or_else(|| CaptureError::Uncounted { name: self.name.clone() })
    }

    /// The input as given.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What a stream that is coded anew says of itself; `None` of other captures, and of a stream that says nothing.
    #[must_use]
    pub fn metadata(&self) -> Option<Metadata> {
        match &self.kind {
            Kind::Stream(..) => stream::metadata(&self.input).ok().flatten(),
            _ => None,
        }
    }

    /// The files of the frames, in order, where each frame is a file of meshes or points.
    #[must_use]
    pub fn frame_files(&self) -> Option<&[PathBuf]> {
        self.kind.frame_files()
    }

    /// Frames a second, where the capture says.
    #[must_use]
    pub fn frame_rate(&self) -> Option<FrameRate> {
        self.kind.frame_rate()
    }

    /// The grid that the frames are on already, if they are volumes.
    #[must_use]
    pub fn grid(&self) -> Option<Grid> {
        self.kind.grid()
    }

    /// What its frames are.
    #[must_use]
    pub fn content(&self) -> ContentKind {
        self.kind.content()
    }

    /// Whether its frames have colours that can be coded; `None` if that is seen in the first frame.
    pub(crate) fn has_colour(&self) -> Option<bool> {
        self.kind.has_colour()
    }

    /// What a user should know before the first frame.
    #[must_use]
    pub fn remarks(&self) -> Vec<Remark> {
        let passed_over = self.kind.passed_over(&self.input, self.colours);
        let lost = (!passed_over.is_empty()).then_some(Remark::NotKept(passed_over));
        self.kind.remarks().into_iter().chain(lost).collect()
    }

    /// When frames are shown in a stream of a frame rate.
    #[must_use]
    pub fn times(&self, rate: FrameRate, source: TimestampSource) -> CaptureTimes {
        let is_kept = source == TimestampSource::Source && self.keeps_times(rate);
        let stated_ns = if is_kept { self.kind.times_ns(&self.input, rate) } else { None };
        CaptureTimes { rate, stated_ns }
    }

    /// Whether a stream of a frame rate has the times that the capture states: at another rate than its own, frames follow each other.
    pub(crate) fn keeps_times(&self, rate: FrameRate) -> bool {
        self.frame_rate() == Some(rate)
    }

    /// Whether the frames are dense fields.
    #[must_use]
    pub fn is_dense(&self) -> bool {
        self.kind.is_dense()
    }

    /// Whether a frame can be read after one that cannot.
    #[must_use]
    pub fn frames_stand_alone(&self) -> bool {
        self.kind.frames_stand_alone()
    }

    /// The frames of a range, or all, counted from 0. Of a pipe, which may hold fewer, no more is known here.
    ///
    /// # Errors
    /// [`CaptureError::Range`] if some of them are not there.
    pub fn range(&self, range: Option<FrameRange>) -> Result<Range<usize>, CaptureError> {
        match (range, self.frames) {
            (Some(range), Some(frames)) => {
                range.within(frames).map_err(|cause| CaptureError::Range { name: self.name.clone(), cause })
            }
            (Some(range), None) => Ok(range.start..range.end),
            (None, frames) => Ok(0..frames.unwrap_or(usize::MAX)),
        }
    }

    /// Bytes of the files that hold the frames of a range; none where that is not known, as of a pipe.
    #[must_use]
    pub fn bytes(&self, range: &Range<usize>) -> Option<u64> {
        let is_all = self.frames == Some(range.len());
        size::bytes(&self.kind, range, self.input.path().filter(|_| is_all))
    }

    /// When a frame was taken, as [`Self::read_since`] has the times of frames read since it (ns); `None` if the capture does not say.
    pub(crate) fn stated_ns(&self, frame: usize) -> Option<u64> {
        self.kind.stated_ns(frame)
    }

    /// Reads the frames of a range that [`Self::range`] gave.
    ///
    /// # Errors
    /// See [`CaptureError`].
    pub fn read(self, range: Range<usize>) -> Result<Frames<CapturedFrame>, CaptureError> {
        self.read_since(None, range)
    }

    /// Reads the frames of a range, with times as they are where reading begins with an earlier frame.
    ///
    /// # Errors
    /// See [`CaptureError`].
    pub(crate) fn read_since(
        self,
        time_origin: Option<usize>,
        range: Range<usize>,
    ) -> Result<Frames<CapturedFrame>, CaptureError> {
        let (origin_m, up) = (self.origin_m, self.up);
        let time_origin = time_origin.unwrap_or(range.start);
        let frames = self.kind.read(self.name, time_origin, range)?;
        if origin_m == [0.0; 3] && up == Up::Y {
            return Ok(frames);
        }
        Ok(Box::new(frames.map(move |frame| Ok(frame?.relative_to(origin_m).with_y_up(up)))))
    }

    /// Reads the surfaces of such frames: meshes as they are, volumes by their zero crossing.
    ///
    /// # Errors
    /// See [`CaptureError`].
    pub fn meshes(self, range: Range<usize>) -> Result<Frames<TriangleMesh>, CaptureError> {
        let memory = self.memory;
        Ok(Box::new(self.read(range)?.map(move |frame| surface_of(frame?, memory))))
    }
}

impl std::fmt::Debug for Capture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Capture").field("name", &self.name).finish_non_exhaustive()
    }
}

/// The surface of a frame's volume, with its colour if it has any.
pub(crate) fn coloured_surface(
    volume: &SparseVolume,
    colour: Option<&ColourFrame>,
    options: SurfaceOptions,
    memory: MemoryLimit,
) -> Result<TriangleMesh, MemoryError> {
    let mut mesh = memory.surface(volume, options)?;
    if let Some(colour) = colour {
        add_tile_texture(&mut mesh, colour, volume.grid());
    }
    Ok(mesh)
}

fn surface_of(frame: CapturedFrame, memory: MemoryLimit) -> Result<TriangleMesh, FrameError> {
    match frame.content {
        Content::Geometry(geometry) if geometry.is_empty() => Ok(TriangleMesh::default()),
        Content::Geometry(Geometry::Mesh(mesh)) => Ok(mesh),
        Content::Volume(volume) | Content::Decoded(volume) => {
            let surface =
                coloured_surface(&volume, frame.colour.as_deref(), SurfaceOptions { normals: true }, memory);
            surface.map_err(|cause| FrameError::Memory { name: frame.name, cause })
        }
        Content::Geometry(Geometry::Points(_)) | Content::Depth(_) => {
            Err(FrameError::NoSurfaceYet { name: frame.name })
        }
    }
}
