//! The decoder of profile `paper`.

use crate::backend::Backend;
use crate::decoder::sequence::Sequence;
use crate::decoder::{FrameFacts, Limits};
use crate::paper::syntax::{self, EntropyState};
use crate::paper::{CodingParameters, FrameSymbols};
use crate::shared::syntax::SyntaxError;
use crate::shared::{BlockCoding, Details};
use crate::{DecodeError, ReferenceBlocks};
use isv_format::{
    FormatError, FrameHeader, FramePayload, Packet, PacketKind, PaperParameters, Prediction, Profile,
    SliceLayout,
};
use isv_volume::Grid;
use rayon::prelude::*;

/// [`crate::Decoder`] for streams of profile `paper`.
#[derive(Debug)]
pub(crate) struct PaperDecoder<B: Backend> {
    profile: Profile,
    parameters: CodingParameters,
    limits: Limits,
    entropy: EntropyState,
    reference: Option<B::Paper>,
    sequence: Sequence,
}

impl<B: Backend> PaperDecoder<B> {
    /// A decoder for the frames of a stream.
    pub(crate) fn new(grid: Grid, paper: PaperParameters, limits: Limits) -> Self {
        let parameters = CodingParameters::new(grid, &paper);
        Self {
            profile: Profile::Paper(paper),
            limits,
            entropy: EntropyState::new(parameters.coefficients()),
            parameters,
            reference: None,
            sequence: Sequence::default(),
        }
    }

    /// The last frame's volume, if it was decoded.
    pub(crate) fn volume(&self) -> Option<&B::Volume> {
        self.reference.as_ref().map(B::paper_volume)
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// See [`crate::Decoder::decode`].
    pub(crate) fn decode(
        &mut self,
        packet: &Packet,
        backend: &mut B,
        details: &mut Details,
    ) -> Result<FrameFacts, DecodeError> {
        // Taken out, so that an error leaves no reference behind.
        let reference = self.reference.take();
        let PacketKind::Frame { keyframe, hashed, .. } = packet.header.kind else {
            return Err(self.sequence.malformed(packet, "an index where a frame should be"));
        };
        if keyframe {
            self.entropy = EntropyState::new(self.parameters.coefficients());
        } else {
            self.sequence.check(packet, reference.is_some())?;
        }
        let reference = reference.filter(|_| !keyframe);
        let payload = FramePayload::parse(packet.geometry()?, packet.payload_at(), hashed, &self.profile)?;
        if keyframe && payload.header.prediction() != Prediction::None {
            return Err(self.sequence.malformed(packet, "a keyframe that predicts from another frame"));
        }
        self.check_limits(packet, &payload.header)?;
        let symbols = self
            .read_symbols(&payload, reference.as_ref().map(B::paper_blocks), details)
            .map_err(|SyntaxError(what)| self.sequence.malformed(packet, what))?;
        self.reference = Some(backend.reconstruct_paper(&self.parameters, symbols, reference.as_ref())?);
        self.sequence.advance(packet);
        Ok(FrameFacts {
            timestamp_ns: packet.header.timestamp_ns,
            keyframe,
            stated_hash: payload.header.volume_hash.filter(|_| backend.is_exact()),
            inexact_blocks: 0,
        })
    }

    /// See [`crate::Decoder::lose_packet`].
    pub(crate) fn lose(&mut self) {
        self.reference = None;
    }

    /// Frames decoded so far.
    pub(crate) fn frames(&self) -> u64 {
        self.sequence.frames()
    }

    fn check_limits(&self, packet: &Packet, header: &FrameHeader) -> Result<(), DecodeError> {
        let block_voxels = self.parameters.grid.edge.block_voxels();
        self.limits.check(packet, self.sequence, block_voxels, header.blocks as usize)?;
        let most_slices = syntax::most_slices(self.parameters.coefficients());
        let too_many_slices = FormatError::LimitExceeded {
            at: packet.at,
            what: "slices of this many coefficients",
            asked: u64::from(header.slices),
            allowed: most_slices as u64,
        };
        if usize::from(header.slices) > most_slices {
            return Err(too_many_slices.into());
        }
        Ok(())
    }

    /// The mirror image of the encoder's `write_symbols`.
    fn read_symbols(
        &mut self,
        payload: &FramePayload,
        reference: Option<ReferenceBlocks>,
        details: &mut Details,
    ) -> Result<FrameSymbols, SyntaxError> {
        let header = &payload.header;
        let prediction = header.prediction();
        let edge = self.parameters.grid.edge;
        let blocks = header.blocks as usize;
        let coords = self.entropy.block_set.read(payload.block_set, blocks, reference)?;
        let unobserved = self.entropy.masks.read(payload.masks, edge, &coords, reference)?;
        let references = FrameSymbols::find_references(&coords, prediction, reference);
        let neighbours = syntax::CausalNeighbours::new(&coords, prediction.has_motion());
        let layout = SliceLayout::new(blocks, usize::from(header.slices));
        let slices = self.entropy.slices(usize::from(header.slices));
        let tallies = details.tallies(layout.ranges());
        let decoded: Vec<Result<_, SyntaxError>> = slices
            .par_iter_mut()
            .zip(layout.ranges().collect::<Vec<_>>())
            .zip(&payload.slices)
            .zip(tallies)
            .map(|(((models, range), bytes), mut tally)| {
                let sources = &references[range.clone()];
                let motion = models.motion.read(
                    bytes.modes,
                    prediction,
                    edge,
                    range,
                    sources,
                    &neighbours,
                    &mut tally,
                )?;
                let levels = models.coefficients.read(bytes.coefficients, sources, &mut tally)?;
                Ok(((motion, levels), tally))
            })
            .collect();
        // In order, so that what is said of several bad slices does not depend on threads.
        let decoded: Vec<_> = decoded.into_iter().collect::<Result<_, SyntaxError>>()?;
        let (decoded, tallies): (Vec<_>, Vec<_>) = decoded.into_iter().unzip();
        let (motion, levels): (Vec<_>, Vec<_>) = decoded.into_iter().unzip();
        let (motion, levels) = (motion.concat(), levels.concat());
        details.set(&coords, tallies, |block| match references[block] {
            Some(_) => BlockCoding::Predicted { from: motion[block].translation.map(i16::from) },
            None => BlockCoding::Alone,
        });
        Ok(FrameSymbols { prediction, coords, unobserved, references, motion, levels })
    }
}
