//! Encoding on a GPU: the arithmetic on samples of [`isv_encode`] in profile `paper`, and its search for motion in profile `main`.
//!
//! | file | profile | step |
//! |---|---|---|
//! | `search` | `paper` | motion of every block, in floating point |
//! | `code` | `paper` | levels of every block and the frame that they give, with the CPU's bits |
//! | `tools` | `paper` | kernels, compiled when an encoder first needs them |
//! | `shifts` | `main` | motion of every block and of cubes of blocks, in floating point |

mod code;
#[cfg(test)]
mod main_tests;
mod search;
pub(crate) mod shaders;
mod shifts;
#[cfg(test)]
mod tests;
mod tools;

use crate::decode::check_edge;
use crate::{GpuBackend, GpuError, GpuPaperFrame, GpuVolume, VolumeStore};
use isv_decode::BackendError;
use isv_decode::paper::{CodingParameters, FrameSymbols};
use isv_encode::{EncodeBackend, EncoderSettings, FrameCoder, MainEncoder, PaperCoder};
use isv_format::{Prediction, Profile, StreamHeader};
use isv_kernels::warp::MotionVector;
use isv_volume::{BlockEdge, SparseVolume};

pub use shifts::GpuMotionSearch;
pub(crate) use tools::EncodeTools;

/// A coder of frames on a GPU, where in profile `main` motion is searched for.
///
/// # Errors
/// [`GpuError::Unsupported`] for blocks of another edge than 8 voxels, and [`GpuError::Refused`] if the driver does not take a
/// kernel.
///
/// # Panics
/// If `settings.gop` is 0.
pub fn frame_coder(
    header: &StreamHeader,
    settings: EncoderSettings,
    store: &VolumeStore,
) -> Result<FrameCoder<GpuBackend, GpuMotionSearch>, GpuError> {
    if header.grid.edge != BlockEdge::E8 {
        return Err(GpuError::Unsupported("blocks of another edge than 8 voxels"));
    }
    Ok(match &header.profile {
        Profile::Paper(paper) => {
            let backend = GpuBackend::new(store)?;
            FrameCoder::Paper(Box::new(PaperCoder::new(header.grid, paper, settings, backend)))
        }
        Profile::Main => {
            let search = GpuMotionSearch::new(store)?;
            FrameCoder::Main(Box::new(MainEncoder::new(header.grid, header.mask_coding, settings, search)))
        }
    })
}

impl EncodeBackend for GpuBackend {
    type Source = GpuVolume;

    fn upload(&mut self, volume: &SparseVolume) -> Result<GpuVolume, BackendError> {
        check_edge(volume.grid().edge)?;
        Ok(GpuVolume::upload(&self.0.store, volume)?)
    }

    fn search_motion(
        &mut self,
        prediction: Prediction,
        source: &GpuVolume,
        references: &[Option<u32>],
        before: &GpuPaperFrame,
    ) -> Result<Vec<MotionVector>, BackendError> {
        Ok(self.0.search_motion(prediction == Prediction::SixDof, source, references, before)?)
    }

    fn code_paper(
        &mut self,
        parameters: &CodingParameters,
        source: &GpuVolume,
        symbols: &mut FrameSymbols,
        before: Option<&GpuPaperFrame>,
    ) -> Result<GpuPaperFrame, BackendError> {
        let (levels, frame) = self.0.code_paper(parameters, source, symbols, before)?;
        symbols.levels = levels;
        Ok(frame)
    }
}
