//! What frames of profile `paper` are coded with.

use super::shaders;
use crate::kernel::Kernel;
use crate::pool::segment_bits;
use crate::storage::GrowingBuffer;
use crate::{Gpu, GpuError};

/// Kernels, and memory that serves one frame after the other.
#[derive(Debug)]
pub(crate) struct EncodeTools {
    pub(super) search: Kernel,
    pub(super) code: Kernel,
    /// Whether blocks have references.
    pub(super) references: GrowingBuffer,
    pub(super) vectors: GrowingBuffer,
    pub(super) moved: GrowingBuffer,
    /// Place in the scan of each position.
    pub(super) places: GrowingBuffer,
    pub(super) levels: GrowingBuffer,
    /// What is read back: vectors or levels.
    pub(super) reading: GrowingBuffer,
}

impl EncodeTools {
    /// Kernels, and no memory yet.
    ///
    /// # Errors
    /// [`GpuError::Refused`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            search: Kernel::new(gpu, &shaders::SEARCH, "search", segment_bits(gpu))?,
            code: Kernel::new(gpu, &shaders::CODE, "code", segment_bits(gpu))?,
            references: GrowingBuffer::new("references"),
            vectors: GrowingBuffer::new("vectors"),
            moved: GrowingBuffer::new("moved blocks"),
            places: GrowingBuffer::new("scan"),
            levels: GrowingBuffer::new("levels"),
            reading: GrowingBuffer::for_reading("vectors or levels to read"),
        })
    }

    /// The tools, made if they were not yet.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn of<'a>(tools: &'a mut Option<Self>, gpu: &Gpu) -> Result<&'a mut Self, GpuError> {
        Ok(match tools {
            Some(tools) => tools,
            None => tools.insert(Self::new(gpu)?),
        })
    }
}
