//! The decoder: one packet, one volume.

mod main;
mod paper;
mod sequence;

use crate::reduced::Lod;
use crate::{DecodeError, volume_hash};
use isv_format::{Packet, Profile, StreamHeader};
use isv_volume::{GridError, SparseVolume};
use main::MainDecoder;
use paper::PaperDecoder;

/// Bounds on what a stream may ask of its decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most voxels in a frame, blocks times voxels a block. A voxel takes about four bytes at the peak of decoding.
    pub frame_voxels: usize,
}

impl Default for Limits {
    /// `3 * 2^30` voxels, six million blocks of 8: a building at 5 mm.
    fn default() -> Self {
        Self { frame_voxels: 3 << 30 }
    }
}

/// A frame as decoded.
#[derive(Clone, Debug)]
pub struct DecodedFrame<'a> {
    /// The volume; it is also the reference for the next frame.
    pub volume: &'a SparseVolume,
    /// When it is shown, in nanoseconds.
    pub timestamp_ns: u64,
    /// Whether decoding could have begun here.
    pub keyframe: bool,
    /// Hash that the stream states, if any; `None` at reduced resolution, where it cannot be compared.
    pub stated_hash: Option<u64>,
}

/// Decodes the packets of a stream in order, from any keyframe on.
#[derive(Debug)]
pub struct Decoder(ProfileDecoder);

/// A decoder of each profile.
#[derive(Debug)]
enum ProfileDecoder {
    Paper(Box<PaperDecoder>),
    Main(Box<MainDecoder>),
}

impl Decoder {
    /// A decoder for the frames of a stream.
    #[must_use]
    pub fn new(header: &StreamHeader, limits: Limits) -> Self {
        Self(match header.profile {
            Profile::Paper(paper) => {
                let decoder = PaperDecoder::new(header.grid, paper, limits);
                ProfileDecoder::Paper(Box::new(decoder))
            }
            Profile::Main => ProfileDecoder::Main(Box::new(MainDecoder::new(header.grid, limits))),
        })
    }

    /// A decoder that decodes at reduced resolution, for previews and weak devices: voxels of twice or four times the edge, in
    /// blocks of as many voxels as the stream's; in profile `paper` straight from the lowest coefficients, in `main` from the full
    /// decode.
    ///
    /// The truncation has as many times fewer voxels, rounded up, and no fewer than 2. A voxel is unobserved if half of the
    /// stream's voxels in it or more are. What is decoded is exact integers too, but in profile `paper` not the full decode sampled
    /// down: between keyframes it drifts from that (`docs/design/013-lod.md`), and hashes that the stream states are skipped.
    ///
    /// # Errors
    /// [`GridError::VoxelSize`] if voxels would be larger than a kilometre.
    pub fn with_lod(header: &StreamHeader, limits: Limits, lod: Lod) -> Result<Self, GridError> {
        Ok(Self(match Self::new(header, limits).0 {
            ProfileDecoder::Paper(decoder) => ProfileDecoder::Paper(Box::new(decoder.with_lod(lod)?)),
            ProfileDecoder::Main(decoder) => ProfileDecoder::Main(Box::new(decoder.with_lod(lod)?)),
        }))
    }

    /// Decodes a frame packet.
    ///
    /// After an error the decoder waits for a keyframe.
    ///
    /// # Errors
    /// See [`DecodeError`]. A stated hash is not compared here; [`Self::decode_and_verify`] does.
    pub fn decode(&mut self, packet: &Packet) -> Result<DecodedFrame<'_>, DecodeError> {
        // Within the pool of threads: from outside, each parallel loop would put this thread to sleep and wake it again.
        rayon::scope(|_| match &mut self.0 {
            ProfileDecoder::Paper(decoder) => decoder.decode(packet),
            ProfileDecoder::Main(decoder) => decoder.decode(packet),
        })
    }

    /// Decodes a frame packet and compares the hash that it states, if it states one.
    ///
    /// # Errors
    /// As [`Self::decode`], and [`DecodeError::HashMismatch`].
    pub fn decode_and_verify(&mut self, packet: &Packet) -> Result<DecodedFrame<'_>, DecodeError> {
        let frame = self.frames();
        let decoded = self.decode(packet)?;
        if let Some(stated) = decoded.stated_hash {
            let found = volume_hash(decoded.volume);
            if stated != found {
                return Err(DecodeError::HashMismatch { frame, stated, found });
            }
        }
        Ok(decoded)
    }

    /// Frames decoded so far.
    fn frames(&self) -> u64 {
        match &self.0 {
            ProfileDecoder::Paper(decoder) => decoder.frames(),
            ProfileDecoder::Main(decoder) => decoder.frames(),
        }
    }
}
