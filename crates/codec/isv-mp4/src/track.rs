//! Tracks: what they hold, and where their samples are.

use crate::boxes::Kind;
use mp4_atom::{Decode, FourCC, Mp4a};

/// Object type of MPEG-4 sound, whose profile says more.
const MPEG4_AUDIO: u8 = 0x40;

/// What a track holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TrackKind {
    /// An `.isv` stream.
    Geometry,
    /// Sound.
    Sound,
    /// Pictures.
    Picture,
    /// Anything else: text, times, data.
    Other,
}

impl TrackKind {
    /// Name in messages: `geometry`, `sound`, `picture` or `other`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Geometry => "geometry",
            Self::Sound => "sound",
            Self::Picture => "picture",
            Self::Other => "other",
        }
    }
}

/// Begin of a track on the time line of the movie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edit {
    /// Time before the track begins (ms).
    pub delay_ms: u32,
    /// Time in the track, in its timescale, of what is heard or seen first. What is before it only warms a decoder up.
    pub media_time: u64,
}

/// All that a track states once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackDescription {
    /// What it holds.
    pub kind: TrackKind,
    /// Units of time a second; not 0.
    pub timescale: u32,
    /// The sample entry, a whole box: codec and its configuration.
    pub sample_entry: Vec<u8>,
    /// Language (ISO 639-2): three letters, `und` if it is not known.
    pub language: String,
    /// Begin on the time line.
    pub edit: Edit,
    /// Width and height of pictures, as 16.16 fixed-point numbers of pixels; 0 without pictures.
    pub size: [u32; 2],
}

impl TrackDescription {
    /// A track without an edit, in no language.
    #[must_use]
    pub fn new(kind: TrackKind, timescale: u32, sample_entry: Vec<u8>) -> Self {
        let (language, edit, size) = ("und".to_owned(), Edit::default(), [0; 2]);
        Self { kind, timescale, sample_entry, language, edit, size }
    }

    /// Type of the sample entry: `mp4a`, `Opus`, `isv1` and so on.
    #[must_use]
    pub fn codec(&self) -> String {
        let kind: Kind =
            self.sample_entry.get(4..8).map_or(*b"    ", |kind| kind.try_into().expect("4 bytes"));
        FourCC::from(kind).to_string()
    }

    /// Name of the codec as manifests state it (RFC 6381), as far as it needs more than the type of the sample entry.
    #[must_use]
    pub fn codec_string(&self) -> String {
        let codec = self.codec();
        match Mp4a::decode(&mut &self.sample_entry[..]).map(|entry| entry.esds.es_desc.dec_config) {
            Ok(config) if config.object_type_indication == MPEG4_AUDIO => {
                let profile = config.dec_specific.map_or(0, |specific| specific.profile);
                format!("{codec}.40.{profile}")
            }
            Ok(config) => format!("{codec}.{:02X}", config.object_type_indication),
            // Browsers know these by names in small letters.
            Err(_) if codec == "Opus" || codec == "fLaC" => codec.to_ascii_lowercase(),
            Err(_) => codec,
        }
    }

    /// A time in the track's timescale, in nanoseconds.
    pub(crate) fn to_ns(&self, time: u64) -> u64 {
        (u128::from(time) * 1_000_000_000 / u128::from(self.timescale)) as u64
    }

    /// A time in nanoseconds, in the track's timescale, rounded to the nearest.
    pub(crate) fn units_of_ns(&self, ns: u64) -> u64 {
        ((u128::from(ns) * u128::from(self.timescale) + 500_000_000) / 1_000_000_000) as u64
    }

    /// Time (ns) on the time line of the movie of a time in the track. What only warms a decoder up is at 0.
    pub(crate) fn shown_ns(&self, time: u64) -> u64 {
        self.to_ns(time.saturating_sub(self.edit.media_time)) + u64::from(self.edit.delay_ms) * 1_000_000
    }
}

/// Place and time of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Decode time in the track's timescale.
    pub time: u64,
    /// Offset in the file.
    pub at: u64,
    /// Size in bytes.
    pub bytes: u32,
    /// Duration in the track's timescale.
    pub duration: u32,
    /// How much later than decoded it is shown, in the track's timescale.
    pub composition_offset: i32,
    /// Whether decoding can begin here.
    pub sync: bool,
}

/// A track of a file.
#[derive(Clone, Debug)]
pub struct Track {
    /// What it states once.
    pub description: TrackDescription,
    /// Samples, in the order of decoding.
    pub samples: Vec<Sample>,
}

impl Track {
    /// Time (s) on the movie's time line at which the last sample ends.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        let end = self.samples.last().map_or(0, |last| last.time + u64::from(last.duration));
        self.description.shown_ns(end) as f64 / 1e9
    }

    /// Time (ns) on the movie's time line at which a sample is decoded.
    #[must_use]
    pub fn shown_ns(&self, sample: &Sample) -> u64 {
        self.description.shown_ns(sample.time)
    }

    /// Bytes of all samples.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.samples.iter().map(|sample| u64::from(sample.bytes)).sum()
    }
}
