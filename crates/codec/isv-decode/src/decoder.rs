//! The decoder: one packet, one volume.

pub(crate) mod failure;
mod limits;
pub(crate) mod sequence;

use crate::DecodeError;
use crate::backend::{Backend, Cpu};
use crate::colour::{ColourFrame, ExactColour};
use crate::main::ExactBlocks;
use crate::main::decoder::MainDecoder;
use crate::paper::decoder::PaperDecoder;
use crate::reduced::Lod;
use crate::shared::{BlockDetail, Details};
use isv_format::{Packet, Profile, StreamHeader};
use isv_volume::{BlockSet, GridError, SparseVolume};
pub use limits::Limits;
use std::sync::Arc;

/// A frame as decoded. `V`: [`Backend::Volume`].
#[derive(Clone, Debug)]
pub struct DecodedFrame<'a, V = SparseVolume> {
    /// The volume; at full resolution it is also the reference for the next frame.
    pub volume: &'a V,
    /// When it is shown, in nanoseconds.
    pub timestamp_ns: u64,
    /// Whether decoding could have begun here.
    pub keyframe: bool,
    /// Hash that the stream states, if any; `None` at reduced resolution, where it cannot be compared.
    pub stated_hash: Option<u64>,
    /// Blocks that are not as the encoder had them, after a loss: see [`Decoder::recover`]. 0 elsewhere.
    pub inexact_blocks: usize,
}

/// What is said of a frame beside its volume.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameFacts {
    pub(crate) timestamp_ns: u64,
    pub(crate) keyframe: bool,
    pub(crate) stated_hash: Option<u64>,
    pub(crate) inexact_blocks: usize,
}

/// Decodes the packets of a stream in order, from any keyframe on. `B`: who does the arithmetic on samples.
#[derive(Debug)]
pub struct Decoder<B: Backend = Cpu> {
    backend: B,
    profile: ProfileDecoder<B>,
    details: Details,
    colour_layers: u8,
}

/// A decoder of each profile.
#[derive(Debug)]
enum ProfileDecoder<B: Backend> {
    Paper(Box<PaperDecoder<B>>),
    Main(Box<MainDecoder<B>>),
}

impl Decoder {
    /// A decoder for the frames of a stream, on the CPU.
    #[must_use]
    pub fn new(header: &StreamHeader, limits: Limits) -> Self {
        Self::with_backend(header, limits, Cpu::default())
    }

    /// A decoder that decodes at reduced resolution, for previews and weak devices.
    ///
    /// Voxels have twice or four times the edge, and blocks have as many voxels as the stream's. Profile `paper` is decoded
    /// straight from the lowest coefficients, profile `main` in full first.
    ///
    /// The truncation has as many times fewer voxels, rounded up, and no fewer than 2. A voxel is unobserved if half of the
    /// stream's voxels in it or more are. What is decoded is exact integers too. In profile `paper` it is not the full decode
    /// sampled down: between keyframes it drifts from that (`docs/design/013-lod.md`). Hashes that the stream states are skipped.
    ///
    /// # Errors
    /// [`GridError::VoxelSize`] if voxels would be larger than a kilometre.
    pub fn with_lod(header: &StreamHeader, limits: Limits, lod: Lod) -> Result<Self, GridError> {
        Ok(Self::with_backend(header, limits, Cpu::with_lod(header, lod)?))
    }
}

impl<B: Backend> Decoder<B> {
    /// A decoder for the frames of a stream, whose samples are the backend's.
    #[must_use]
    pub fn with_backend(header: &StreamHeader, limits: Limits, backend: B) -> Self {
        let profile = match header.profile {
            Profile::Paper(paper) => {
                let decoder = PaperDecoder::new(header.grid, paper, limits);
                ProfileDecoder::Paper(Box::new(decoder))
            }
            Profile::Main => {
                let decoder = MainDecoder::new(header.grid, header.mask_coding, limits);
                ProfileDecoder::Main(Box::new(decoder))
            }
        };
        let colour_layers = header.colour_layers.count();
        Self { backend, profile, details: Details::default(), colour_layers }
    }

    /// Sets whether to go on after a lost packet at the next resilient frame, and not only at the next keyframe. Only profile
    /// `main` has resilient frames. What is decoded then is near what was encoded. [`DecodedFrame::inexact_blocks`] counts the
    /// blocks that are not yet exact; no other frames are decoded until all are. Meanwhile [`Self::volume`] is the last one
    /// before the loss.
    ///
    /// A stream can be entered so at any resilient frame.
    pub fn recover(&mut self, wanted: bool) {
        if let ProfileDecoder::Main(decoder) = &mut self.profile {
            decoder.recover(wanted);
        }
    }

    /// Says that a packet before the next one is lost, as its reader knows. Nothing but a keyframe, or what [`Self::recover`]
    /// says, follows what was decoded. The count in a packet tells of most losses by itself, but not of that of a whole GOP.
    pub fn lose_packet(&mut self) {
        self.profile.lose();
    }

    /// Says that a packet is there that is not to be decoded. It does what [`Self::lose_packet`] does, but the packet's bytes
    /// count towards the blocks that [`Limits`] allow to the frames behind it.
    pub fn pass_over(&mut self, packet: &Packet) {
        self.profile.pass_over(packet);
    }

    /// Whether the colour of frames is decoded, of streams that have any: see [`Self::colour`]. Whoever does not want it does not read
    /// it. Asked before the first frame.
    pub fn keep_colour(&mut self, wanted: bool) {
        if let ProfileDecoder::Main(decoder) = &mut self.profile {
            decoder.keep_colour(if wanted { self.colour_layers } else { 0 });
        }
    }

    /// The colour of the last frame; `None` if there is none or nobody asked for it.
    #[must_use]
    pub fn colour(&self) -> Option<&Arc<ColourFrame>> {
        match &self.profile {
            ProfileDecoder::Paper(_) => None,
            ProfileDecoder::Main(decoder) => decoder.colour(),
        }
    }

    /// Whether the colour of the last frame is what a decoder without loss has: see [`Self::recover`]. `false` where colour is not decoded.
    #[must_use]
    pub fn is_colour_exact(&self) -> bool {
        match &self.profile {
            ProfileDecoder::Paper(_) => false,
            ProfileDecoder::Main(decoder) => decoder.is_colour_exact(),
        }
    }

    /// What of the last frame's colour is as a decoder without loss has it: see [`Self::recover`]. `None` where colour is not decoded.
    #[must_use]
    pub fn exact_colour(&self) -> Option<&ExactColour> {
        match &self.profile {
            ProfileDecoder::Paper(_) => None,
            ProfileDecoder::Main(decoder) => decoder.exact_colour(),
        }
    }

    /// Whether [`Self::details`] are kept of the frames from the next one on. Without them decoding pays nothing for them.
    pub fn keep_details(&mut self, wanted: bool) {
        self.details.keep(wanted);
    }

    /// How the last frame's blocks are coded, in Morton order: those that it codes, and in profile `main` those that stay as they
    /// are. Empty before the first frame, after an error and unless [`Self::keep_details`] asked for them.
    #[must_use]
    pub fn details(&self) -> &[BlockDetail] {
        self.details.blocks()
    }

    /// The backend, which does the arithmetic on samples.
    #[must_use]
    pub fn backend(&self) -> &B {
        &self.backend
    }

    /// The volume of the last frame; `None` before the first, and after an error unless [`Self::recover`] asked for it.
    #[must_use]
    pub fn volume(&self) -> Option<&B::Volume> {
        self.profile.volume()
    }

    /// The blocks of the last frame's volume that were coded, in profile `main` at full resolution: the decoder made up the others. `None`
    /// before the first frame and in profile `paper`, where all are coded.
    #[must_use]
    pub fn coded_blocks(&self) -> Option<&BlockSet> {
        match &self.profile {
            ProfileDecoder::Paper(_) => None,
            ProfileDecoder::Main(decoder) => decoder.coded_blocks(),
        }
    }

    /// Which blocks of the last frame are exact, unless all are: see [`Self::recover`].
    #[must_use]
    pub fn exact_blocks(&self) -> Option<&ExactBlocks> {
        match &self.profile {
            ProfileDecoder::Paper(_) => None,
            ProfileDecoder::Main(decoder) => decoder.exact_blocks(),
        }
    }

    /// Decodes a frame packet.
    ///
    /// After an error the decoder waits for a keyframe, or for what [`Self::recover`] says.
    ///
    /// # Errors
    /// See [`DecodeError`]. A stated hash is not compared here; [`Self::decode_and_verify`] does.
    pub fn decode(&mut self, packet: &Packet) -> Result<DecodedFrame<'_, B::Volume>, DecodeError> {
        let facts = self.profile.decode(packet, &mut self.backend, &mut self.details)?;
        Ok(self.frame(facts))
    }

    /// Decodes a frame packet and compares the hash that it states, if it states one.
    ///
    /// # Errors
    /// As [`Self::decode`], and [`DecodeError::HashMismatch`].
    pub fn decode_and_verify(&mut self, packet: &Packet) -> Result<DecodedFrame<'_, B::Volume>, DecodeError> {
        let frame = self.profile.frames();
        let facts = self.profile.decode(packet, &mut self.backend, &mut self.details)?;
        if let Some(stated) = facts.stated_hash {
            let found = self.backend.hash(self.profile.volume().expect("a frame was decoded"))?;
            if stated != found {
                self.profile.lose();
                self.details.clear();
                return Err(DecodeError::HashMismatch { frame, stated, found });
            }
        }
        Ok(self.frame(facts))
    }

    /// The frame that was decoded.
    fn frame(&self, facts: FrameFacts) -> DecodedFrame<'_, B::Volume> {
        let FrameFacts { timestamp_ns, keyframe, stated_hash, inexact_blocks } = facts;
        let volume = self.profile.volume().expect("a frame was decoded");
        DecodedFrame { volume, timestamp_ns, keyframe, stated_hash, inexact_blocks }
    }
}

impl<B: Backend> ProfileDecoder<B> {
    /// Decodes a frame packet.
    ///
    /// # Errors
    /// As [`Decoder::decode`].
    fn decode(
        &mut self,
        packet: &Packet,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<FrameFacts, DecodeError> {
        // Within the pool of threads: from outside, each parallel loop would put this thread to sleep and wake it again.
        let facts = rayon::scope(|_| match self {
            Self::Paper(decoder) => decoder.decode(packet, backend, details),
            Self::Main(decoder) => decoder.decode(packet, backend, details),
        });
        facts.inspect_err(|_| details.clear())
    }

    /// Notes the loss of a packet: see [`Decoder::lose_packet`].
    fn lose(&mut self) {
        match self {
            Self::Paper(decoder) => decoder.lose(),
            Self::Main(decoder) => decoder.lose(),
        }
    }

    /// Notes a packet that is not to be decoded: see [`Decoder::pass_over`].
    fn pass_over(&mut self, packet: &Packet) {
        match self {
            // A keyframe is next, whose bytes are all that counts.
            Self::Paper(decoder) => decoder.lose(),
            Self::Main(decoder) => decoder.pass_over(packet),
        }
    }

    /// The volume of the last frame: see [`Decoder::volume`].
    fn volume(&self) -> Option<&B::Volume> {
        match self {
            Self::Paper(decoder) => decoder.volume(),
            Self::Main(decoder) => decoder.volume(),
        }
    }

    /// Frames decoded so far.
    fn frames(&self) -> u64 {
        match self {
            Self::Paper(decoder) => decoder.frames(),
            Self::Main(decoder) => decoder.frames(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_frame_within_the_limit_takes_can_be_addressed() {
        // The largest list that a decoder holds has four bytes a voxel: the levels of profile `paper`.
        let largest = Limits::default().frame_voxels.checked_mul(4);
        assert!(largest.is_some_and(|bytes| bytes <= isize::MAX as usize));
    }
}
