//! Facts that a stream states about itself, as JSON has them.

use super::{PacketSummary, StreamError, StreamSummary, TrackSummary};
use crate::Input;
use crate::metadata::Metadata;
use isv_format::{PaperParameters, Prediction, Profile, StreamHeader};
use isv_kernels::quant::STEP_FRACTION_BITS;
use isv_volume::CODES_PER_VOXEL;
use serde::Serialize;

/// Facts of a stream. The names of the fields are the keys of `isv info --json`.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct StreamInfo {
    /// Version of the format.
    pub format_version: u16,
    /// Layers of colour samples that frames may have.
    pub colour_layers: u8,
    /// Coding of unobserved voxels: `cells` or `voxels`.
    pub masks: &'static str,
    /// Profile: `main` or `paper`.
    pub profile: &'static str,
    /// Number of frames.
    pub frames: usize,
    /// Frames a second.
    pub fps: f64,
    /// Edge of a voxel (m).
    pub voxel_size_m: f64,
    /// Distance from the surface at which distances are cut off (voxels).
    pub truncation_voxels: u32,
    /// Edge of a block (voxels).
    pub block_edge: usize,
    /// Facts of profile `paper`.
    #[serde(flatten)]
    pub paper: Option<PaperInfo>,
    /// Time from the first frame to the end of the last, by timestamps (s).
    pub duration_s: f64,
    /// Bytes of the whole file.
    pub bytes: u64,
    /// Tracks of an MP4 file; none of an `.isv` file.
    pub tracks: Vec<TrackSummary>,
    /// Bytes of the geometry parts of all frames.
    pub bytes_geometry: usize,
    /// Bytes of the colour parts of all frames, without their lengths.
    pub bytes_colour: usize,
    /// Mean rate (Mbps).
    pub bitrate_mbps: f64,
    /// Whether index and trailer are there, with which a writer ends.
    pub complete: bool,
    /// Bytes of the file behind its end, where there should be none.
    pub bytes_behind: u64,
    /// Packets whose types are not known and may be skipped.
    pub unknown_packets: usize,
    /// What the stream says of itself; nothing if it says nothing.
    pub metadata: Option<Metadata>,
    /// Numbers of the keyframes.
    pub keyframes: Vec<usize>,
    /// Facts of each frame.
    pub packets: Vec<PacketInfo>,
}

/// Facts that only profile `paper` states for a whole stream.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct PaperInfo {
    /// Coefficients coded of each block.
    pub coefficients: u16,
    /// Quantizer step of a block's mean (mm).
    pub dc_step_mm: f64,
    /// Quantizer step of the other coefficients (mm).
    pub ac_step_mm: f64,
}

/// Facts of a frame.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct PacketInfo {
    /// Bytes of header and payload.
    pub bytes: usize,
    /// Bytes of the geometry part of the payload.
    pub bytes_geometry: usize,
    /// Bytes of the colour part of the payload, without its length.
    pub bytes_colour: usize,
    /// Whether decoding can begin here.
    pub keyframe: bool,
    /// Blocks that it codes.
    pub blocks: u32,
    /// Prediction of its blocks: `none`, `zero`, `3dof` or `6dof`.
    pub prediction: &'static str,
    /// Whether a decoder that lost something can go on here, though it is no keyframe.
    pub resilient: bool,
    /// Time when it is shown (ns).
    pub timestamp_ns: u64,
}

impl StreamInfo {
    /// Reads the packets of a stream in a file.
    ///
    /// # Errors
    /// [`StreamError`], which names it.
    pub fn read(input: &Input) -> Result<Self, StreamError> {
        Ok(Self::new(&StreamSummary::read(input)?))
    }

    fn new(summary: &StreamSummary) -> Self {
        let (header, packets) = (&summary.header, &summary.packets);
        let keyframes = packets.iter().enumerate().filter(|(_, p)| p.keyframe).map(|(frame, _)| frame);
        Self {
            format_version: header.version.number(),
            colour_layers: header.colour_layers.count(),
            masks: header.mask_coding.name(),
            profile: header.profile.name(),
            frames: packets.len(),
            fps: header.frame_rate.per_second(),
            voxel_size_m: header.grid.voxel_size.metres(),
            truncation_voxels: header.grid.truncation.voxels(),
            block_edge: header.grid.edge.voxels(),
            paper: PaperInfo::new(header),
            bytes: summary.bytes,
            tracks: summary.tracks.clone(),
            bytes_geometry: packets.iter().map(|packet| packet.bytes_geometry).sum(),
            bytes_colour: packets.iter().map(|packet| packet.bytes_colour).sum(),
            duration_s: summary.duration_s,
            bitrate_mbps: summary.mbps(),
            complete: summary.is_complete,
            bytes_behind: summary.bytes_behind,
            unknown_packets: summary.unknown_packets,
            metadata: summary.metadata.clone(),
            keyframes: keyframes.collect(),
            packets: packets.iter().map(PacketInfo::new).collect(),
        }
    }
}

impl PaperInfo {
    fn new(header: &StreamHeader) -> Option<Self> {
        let Profile::Paper(PaperParameters { coefficients, dc_step, ac_step }) = header.profile else {
            return None;
        };
        let [dc_step_mm, ac_step_mm] = [dc_step, ac_step].map(|step| step_mm(header, step));
        Some(Self { coefficients, dc_step_mm, ac_step_mm })
    }
}

impl PacketInfo {
    fn new(packet: &PacketSummary) -> Self {
        Self {
            bytes: packet.bytes,
            bytes_geometry: packet.bytes_geometry,
            bytes_colour: packet.bytes_colour,
            keyframe: packet.keyframe,
            blocks: packet.blocks,
            prediction: prediction_name(packet.prediction),
            resilient: packet.resilient,
            timestamp_ns: packet.timestamp_ns,
        }
    }
}

/// A step of a stream's header, which is in sixteenths of a code, in millimetres.
fn step_mm(header: &StreamHeader, step: u32) -> f64 {
    f64::from(step) / f64::from(CODES_PER_VOXEL << STEP_FRACTION_BITS) * header.grid.voxel_size.metres() * 1e3
}

/// The name of a kind of prediction.
fn prediction_name(prediction: Prediction) -> &'static str {
    match prediction {
        Prediction::None => "none",
        Prediction::ZeroMotion => "zero",
        Prediction::ThreeDof => "3dof",
        Prediction::SixDof => "6dof",
    }
}
