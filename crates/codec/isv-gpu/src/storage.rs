//! Memory of the GPU.

use crate::{Gpu, GpuError};
use bytemuck::{NoUninit, cast_slice};
use wgpu::{Buffer, BufferSize, QueueWriteBufferView};

/// What a buffer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Usage {
    /// Kernels read and write it.
    Kernels,
    /// Parameters of kernels.
    Parameters,
    /// It is read from here.
    Reading,
    /// Times by the GPU's clock.
    Times,
}

/// A buffer, which is given back when it is dropped.
#[derive(Debug)]
pub(crate) struct Storage {
    gpu: Gpu,
    buffer: Buffer,
}

impl Storage {
    pub(crate) fn new(gpu: Gpu, buffer: Buffer) -> Self {
        Self { gpu, buffer }
    }

    pub(crate) fn buffer(&self) -> &Buffer {
        &self.buffer
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.buffer.size()
    }
}

impl Drop for Storage {
    fn drop(&mut self) {
        self.gpu.release(self.buffer.size());
    }
}

/// A buffer that grows to what is put into it, and serves one frame after the other.
#[derive(Debug)]
pub(crate) struct GrowingBuffer {
    what: &'static str,
    usage: Usage,
    storage: Option<Storage>,
}

impl GrowingBuffer {
    /// No memory yet.
    pub(crate) fn new(what: &'static str) -> Self {
        Self { what, usage: Usage::Kernels, storage: None }
    }

    /// A buffer for the CPU to read, without memory yet.
    pub(crate) fn for_reading(what: &'static str) -> Self {
        Self { what, usage: Usage::Reading, storage: None }
    }

    /// The buffer, of this many bytes at least, whatever is in them.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(crate) fn of(&mut self, gpu: &Gpu, bytes: u64) -> Result<&Storage, GpuError> {
        let storage = match self.storage.take() {
            Some(storage) if storage.bytes() >= bytes => storage,
            // A little more, so that it serves the next frames too.
            small => {
                drop(small);
                gpu.storage(self.what, (bytes + bytes / 4).min(gpu.binding_bytes()).max(bytes), self.usage)?
            }
        };
        Ok(self.storage.insert(storage))
    }

    /// The buffer with these values at its start.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(crate) fn holding<T: NoUninit>(&mut self, gpu: &Gpu, values: &[T]) -> Result<&Storage, GpuError> {
        let bytes: &[u8] = cast_slice(values);
        let storage = self.of(gpu, bytes.len() as u64)?;
        write(gpu, storage, 0, bytes);
        Ok(storage)
    }
}

/// Writes bytes, a multiple of four, to a buffer before all commands that are submitted later.
pub(crate) fn write(gpu: &Gpu, storage: &Storage, at: u64, bytes: &[u8]) {
    if let Some(size) = BufferSize::new(bytes.len() as u64) {
        let view: Option<QueueWriteBufferView> = gpu.queue().write_buffer_with(storage.buffer(), at, size);
        if let Some(mut view) = view {
            view.copy_from_slice(bytes);
        }
    }
}
