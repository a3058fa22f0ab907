//! Frames as meshes, whatever they come from.

use crate::frame_range::FrameRange;
use crate::stream::{StreamFrames, load_index};
use anyhow::Result;
use isv::io::{FrameSequence, ScaleCheck, Unit, read_mesh};
use isv::surface::{SurfaceOptions, extract_surface};
use isv::volume::TriangleMesh;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::vec::IntoIter;

/// The frames of mesh files, all in one unit.
#[derive(Debug)]
pub(crate) struct MeshFrames {
    paths: IntoIter<PathBuf>,
    unit: Unit,
    scale: ScaleCheck,
}

impl MeshFrames {
    /// The frames of a sequence, whose coordinates are in `unit`.
    pub(crate) fn new(sequence: &FrameSequence, unit: Unit) -> Self {
        Self { paths: sequence.paths().to_vec().into_iter(), unit, scale: ScaleCheck::new() }
    }

    fn read(&mut self, path: PathBuf) -> Result<(PathBuf, TriangleMesh)> {
        let mesh = read_mesh(&path, self.unit)?;
        let diagonal_m = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        self.scale.check(&path, diagonal_m)?;
        Ok((path, mesh))
    }
}

/// Each mesh with the file it came from.
impl Iterator for MeshFrames {
    type Item = Result<(PathBuf, TriangleMesh)>;

    fn next(&mut self) -> Option<Self::Item> {
        let path = self.paths.next()?;
        Some(self.read(path))
    }
}

/// An input of frames: mesh files or an `.isv` stream.
#[derive(Debug)]
pub(crate) struct Source {
    name: String,
    frames: usize,
    kind: Kind,
}

#[derive(Debug)]
enum Kind {
    Meshes(FrameSequence, Unit),
    Stream,
}

impl Source {
    /// Finds the frames of a folder, a pattern, a mesh file or an `.isv` file. `unit` is that of mesh files.
    pub(crate) fn open(input: &str, unit: Unit) -> Result<Self> {
        let is_stream = Path::new(input).extension().is_some_and(|e| e.eq_ignore_ascii_case("isv"));
        let (frames, kind) = if is_stream {
            (load_index(Path::new(input))?.frames.len(), Kind::Stream)
        } else {
            let sequence = FrameSequence::open(input)?;
            (sequence.paths().len(), Kind::Meshes(sequence, unit))
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

    /// The frames of a range, or all, counted from 0.
    pub(crate) fn range(&self, range: Option<FrameRange>) -> Result<Range<usize>> {
        range.map_or(Ok(0..self.frames), |range| range.within(self.frames, &self.name))
    }

    /// The meshes of frames that are there.
    pub(crate) fn meshes(
        &self,
        frames: Range<usize>,
    ) -> Result<Box<dyn Iterator<Item = Result<TriangleMesh>>>> {
        match &self.kind {
            Kind::Meshes(sequence, unit) => {
                let meshes = MeshFrames::new(&sequence.select(frames)?, *unit);
                Ok(Box::new(meshes.map(|frame| Ok(frame?.1))))
            }
            Kind::Stream => {
                let range = FrameRange { start: frames.start, end: frames.end };
                let decoded = StreamFrames::open(Path::new(&self.name), Some(range))?;
                let options = SurfaceOptions { normals: true };
                Ok(Box::new(decoded.map(move |frame| Ok(extract_surface(&frame?.volume, &options)))))
            }
        }
    }
}
