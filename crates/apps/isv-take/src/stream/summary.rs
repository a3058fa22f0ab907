//! Summaries of streams, without decoding them.

use super::{StreamError, StreamFault, open_file};
use crate::Input;
#[cfg(feature = "io")]
use crate::metadata::Metadata;
use crate::timeline::Timeline;
use isv_format::{FormatError, FrameCoding, FramePayload, Packet, PacketKind, PacketReader, Prediction};
use isv_format::{Profile, StreamHeader};
use std::io::Read;

/// Header, packets and duration of a stream.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StreamSummary {
    /// Header of the stream.
    pub header: StreamHeader,
    /// What the stream says of itself.
    #[cfg(feature = "io")]
    pub metadata: Option<Metadata>,
    /// Frame packets, up to the end or a cut.
    pub packets: Vec<PacketSummary>,
    /// Number of other packets, whose types this build does not know.
    pub unknown_packets: usize,
    /// Time (s) from when the first frame is shown to when the last one is no longer.
    pub duration_s: f64,
    /// Bytes of the file; of a pipe, those of the stream.
    pub bytes: u64,
    /// Bytes of the stream and what is behind it: those of the file, but for an MP4 file.
    pub stream_bytes: u64,
    /// Tracks of the MP4 file that the stream is in, the stream's included; none in an `.isv` file.
    #[cfg(feature = "io")]
    pub tracks: Vec<TrackSummary>,
    /// Bytes of the file behind the end of the stream, where there should be none.
    pub bytes_behind: u64,
    /// Whether index and trailer are there, with which a writer ends.
    pub is_complete: bool,
}

/// Header fields of a frame packet.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct PacketSummary {
    /// Bytes of header and payload.
    pub bytes: usize,
    /// Bytes of the geometry part of the payload.
    pub bytes_geometry: usize,
    /// Bytes of the colour part of the payload, without its length; 0 if there is none.
    pub bytes_colour: usize,
    /// Whether decoding can begin here.
    pub keyframe: bool,
    /// Blocks that it codes.
    pub blocks: u32,
    /// Prediction of its blocks.
    pub prediction: Prediction,
    /// Whether a decoder that lost something can go on here, though it is no keyframe.
    pub resilient: bool,
    /// Time when it is shown (ns).
    pub timestamp_ns: u64,
}

impl StreamSummary {
    /// Reads the packets of a stream.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn read(input: &Input) -> Result<Self, StreamError> {
        let mut source = open_file(input)?;
        let read = || {
            let file = input.path().ok_or(StreamFault::NoFile)?.metadata()?;
            let length = if file.is_file() { Some(source.length()?) } else { None };
            #[cfg(feature = "io")]
            let tracks = source.mp4().map_or_else(Vec::new, TrackSummary::all);
            let mut reader = PacketReader::new(source)?;
            let header = *reader.header();
            let packets = read_packets(&mut reader, &header.profile)?;
            // A pipe has no length but what was read of it.
            let stream_bytes = length.unwrap_or(reader.at());
            let bytes = length.map_or(stream_bytes, |_| file.len());
            let is_complete = reader.complete();
            let bytes_behind = if is_complete { stream_bytes.saturating_sub(reader.at()) } else { 0 };
            let unknown_packets = reader.skipped();
            #[cfg(feature = "io")]
            let metadata = reader.metadata().and_then(Metadata::parse);
            let mut timeline = Timeline::new(header.frame_rate);
            packets.iter().for_each(|packet: &PacketSummary| _ = timeline.place(packet.timestamp_ns));
            let duration_s = timeline.end_s();
            Ok(Self {
                header,
                #[cfg(feature = "io")]
                metadata,
                packets,
                unknown_packets,
                duration_s,
                bytes,
                stream_bytes,
                #[cfg(feature = "io")]
                tracks,
                bytes_behind,
                is_complete,
            })
        };
        read().map_err(|fault: StreamFault| fault.in_stream(&input.name()))
    }

    /// Megabits a second of the stream; 0 if it takes no time to show.
    #[must_use]
    pub fn mbps(&self) -> f64 {
        let bits = (self.stream_bytes - self.bytes_behind) as f64 * 8.0;
        if self.duration_s > 0.0 { bits / self.duration_s / 1e6 } else { 0.0 }
    }
}

/// A track of an MP4 file. The names of the fields are keys of `isv info --json`.
#[cfg(feature = "io")]
#[derive(Clone, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct TrackSummary {
    /// What it holds: `geometry`, `sound`, `picture` or `other`.
    pub kind: &'static str,
    /// Type of its sample entry, such as `isv1`, `mp4a`, `Opus` or `avc1`.
    pub codec: String,
    /// Language (ISO 639-2), `und` if it is not known.
    pub language: String,
    /// Number of samples.
    pub samples: usize,
    /// Time (s) at which the last sample ends.
    pub end_s: f64,
    /// Time (s) by which it is longer than geometry; below 0 if it is shorter.
    pub longer_s: f64,
    /// Bytes of all samples.
    pub bytes: u64,
}

#[cfg(feature = "io")]
impl TrackSummary {
    /// Facts of the tracks of a file.
    fn all<S: Read + std::io::Seek>(file: &isv_mp4::Mp4File<S>) -> Vec<Self> {
        let tracks = file.tracks();
        let geometry = tracks.iter().find(|track| track.description.kind == isv_mp4::TrackKind::Geometry);
        let geometry_s = geometry.map_or(0.0, isv_mp4::Track::end_s);
        tracks.iter().map(|track| Self::new(track, geometry_s)).collect()
    }

    /// Facts of a track beside geometry that ends at a time (s).
    fn new(track: &isv_mp4::Track, geometry_s: f64) -> Self {
        Self {
            kind: track.description.kind.name(),
            codec: track.description.codec(),
            language: track.description.language.clone(),
            samples: track.samples.len(),
            end_s: track.end_s(),
            longer_s: track.end_s() - geometry_s,
            bytes: track.bytes(),
        }
    }
}

/// The packets up to the end, or up to a cut.
fn read_packets(
    reader: &mut PacketReader<impl Read>,
    profile: &Profile,
) -> Result<Vec<PacketSummary>, FormatError> {
    let mut packets = Vec::new();
    loop {
        match reader.next_frame() {
            Ok(Some(packet)) => packets.push(PacketSummary::new(&packet, profile)?),
            Ok(None) | Err(FormatError::Truncated { .. }) => return Ok(packets),
            Err(error) => return Err(error),
        }
    }
}

impl PacketSummary {
    fn new(packet: &Packet, profile: &Profile) -> Result<Self, FormatError> {
        let hashed = matches!(packet.header.kind, PacketKind::Frame { hashed: true, .. });
        let parts = packet.parts()?;
        let frame = FramePayload::parse(parts.geometry, packet.payload_at(), hashed, profile)?.header;
        Ok(Self {
            bytes: packet.total_bytes(),
            bytes_geometry: parts.geometry.len(),
            bytes_colour: parts.colour.map_or(0, <[u8]>::len),
            keyframe: packet.is_keyframe(),
            blocks: frame.blocks,
            prediction: frame.prediction(),
            resilient: matches!(frame.coding, FrameCoding::Main(main) if main.kind.is_resilient()),
            timestamp_ns: packet.header.timestamp_ns,
        })
    }
}
