//! What frames are made with.

use super::coded_blocks::CodedBuffers;
use super::extrapolated_blocks::ExtrapolatedBuffers;
use super::kernels::Kernels;
use super::syntax_readback::ReadbackBuffers;
use crate::commands::Commands;
use crate::encode::EncodeTools;
use crate::kernel::Kernel;
use crate::pool::SamplePool;
use crate::{Gpu, GpuError, Storage, VolumeStore};
use std::sync::MutexGuard;

/// Kernels, and memory that serves one frame after the other.
#[derive(Debug)]
pub(crate) struct DecodeResources {
    pub(crate) store: VolumeStore,
    pub(super) kernels: Kernels,
    pub(super) coded_buffers: CodedBuffers,
    pub(super) extrapolated_buffers: ExtrapolatedBuffers,
    pub(super) readback_buffers: ReadbackBuffers,
    /// What only an encoder needs, once it was needed.
    pub(crate) encoding: Option<EncodeTools>,
}

impl DecodeResources {
    /// Kernels, and no memory yet.
    ///
    /// # Errors
    /// [`GpuError::Refused`].
    pub(super) fn new(store: &VolumeStore) -> Result<Self, GpuError> {
        Ok(Self {
            store: store.clone(),
            kernels: Kernels::new(store.gpu())?,
            coded_buffers: CodedBuffers::default(),
            extrapolated_buffers: ExtrapolatedBuffers::default(),
            readback_buffers: ReadbackBuffers::default(),
            encoding: None,
        })
    }
}

/// The commands of a frame in the making.
pub(super) struct FrameCommands<'a> {
    pub(super) gpu: &'a Gpu,
    pub(super) kernels: &'a Kernels,
    pub(super) pool: MutexGuard<'a, SamplePool>,
    pub(super) commands: Commands,
}

impl<'a> FrameCommands<'a> {
    /// None yet; the samples are ours meanwhile.
    pub(super) fn new(store: &'a VolumeStore, kernels: &'a Kernels) -> Self {
        let commands = Commands::new(store.gpu());
        Self { gpu: store.gpu(), kernels, pool: store.pool(), commands }
    }

    /// Runs a kernel: see [`Commands::run`].
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(super) fn run(
        &mut self,
        kernel: &Kernel,
        words: &[u32],
        buffers: &[&Storage],
        groups: u32,
    ) -> Result<(), GpuError> {
        self.commands.run(kernel, Some(&self.pool), words, buffers, groups)
    }
}
