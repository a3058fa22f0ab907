//! The coder of either profile.

use crate::backend::{EncodeBackend, SearchBackend};
use crate::encoder::EncoderSettings;
use crate::frame_writer::UnwrittenFrame;
use crate::main::{ColourRate, MainEncoder};
use crate::paper::PaperCoder;
use isv_decode::BackendError;
use isv_decode::backend::Cpu;
use isv_format::{Profile, StreamHeader};
use isv_volume::SparseVolume;

/// Codes the frames of a stream up to where a [`FrameWriter`](crate::FrameWriter) goes on. `P`, `M`: who does the arithmetic on
/// samples in profile `paper`, and the search for motion in profile `main`.
#[derive(Debug)]
pub enum FrameCoder<P: EncodeBackend, M: SearchBackend> {
    /// Coder of profile `paper`.
    Paper(Box<PaperCoder<P>>),
    /// Encoder of profile `main`, whose choices depend on what models have learned: it writes by itself.
    Main(Box<MainEncoder<M>>),
}

impl FrameCoder<Cpu, Cpu> {
    /// A coder on the CPU.
    ///
    /// # Panics
    /// If `settings.gop` is 0.
    #[must_use]
    pub fn on_cpu(header: &StreamHeader, settings: EncoderSettings) -> Self {
        match &header.profile {
            Profile::Paper(paper) => {
                Self::Paper(Box::new(PaperCoder::new(header.grid, paper, settings, Cpu::default())))
            }
            Profile::Main => {
                let encoder = MainEncoder::new(header.grid, header.mask_coding, settings, Cpu::default());
                Self::Main(Box::new(encoder))
            }
        }
    }

    /// What the decoder will have after the last frame; `None` before the first.
    #[must_use]
    pub fn reconstruction(&self) -> Option<&SparseVolume> {
        match self {
            Self::Paper(coder) => coder.reconstruction(),
            Self::Main(encoder) => encoder.reconstruction(),
        }
    }
}

impl<P: EncodeBackend, M: SearchBackend> FrameCoder<P, M> {
    /// Codes the next frame.
    ///
    /// # Errors
    /// The backend's: see [`BackendError`].
    ///
    /// # Panics
    /// If the volume is not on the stream's grid.
    pub fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, BackendError> {
        match self {
            Self::Paper(coder) => coder.code(volume),
            Self::Main(encoder) => Ok(encoder.encode(volume)?.into()),
        }
    }

    /// Rate control of the colour of the frame coded last.
    pub fn colour_rate(&mut self) -> ColourRate<'_> {
        match self {
            Self::Paper(_) => ColourRate::CONSTANT,
            Self::Main(encoder) => encoder.colour_rate(),
        }
    }
}
