//! Stores of volumes on a GPU.

use crate::blocks::INSERT;
use crate::kernel::Kernel;
use crate::pool::{SamplePool, segment_bits};
use crate::{Gpu, GpuError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A GPU with its sample pool. Volumes that are worked on together live in one store; copies share it.
#[derive(Clone, Debug)]
pub struct VolumeStore(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    gpu: Gpu,
    pool: Mutex<SamplePool>,
    insert: Kernel,
}

impl VolumeStore {
    /// An empty store.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], [`GpuError::Refused`].
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let insert = Kernel::new(gpu, &INSERT, "insert", segment_bits(gpu))?;
        Ok(Self(Arc::new(Inner { gpu: gpu.clone(), pool: Mutex::new(SamplePool::new(gpu)?), insert })))
    }

    /// The GPU.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.0.gpu
    }

    /// The samples of all volumes, which nobody else changes meanwhile. Slots are taken before commands are gathered: taking them
    /// can move the samples.
    pub(crate) fn pool(&self) -> MutexGuard<'_, SamplePool> {
        self.0.pool.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Enters blocks into their table.
    pub(crate) fn insert(&self) -> &Kernel {
        &self.0.insert
    }
}

/// Slots of one volume, given back when nobody has them any more.
#[derive(Debug)]
pub(crate) struct Slots {
    store: VolumeStore,
    slots: Vec<u32>,
}

impl Slots {
    /// Wraps slots that were taken or shared for a volume.
    pub(crate) fn new(store: &VolumeStore, slots: Vec<u32>) -> Self {
        Self { store: store.clone(), slots }
    }

    /// One for each block.
    pub(crate) fn get(&self) -> &[u32] {
        &self.slots
    }
}

impl Drop for Slots {
    fn drop(&mut self) {
        self.store.pool().give_back(&self.slots);
    }
}
