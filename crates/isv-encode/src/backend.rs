//! The arithmetic on samples of profile `paper`'s encoder, apart from the writing of its symbols: who does it.
//!
//! ```text
//! SparseVolume ─> EncodeBackend: motion search ─> vectors ─> EncodeBackend: residual, DCT, quantizer ─> levels ─> range coder
//!                      ▲                                                 └─ inverse DCT: its frame ─┐
//!                      └────────────────────────────────────────────────────────────────────────────┘
//! ```

mod cpu;

use isv_decode::backend::Backend;
use isv_decode::{BackendError, CodingParameters, FrameSymbols};
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use isv_volume::SparseVolume;
use std::fmt;

/// What an encoder of profile `paper` asks of whoever does its arithmetic on samples. [`Cpu`](isv_decode::backend::Cpu) is the
/// reference.
///
/// Vectors are a choice, for which floating point may be used: those of two backends may differ. Under the same vectors all give
/// the same levels and the same frame.
pub trait EncodeBackend: Backend {
    /// A frame to be coded, where this backend keeps it.
    type Source: fmt::Debug;

    /// Takes a frame to be coded.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn upload(&mut self, volume: &SparseVolume) -> Result<Self::Source, BackendError>;

    /// One vector a block of the source (Sec. 3.5, Eq. 12 to 14); zero for blocks without a reference.
    ///
    /// - `prediction`: one that has motion.
    /// - `references`: of [`FrameSymbols::find_references`] in `before`.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn search_motion(
        &mut self,
        prediction: Prediction,
        source: &Self::Source,
        references: &[Option<u32>],
        before: &Self::Paper,
    ) -> Result<Vec<MotionVector>, BackendError>;

    /// Codes a source under the prediction and the motion of its symbols: fills in their levels (Eq. 3, 6, 7 and 10) and returns
    /// the frame that they give (Eq. 11), as [`Backend::reconstruct_paper`] makes it of the same symbols.
    ///
    /// # Errors
    /// See [`BackendError`].
    fn code_paper(
        &mut self,
        parameters: &CodingParameters,
        source: &Self::Source,
        symbols: &mut FrameSymbols,
        before: Option<&Self::Paper>,
    ) -> Result<Self::Paper, BackendError>;
}
