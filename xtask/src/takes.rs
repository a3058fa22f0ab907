//! What is measured: the project's own figure, and captures.

use anyhow::Result;
use isv::raw::decode::{Decoder, Limits};
use isv::raw::format::{FrameRate, PacketReader};
use isv::raw::io::{FrameSequence, Unit, read_mesh};
use isv::raw::volume::{SparseVolume, TriangleMesh, VoxelSize};
use isv_figure::figure_mesh;
use isv_study::{Take, TakeError, TakeFrames};
use std::path::Path;
use std::time::Instant;

/// Frames a second of all takes.
pub(crate) const FRAME_RATE: FrameRate = FrameRate::DEFAULT;

/// The first frames of a folder of meshes, in metres.
pub(crate) struct Sequence {
    name: String,
    files: FrameSequence,
}

impl Sequence {
    /// The first `frames` frames, or all if there are fewer.
    pub(crate) fn open(folder: &Path, frames: usize) -> Result<Self> {
        let files = FrameSequence::open(folder)?;
        let count = files.paths().len().min(frames);
        let name = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned();
        Ok(Self { name, files: files.select(0..count)? })
    }
}

impl Take for Sequence {
    fn name(&self) -> &str {
        &self.name
    }

    fn frames(&self) -> usize {
        self.files.paths().len()
    }

    fn frame_rate(&self) -> FrameRate {
        FRAME_RATE
    }

    fn meshes(&self) -> Result<TakeFrames<'_>, TakeError> {
        Ok(Box::new(self.files.paths().iter().map(|path| Ok(read_mesh(path, Unit::Metre)?))))
    }
}

/// The demo's figure in motion.
pub(crate) struct Figure {
    frames: usize,
    voxel: VoxelSize,
}

impl Figure {
    /// The first frames of its motion, modelled with voxels of 8 mm.
    pub(crate) fn new(frames: usize) -> Result<Self> {
        Ok(Self { frames, voxel: VoxelSize::from_metres(0.008)? })
    }
}

impl Take for Figure {
    fn name(&self) -> &str {
        "figure"
    }

    fn frames(&self) -> usize {
        self.frames
    }

    fn frame_rate(&self) -> FrameRate {
        FRAME_RATE
    }

    fn meshes(&self) -> Result<TakeFrames<'_>, TakeError> {
        let mesh =
            |frame| -> TriangleMesh { figure_mesh(frame as f64 / FRAME_RATE.per_second(), self.voxel) };
        Ok(Box::new((0..self.frames).map(move |frame| Ok(mesh(frame)))))
    }
}

/// The decoded volumes of a stream, and the milliseconds of each packet and of what is done with its volume.
pub(crate) fn decode_stream(
    stream: &[u8],
    then: impl Fn(&SparseVolume),
) -> Result<(Vec<SparseVolume>, Vec<f64>)> {
    let mut reader = PacketReader::new(stream)?;
    let header = reader.header();
    let mut decoder = Decoder::new(header, Limits::default());
    let (mut volumes, mut decode_ms) = (Vec::new(), Vec::new());
    while let Some(packet) = reader.next_frame()? {
        let start = Instant::now();
        let volume = decoder.decode(&packet)?.volume;
        then(volume);
        decode_ms.push(start.elapsed().as_secs_f64() * 1e3);
        volumes.push(volume.clone());
    }
    Ok((volumes, decode_ms))
}
