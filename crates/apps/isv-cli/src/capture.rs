//! Inputs: everything that frames can come from.

mod files;
mod kinds;
mod pipe;
mod size;

use crate::frame_range::FrameRange;
use crate::memory;
use crate::stream;
use crate::up::Up;
use anyhow::{Context, Result, anyhow, bail};
use isv::format::FrameRate;
use isv::io::{DenseOptions, Geometry, InvalidPoints, Unit};
use isv::surface::SurfaceOptions;
use isv::volume::{DepthImage, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use kinds::Kind;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Frames, one after the other, each of them or what is wrong with it.
pub(crate) type Frames<T> = Box<dyn Iterator<Item = Result<T>> + Send>;

/// What a frame is before it becomes a volume.
#[derive(Debug)]
pub(crate) enum Content {
    /// A mesh or points.
    Geometry(Geometry),
    /// What depth cameras saw at one time.
    Depth(Vec<DepthImage>),
    /// A volume already.
    Volume(SparseVolume),
    /// A volume that was decoded in profile `main`, which is one at its surface alone.
    Decoded(SparseVolume),
}

/// What all frames of a capture are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ContentKind {
    /// [`Content::Geometry`]
    Geometry,
    /// [`Content::Depth`]
    Depth,
    /// [`Content::Volume`]
    Volume,
}

impl ContentKind {
    /// The frames in a sentence.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Geometry => "meshes and points",
            Self::Depth => "depth images",
            Self::Volume => "volumes",
        }
    }
}

/// A frame of a capture.
#[derive(Debug)]
pub(crate) struct CapturedFrame {
    /// Its number in the capture.
    pub(crate) number: usize,
    /// The file it came from, or the capture and its number; for messages.
    pub(crate) name: String,
    /// When it is shown, if the capture is a stream, which says so.
    pub(crate) timestamp_ns: Option<u64>,
    pub(crate) content: Content,
}

impl CapturedFrame {
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
        Self { content, ..self }
    }
}

/// What a user says of a capture that does not say so itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hints {
    /// Unit of coordinates.
    pub(crate) unit: Unit,
    pub(crate) voxel_size: Option<VoxelSize>,
    pub(crate) truncation: Option<Truncation>,
    /// Frames a second, at which an animation is sampled.
    pub(crate) frame_rate: FrameRate,
    /// The place of meshes and points, in metres, that is to be the origin.
    pub(crate) origin_m: [f64; 3],
    /// Treatment of points that are nowhere.
    pub(crate) invalid_points: InvalidPoints,
    /// Whether frames of one shape may be of different scales.
    pub(crate) mixed_scales: bool,
    /// The axis of meshes, points and depth cameras that points up.
    pub(crate) up: Up,
    /// How dense fields are read.
    pub(crate) dense: DenseOptions,
}

impl Hints {
    /// Those of a capture in a unit, with nothing else said.
    pub(crate) fn in_unit(unit: Unit) -> Self {
        let frame_rate = FrameRate { numerator: 30, denominator: 1 };
        Self {
            unit,
            voxel_size: None,
            truncation: None,
            frame_rate,
            origin_m: [0.0; 3],
            invalid_points: InvalidPoints::Refuse,
            mixed_scales: false,
            up: Up::Y,
            dense: DenseOptions::default(),
        }
    }

    /// With a place in the capture's unit as the origin.
    pub(crate) fn with_origin(self, origin: Option<[f64; 3]>) -> Self {
        Self { origin_m: origin.unwrap_or_default().map(|x| x * self.unit.metres()), ..self }
    }
}

/// Treatment of points that are nowhere, as `--drop-invalid-points` asks for it.
pub(crate) fn invalid_points(drop: bool) -> InvalidPoints {
    if drop { InvalidPoints::Drop } else { InvalidPoints::Refuse }
}

/// Edge of a voxel where neither the user nor the capture says.
pub(crate) fn default_voxel_size() -> VoxelSize {
    VoxelSize::from_nanometres(5_000_000).expect("5 mm is in range")
}

/// An input of frames.
pub(crate) struct Capture {
    name: String,
    path: PathBuf,
    /// How many, if that is known before they came.
    frames: Option<usize>,
    kind: Kind,
    origin_m: [f64; 3],
    up: Up,
}

impl Capture {
    /// Finds the frames of a folder, a pattern, a file or (`-`) standard input.
    pub(crate) fn open(input: &Path, hints: &Hints) -> Result<Self> {
        let (frames, kind) = Kind::open(input, hints)?;
        Ok(Self {
            name: stream::name(input),
            path: input.to_owned(),
            frames,
            kind,
            origin_m: hints.origin_m,
            up: hints.up,
        })
    }

    /// How many frames there are, unless they come from a pipe.
    pub(crate) fn frames(&self) -> Option<usize> {
        self.frames
    }

    /// How many frames there are, where that must be known.
    pub(crate) fn counted(&self) -> Result<usize> {
        self.frames.ok_or_else(|| anyhow!("{}: a pipe cannot be used here: name a file or folder", self.name))
    }

    /// The input as given.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Frames a second, where the capture says.
    pub(crate) fn frame_rate(&self) -> Option<FrameRate> {
        self.kind.frame_rate()
    }

    /// The grid that the frames are on already, if they are volumes.
    pub(crate) fn grid(&self) -> Option<Grid> {
        self.kind.grid()
    }

    /// What its frames are.
    pub(crate) fn content(&self) -> ContentKind {
        self.kind.content()
    }

    /// What a user should know before the first frame.
    pub(crate) fn remarks(&self) -> Vec<String> {
        self.kind.remarks().into_iter().map(|remark| format!("{}: {remark}", self.name)).collect()
    }

    /// Whether the frames are dense fields.
    pub(crate) fn is_dense(&self) -> bool {
        self.kind.is_dense()
    }

    /// Whether a frame can be read after one that cannot.
    pub(crate) fn frames_stand_alone(&self) -> bool {
        self.kind.frames_stand_alone()
    }

    /// The frames of a range, or all, counted from 0. Of a pipe, which may hold fewer, no more is known here.
    pub(crate) fn range(&self, range: Option<FrameRange>) -> Result<Range<usize>> {
        match (range, self.frames) {
            (Some(range), Some(frames)) => range.within(frames, &self.name),
            (Some(range), None) => Ok(range.start..range.end),
            (None, frames) => Ok(0..frames.unwrap_or(usize::MAX)),
        }
    }

    /// Bytes of the files that hold the frames of a range; none where that is not known, as of a pipe.
    pub(crate) fn bytes(&self, range: &Range<usize>) -> Option<u64> {
        let is_all = self.frames == Some(range.len());
        size::bytes(&self.kind, range, is_all.then_some(&self.path))
    }

    /// Reads the frames of a range that [`Self::range`] gave.
    pub(crate) fn read(self, range: Range<usize>) -> Result<Frames<CapturedFrame>> {
        let (origin_m, up) = (self.origin_m, self.up);
        let frames = self.kind.read(self.name, range)?;
        if origin_m == [0.0; 3] && up == Up::Y {
            return Ok(frames);
        }
        Ok(Box::new(frames.map(move |frame| Ok(frame?.relative_to(origin_m).with_y_up(up)))))
    }

    /// Reads the surfaces of such frames: meshes as they are, volumes by their zero crossing.
    pub(crate) fn meshes(self, range: Range<usize>) -> Result<Frames<TriangleMesh>> {
        Ok(Box::new(self.read(range)?.map(|frame| surface_of(frame?))))
    }
}

impl std::fmt::Debug for Capture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Capture").field("name", &self.name).finish_non_exhaustive()
    }
}

fn surface_of(frame: CapturedFrame) -> Result<TriangleMesh> {
    match frame.content {
        Content::Geometry(Geometry::Mesh(mesh)) => Ok(mesh),
        Content::Volume(volume) | Content::Decoded(volume) => {
            memory::surface(&volume, SurfaceOptions { normals: true }).context(frame.name)
        }
        Content::Geometry(Geometry::Points(_)) | Content::Depth(_) => {
            bail!("{}: no surface yet: isv encode makes one of points and depth images", frame.name)
        }
    }
}
