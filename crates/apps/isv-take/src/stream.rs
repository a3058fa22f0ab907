//! Streams from `.isv` and MP4 files and from pipes: decoded frame by frame, checked, repaired, cut and joined.

mod bytes;
mod concealing;
mod cut;
mod error;
#[cfg(feature = "io")]
mod info;
mod join;
#[cfg(feature = "io")]
mod mux;
#[cfg(feature = "io")]
mod output;
mod repair;
mod summary;
mod verify;

pub use bytes::{StreamBytes, StreamFile};
pub use concealing::ConcealingFrames;
pub use cut::cut;
pub use error::{EditError, StreamError, StreamFault, damage_in_words};
#[cfg(feature = "io")]
pub use info::{PacketInfo, PaperInfo, StreamInfo};
pub use join::{JoinedTimes, join};
#[cfg(feature = "sound")]
pub use mux::sound;
#[cfg(feature = "io")]
pub use mux::{
    default_sound, demux, mux, picture, tell_of_ends, tracks_beside, tracks_beside_all, write_error,
};
#[cfg(feature = "io")]
pub use output::{Container, StreamOutput, Tracks, check_output, tracks_kept_in};
pub use repair::{Repaired, repair};
#[cfg(feature = "io")]
pub use summary::TrackSummary;
pub use summary::{PacketSummary, StreamSummary};
pub use verify::{Verified, verify};

use crate::device::{DecodedVolume, StreamDecoder};
#[cfg(feature = "io")]
use crate::metadata::Metadata;
use crate::{Event, FrameRange, Input, MemoryLimit, Observer, OpenDevice};
use isv_decode::Lod;
use isv_decode::colour::ColourFrame;
use isv_format::{MetadataText, PacketReader, StreamHeader, StreamIndex};
use isv_surface::SurfaceOptions;
use isv_volume::{BlockSet, TriangleMesh};
use std::fs::{self, File};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// Bytes from a file or a pipe.
pub type ByteSource = Box<dyn Read + Send>;

/// Bytes in which a reader can go to any place.
pub trait SeekableBytes: Read + Seek + Send {}

impl<S: Read + Seek + Send> SeekableBytes for S {}

/// Opens the file of a stream, an `.isv` or an MP4 file.
///
/// # Errors
/// [`StreamError`], which names it.
pub fn open_file(input: &Input) -> Result<StreamFile, StreamError> {
    let open = || {
        let file = File::open(input.path().ok_or(StreamFault::NoFile)?)?;
        let metadata = file.metadata();
        if metadata.as_ref().is_ok_and(fs::Metadata::is_dir) {
            return Err(StreamFault::Folder);
        }
        let is_file = metadata.is_ok_and(|found| found.is_file());
        let source = BufReader::with_capacity(1 << 16, file);
        // What has come out of a pipe cannot be put back.
        if is_file { StreamFile::new(source) } else { Ok(StreamFile::plain(source)) }
    };
    open().map_err(|fault: StreamFault| fault.in_stream(&input.name()))
}

/// Opens the bytes of a stream.
///
/// # Errors
/// [`StreamError`], which names it.
pub fn source(input: &Input) -> Result<ByteSource, StreamError> {
    Ok(match input {
        Input::StandardInput => piped(io::stdin()),
        Input::Path(path) if path.is_file() => Box::new(open_file(input)?),
        Input::Path(_) => piped(open_file(input)?),
    })
}

/// Bytes of a stream that come once, as such or in an MP4 file. None is read before the first is asked for.
pub(crate) fn piped(source: impl Read + Send + 'static) -> ByteSource {
    #[cfg(feature = "io")]
    return Box::new(isv_mp4::Unwrapped::new(source));
    #[cfg(not(feature = "io"))]
    Box::new(source)
}

/// Opens a stream and reads its header.
///
/// # Errors
/// [`StreamError`], which names it.
pub fn open(
    input: &Input,
    memory: MemoryLimit,
) -> Result<(PacketReader<ByteSource>, StreamHeader), StreamError> {
    begin(&input.name(), source(input)?, memory)
}

fn begin(
    name: &str,
    source: ByteSource,
    memory: MemoryLimit,
) -> Result<(PacketReader<ByteSource>, StreamHeader), StreamError> {
    let packets = PacketReader::new(source).map_err(|error| StreamFault::from(error).in_stream(name))?;
    let packets = packets.with_largest_payload(memory.largest_payload());
    let header = *packets.header();
    Ok((packets, header))
}

/// Bytes of a stream in bytes that can be sought in and that may be those of an MP4 file. `name` is theirs in messages.
///
/// # Errors
/// [`StreamError`], which names them.
pub fn seekable<S: Read + Seek>(name: &str, source: S) -> Result<StreamBytes<S>, StreamError> {
    StreamBytes::new(source).map_err(|fault| fault.in_stream(name))
}

/// What a stream in a file says of itself; `None` if that is nothing.
///
/// # Errors
/// [`StreamError`], which names it.
#[cfg(feature = "io")]
pub fn metadata(input: &Input) -> Result<Option<Metadata>, StreamError> {
    Ok(metadata_text(input)?.as_ref().and_then(Metadata::parse))
}

/// What a stream in bytes says of itself; `None` if that is nothing. `name` is theirs in messages.
///
/// # Errors
/// [`StreamError`], which names them.
#[cfg(feature = "io")]
pub fn metadata_of(name: &str, source: ByteSource) -> Result<Option<Metadata>, StreamError> {
    let (packets, _) = begin(name, source, MemoryLimit::default())?;
    Ok(text_before_frames(packets).as_ref().and_then(Metadata::parse))
}

/// The text of what a stream in a file says of itself.
fn metadata_text(input: &Input) -> Result<Option<MetadataText>, StreamError> {
    Ok(text_before_frames(open(input, MemoryLimit::default())?.0))
}

fn text_before_frames(mut packets: PacketReader<ByteSource>) -> Option<MetadataText> {
    // It stands before the first frame. Whether that is sound is for others to find.
    let _ = packets.next_frame();
    packets.metadata().cloned()
}

/// Finds the frames of a stream in a file; what follows a cut is not there.
///
/// # Errors
/// [`StreamError`], which names it.
pub fn load_index(input: &Input) -> Result<StreamIndex, StreamError> {
    index_of(&input.name(), &mut open_file(input)?)
}

/// Finds the frames of a stream in bytes; what follows a cut is not there. `name` is theirs in messages.
///
/// # Errors
/// [`StreamError`], which names them.
pub fn index_of(name: &str, source: &mut (impl Read + Seek)) -> Result<StreamIndex, StreamError> {
    StreamIndex::load(source).map_err(|error| StreamFault::from(error).in_stream(name))
}

/// What a reader does where packets are damaged or missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum AfterLoss {
    /// Ends with an error.
    #[default]
    Stop,
    /// Holds the last frame in place of each lost one, and goes on where that can be.
    Hold,
}

/// A frame of a stream.
#[derive(Debug)]
pub struct StreamFrame {
    /// Number in the stream.
    pub number: usize,
    /// Time at which it is shown, in nanoseconds.
    pub timestamp_ns: u64,
    /// What was decoded.
    pub volume: DecodedVolume,
    /// Blocks of the full resolution that were coded, in profile `main`.
    pub coded_blocks: Option<BlockSet>,
    /// Colour, if the stream has any and it was asked for.
    pub colour: Option<Arc<ColourFrame>>,
    /// Surface, if it was extracted with the frame.
    pub surface: Option<TriangleMesh>,
    /// Time that decoding took (ms).
    pub decode_ms: f64,
}

/// How a stream is decoded.
#[derive(Clone)]
pub struct DecodeSettings {
    /// Frames to decode; `None` for all.
    pub frames: Option<FrameRange>,
    /// Level of detail.
    pub lod: Lod,
    /// Whether colour is decoded, where there is any.
    pub colour: bool,
    /// The device that does the arithmetic.
    pub device: OpenDevice,
    /// Memory for frames.
    pub memory: MemoryLimit,
    /// Observer of what happens.
    pub observer: Arc<dyn Observer>,
}

/// Decodes the frames of a stream in order, all of them or a range.
pub struct StreamFrames {
    name: String,
    header: StreamHeader,
    packets: PacketReader<ByteSource>,
    decoder: StreamDecoder,
    observer: Arc<dyn Observer>,
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
    /// Opens a stream. In a file, decoding begins at the last keyframe before the range; on a pipe, at the start.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn open(input: &Input, settings: &DecodeSettings) -> Result<Self, StreamError> {
        let name = input.name();
        if input.path().is_none_or(|path| !path.is_file()) {
            return Self::from_source(&name, source(input)?, settings);
        }
        let mut file = open_file(input)?;
        let length = file.length().map_err(|error| StreamFault::from(error).in_stream(&name))?;
        Ok(Self { length: Some(length), ..Self::from_stream_bytes(&name, file, settings)? })
    }

    /// Reads a stream from bytes as they come; `name` is theirs in messages.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn from_source(
        name: &str,
        source: ByteSource,
        settings: &DecodeSettings,
    ) -> Result<Self, StreamError> {
        let (packets, header) = begin(name, source, settings.memory)?;
        Self::new(name.to_owned(), header, packets, settings)
    }

    /// Reads a stream from bytes that can be sought in, an MP4 file's too. Decoding begins at the last keyframe before the range.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn from_seekable(
        name: &str,
        source: Box<dyn SeekableBytes>,
        settings: &DecodeSettings,
    ) -> Result<Self, StreamError> {
        Self::from_stream_bytes(name, seekable(name, source)?, settings)
    }

    fn from_stream_bytes(
        name: &str,
        mut source: StreamBytes<impl Read + Seek + Send + 'static>,
        settings: &DecodeSettings,
    ) -> Result<Self, StreamError> {
        let Some(range) = settings.frames else { return Self::from_source(name, Box::new(source), settings) };
        let header = read_header(name, &mut source)?;
        let (packets, first) = seek(name, source, &header, range, settings.memory)?;
        Ok(Self { first, next: first, ..Self::new(name.to_owned(), header, packets, settings)? })
    }

    fn new(
        name: String,
        header: StreamHeader,
        packets: PacketReader<ByteSource>,
        settings: &DecodeSettings,
    ) -> Result<Self, StreamError> {
        let DecodeSettings { frames: range, lod, colour, device, memory, observer } = settings;
        let decoder = device.decoder(&header, memory.decoder_limits(), *lod, *colour, observer);
        let decoder = decoder.map_err(|fault| fault.in_stream(&name))?;
        let (range, observer) = (*range, Arc::clone(observer));
        let (length, first, next, failed) = (None, 0, 0, false);
        Ok(Self { name, header, packets, decoder, observer, length, first, next, range, failed })
    }

    /// The header of the stream.
    #[must_use]
    pub fn header(&self) -> &StreamHeader {
        &self.header
    }

    /// Limits a stream that was opened without a range to some frames.
    #[must_use]
    pub fn limited_to(mut self, range: Range<usize>) -> Self {
        self.range = (range != (0..usize::MAX)).then_some(FrameRange { start: range.start, end: range.end });
        self
    }

    /// The frames with their surfaces, where they are decoded on a GPU.
    ///
    /// # Errors
    /// [`StreamError`] if the GPU fails.
    pub fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self, StreamError> {
        self.decoder = self
            .decoder
            .with_surfaces(options)
            .map_err(|error| StreamFault::from(error).in_stream(&self.name))?;
        Ok(self)
    }

    /// Decodes up to the next frame inside the range.
    fn advance(&mut self) -> Result<Option<StreamFrame>, StreamFault> {
        loop {
            if self.range.is_some_and(|range| self.next >= range.end) {
                return Ok(None);
            }
            let Some(packet) = self.packets.next_frame()? else {
                self.range.map_or(Ok(0..0), |range| range.within(self.next))?;
                tell_if_cut(&self.name, &self.packets, &*self.observer);
                if self.packets.complete()
                    && let Some(behind) = self.length.map(|length| length.saturating_sub(self.packets.at()))
                    && behind > 0
                {
                    self.observer.event(&Event::BytesBehindEnd { name: self.name.clone(), bytes: behind });
                }
                return Ok(None);
            };
            let (decoded, decode_ms) = timed(|| self.decoder.decode(&packet));
            let decoded = decoded.map_err(|error| StreamFault::decoding(self.first, error))?;
            let number = self.next;
            self.next += 1;
            if self.range.is_none_or(|range| number >= range.start) {
                return Ok(Some(StreamFrame {
                    number,
                    timestamp_ns: packet.header.timestamp_ns,
                    volume: decoded.volume,
                    coded_blocks: decoded.coded_blocks,
                    surface: decoded.surface,
                    colour: decoded.colour,
                    decode_ms,
                }));
            }
        }
    }
}

impl Iterator for StreamFrames {
    type Item = Result<StreamFrame, StreamError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let frame = self.advance().map_err(|fault| fault.in_stream(&self.name)).transpose();
        self.failed = matches!(frame, Some(Err(_)));
        frame
    }
}

/// A reader at the last keyframe before a range, and the number of that frame.
fn seek(
    name: &str,
    mut source: impl Read + Seek + Send + 'static,
    header: &StreamHeader,
    range: FrameRange,
    memory: MemoryLimit,
) -> Result<(PacketReader<ByteSource>, usize), StreamError> {
    let mut find = || {
        let index = StreamIndex::load(&mut source)?;
        let range = range.within(index.frames.len())?;
        let no_keyframe = StreamFault::NoKeyframe { frame: range.start };
        let keyframe = index.keyframe_before(range.start).ok_or(no_keyframe)?;
        let at = index.frames[keyframe].at;
        source.seek(SeekFrom::Start(at))?;
        Ok((at, keyframe))
    };
    let (at, keyframe) = find().map_err(|fault: StreamFault| fault.in_stream(name))?;
    let packets = PacketReader::at_packet(Box::new(source) as ByteSource, at, header);
    Ok((packets.with_largest_payload(memory.largest_payload()), keyframe))
}

/// Reads the header of a stream. The source is behind it then.
///
/// # Errors
/// [`StreamError`], which names the stream.
pub fn read_header(name: &str, source: &mut dyn Read) -> Result<StreamHeader, StreamError> {
    let packets = PacketReader::new(source).map_err(|error| StreamFault::from(error).in_stream(name))?;
    Ok(*packets.header())
}

/// Tells that a stream that was read to its end ends without one.
pub fn tell_if_cut(name: &str, packets: &PacketReader<impl Read>, observer: &dyn Observer) {
    if !packets.complete() {
        observer.event(&Event::Cut { name: name.to_owned() });
    }
}

/// Tells that bytes follow the end of a stream, which its copy lacks. `end`: where it ends. What comes out of a pipe is not waited for.
fn tell_if_more(input: &Input, end: u64, observer: &dyn Observer) {
    let file = input.path().and_then(|path| path.metadata().ok()).filter(fs::Metadata::is_file);
    if file.is_none() {
        return;
    }
    let length = open_file(input).ok().and_then(|mut stream| stream.seek(SeekFrom::End(0)).ok());
    if let Some(bytes @ 1..) = length.map(|length| length.saturating_sub(end)) {
        observer.event(&Event::BytesBehindEnd { name: input.name(), bytes });
    }
}

/// Tells that a copy of a stream lacks packets whose types are not known.
fn tell_if_left_out(name: &str, packets: usize, observer: &dyn Observer) {
    if packets > 0 {
        observer.event(&Event::LeftOut { name: name.to_owned(), packets });
    }
}

/// Runs a step and measures it in milliseconds.
pub fn timed<T>(step: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = step();
    (result, start.elapsed().as_secs_f64() * 1e3)
}
