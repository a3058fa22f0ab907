//! The reference.

use super::{EncodeBackend, SearchBackend};
use crate::main::{BlockShifts, MotionQuery};
use crate::paper::motion_search::search_motion;
use crate::paper::residual::quantized_residual;
use isv_decode::BackendError;
use isv_decode::backend::{Cpu, CpuPaperFrame};
use isv_decode::main::MainReference;
use isv_decode::paper::reconstruct::{add_residuals, predict};
use isv_decode::paper::{CodingParameters, FrameSymbols, Reference};
use isv_format::Prediction;
use isv_kernels::warp::MotionVector;
use isv_volume::SparseVolume;

/// It fails only where frames are decoded at reduced resolution: [`BackendError::Unsupported`].
impl EncodeBackend for Cpu {
    type Source = SparseVolume;

    fn upload(&mut self, volume: &SparseVolume) -> Result<SparseVolume, BackendError> {
        Ok(volume.clone())
    }

    fn search_motion(
        &mut self,
        prediction: Prediction,
        source: &SparseVolume,
        references: &[Option<u32>],
        before: &CpuPaperFrame,
    ) -> Result<Vec<MotionVector>, BackendError> {
        Ok(search_motion(prediction, source, at_full_resolution(before)?, references))
    }

    fn code_paper(
        &mut self,
        parameters: &CodingParameters,
        source: &SparseVolume,
        symbols: &mut FrameSymbols,
        before: Option<&CpuPaperFrame>,
    ) -> Result<CpuPaperFrame, BackendError> {
        let before = before.map(at_full_resolution).transpose()?;
        let mut samples = predict(parameters, symbols, before);
        symbols.levels = quantized_residual(parameters, source, &samples);
        add_residuals(parameters, &symbols.levels, &mut samples);
        let (coords, unobserved) = (symbols.coords.clone(), symbols.unobserved.clone());
        let decoded = SparseVolume::from_parts(parameters.grid, coords, samples, unobserved);
        Ok(Reference::new(decoded).into())
    }
}

/// It never fails.
impl SearchBackend for Cpu {
    fn keep(&mut self, _frame: &MainReference) -> Result<(), BackendError> {
        Ok(())
    }

    fn find_shifts(&mut self, _frame: &MotionQuery) -> Result<Option<Vec<BlockShifts>>, BackendError> {
        Ok(None)
    }
}

fn at_full_resolution(frame: &CpuPaperFrame) -> Result<&Reference, BackendError> {
    frame.reference().ok_or(BackendError::Unsupported("encoding at reduced resolution"))
}
