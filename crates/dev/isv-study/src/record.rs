//! What a study knows of one codec at one point.

use crate::Metric;
use isv::raw::metrics::{ColourError, GeometryError};
use serde::{Deserialize, Serialize};

/// A codec at an operating point on a take. Every byte that a decoder needs is counted, except a trained transform.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Everything that the figures depend on, so that a study can go on where it stopped.
    pub key: String,
    /// [`crate::Codec`]'s name.
    pub codec: String,
    /// [`crate::OperatingPoint`]'s name.
    pub point: String,
    /// Frames a second.
    pub frames_per_second: f64,
    /// Bytes of the whole stream.
    pub bytes: u64,
    /// Bytes of these that are colour.
    #[serde(default)]
    pub bytes_colour: u64,
    /// Bytes of each frame.
    pub frame_bytes: Vec<u64>,
    /// The bytes by what they say, where the codec tells.
    pub kinds: Option<BytesByKind>,
    /// Mesh to what the codec takes: ingest, or simplification.
    pub prepare_ms: Timing,
    /// Time to encode the geometry of what was prepared. Codecs of points do not tell the time of colours apart: it is in this time.
    pub encode_ms: Timing,
    /// Time to encode colour; `None` if there is none, or if it is part of [`Self::encode_ms`].
    #[serde(default)]
    pub colour_encode_ms: Option<Timing>,
    /// Time from bytes to a mesh without colour, or to points, with their colours if they have any.
    pub decode_ms: Timing,
    /// Peak memory in bytes while preparing and encoding, or of the program that encodes; `None` where the system does not
    /// say.
    pub encode_peak_bytes: Option<u64>,
    /// Peak memory in bytes while decoding, or of the program that decodes.
    pub decode_peak_bytes: Option<u64>,
    /// Mean error over frames.
    pub error: GeometryError,
    /// Error of each frame.
    pub frame_errors: Vec<GeometryError>,
    /// Mean error of colour over frames; without figures if the capture or the codec has no colour.
    #[serde(default)]
    pub colour_error: ColourError,
    /// Error of each frame's colour.
    #[serde(default)]
    pub frame_colour_errors: Vec<ColourError>,
    /// Step (m) of the lattice that decoded points lie on, for codecs of points.
    #[serde(default)]
    pub point_step_m: Option<f64>,
    /// Programs of others that were run.
    #[serde(default)]
    pub programs: Vec<ProgramUse>,
}

/// A program of another codec, as it was run for a record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProgramUse {
    /// Version that it states; empty if it states none.
    pub version: String,
    /// The command line. Files are named without their folder.
    pub command: String,
    /// What a reader must know of it, if there is anything.
    pub note: Option<String>,
}

/// Bytes of a stream by what they say, to fractions of a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BytesByKind {
    /// Which blocks there are.
    pub occupancy: f64,
    /// Which voxels are unobserved.
    pub masks: f64,
    /// Motion vectors.
    pub motion: f64,
    /// DC coefficients.
    pub dc: f64,
    /// All other coefficients.
    pub ac: f64,
    /// Headers, flags, lengths and the index.
    pub headers: f64,
    /// Colour.
    #[serde(default)]
    pub colour: f64,
}

impl BytesByKind {
    /// Names and values, in the order of charts and tables.
    #[must_use]
    pub fn named(&self) -> [(&'static str, f64); 7] {
        [
            ("occupancy", self.occupancy),
            ("masks", self.masks),
            ("motion", self.motion),
            ("DC", self.dc),
            ("AC", self.ac),
            ("headers and flags", self.headers),
            ("colour", self.colour),
        ]
    }
}

/// Milliseconds a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Half of the frames took no longer.
    pub median: f64,
    /// Mean over frames.
    pub mean: f64,
}

impl Timing {
    /// Median and mean of the times of all frames; zero without frames.
    #[must_use]
    pub fn from_ms(mut ms: Vec<f64>) -> Self {
        if ms.is_empty() {
            return Self::default();
        }
        ms.sort_by(f64::total_cmp);
        let middle = ms.len() / 2;
        let median =
            if ms.len().is_multiple_of(2) { ms[middle - 1].midpoint(ms[middle]) } else { ms[middle] };
        Self { median, mean: ms.iter().sum::<f64>() / ms.len() as f64 }
    }
}

impl Record {
    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frame_bytes.len()
    }

    /// Rate of the whole stream (megabits a second).
    #[must_use]
    pub fn mbps(&self) -> f64 {
        self.per_second(self.bytes as f64)
    }

    /// Rate of all but colour (megabits a second).
    #[must_use]
    pub fn geometry_mbps(&self) -> f64 {
        self.per_second((self.bytes - self.bytes_colour) as f64)
    }

    /// Rate of colour (megabits a second); 0 without.
    #[must_use]
    pub fn colour_mbps(&self) -> f64 {
        self.per_second(self.bytes_colour as f64)
    }

    /// The rate that a measure stands against (megabits a second): that of geometry or of colour, or of both for pictures, which show
    /// both.
    #[must_use]
    pub fn mbps_for(&self, metric: Metric) -> f64 {
        match metric {
            Metric::RenderY => self.mbps(),
            Metric::ColourY => self.colour_mbps(),
            _ => self.geometry_mbps(),
        }
    }

    /// A part of the stream's bytes as megabits a second.
    #[must_use]
    pub fn per_second(&self, bytes: f64) -> f64 {
        bytes * 8.0 * self.frames_per_second / self.frames() as f64 / 1e6
    }

    /// A mean error.
    #[must_use]
    pub fn value(&self, metric: Metric) -> Option<f64> {
        if metric.is_of_colour() { metric.of_colour(&self.colour_error) } else { metric.of(&self.error) }
    }
}
