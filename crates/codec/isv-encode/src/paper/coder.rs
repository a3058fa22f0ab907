//! Samples to symbols in profile `paper`.

use crate::backend::EncodeBackend;
use crate::encoder::{BLOCKS_PER_SLICE, EncodedFrame, EncoderSettings, MotionMode};
use crate::frame_writer::{FrameWriter, PaperSymbols, UnwrittenFrame};
use isv_decode::BackendError;
use isv_decode::paper::syntax::most_slices;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_format::{PaperParameters, Prediction};
use isv_kernels::warp::MotionVector;
use isv_volume::{Grid, SparseVolume};

/// Codes the frames of a stream of profile `paper` up to their symbols, which a [`FrameWriter`] writes. Its arithmetic on samples
/// is a backend's.
#[derive(Debug)]
pub struct PaperCoder<B: EncodeBackend> {
    parameters: CodingParameters,
    settings: EncoderSettings,
    backend: B,
    reference: Option<B::Paper>,
    /// Frames since the last keyframe and with it; 0 before the first.
    since_keyframe: u32,
    /// What has been written, under [`MotionMode::Auto`] only: there it takes bytes to choose.
    writer: FrameWriter,
}

impl<B: EncodeBackend> PaperCoder<B> {
    /// A coder of the frames of a stream: the grid of its header, and the parameters of its profile.
    ///
    /// # Panics
    /// If `settings.gop` is 0 or a step of `paper` is out of range.
    #[must_use]
    pub fn new(grid: Grid, paper: &PaperParameters, settings: EncoderSettings, backend: B) -> Self {
        assert!(settings.gop > 0, "a GOP has at least one frame");
        Self {
            parameters: CodingParameters::new(grid, paper),
            settings,
            backend,
            reference: None,
            since_keyframe: 0,
            writer: FrameWriter::default(),
        }
    }

    /// Codes the next frame. After an error the next one is coded as this one would have been.
    ///
    /// # Errors
    /// The backend's: see [`BackendError`].
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, BackendError> {
        assert_eq!(volume.grid(), &self.parameters.grid, "one grid a stream");
        let source = self.backend.upload(volume)?;
        let keyframe = self.since_keyframe.is_multiple_of(self.settings.gop);
        let (frame, decoded) = match self.settings.motion {
            MotionMode::Fixed(prediction) => {
                let prediction = if keyframe { Prediction::None } else { prediction };
                let (symbols, decoded) = self.code_predicted(volume, &source, keyframe, prediction)?;
                (symbols.into(), decoded)
            }
            MotionMode::Auto => {
                let (frame, decoded) = self.code_smallest(volume, &source, keyframe)?;
                (frame.into(), decoded)
            }
        };
        self.reference = Some(decoded);
        self.since_keyframe = if keyframe { 1 } else { self.since_keyframe + 1 };
        Ok(frame)
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&B::Volume> {
        self.reference.as_ref().map(B::paper_volume)
    }

    /// Codes a frame under every kind of prediction, and keeps the one that takes the fewest bytes.
    fn code_smallest(
        &mut self,
        volume: &SparseVolume,
        source: &B::Source,
        keyframe: bool,
    ) -> Result<(EncodedFrame, B::Paper), BackendError> {
        let candidates: &[Prediction] = if keyframe { &[Prediction::None] } else { &Prediction::ALL };
        let mut best: Option<(EncodedFrame, B::Paper, FrameWriter)> = None;
        for prediction in candidates {
            let (symbols, decoded) = self.code_predicted(volume, source, keyframe, *prediction)?;
            let mut writer = self.writer.clone();
            let frame = writer.write(symbols.into());
            if best.as_ref().is_none_or(|(best, ..)| frame.segment_bytes() < best.segment_bytes()) {
                best = Some((frame, decoded, writer));
            }
        }
        let (frame, decoded, writer) = best.expect("at least one candidate");
        self.writer = writer;
        Ok((frame, decoded))
    }

    /// Codes a frame under one kind of prediction. What the next frame sees stays as it is.
    fn code_predicted(
        &mut self,
        volume: &SparseVolume,
        source: &B::Source,
        keyframe: bool,
        prediction: Prediction,
    ) -> Result<(PaperSymbols, B::Paper), BackendError> {
        let Self { parameters, settings, backend, reference, .. } = self;
        let reference = reference.as_ref().filter(|_| !keyframe);
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
        let volume_hash = match settings.checksums {
            true => Some(backend.hash(B::paper_volume(&decoded))?),
            false => None,
        };
        let symbols = PaperSymbols {
            keyframe,
            edge: parameters.grid.edge,
            coefficients: parameters.coefficients(),
            slices: slice_count(settings, parameters, volume.block_count()),
            symbols,
            volume_hash,
        };
        Ok((symbols, decoded))
    }
}

fn slice_count(settings: &EncoderSettings, parameters: &CodingParameters, blocks: usize) -> u16 {
    let wanted = settings.slices.map_or(blocks.div_ceil(BLOCKS_PER_SLICE), usize::from);
    wanted.clamp(1, most_slices(parameters.coefficients())) as u16
}
