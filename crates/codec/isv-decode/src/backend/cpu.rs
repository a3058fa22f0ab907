//! The reference: every other backend gives the bits that this one does.

use super::{Backend, MainFrame};
use crate::main::activity::{Activity, expected_activity};
use crate::main::crossed_cells::{cells_at_unsettled, crossed_corners};
use crate::main::reconstruct::{filter_and_extend, reconstruct as reconstruct_blocks};
use crate::main::{MainBlocks, MainReference};
use crate::paper::reconstruct::{predict, reconstruct};
use crate::paper::{CodingParameters, FrameSymbols, Reference};
use crate::reduced::{Lod, ReducedFrame, ReducedGrid, ReducedParameters, downsample};
use crate::{BackendError, ReferenceBlocks, volume_hash};
use isv_format::{Profile, StreamHeader};
use isv_volume::{BlockSet, GridError, SparseVolume, VoxelMask};
use std::collections::BTreeMap;
use std::mem::take;
use tracing::debug_span;

/// The CPU: all threads of the pool that it is called in, and the samples in its memory. It never fails.
#[derive(Debug, Default)]
pub struct Cpu {
    /// Samples of a frame that was retired, for their memory.
    spare: Vec<i16>,
    reduction: Option<Reduction>,
}

/// What becomes of a stream at reduced resolution.
#[derive(Debug)]
enum Reduction {
    /// It is decoded so.
    Paper(ReducedParameters),
    /// It is decoded in full and sampled down to this grid.
    Main(ReducedGrid),
}

impl Cpu {
    /// For a stream that is to be decoded at reduced resolution.
    ///
    /// # Errors
    /// As [`crate::Decoder::with_lod`].
    pub(crate) fn with_lod(header: &StreamHeader, lod: Lod) -> Result<Self, GridError> {
        let reduction = match (lod, header.profile) {
            (Lod::Full, _) => None,
            (_, Profile::Paper(paper)) => {
                let parameters = CodingParameters::new(header.grid, &paper);
                Some(Reduction::Paper(ReducedParameters::new(&parameters, lod)?))
            }
            (_, Profile::Main) => Some(Reduction::Main(ReducedGrid::new(&header.grid, lod)?)),
        };
        Ok(Self { reduction, ..Self::default() })
    }
}

/// A frame of profile `paper` on the CPU, at the resolution that is decoded.
#[derive(Debug)]
pub struct CpuPaperFrame(PaperFrame);

#[derive(Debug)]
enum PaperFrame {
    Full(Reference),
    Reduced(ReducedFrame),
}

impl CpuPaperFrame {
    /// The frame as a reference; `None` at reduced resolution.
    #[must_use]
    pub fn reference(&self) -> Option<&Reference> {
        match &self.0 {
            PaperFrame::Full(reference) => Some(reference),
            PaperFrame::Reduced(_) => None,
        }
    }
}

/// At full resolution.
impl From<Reference> for CpuPaperFrame {
    fn from(reference: Reference) -> Self {
        Self(PaperFrame::Full(reference))
    }
}

/// A frame of profile `main` on the CPU.
#[derive(Debug)]
pub struct CpuMainFrame {
    reference: MainReference,
    /// At reduced resolution, its volume there, once it has its masks.
    reduced: Option<SparseVolume>,
}

impl Backend for Cpu {
    type Volume = SparseVolume;
    type Paper = CpuPaperFrame;
    type Main = CpuMainFrame;

    fn reconstruct_paper(
        &mut self,
        parameters: &CodingParameters,
        symbols: FrameSymbols,
        before: Option<&CpuPaperFrame>,
    ) -> Result<CpuPaperFrame, BackendError> {
        let before = before.map(|CpuPaperFrame(frame)| frame);
        let frame = match &self.reduction {
            Some(Reduction::Paper(reduced)) => {
                let before = match before {
                    Some(PaperFrame::Reduced(frame)) => Some(frame),
                    _ => None,
                };
                PaperFrame::Reduced(reduced.reconstruct(parameters, symbols, before))
            }
            _ => {
                let before = match before {
                    Some(PaperFrame::Full(reference)) => Some(reference),
                    _ => None,
                };
                let prediction = predict(parameters, &symbols, before);
                PaperFrame::Full(Reference::new(reconstruct(parameters, symbols, prediction)))
            }
        };
        Ok(CpuPaperFrame(frame))
    }

    fn paper_blocks(CpuPaperFrame(frame): &CpuPaperFrame) -> ReferenceBlocks<'_> {
        match frame {
            PaperFrame::Full(reference) => reference.blocks(),
            PaperFrame::Reduced(frame) => frame.blocks(),
        }
    }

    fn paper_volume(CpuPaperFrame(frame): &CpuPaperFrame) -> &SparseVolume {
        match frame {
            PaperFrame::Full(reference) => reference.volume(),
            PaperFrame::Reduced(frame) => frame.volume(),
        }
    }

    fn reconstruct_main(
        &mut self,
        frame: MainFrame<'_>,
        before: Option<&CpuMainFrame>,
    ) -> Result<CpuMainFrame, BackendError> {
        let MainFrame { parameters, header, symbols, causal, plan, predicts } = frame;
        let before = before.map(|before| &before.reference);
        let mut samples = plan.samples(take(&mut self.spare));
        debug_span!("prediction and residual").in_scope(|| {
            let (source, places) = (before.filter(|_| predicts), plan.places());
            reconstruct_blocks(parameters, header, &symbols, causal, source, places, &mut samples);
        });
        let kept = before.map(MainReference::decoded);
        let decoded = filter_and_extend(parameters, header, &symbols, samples, plan, kept);
        let reference = MainReference::new(decoded, symbols, BTreeMap::new());
        Ok(CpuMainFrame { reference, reduced: None })
    }

    fn main_blocks(frame: &CpuMainFrame) -> MainBlocks<'_> {
        frame.reference.blocks()
    }

    fn main_volume(frame: &CpuMainFrame) -> &SparseVolume {
        frame.reduced.as_ref().unwrap_or(frame.reference.volume())
    }

    fn main_field(&mut self, frame: &CpuMainFrame) -> Result<SparseVolume, BackendError> {
        Ok(frame.reference.volume().clone())
    }

    fn crossed_corners(&mut self, frame: &CpuMainFrame) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        Ok(crossed_corners(frame.reference.decoded()))
    }

    fn crossed_cells(&mut self, frame: &CpuMainFrame) -> Result<Vec<(u32, VoxelMask)>, BackendError> {
        Ok(cells_at_unsettled(frame.reference.decoded()))
    }

    fn add_masks(
        &mut self,
        frame: &mut CpuMainFrame,
        masks: BTreeMap<u32, VoxelMask>,
    ) -> Result<(), BackendError> {
        frame.reference.add_unobserved(masks);
        if let Some(Reduction::Main(grid)) = &self.reduction {
            frame.reduced = Some(downsample(frame.reference.decoded(), grid));
        }
        Ok(())
    }

    fn expected_activity(
        &mut self,
        frame: &CpuMainFrame,
        skipped: &BlockSet,
    ) -> Result<Vec<Activity>, BackendError> {
        Ok(expected_activity(&frame.reference, skipped))
    }

    fn retire(&mut self, frame: CpuMainFrame) {
        self.spare = frame.reference.into_spare_buffer();
    }

    fn hash(&mut self, volume: &SparseVolume) -> Result<u64, BackendError> {
        Ok(volume_hash(volume))
    }

    /// Not at reduced resolution.
    fn is_exact(&self) -> bool {
        self.reduction.is_none()
    }
}
