//! A list of commands for the GPU.

use crate::kernel::Kernel;
use crate::pool::SamplePool;
use crate::stopwatch::Stopwatch;
use crate::storage::{Usage, write};
use crate::{Gpu, GpuError, Storage};
use std::mem::replace;
use wgpu::{
    BindGroupDescriptor, BindGroupEntry, BindingResource, Buffer, BufferBinding, BufferSize, CommandEncoder,
    CommandEncoderDescriptor, ComputePassDescriptor,
};

/// Bytes from one dispatch's parameters to the next one's.
const PARAMETERS: u64 = 256;
/// Dispatches whose parameters are in one buffer, and that are handed over together.
const AT_ONCE: u64 = 256;
/// Most workgroups along an axis that every device allows.
const GROUPS_ALONG: u32 = 65_535;

/// Commands that are being gathered, to run in order.
#[derive(Debug)]
pub(crate) struct Commands {
    gpu: Gpu,
    encoder: CommandEncoder,
    /// Buffers of parameters, and how many dispatches have theirs.
    parameters: Vec<Storage>,
    dispatches: u64,
    /// While times are taken.
    stopwatch: Option<Stopwatch>,
}

impl Commands {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let encoder = gpu.device().create_command_encoder(&CommandEncoderDescriptor::default());
        let stopwatch = gpu.times().is_some().then(|| Stopwatch::new(gpu));
        Self { gpu: gpu.clone(), encoder, parameters: Vec::new(), dispatches: 0, stopwatch }
    }

    /// Runs a kernel in `groups` workgroups, none if that is 0, after all that was gathered before.
    ///
    /// - `pool`: where its samples are, if it looks at any.
    /// - `parameters`: at most 64 words.
    /// - `buffers`: in the order of its bindings.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    ///
    /// # Panics
    /// If there are not as many buffers as bindings, or no pool where one is needed.
    pub(crate) fn run(
        &mut self,
        kernel: &Kernel,
        pool: Option<&SamplePool>,
        parameters: &[u32],
        buffers: &[&Storage],
        groups: u32,
    ) -> Result<(), GpuError> {
        if groups == 0 {
            return Ok(());
        }
        assert_eq!(buffers.len(), kernel.bindings.len(), "a buffer for each binding");
        let own = kernel.bindings.iter().zip(buffers).map(|(binding, storage)| BindGroupEntry {
            binding: *binding,
            resource: storage.buffer().as_entire_binding(),
        });
        let mut entries: Vec<_> = own.collect();
        let at = self.dispatches % AT_ONCE * PARAMETERS;
        if kernel.has_parameters {
            if at == 0 {
                self.begin_part()?;
                self.parameters.push(self.gpu.storage(
                    "parameters",
                    PARAMETERS * AT_ONCE,
                    Usage::Parameters,
                )?);
            }
            self.dispatches += 1;
            let storage = self.parameters.last().expect("parameters have a buffer");
            write(&self.gpu, storage, at, bytemuck::cast_slice(parameters));
            let size = BufferSize::new(PARAMETERS);
            let resource =
                BindingResource::Buffer(BufferBinding { buffer: storage.buffer(), offset: at, size });
            entries.push(BindGroupEntry { binding: 0, resource });
        }
        let bind = |layout: usize, entries: &[BindGroupEntry]| {
            let layout = &kernel.groups[layout];
            self.gpu.device().create_bind_group(&BindGroupDescriptor { label: None, layout, entries })
        };
        let own = bind(1, &entries);
        let pool = match pool.filter(|_| kernel.uses_pool) {
            Some(pool) => bind(0, &pool.entries()),
            None => bind(0, &[]),
        };
        let timestamp_writes = self.stopwatch.as_mut().and_then(|watch| watch.next(kernel.name, groups));
        let descriptor = ComputePassDescriptor { label: Some(kernel.name), timestamp_writes };
        let mut pass = self.encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &pool, &[]);
        pass.set_bind_group(1, &own, &[]);
        let along = groups.min(GROUPS_ALONG);
        pass.dispatch_workgroups(along, groups.div_ceil(along), 1);
        Ok(())
    }

    /// Hands what was gathered so far to the GPU, if anything. Drivers reset devices that work on one list for seconds, and a
    /// stream can ask for tens of thousands of dispatches.
    fn begin_part(&mut self) -> Result<(), GpuError> {
        if self.dispatches > 0 {
            let next = self.gpu.device().create_command_encoder(&CommandEncoderDescriptor::default());
            self.gpu.submit(replace(&mut self.encoder, next).finish())?;
        }
        Ok(())
    }

    /// Copies bytes, a multiple of four, from the start of one buffer to that of another.
    pub(crate) fn copy(&mut self, from: &Storage, to: &Storage, bytes: u64) {
        self.copy_between((from.buffer(), 0), (to.buffer(), 0), bytes);
    }

    /// Copies bytes, all multiples of four, from a place in one buffer to one in another.
    pub(crate) fn copy_between(&mut self, from: (&Buffer, u64), to: (&Buffer, u64), bytes: u64) {
        if bytes > 0 {
            self.encoder.copy_buffer_to_buffer(from.0, from.1, to.0, to.1, bytes.next_multiple_of(4));
        }
    }

    /// Hands all of them to the GPU.
    ///
    /// # Errors
    /// As [`Gpu::submit`].
    pub(crate) fn submit(mut self) -> Result<(), GpuError> {
        let watch =
            self.stopwatch.take().map(|watch| watch.stop(&self.gpu, &mut self.encoder)).transpose()?;
        self.gpu.submit(self.encoder.finish())?;
        match (watch, &mut *self.gpu.times()) {
            (Some(watch), Some(times)) => watch.add_to(&self.gpu, times),
            _ => Ok(()),
        }
    }
}
