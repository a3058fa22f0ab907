//! `.isv` streams from files and pipes, decoded frame by frame.

use crate::backend::{self, BackendArgs};
use crate::failure::usage;
use crate::frame_range::FrameRange;
use crate::memory;
use crate::output::{is_pipe, say};
use crate::stats::timed;
use anyhow::{Context, Result, anyhow, bail};
use isv::decode::{DecodeError, Lod};
use isv::format::{FormatError, PacketReader, StreamHeader, StreamIndex};
use isv::gpu::{AnyDecoder, AnyVolume};
use isv::ingest::{coded_field, redistance};
use isv::surface::SurfaceOptions;
use isv::volume::{BlockSet, SparseVolume, TriangleMesh};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Bytes from a file or a pipe.
pub(crate) type ByteSource = Box<dyn Read + Send>;

/// Says that a stream that was read to its end ends without one.
pub(crate) fn say_if_cut(name: &str, packets: &PacketReader<impl Read>) {
    if !packets.complete() {
        say(format_args!("{name}: ends without an index: it may have been cut after its last whole frame"));
    }
}

/// The name of an input in messages.
pub(crate) fn name(path: &Path) -> String {
    if is_pipe(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// Opens a file.
pub(crate) fn open_file(path: &Path) -> Result<BufReader<File>> {
    if is_pipe(path) {
        return Err(usage("standard input: this command needs a file, which it can seek in"));
    }
    let file = File::open(path).with_context(|| name(path))?;
    if file.metadata().is_ok_and(|m| m.is_dir()) {
        bail!("{}: a folder, where an .isv file should be", name(path));
    }
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Opens the bytes of a stream, `-` being standard input.
pub(crate) fn source(path: &Path) -> Result<ByteSource> {
    Ok(if is_pipe(path) { Box::new(io::stdin()) } else { Box::new(open_file(path)?) })
}

/// Opens a stream, `-` being standard input, and reads its header.
pub(crate) fn open(path: &Path) -> Result<(PacketReader<ByteSource>, StreamHeader)> {
    let packets = PacketReader::new(source(path)?).with_context(|| name(path))?;
    let packets = packets.with_largest_payload(memory::largest_payload());
    let header = *packets.header().expect("a reader that began at the header has it");
    Ok((packets, header))
}

/// Finds the frames of a stream in a file; what follows a cut is not there.
pub(crate) fn load_index(path: &Path) -> Result<StreamIndex> {
    StreamIndex::load(&mut open_file(path)?).with_context(|| name(path))
}

/// A frame of a stream.
#[derive(Debug)]
pub(crate) struct StreamFrame {
    /// Its number in the stream.
    pub(crate) number: usize,
    /// When it is shown.
    pub(crate) timestamp_ns: u64,
    /// What was decoded.
    pub(crate) volume: AnyVolume,
    /// The blocks of the full resolution that were coded, in profile `main`.
    pub(crate) coded_blocks: Option<BlockSet>,
    /// Its surface, if that was extracted with it.
    pub(crate) surface: Option<TriangleMesh>,
    /// How long that took.
    pub(crate) decode_ms: f64,
}

/// The field of a decoded frame if its stream coded it away from the surface too: `--band full` in profile `main`.
pub(crate) fn full_band(volume: &SparseVolume, coded_blocks: Option<&BlockSet>) -> Option<SparseVolume> {
    coded_field(volume, coded_blocks?)
}

/// A frame that was decoded in profile `main` with distances wherever it has samples, and not at the surface alone.
pub(crate) fn with_distances(volume: &SparseVolume) -> Result<SparseVolume> {
    let surface = memory::surface(volume, SurfaceOptions::default())?;
    let max_blocks = memory::limits().frame_voxels / volume.grid().edge.block_voxels();
    Ok(redistance(volume, &surface, max_blocks)?)
}

/// Decodes the frames of a stream in order, all of them or a range.
pub(crate) struct StreamFrames {
    name: String,
    header: StreamHeader,
    packets: PacketReader<ByteSource>,
    decoder: AnyDecoder,
    /// Bytes of the file, if it is one.
    length: Option<u64>,
    /// Number of the frame that the decoder began with.
    first: usize,
    /// Number of the next frame to decode.
    next: usize,
    range: Option<FrameRange>,
    /// Whether there was an error, after which nothing can be decoded.
    failed: bool,
}

impl StreamFrames {
    /// Opens a stream, to be decoded at a level of detail by a backend. In a file, decoding begins at the last keyframe before the
    /// range; on a pipe, at the start.
    pub(crate) fn open(
        path: &Path,
        range: Option<FrameRange>,
        lod: Lod,
        backend: BackendArgs,
    ) -> Result<Self> {
        let (mut packets, header) = open(path)?;
        let mut first = 0;
        if let Some(range) = range.filter(|_| path.is_file()) {
            (packets, first) = seek(path, range)?;
        }
        let decoder = backend.decoder(&header, lod).with_context(|| name(path))?;
        let length = path.metadata().ok().filter(std::fs::Metadata::is_file).map(|file| file.len());
        Ok(Self {
            name: name(path),
            header,
            packets,
            decoder,
            length,
            first,
            next: first,
            range,
            failed: false,
        })
    }

    /// The header of the stream.
    pub(crate) fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// Of a stream opened without a range, only a range that [`Capture::range`](crate::capture::Capture::range) gave.
    pub(crate) fn limited_to(mut self, range: Range<usize>) -> Self {
        self.range = (range != (0..usize::MAX)).then_some(FrameRange { start: range.start, end: range.end });
        self
    }

    /// The frames with their surfaces, where they are decoded on a GPU.
    pub(crate) fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self> {
        self.decoder = self.decoder.with_surfaces(options)?;
        Ok(self)
    }

    /// Decodes up to the next frame inside the range.
    fn advance(&mut self) -> Result<Option<StreamFrame>> {
        loop {
            if self.range.is_some_and(|range| self.next >= range.end) {
                return Ok(None);
            }
            let Some(packet) = self.packets.next_frame().with_context(|| self.name.clone())? else {
                self.range.map_or(Ok(0..0), |range| range.within(self.next, &self.name))?;
                say_if_cut(&self.name, &self.packets);
                if self.packets.complete()
                    && let Some(behind) = self.length.map(|length| length.saturating_sub(self.packets.at()))
                    && behind > 0
                {
                    let name = &self.name;
                    say(format_args!("{name}: {behind} bytes follow the end of the stream and are left out"));
                }
                return Ok(None);
            };
            let (decoded, decode_ms) = timed(|| self.decoder.decode(&packet));
            let decoded = decoded.map_err(|error| fault(&self.name, self.first, error))?;
            if let Some(why) = self.decoder.take_notice() {
                backend::notify(&why);
            }
            let number = self.next;
            self.next += 1;
            if self.range.is_none_or(|range| number >= range.start) {
                return Ok(Some(StreamFrame {
                    number,
                    timestamp_ns: packet.header.timestamp_ns,
                    volume: decoded.volume,
                    coded_blocks: decoded.coded_blocks,
                    surface: decoded.surface,
                    decode_ms,
                }));
            }
        }
    }
}

impl Iterator for StreamFrames {
    type Item = Result<StreamFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let frame = self.advance().transpose();
        self.failed = matches!(frame, Some(Err(_)));
        frame
    }
}

/// A reader at the last keyframe before a range, and the number of that frame.
fn seek(path: &Path, range: FrameRange) -> Result<(PacketReader<ByteSource>, usize)> {
    let index = load_index(path)?;
    let range = range.within(index.frames.len(), &name(path))?;
    let keyframe = index
        .keyframe_before(range.start)
        .ok_or_else(|| anyhow!("{}: no keyframe at or before frame {}", name(path), range.start))?;
    let at = index.frames[keyframe].at;
    let mut file = open_file(path)?;
    file.seek(SeekFrom::Start(at)).with_context(|| name(path))?;
    let packets = PacketReader::at_packet(Box::new(file) as ByteSource, at);
    Ok((packets.with_largest_payload(memory::largest_payload()), keyframe))
}

/// Whether an error is one of bytes that were damaged or lost, so that others of the stream may be sound.
pub(crate) fn is_loss(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| match (cause.downcast_ref(), cause.downcast_ref()) {
        (Some(FormatError::Checksum { at, .. }), _) => *at > 0,
        (Some(FormatError::Truncated { at, .. }), _) => *at > StreamHeader::BYTES as u64,
        (Some(FormatError::Malformed { at, .. }), _) => *at >= StreamHeader::BYTES as u64,
        (_, Some(error)) => is_missing(error),
        _ => false,
    })
}

/// An error, with what helps against it where bytes were damaged or lost. A repaired stream can still miss frames, where others make whole again
/// what followed them.
pub(crate) fn advise_repair(error: anyhow::Error) -> anyhow::Error {
    match error.chain().any(|cause| cause.downcast_ref().is_some_and(is_missing)) {
        true => anyhow!("{error:#}: isv decode --after-loss hold goes on behind it"),
        false if is_loss(&error) => anyhow!("{error:#}: isv repair keeps what is sound"),
        false => error,
    }
}

/// Whether an error is one of a frame that is not there.
fn is_missing(error: &DecodeError) -> bool {
    matches!(error, DecodeError::NoReference { .. } | DecodeError::MissingFrame { .. })
}

/// Whether an error is one of bytes that end too early: nothing comes behind it.
pub(crate) fn is_cut(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| matches!(cause.downcast_ref(), Some(FormatError::Truncated { .. })))
}

/// A decoder's error with the name of the stream, and its frame counted from the stream's start. `first` is the number
/// of the frame that the decoder began with.
pub(crate) fn fault(name: &str, first: usize, error: DecodeError) -> anyhow::Error {
    let first = first as u64;
    let error = match error {
        DecodeError::Malformed { frame, at, what } => {
            DecodeError::Malformed { frame: first + frame, at, what }
        }
        DecodeError::HashMismatch { frame, stated, found } => {
            DecodeError::HashMismatch { frame: first + frame, stated, found }
        }
        other => other,
    };
    let is_large = matches!(error, DecodeError::TooManyBlocks { .. } | DecodeError::TooFewBytes { .. });
    let error = match memory::chosen() {
        _ if !is_large => anyhow::Error::from(error),
        Some(size) => anyhow!("{error}: that is what --max-memory {size} has room for"),
        None => anyhow!("{error}: --max-memory with a larger amount allows it"),
    };
    error.context(name.to_owned())
}
