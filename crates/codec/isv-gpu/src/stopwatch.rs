//! How long kernels take, by the GPU's own clock.

use crate::storage::Usage;
use crate::{Gpu, GpuError, Storage};
use std::collections::BTreeMap;
use wgpu::{
    CommandEncoder, ComputePassTimestampWrites, QUERY_SET_MAX_QUERIES, QuerySet, QuerySetDescriptor,
    QueryType,
};

/// Time of a kernel, over all its dispatches.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KernelTime {
    /// Dispatches.
    pub dispatches: u32,
    /// Workgroups of all of them.
    pub workgroups: u64,
    /// Nanoseconds of all of them.
    pub nanoseconds: f64,
}

/// The dispatches of a list of commands, each with a time before and one after it.
#[derive(Debug)]
pub(crate) struct Stopwatch {
    queries: QuerySet,
    /// Name and workgroups of each dispatch.
    dispatches: Vec<(&'static str, u32)>,
}

impl Stopwatch {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let descriptor = QuerySetDescriptor {
            label: Some("times"),
            ty: QueryType::Timestamp,
            count: QUERY_SET_MAX_QUERIES,
        };
        Self { queries: gpu.device().create_query_set(&descriptor), dispatches: Vec::new() }
    }

    /// Timestamps that the next dispatch writes; `None` if there were too many before it.
    pub(crate) fn next(
        &mut self,
        name: &'static str,
        workgroups: u32,
    ) -> Option<ComputePassTimestampWrites<'_>> {
        let first = 2 * self.dispatches.len() as u32;
        if first >= QUERY_SET_MAX_QUERIES {
            return None;
        }
        self.dispatches.push((name, workgroups));
        Some(ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Has the times copied to where they can be read, as the last of the commands.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub(crate) fn stop(self, gpu: &Gpu, encoder: &mut CommandEncoder) -> Result<StoppedWatch, GpuError> {
        let count = 2 * self.dispatches.len() as u32;
        let bytes = 8 * u64::from(count);
        let times = gpu.storage("times", bytes, Usage::Times)?;
        let reading = gpu.storage("times to read", bytes, Usage::Reading)?;
        if count > 0 {
            encoder.resolve_query_set(&self.queries, 0..count, times.buffer(), 0);
            encoder.copy_buffer_to_buffer(times.buffer(), 0, reading.buffer(), 0, bytes);
        }
        Ok(StoppedWatch { dispatches: self.dispatches, reading, bytes })
    }
}

/// Times that are about to be there.
#[derive(Debug)]
pub(crate) struct StoppedWatch {
    dispatches: Vec<(&'static str, u32)>,
    reading: Storage,
    bytes: u64,
}

impl StoppedWatch {
    /// Adds the times to those of the kernels, once all is done.
    ///
    /// # Errors
    /// As [`Gpu::read`].
    pub(crate) fn add_to(
        self,
        gpu: &Gpu,
        kernels: &mut BTreeMap<&'static str, KernelTime>,
    ) -> Result<(), GpuError> {
        let period = f64::from(gpu.queue().get_timestamp_period());
        let bytes = gpu.read(&[(&self.reading, self.bytes)])?.remove(0);
        let times = bytes.as_chunks::<8>().0.as_chunks::<2>().0;
        for ((name, workgroups), [begin, end]) in self.dispatches.into_iter().zip(times) {
            let ticks = u64::from_le_bytes(*end).saturating_sub(u64::from_le_bytes(*begin));
            let kernel = kernels.entry(name).or_default();
            kernel.dispatches += 1;
            kernel.workgroups += u64::from(workgroups);
            kernel.nanoseconds += ticks as f64 * period;
        }
        Ok(())
    }
}
