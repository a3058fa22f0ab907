//! Streams into MP4 files and out of them, and the tracks beside them.

use super::output::Tracks;
use super::{
    EditError, JoinedTimes, StreamBytes, StreamError, StreamFault, StreamOutput, StreamSummary, open_file,
    source,
};
use crate::{Event, FrameRange, Input, MemoryLimit, Observer};
use isv_format::{PacketReader, StreamHeader};
use isv_mp4::{Chained, Mp4Error, Mp4File, OtherEnd, SampleSource, Track, TrackKind, TrackSource, Trimmed};
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;

/// Puts a stream into an MP4 file, byte for byte, and returns the file's sink and the number of frames. The file is complete.
///
/// # Errors
/// [`EditError`]: a stream that is damaged, cut off or has no frame, and what reading and writing may fail by.
pub fn mux<W: Write>(
    input: &Input,
    memory: MemoryLimit,
    observer: &dyn Observer,
    create: impl FnOnce() -> io::Result<StreamOutput<W>>,
) -> Result<(W, usize), EditError> {
    let name = input.name();
    let fault = |error: isv_format::FormatError| EditError::from(StreamFault::from(error).in_stream(&name));
    let mut begin = source(input)?;
    let mut header = Vec::new();
    begin
        .by_ref()
        .take(StreamHeader::BYTES as u64)
        .read_to_end(&mut header)
        .map_err(|error| fault(error.into()))?;
    // Of what is no stream no file is made.
    drop(PacketReader::new(&header[..]).map_err(fault)?);
    let source = io::Cursor::new(header).chain(begin);
    let tee = Tee { source, sink: create()?, failed: None };
    let mut packets = PacketReader::new(tee).map_err(fault)?.with_largest_payload(memory.largest_payload());
    let mut frames = 0;
    let end = loop {
        match packets.next_frame() {
            Ok(Some(_)) => frames += 1,
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    let end_at = packets.complete().then(|| packets.at());
    let Tee { sink, failed, .. } = packets.into_source();
    if let Some(error) = failed {
        return Err(EditError::Create(error));
    }
    end.map_err(fault)?;
    if frames == 0 {
        return Err(StreamFault::EndsBefore { frame: 0 }.in_stream(&name).into());
    }
    match end_at {
        Some(end) => super::tell_if_more(input, end, observer),
        None => observer.event(&Event::Cut { name: name.clone() }),
    }
    super::tell_if_left_out(&name, sink.left_out(), observer);
    let (output, ends) = sink.finish_with_ends().map_err(write_error)?;
    tell_of_ends(&name, &ends, observer);
    Ok((output, frames))
}

/// Tells which tracks beside a stream are longer or shorter than its geometry.
pub fn tell_of_ends(name: &str, ends: &[OtherEnd], observer: &dyn Observer) {
    for end in ends {
        observer.event(&Event::OtherEnd { name: name.to_owned(), end: *end });
    }
}

/// Takes the stream out of an MP4 file, byte for byte, and returns the sink.
///
/// # Errors
/// [`EditError`]: a file that is no MP4 file with a frame of geometry, and what reading and writing may fail by.
pub fn demux<W: Write>(
    input: &Input,
    observer: &dyn Observer,
    create: impl FnOnce() -> io::Result<W>,
) -> Result<W, EditError> {
    let fault = |fault: StreamFault| EditError::from(fault.in_stream(&input.name()));
    let mut stream = open_file(input)?;
    let file = stream.mp4().ok_or_else(|| fault(Mp4Error::NotMp4.into()))?;
    let geometry = file.track_of(TrackKind::Geometry).map_err(|error| fault(error.into()))?;
    if file.tracks()[geometry].samples.is_empty() {
        return Err(fault(StreamFault::EndsBefore { frame: 0 }));
    }
    if !file.is_whole() {
        observer.event(&Event::Cut { name: input.name() });
    }
    let mut sink = create()?;
    io::copy(&mut stream, &mut sink)?;
    Ok(sink)
}

/// The tracks beside the stream in an MP4 file, for the stream's frames in a range: their times begin with its first frame's. None beside
/// a stream in a file of its own or in a pipe.
///
/// # Errors
/// [`StreamError`], which names the file.
pub fn tracks_beside(input: &Input, frames: Option<FrameRange>) -> Result<Tracks, StreamError> {
    let Some(file) = mp4_file(input)? else { return Ok(Tracks::new()) };
    let named = |fault: StreamFault| fault.in_stream(&input.name());
    let geometry = file.track_of(TrackKind::Geometry).map_err(|error| named(error.into()))?;
    let (begin_ns, end_ns) = match frames {
        None => (0, u64::MAX),
        Some(frames) => {
            let samples = &file.tracks()[geometry].samples;
            let range = frames.within(samples.len()).map_err(|error| named(error.into()))?;
            let shown =
                |frame: usize| samples.get(frame).map(|sample| file.tracks()[geometry].shown_ns(sample));
            (shown(range.start).unwrap_or(0), shown(range.end).unwrap_or(u64::MAX))
        }
    };
    let others = (0..file.tracks().len()).filter(|track| is_kept(&file.tracks()[*track]));
    let others: Vec<_> = others.collect();
    let mut tracks = Tracks::new();
    for track in others {
        // Each reads at its own pace.
        let file = mp4_file(input)?.ok_or_else(|| named(StreamFault::Changed))?;
        let whole = Box::new(TrackSource::new(file, track).map_err(|error| named(error.into()))?);
        tracks.push(match frames {
            None => whole,
            Some(_) => Box::new(Trimmed::new(whole, begin_ns, end_ns)),
        });
    }
    Ok(tracks)
}

/// The tracks beside streams that are joined, each where its stream is in time. `None` if the files do not have tracks of the same
/// codecs.
///
/// # Errors
/// [`StreamError`], which names a file.
pub fn tracks_beside_all(inputs: &[Input], times: JoinedTimes) -> Result<Option<Tracks>, StreamError> {
    let mut chains: Option<Vec<Chain>> = None;
    let (mut begin_ns, mut first_ns) = (0u64, None);
    for input in inputs {
        let tracks = tracks_beside(input, None)?;
        if times == JoinedTimes::Keep && !tracks.is_empty() {
            let stated_ns = first_timestamp_ns(input)?;
            let since_first = stated_ns.saturating_sub(*first_ns.get_or_insert(stated_ns));
            begin_ns = begin_ns.max(since_first);
        }
        let chains = chains.get_or_insert_with(|| tracks.iter().map(|_| Vec::new()).collect());
        if chains.len() != tracks.len() {
            return Ok(None);
        }
        for (chain, track) in chains.iter_mut().zip(tracks) {
            if chain.first().is_some_and(|(_, first)| first.description() != track.description()) {
                return Ok(None);
            }
            chain.push((begin_ns, track));
        }
        begin_ns = begin_ns.saturating_add(geometry_ns(input)?);
    }
    Ok(Some(chains.unwrap_or_default().into_iter().map(|chain| Box::new(Chained::new(chain)) as _).collect()))
}

/// Tracks that follow each other, with the times (ns) at which they begin.
type Chain = Vec<(u64, Box<dyn SampleSource>)>;

/// Time stamp of the first packet of a stream; 0 if there is none.
fn first_timestamp_ns(input: &Input) -> Result<u64, StreamError> {
    Ok(StreamSummary::read(input)?.packets.first().map_or(0, |first| first.timestamp_ns))
}

/// Time (ns) that the geometry of an MP4 file takes to show; 0 for a stream in a file of its own.
fn geometry_ns(input: &Input) -> Result<u64, StreamError> {
    let Some(file) = mp4_file(input)? else { return Ok(0) };
    let geometry = file.track_of(TrackKind::Geometry);
    let geometry = geometry.map_err(|error| StreamFault::from(error).in_stream(&input.name()))?;
    let track = &file.tracks()[geometry];
    let begin_ns = track.samples.first().map_or(0, |first| track.shown_ns(first));
    Ok(((track.end_s() * 1e9).round() as u64).saturating_sub(begin_ns))
}

/// The sound of a file, to lie beside a stream.
///
/// # Errors
/// [`Mp4Error`]: no sound that can be taken.
#[cfg(feature = "sound")]
pub fn sound(path: &Path, options: isv_mp4::SoundOptions) -> Result<Box<dyn SampleSource>, Mp4Error> {
    isv_mp4::open_sound(File::open(path)?, options)
}

/// The sound of a file, to lie beside a stream, with the default options.
///
/// # Errors
/// [`Mp4Error`]: no sound that can be taken.
#[cfg(feature = "sound")]
pub fn default_sound(path: &Path) -> Result<Box<dyn SampleSource>, Mp4Error> {
    sound(path, isv_mp4::SoundOptions::default())
}

/// The track of sound of an MP4 file, to lie beside a stream.
///
/// # Errors
/// [`Mp4Error`]: no MP4 file with sound.
#[cfg(not(feature = "sound"))]
pub fn default_sound(path: &Path) -> Result<Box<dyn SampleSource>, Mp4Error> {
    track_of(path, TrackKind::Sound)
}

/// The track of pictures of an MP4 file, to lie beside a stream.
///
/// # Errors
/// [`Mp4Error`]: no MP4 file with pictures.
pub fn picture(path: &Path) -> Result<Box<dyn SampleSource>, Mp4Error> {
    track_of(path, TrackKind::Picture)
}

fn track_of(path: &Path, kind: TrackKind) -> Result<Box<dyn SampleSource>, Mp4Error> {
    let file = Mp4File::open(BufReader::new(File::open(path)?))?;
    let track = file.track_of(kind)?;
    Ok(Box::new(TrackSource::new(file, track)?))
}

/// Whether a track is copied with geometry.
fn is_kept(track: &Track) -> bool {
    matches!(track.description.kind, TrackKind::Sound | TrackKind::Picture)
}

/// The MP4 file of a stream; `None` if it is in a file of its own or comes through a pipe.
fn mp4_file(input: &Input) -> Result<Option<Mp4File<BufReader<File>>>, StreamError> {
    match input.path() {
        Some(path) if path.is_file() => Ok(StreamBytes::into_mp4(open_file(input)?)),
        _ => Ok(None),
    }
}

/// An error of an MP4 file that is written.
pub fn write_error(error: Mp4Error) -> EditError {
    match error {
        Mp4Error::Io(error) => EditError::Create(error),
        Mp4Error::Stream(error) => EditError::Write(error),
        other => EditError::Create(io::Error::other(other)),
    }
}

/// Gives what it reads to a sink, too.
struct Tee<R, W> {
    source: R,
    sink: W,
    /// The first error of the sink.
    failed: Option<io::Error>,
}

impl<R: Read, W: Write> Read for Tee<R, W> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.source.read(buffer)?;
        if let Err(error) = self.sink.write_all(&buffer[..read]) {
            self.failed.get_or_insert(error);
            return Err(io::ErrorKind::WriteZero.into());
        }
        Ok(read)
    }
}
