//! The encoder of profile `paper`.

use crate::backend::EncodeBackend;
use crate::encoder::{BLOCKS_PER_SLICE, EncodedFrame, EncoderSettings, MotionMode};
use crate::syntax;
use isv_decode::syntax::{EntropyState, most_slices};
use isv_decode::{BackendError, CodingParameters, FrameSymbols};
use isv_format::{FrameCoding, FrameHeader, PaperParameters, Prediction};
use isv_kernels::warp::MotionVector;
use isv_volume::{Grid, SparseVolume};

/// [`Encoder`](crate::Encoder) for streams of profile `paper`, whose arithmetic on samples is a backend's.
#[derive(Debug)]
pub struct PaperEncoder<B: EncodeBackend> {
    parameters: CodingParameters,
    settings: EncoderSettings,
    backend: B,
    state: State<B>,
    /// Frames since the last keyframe and with it; 0 before the first.
    since_keyframe: u32,
}

/// What one frame leaves behind for the next.
#[derive(Debug)]
struct State<B: EncodeBackend> {
    entropy: EntropyState,
    reference: Option<B::Paper>,
}

impl<B: EncodeBackend> PaperEncoder<B> {
    /// An encoder for the frames of a stream: the grid of its header, and the parameters of its profile.
    ///
    /// # Panics
    /// If `settings.gop` is 0 or a step of `paper` is out of range.
    #[must_use]
    pub fn new(grid: Grid, paper: &PaperParameters, settings: EncoderSettings, backend: B) -> Self {
        assert!(settings.gop > 0, "a GOP has at least one frame");
        let parameters = CodingParameters::new(grid, paper);
        let state = State::first(&parameters);
        Self { parameters, settings, backend, state, since_keyframe: 0 }
    }

    /// Codes the next frame. After an error the next one is coded as this one would have been.
    ///
    /// # Errors
    /// The backend's: see [`BackendError`].
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn encode(&mut self, volume: &SparseVolume) -> Result<EncodedFrame, BackendError> {
        assert_eq!(volume.grid(), &self.parameters.grid, "one grid a stream");
        let keyframe = self.since_keyframe.is_multiple_of(self.settings.gop);
        if keyframe {
            self.state = State::first(&self.parameters);
        }
        let candidates: &[Prediction] = match &self.settings.motion {
            _ if keyframe => &[Prediction::None],
            MotionMode::Fixed(prediction) => &[*prediction],
            MotionMode::Auto => &Prediction::ALL,
        };
        let source = self.backend.upload(volume)?;
        let mut best: Option<(EncodedFrame, State<B>)> = None;
        for prediction in candidates {
            let coded = self.encode_predicted(volume, &source, keyframe, *prediction)?;
            if best.as_ref().is_none_or(|(best, _)| coded.0.segment_bytes() < best.segment_bytes()) {
                best = Some(coded);
            }
        }
        let (frame, state) = best.expect("at least one candidate");
        self.state = state;
        self.since_keyframe = if keyframe { 1 } else { self.since_keyframe + 1 };
        Ok(frame)
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&B::Volume> {
        self.state.reference.as_ref().map(B::paper_volume)
    }

    /// Codes a frame under one kind of prediction. What the next frame sees stays as it is.
    fn encode_predicted(
        &mut self,
        volume: &SparseVolume,
        source: &B::Source,
        keyframe: bool,
        prediction: Prediction,
    ) -> Result<(EncodedFrame, State<B>), BackendError> {
        let Self { parameters, settings, backend, state, .. } = self;
        let reference = state.reference.as_ref();
        let before = reference.map(B::paper_blocks);
        let references = FrameSymbols::find_references(volume.coords(), prediction, before);
        let motion = match reference {
            Some(reference) if prediction.has_motion() => {
                backend.search_motion(prediction, source, &references, reference)?
            }
            _ => vec![MotionVector::ZERO; volume.block_count()],
        };
        let mut symbols = FrameSymbols {
            prediction,
            coords: volume.coords().to_vec(),
            unobserved: volume.unobserved_masks().clone(),
            references,
            motion,
            levels: Vec::new(),
        };
        let decoded = backend.code_paper(parameters, source, &mut symbols, reference)?;

        let slices = slice_count(settings, parameters, volume.block_count());
        let mut entropy = state.entropy.clone();
        let segments =
            syntax::write_symbols(&mut entropy, parameters.grid.edge, &symbols, usize::from(slices), before);
        let volume_hash = match settings.checksums {
            true => Some(backend.hash(B::paper_volume(&decoded))?),
            false => None,
        };
        let header = FrameHeader {
            prediction,
            blocks: volume.block_count() as u32,
            slices,
            coding: FrameCoding::Paper,
            volume_hash,
        };
        let frame = EncodedFrame::new(keyframe, header, segments);
        Ok((frame, State { entropy, reference: Some(decoded) }))
    }
}

impl<B: EncodeBackend> State<B> {
    /// Before a keyframe.
    fn first(parameters: &CodingParameters) -> Self {
        Self { entropy: EntropyState::new(parameters.coefficients()), reference: None }
    }
}

fn slice_count(settings: &EncoderSettings, parameters: &CodingParameters, blocks: usize) -> u16 {
    let wanted = settings.slices.map_or(blocks.div_ceil(BLOCKS_PER_SLICE), usize::from);
    wanted.clamp(1, most_slices(parameters.coefficients())) as u16
}
