//! A stream taken in as the bytes of an `.isv` file, and written as the track of geometry of an MP4 file.

use crate::geometry::describe;
use crate::interleave::{FragmentSource, write_before};
use crate::{Mp4Error, Mp4Writer, OtherEnd, SampleSource, SourceSample, TrackDescription, is_other_end};
use isv_format::{FormatError, PacketHeader, PacketKind, StreamHeader, StreamIndex};
use std::io::{self, Write};

/// Most bytes and most time (ns) of geometry in a fragment. A longer GOP is divided.
const MOST_BYTES: usize = 1 << 24;
const MOST_NS: u64 = 10_000_000_000;
/// Most tracks beside geometry.
const MOST_TRACKS: usize = 15;

/// A sink for the bytes of a stream that writes them as an MP4 file, with sound and picture beside.
///
/// What writes a stream into a file writes an MP4 file through this: nothing of it knows. A write returns when its bytes are taken;
/// a fragment is written once it is whole. Frames are taken as they are, and checked by nobody but their length and type.
pub struct GeometrySink<W: Write> {
    /// The sink, until the first frame.
    sink: Option<W>,
    writer: Option<Mp4Writer<W>>,
    tracks: Vec<FragmentSource>,
    descriptions: Vec<TrackDescription>,
    stream: StreamState,
    /// Bytes of a part of the stream that is not whole yet.
    part: Vec<u8>,
    /// Bytes before the first frame.
    configuration: Vec<u8>,
    fragment: Vec<SourceSample>,
    fragment_bytes: usize,
    /// The last frame, whose duration the next one tells.
    last: Option<SourceSample>,
    last_ns: u64,
    /// Timestamp of the first frame, with which the movie begins.
    first_ns: Option<u64>,
    left_out: usize,
}

/// What comes next.
enum StreamState {
    Header,
    Packets(StreamHeader),
    Trailer(StreamHeader),
    End(StreamHeader),
}

impl<W: Write> GeometrySink<W> {
    /// Writes to `sink`, with these tracks beside geometry.
    ///
    /// # Errors
    /// More than 15 tracks.
    pub fn new(sink: W, tracks: Vec<Box<dyn SampleSource>>) -> Result<Self, Mp4Error> {
        if tracks.len() > MOST_TRACKS {
            return Err(Mp4Error::TooManyTracks(tracks.len()));
        }
        Ok(Self {
            sink: Some(sink),
            writer: None,
            descriptions: tracks.iter().map(|track| track.description().clone()).collect(),
            tracks: tracks.into_iter().map(FragmentSource::new).collect(),
            stream: StreamState::Header,
            part: Vec::new(),
            configuration: Vec::new(),
            fragment: Vec::new(),
            fragment_bytes: 0,
            last: None,
            last_ns: 0,
            first_ns: None,
            left_out: 0,
        })
    }

    /// Number of packets behind the first frame that an MP4 file has no place for: readers may skip them.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The sink; `None` after an error.
    pub fn sink_mut(&mut self) -> Option<&mut W> {
        self.sink.as_mut().or(self.writer.as_mut().map(Mp4Writer::sink_mut))
    }

    /// Writes what is held, the rest of the other tracks and the end of the file, and gives the sink back.
    ///
    /// # Errors
    /// A stream that ends inside a packet; errors of the sink and of the tracks.
    ///
    /// # Panics
    /// After an error of a write.
    pub fn finish(self) -> Result<W, Mp4Error> {
        self.finish_with_ends().map(|(sink, _)| sink)
    }

    /// Does as [`Self::finish`], and tells which tracks are longer or shorter than geometry.
    ///
    /// # Errors
    /// Errors of [`Self::finish`].
    ///
    /// # Panics
    /// After an error of a write.
    pub fn finish_with_ends(mut self) -> Result<(W, Vec<OtherEnd>), Mp4Error> {
        let header = match self.stream {
            StreamState::Header => {
                return Err(FormatError::Truncated {
                    at: self.part.len() as u64,
                    inside: "the stream header",
                }
                .into());
            }
            StreamState::Packets(header) | StreamState::End(header) => header,
            StreamState::Trailer(_) => {
                return Err(
                    FormatError::Truncated { at: self.part.len() as u64, inside: "the trailer" }.into()
                );
            }
        };
        if !self.part.is_empty() {
            return Err(FormatError::Truncated { at: self.part.len() as u64, inside: "a packet" }.into());
        }
        self.begin(&header)?;
        if let Some(last) = self.last.take() {
            self.push(last)?;
        }
        self.write_fragment()?;
        self.write_others(u64::MAX)?;
        let writer = self.writer.take().expect("begun above");
        let others = other_ends(&writer, &self.descriptions, &header);
        Ok((writer.finish()?, others))
    }

    /// Takes what is whole of the bytes that are held.
    fn take_parts(&mut self) -> Result<(), Mp4Error> {
        let mut at = 0;
        while let Some(taken) = self.take_part(at)? {
            at += taken;
        }
        self.part.drain(..at);
        Ok(())
    }

    /// Takes the part of the stream that begins at byte `at` of what is held, and tells its length; `None` if it is not whole.
    fn take_part(&mut self, at: usize) -> Result<Option<usize>, Mp4Error> {
        let held = &self.part[at..];
        match self.stream {
            StreamState::Header => {
                let Some(bytes) = held.first_chunk::<{ StreamHeader::BYTES }>() else { return Ok(None) };
                let header = StreamHeader::parse(bytes)?;
                self.configuration.extend(bytes);
                self.stream = StreamState::Packets(header);
                Ok(Some(StreamHeader::BYTES))
            }
            StreamState::Packets(header) => {
                let Some(bytes) = held.first_chunk::<{ PacketHeader::BYTES }>() else { return Ok(None) };
                let length = PacketHeader::BYTES + PacketHeader::length(bytes, 0)? as usize;
                let Some(packet) = held.get(..length) else { return Ok(None) };
                let packet = packet.to_vec();
                self.packet(&header, PacketHeader::parse(bytes, 0, &header)?, packet)?;
                Ok(Some(length))
            }
            StreamState::Trailer(header) => {
                let whole = held.len() >= StreamIndex::TRAILER_BYTES;
                if whole {
                    self.stream = StreamState::End(header);
                }
                Ok(whole.then_some(StreamIndex::TRAILER_BYTES))
            }
            StreamState::End(_) if held.is_empty() => Ok(None),
            StreamState::End(_) => {
                Err(Mp4Error::Unsupported("bytes follow the end of the stream".to_owned()))
            }
        }
    }

    fn packet(&mut self, stream: &StreamHeader, header: PacketHeader, data: Vec<u8>) -> Result<(), Mp4Error> {
        match header.kind {
            PacketKind::Frame { keyframe, .. } => {
                self.begin(stream)?;
                self.frame(stream, keyframe, header.timestamp_ns, data)?;
            }
            PacketKind::Index => self.stream = StreamState::Trailer(*stream),
            _ if self.writer.is_none() => self.configuration.extend(data),
            _ => self.left_out += 1,
        }
        Ok(())
    }

    /// Writes the boxes before the first fragment, once.
    fn begin(&mut self, stream: &StreamHeader) -> Result<(), Mp4Error> {
        let Some(sink) = self.sink.take() else { return Ok(()) };
        self.descriptions.insert(0, describe(stream, &self.configuration));
        self.writer = Some(Mp4Writer::new(sink, &self.descriptions)?);
        Ok(())
    }

    fn frame(
        &mut self,
        stream: &StreamHeader,
        sync: bool,
        timestamp_ns: u64,
        data: Vec<u8>,
    ) -> Result<(), Mp4Error> {
        let geometry = &self.descriptions[0];
        let frame = geometry.units_of_ns(stream.frame_rate.timestamp_ns(1)).clamp(1, u32::MAX.into()) as u32;
        let first_ns = *self.first_ns.get_or_insert(timestamp_ns);
        let mut time = geometry.units_of_ns(timestamp_ns.saturating_sub(first_ns));
        if let Some(mut last) = self.last.take() {
            // Times that do not ascend are of a writer without a clock: then frames come at the nominal rate.
            if timestamp_ns <= self.last_ns || time <= last.time {
                time = last.time + u64::from(last.duration);
            }
            // A pause of days is more than a duration can say.
            last.duration = u32::try_from(time - last.time).unwrap_or(u32::MAX);
            self.push(last)?;
        }
        self.last_ns = timestamp_ns;
        self.last = Some(SourceSample { time, duration: frame, composition_offset: 0, sync, data });
        Ok(())
    }

    /// Adds a frame whose duration is known to the fragment, which it may end.
    fn push(&mut self, sample: SourceSample) -> Result<(), Mp4Error> {
        let geometry = &self.descriptions[0];
        let is_full = self.fragment.first().is_some_and(|first| {
            geometry.to_ns(sample.time - first.time) >= MOST_NS
                || self.fragment_bytes + sample.data.len() > MOST_BYTES
        });
        if sample.sync || is_full {
            self.write_fragment()?;
        }
        self.fragment_bytes += sample.data.len();
        self.fragment.push(sample);
        Ok(())
    }

    /// Writes the frames that are held as a fragment, behind what is heard and seen meanwhile.
    fn write_fragment(&mut self) -> Result<(), Mp4Error> {
        let Some(last) = self.fragment.last() else { return Ok(()) };
        let end = last.time + u64::from(last.duration);
        self.write_others(self.descriptions[0].to_ns(end))?;
        self.writer.as_mut().expect("frames come behind the begin").write_fragment(0, &self.fragment)?;
        self.fragment.clear();
        self.fragment_bytes = 0;
        Ok(())
    }

    /// Writes the fragments of the other tracks that begin before a time (ns).
    fn write_others(&mut self, end_ns: u64) -> Result<(), Mp4Error> {
        let writer = self.writer.as_mut().expect("tracks come behind the begin");
        write_before(writer, &mut self.tracks, 1, end_ns)
    }
}

/// The tracks that end earlier or later than geometry, which is the first.
fn other_ends<W: Write>(
    writer: &Mp4Writer<W>,
    descriptions: &[TrackDescription],
    stream: &StreamHeader,
) -> Vec<OtherEnd> {
    let end_s = |track: usize| descriptions[track].shown_ns(writer.end(track)) as f64 / 1e9;
    let geometry_s = end_s(0);
    let frame_s = 1.0 / stream.frame_rate.per_second();
    let others = (1..descriptions.len()).map(|track| OtherEnd {
        track: track + 1,
        kind: descriptions[track].kind,
        end_s: end_s(track),
        geometry_s,
    });
    others.filter(|other| is_other_end(other.longer_s(), frame_s)).collect()
}

impl<W: Write> Write for GeometrySink<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.part.extend(bytes);
        self.take_parts().map_err(|error| match error {
            Mp4Error::Io(error) => error,
            other => io::Error::other(other),
        })?;
        Ok(bytes.len())
    }

    /// Does nothing: a fragment goes out when it is whole.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
