//! The colour of a stream's frames, one after the other.

use super::cells::ColourCells;
use super::exactness::ExactColour;
use super::frame::{ColourFrame, ColourShape};
use super::reconstruct::{ColourSteps, reconstruct};
use super::reference::ColourReference;
use super::symbols::{ColourSymbols, LayerCoefficients};
use super::syntax::coefficients::{FrameEnergies, LayerBlocks};
use super::syntax::modes::ModeBlocks;
use super::syntax::{ColourModels, ColourSlices};
use crate::main::CausalBlocks;
use crate::shared::syntax::SyntaxError;
use isv_format::{ColourHeader, ColourKind, ColourPayload, FormatError, RefusalClass, SliceLayout};
use isv_volume::SparseVolume;
use rayon::prelude::*;
use std::sync::Arc;
use thiserror::Error;

/// Most places for samples in a frame's deepest layers, at 8 bytes each: about 20 people with samples at quarter voxels of 5 mm.
const MAX_SAMPLES: usize = 1 << 27;

/// Why the colour of a frame cannot be decoded.
#[derive(Debug, Error)]
pub enum ColourError {
    /// The colour part is malformed.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The colour part has symbols that no encoder writes.
    #[error("{0}")]
    Syntax(&'static str),
    /// The blocks are so deep that the samples take too much memory.
    #[error("{samples} colour samples are more than the limit of {}", MAX_SAMPLES)]
    TooManySamples {
        /// Places for samples of the blocks at their depths.
        samples: usize,
    },
    /// The frame is predicted from one that is missing.
    #[error("the colour of the frame before is missing")]
    NoReference,
    /// The decoded samples differ from the encoder's, by their hash.
    #[error("the colour decodes to hash {found:016x}, but {stated:016x} is stated")]
    HashMismatch {
        /// The hash that the frame states.
        stated: u64,
        /// Hash of the decoded samples.
        found: u64,
    },
}

impl ColourError {
    /// Class of the fault.
    #[must_use]
    pub fn class(&self) -> Option<RefusalClass> {
        match self {
            Self::Format(error) => error.class(),
            Self::Syntax(_) => Some(RefusalClass::Malformed),
            Self::TooManySamples { .. } => Some(RefusalClass::Limit),
            Self::NoReference => Some(RefusalClass::Missing),
            Self::HashMismatch { .. } => Some(RefusalClass::Damaged),
        }
    }
}

impl From<SyntaxError> for ColourError {
    fn from(error: SyntaxError) -> Self {
        Self::Syntax(error.0)
    }
}

/// Decodes the colour parts of a stream's packets in order, from any keyframe on.
#[derive(Clone, Debug)]
pub struct ColourDecoder {
    layers: u8,
    entropy: ColourSlices,
    reference: Option<ColourReference>,
    /// Whether the models are those that the next frame was coded with.
    is_synchronous: bool,
    /// What of the reference, or that there is none, is as the encoder has it.
    exact: ExactColour,
    /// Whether the next frame is a keyframe.
    at_keyframe: bool,
}

impl ColourDecoder {
    /// Creates a decoder for a stream of so many colour layers, 1 to 3.
    #[must_use]
    pub fn new(layers: u8) -> Self {
        Self {
            layers,
            entropy: ColourSlices::default(),
            reference: None,
            is_synchronous: false,
            exact: ExactColour::Nothing,
            at_keyframe: false,
        }
    }

    /// The last frame; `None` before the first and after an error.
    #[must_use]
    pub fn frame(&self) -> Option<&Arc<ColourFrame>> {
        self.reference.as_ref().map(|reference| &reference.frame)
    }

    /// Whether the last frame has the samples that a decoder without loss has.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.exact.is_whole()
    }

    /// What of the last frame is as a decoder without loss has it.
    #[must_use]
    pub fn exact(&self) -> &ExactColour {
        &self.exact
    }

    /// Tells that a frame was lost. Decoding goes on at the next intra or resilient frame.
    pub fn lose(&mut self) {
        (self.is_synchronous, self.exact) = (false, ExactColour::Nothing);
    }

    /// Tells that the next frame is a keyframe: what comes before it has no say, so that decoding can begin there.
    pub fn begin_group(&mut self) {
        (self.reference, self.is_synchronous) = (None, false);
        (self.exact, self.at_keyframe) = (ExactColour::Whole, true);
    }

    /// Decodes a colour part. `volume`: the frame's decoded field. `at`: where the part begins in the stream. `is_exact`: whether the
    /// field is known to be the encoder's: on another one the symbols are others. A hash is compared if all samples have to be the
    /// encoder's too.
    ///
    /// # Errors
    /// See [`ColourError`]; the next frame that can be decoded is one whose symbols can be read without others.
    pub fn decode(
        &mut self,
        volume: &SparseVolume,
        bytes: &[u8],
        at: u64,
        is_exact: bool,
    ) -> Result<&Arc<ColourFrame>, ColourError> {
        let was_synchronous = std::mem::take(&mut self.is_synchronous);
        let (was_exact, at_keyframe) =
            (std::mem::take(&mut self.exact), std::mem::take(&mut self.at_keyframe));
        let payload = ColourPayload::parse(bytes, at, self.layers)?;
        let kind = payload.header.kind;
        if at_keyframe && kind != ColourKind::Intra {
            return Err(ColourError::Syntax("a keyframe whose colour is predicted from another frame"));
        }
        if kind == ColourKind::Predicted && !was_synchronous {
            return Err(ColourError::NoReference);
        }
        // A frame that can be read without the one before may still be predicted from it; where that is lost, from nothing.
        let reference = self.reference.take().unwrap_or_default();
        if kind != ColourKind::Predicted {
            self.entropy = ColourSlices::default();
        }
        let cells = ColourCells::new(volume);
        let known = (kind == ColourKind::Predicted).then_some(&reference);
        let (symbols, shape) = read_symbols(&mut self.entropy, &payload, cells, volume, known, self.layers)?;
        let steps = steps(&payload.header);
        let before = &*reference.frame;
        let frame = reconstruct(kind, shape, &symbols, &steps, before);
        self.exact = match is_exact {
            true => ExactColour::of_frame(kind, &frame.shape, &symbols.modes, (before, &was_exact)),
            false => ExactColour::Nothing,
        };
        if let Some(stated) = payload.header.hash.filter(|_| self.exact.is_whole()) {
            let found = frame.hash();
            if found != stated {
                self.exact = ExactColour::Nothing;
                return Err(ColourError::HashMismatch { stated, found });
            }
        }
        self.is_synchronous = true;
        Ok(&self.reference.insert(ColourReference::new(Arc::new(frame), &symbols)).frame)
    }

    /// Keeps the colour of the frame before, for a frame without a colour part; `None` if that has none. `volume`: the frame's decoded
    /// field; if that is not the encoder's, [`Self::lose`] has to be called first.
    ///
    /// # Errors
    /// More samples than a frame may have.
    pub fn carry_over(&mut self, volume: &SparseVolume) -> Result<Option<&Arc<ColourFrame>>, ColourError> {
        self.at_keyframe = false;
        let Some(reference) = self.reference.take() else { return Ok(None) };
        let (was_synchronous, was_exact) =
            (std::mem::take(&mut self.is_synchronous), std::mem::take(&mut self.exact));
        let carried = reference.carried_over(volume)?;
        self.is_synchronous = was_synchronous;
        self.exact = was_exact.carried_over(&reference.frame, &carried.frame);
        Ok(Some(&self.reference.insert(carried).frame))
    }
}

/// The steps that a header states.
#[must_use]
pub fn steps(header: &ColourHeader) -> ColourSteps {
    ColourSteps { luma: u32::from(header.luma_step), chroma: u32::from(header.chroma_step) }
}

/// Refuses blocks whose samples would take more memory than a frame may.
pub(super) fn check_samples(cells: &ColourCells, depths: &[u8]) -> Result<(), ColourError> {
    let slots = cells.blocks().iter().zip(depths).map(|(cells, depth)| cells.count() << (3 * depth));
    let samples = slots.sum();
    if samples > MAX_SAMPLES { Err(ColourError::TooManySamples { samples }) } else { Ok(()) }
}

/// Reads the symbols of a frame, and lays out its samples.
fn read_symbols(
    entropy: &mut ColourSlices,
    payload: &ColourPayload,
    cells: ColourCells,
    volume: &SparseVolume,
    reference: Option<&ColourReference>,
    layers: u8,
) -> Result<(ColourSymbols, ColourShape), ColourError> {
    let coords = cells.coords();
    let slices = usize::from(payload.header.slices);
    let ranges: Vec<_> = SliceLayout::new(coords.len(), slices).ranges().collect();
    let causal = CausalBlocks::new(coords, ranges.iter().cloned());
    let before = match reference {
        Some(reference) => reference.blocks_at(coords),
        None => vec![None; coords.len()],
    };
    let predicts = payload.header.kind.predicts();
    let models = entropy.slices(slices);
    let modes: Vec<_> = models
        .par_iter_mut()
        .zip(&ranges)
        .zip(&payload.modes)
        .map(|((models, range), bytes)| {
            let (causal, before) = (&causal, &before[..]);
            let blocks = ModeBlocks { range: range.clone(), causal, before, predicts, max_depth: layers - 1 };
            models.modes.read(bytes, &blocks)
        })
        .collect::<Result<_, SyntaxError>>()?;
    let mut symbols = ColourSymbols::default();
    for (modes, depths) in modes {
        symbols.modes.extend(modes);
        symbols.depths.extend(depths);
    }
    check_samples(&cells, &symbols.depths)?;
    let shape = ColourShape::new(cells, symbols.depths.clone(), volume);
    let coords = shape.cells().coords();
    let of_slice = |slice: usize, models: &mut ColourModels| {
        let mut energies = FrameEnergies::new(coords.len());
        let (shape, modes, causal, before) = (&shape, &symbols.modes[..], &causal, &before[..]);
        let range = ranges[slice].clone();
        let mut blocks = LayerBlocks { shape, range, modes, causal, before, energies: &mut energies };
        let read = |layer: u8| {
            models.coefficients.read(payload.layers[usize::from(layer)][slice], layer, &mut blocks)
        };
        (0..layers).map(read).collect::<Result<Vec<LayerCoefficients>, SyntaxError>>()
    };
    let read: Vec<_> = models
        .par_iter_mut()
        .enumerate()
        .map(|(slice, models)| of_slice(slice, models))
        .collect::<Result<_, SyntaxError>>()?;
    for slice in read {
        for (layer, coefficients) in slice.iter().enumerate() {
            symbols.layers[layer].append(coefficients);
        }
    }
    Ok((symbols, shape))
}
