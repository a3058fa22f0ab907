//! Inputs: everything that frames can come from.

use crate::frame_range::FrameRange;
use crate::stream::{self, StreamFrames, load_index};
use anyhow::{Result, bail};
use isv::format::{FrameRate, StreamHeader};
use isv::io::{FrameSequence, Geometry, ScaleCheck, Unit, read_geometry};
use isv::surface::{SurfaceOptions, extract_surface};
use isv::volume::{Grid, SparseVolume, TriangleMesh};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Frames, one after the other, each of them or what is wrong with it.
pub(crate) type Frames<T> = Box<dyn Iterator<Item = Result<T>> + Send>;

/// What a frame is before it becomes a volume.
#[derive(Debug)]
pub(crate) enum Content {
    /// A mesh or points.
    Geometry(Geometry),
    /// A volume already.
    Volume(SparseVolume),
}

/// A frame of a capture.
#[derive(Debug)]
pub(crate) struct CapturedFrame {
    /// Its number in the capture.
    pub(crate) number: usize,
    /// The file it came from, or the capture and its number; for messages.
    pub(crate) name: String,
    pub(crate) content: Content,
}

/// An input of frames.
#[derive(Debug)]
pub(crate) struct Capture {
    name: String,
    frames: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    /// Files of meshes or points, one a frame.
    Files(FrameSequence, Unit),
    /// An `.isv` file.
    Stream(StreamHeader),
}

impl Capture {
    /// Finds the frames of a folder, a pattern or a file. `unit` is that of the coordinates in files that do not say.
    pub(crate) fn open(input: &str, unit: Unit) -> Result<Self> {
        let path = Path::new(input);
        let is_stream = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("isv"));
        let (frames, kind) = if is_stream {
            let (_, header) = stream::open(path)?;
            (load_index(path)?.frames.len(), Kind::Stream(header))
        } else {
            let sequence = FrameSequence::open(input)?;
            (sequence.paths().len(), Kind::Files(sequence, unit))
        };
        Ok(Self { name: input.to_owned(), frames, kind })
    }

    /// How many frames there are.
    pub(crate) fn frames(&self) -> usize {
        self.frames
    }

    /// The input as given.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Frames a second, where the capture says.
    pub(crate) fn frame_rate(&self) -> Option<FrameRate> {
        match &self.kind {
            Kind::Files(..) => None,
            Kind::Stream(header) => Some(header.frame_rate),
        }
    }

    /// The grid that the frames are on already, if they are volumes.
    pub(crate) fn grid(&self) -> Option<Grid> {
        match &self.kind {
            Kind::Files(..) => None,
            Kind::Stream(header) => Some(header.grid),
        }
    }

    /// Whether a frame can be read after one that cannot.
    pub(crate) fn frames_stand_alone(&self) -> bool {
        match &self.kind {
            Kind::Files(..) => true,
            Kind::Stream(_) => false,
        }
    }

    /// The frames of a range, or all, counted from 0.
    pub(crate) fn range(&self, range: Option<FrameRange>) -> Result<Range<usize>> {
        range.map_or(Ok(0..self.frames), |range| range.within(self.frames, &self.name))
    }

    /// Reads frames that are there.
    pub(crate) fn read(self, range: Range<usize>) -> Result<Frames<CapturedFrame>> {
        match self.kind {
            Kind::Files(sequence, unit) => {
                Ok(Box::new(FileFrames::new(&sequence.select(range.clone())?, range.start, unit)))
            }
            Kind::Stream(_) => {
                let range = FrameRange { start: range.start, end: range.end };
                let frames = StreamFrames::open(Path::new(&self.name), Some(range))?;
                Ok(Box::new(frames.map(move |frame| {
                    let frame = frame?;
                    let (number, content) = (frame.number, Content::Volume(frame.volume));
                    Ok(CapturedFrame { number, name: format!("{}, frame {number}", self.name), content })
                })))
            }
        }
    }

    /// Reads the surfaces of frames that are there: meshes as they are, volumes by their zero crossing.
    pub(crate) fn meshes(self, range: Range<usize>) -> Result<Frames<TriangleMesh>> {
        Ok(Box::new(self.read(range)?.map(|frame| surface_of(frame?))))
    }
}

fn surface_of(frame: CapturedFrame) -> Result<TriangleMesh> {
    match frame.content {
        Content::Geometry(Geometry::Mesh(mesh)) => Ok(mesh),
        Content::Volume(volume) => Ok(extract_surface(&volume, &SurfaceOptions { normals: true })),
        Content::Geometry(Geometry::Points(_)) => {
            bail!("{}: points, where a surface is needed: isv encode makes one of them", frame.name)
        }
    }
}

/// Reads files in order.
struct FileFrames {
    paths: std::vec::IntoIter<PathBuf>,
    /// Number of the next frame.
    number: usize,
    unit: Unit,
    scale: ScaleCheck,
}

impl FileFrames {
    fn new(sequence: &FrameSequence, first: usize, unit: Unit) -> Self {
        let paths = sequence.paths().to_vec().into_iter();
        Self { paths, number: first, unit, scale: ScaleCheck::new() }
    }

    fn read(&mut self, number: usize, path: &Path) -> Result<CapturedFrame> {
        let geometry = read_geometry(path, self.unit)?;
        let diagonal_m = geometry.bounds().map_or(0.0, |(low, high)| low.distance(high));
        self.scale.check(path, diagonal_m)?;
        Ok(CapturedFrame { number, name: path.display().to_string(), content: Content::Geometry(geometry) })
    }
}

impl Iterator for FileFrames {
    type Item = Result<CapturedFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        let number = self.number;
        self.number += 1;
        Some(self.read(number, &path))
    }
}
