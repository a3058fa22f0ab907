//! A GPU that is ready to work.

use crate::adapter::{AdapterKind, AdapterReport, enumerate, report};
use crate::adapter::{SHARED_BYTES, STORAGE_BUFFERS, THREADS};
use crate::commands::Commands;
use crate::error::one_line;
use crate::kernel::{Kernel, KernelKey};
use crate::storage::Usage;
use crate::{GpuError, KernelTime, Storage};
use pollster::block_on;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use wgpu::{
    Adapter, BufferDescriptor, BufferUsages, CommandBuffer, Device, DeviceDescriptor, Error, ErrorFilter,
    Features, Limits, MapMode, PollType, Queue,
};

/// Most bytes of a buffer that a kernel sees where nothing else is asked for, if the device allows as much. All allow 128 MiB.
const BINDING_BYTES: u64 = 1 << 30;

/// Bytes of the buffer whose copying is timed, how often it is copied at a time, and how often that is timed.
const COPY_BYTES: u64 = 64 << 20;
const COPIES: u32 = 32;
const COPY_TRIALS: usize = 4;

/// Which GPU to open, and how much of it to use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GpuChoice {
    /// A part of its name, in any case; without it, the first real card, and then the first of what else there is.
    pub name: Option<String>,
    /// Whether a driver that computes on the processor will do.
    pub software: bool,
    /// Bytes of a buffer that a kernel sees at most; what is larger is split. Never more than the device allows.
    pub binding_bytes: u64,
}

impl Default for GpuChoice {
    /// Any real GPU, buffers of 1 GiB.
    fn default() -> Self {
        Self { name: None, software: false, binding_bytes: BINDING_BYTES }
    }
}

/// An open GPU. Copies share it.
#[derive(Clone, Debug)]
pub struct Gpu(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    report: AdapterReport,
    device: Device,
    queue: Queue,
    binding_bytes: u64,
    /// The first thing that went wrong since it was last asked.
    fault: Arc<Mutex<Option<GpuError>>>,
    memory: Mutex<Memory>,
    /// All kernels that were compiled.
    kernels: Mutex<HashMap<KernelKey, Kernel>>,
    /// Times of kernels, while they are taken.
    times: Mutex<Option<BTreeMap<&'static str, KernelTime>>>,
}

/// Bytes of buffers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Now.
    pub bytes: u64,
    /// At the most so far.
    pub peak: u64,
}

impl Gpu {
    /// Opens a GPU.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] if there is none that fits, [`GpuError::TooSmall`] if it can do too little,
    /// [`GpuError::NotOpened`] if the driver refuses.
    pub fn open(choice: &GpuChoice) -> Result<Self, GpuError> {
        let (adapter, report) = choose(choice)?;
        if let Some(fault) = report.fault {
            return Err(fault);
        }
        let binding_bytes = choice.binding_bytes.min(report.binding_bytes).min(report.buffer_bytes);
        let limits = Limits {
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_compute_invocations_per_workgroup: THREADS,
            max_compute_workgroup_size_x: THREADS,
            max_compute_workgroup_storage_size: SHARED_BYTES,
            max_storage_buffer_binding_size: binding_bytes,
            max_buffer_size: report.buffer_bytes,
            ..Limits::default()
        };
        let descriptor = DeviceDescriptor {
            label: Some("isv"),
            required_features: adapter.features() & Features::TIMESTAMP_QUERY,
            required_limits: limits,
            ..DeviceDescriptor::default()
        };
        let opened = block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| GpuError::NotOpened {
            adapter: report.name.clone(),
            reason: one_line(&error),
        })?;
        let fault = Arc::new(Mutex::new(None));
        let (on_error, on_loss) = (Arc::clone(&fault), Arc::clone(&fault));
        device.on_uncaptured_error(Arc::new(move |error: Error| note(&on_error, GpuError::refused(&error))));
        device.set_device_lost_callback(move |_, reason| note(&on_loss, GpuError::Lost(reason)));
        let report = AdapterReport { fault: None, ..report };
        Ok(Self(Arc::new(Inner {
            report,
            device,
            queue,
            binding_bytes,
            fault,
            memory: Mutex::default(),
            kernels: Mutex::default(),
            times: Mutex::default(),
        })))
    }

    /// What its driver says of it.
    #[must_use]
    pub fn report(&self) -> &AdapterReport {
        &self.0.report
    }

    /// Bytes of the buffers that it holds for us.
    #[must_use]
    pub fn memory(&self) -> Memory {
        *self.0.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the times of all kernels from now on, for which each list of commands is waited for. Not if the device has no clock
    /// ([`AdapterReport::has_timestamps`]).
    pub fn start_timing(&self) {
        if self.0.report.has_timestamps {
            *self.times() = Some(BTreeMap::new());
        }
    }

    /// The times of kernels since they were taken, by name; they are taken no more.
    pub fn take_times(&self) -> BTreeMap<&'static str, KernelTime> {
        self.times().take().unwrap_or_default()
    }

    pub(crate) fn times(&self) -> MutexGuard<'_, Option<BTreeMap<&'static str, KernelTime>>> {
        self.0.times.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The kernels that were compiled so far.
    pub(crate) fn kernels(&self) -> MutexGuard<'_, HashMap<KernelKey, Kernel>> {
        self.0.kernels.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until all that was submitted is done.
    ///
    /// # Errors
    /// What went wrong so far: [`GpuError::Lost`], [`GpuError::OutOfMemory`], [`GpuError::Refused`].
    pub fn wait(&self) -> Result<(), GpuError> {
        let waited = self.0.device.poll(PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// How many bytes a second it copies from one buffer to another, each byte counted once: what bounds every kernel.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub fn copy_rate(&self) -> Result<f64, GpuError> {
        let bytes = self.binding_bytes().min(COPY_BYTES);
        let [from, to] =
            [self.storage("a copy", bytes, Usage::Kernels)?, self.storage("a copy", bytes, Usage::Kernels)?];
        let reading = self.storage("the end of a copy", 4, Usage::Reading)?;
        let mut best = f64::INFINITY;
        for _ in 0..COPY_TRIALS {
            let start = Instant::now();
            let mut commands = Commands::new(self);
            (0..COPIES).for_each(|_| commands.copy(&from, &to, bytes));
            commands.copy(&to, &reading, 4);
            commands.submit()?;
            self.read(&[(&reading, 4)])?;
            best = best.min(start.elapsed().as_secs_f64());
        }
        Ok(bytes as f64 * f64::from(COPIES) / best)
    }

    /// Bytes of a buffer that a kernel sees at most.
    pub(crate) fn binding_bytes(&self) -> u64 {
        self.0.binding_bytes
    }

    pub(crate) fn device(&self) -> &Device {
        &self.0.device
    }

    pub(crate) fn queue(&self) -> &Queue {
        &self.0.queue
    }

    /// A buffer of zeros; at least of four bytes, and a multiple of four.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub(crate) fn storage(&self, what: &'static str, bytes: u64, usage: Usage) -> Result<Storage, GpuError> {
        let bytes = bytes.max(4).next_multiple_of(4);
        let limit = self.0.binding_bytes;
        if bytes > limit {
            return Err(GpuError::TooLarge { what, bytes, limit });
        }
        let scope = self.0.device.push_error_scope(ErrorFilter::OutOfMemory);
        let usage = match usage {
            Usage::Kernels => BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
            Usage::Parameters => BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            Usage::Reading => BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            Usage::Times => BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC,
        };
        let descriptor =
            BufferDescriptor { label: Some(what), size: bytes, usage, mapped_at_creation: false };
        let buffer = self.0.device.create_buffer(&descriptor);
        match block_on(scope.pop()) {
            Some(_) => Err(GpuError::OutOfMemory { what, bytes }),
            None => {
                self.account(|memory| {
                    memory.bytes += bytes;
                    memory.peak = memory.peak.max(memory.bytes);
                });
                Ok(Storage::new(self.clone(), buffer))
            }
        }
    }

    /// Forgets a buffer's bytes.
    pub(crate) fn release(&self, bytes: u64) {
        self.account(|memory| memory.bytes -= bytes);
    }

    fn account(&self, change: impl FnOnce(&mut Memory)) {
        change(&mut self.0.memory.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Hands commands to the GPU, which begins with them while we go on.
    ///
    /// # Errors
    /// What went wrong so far: [`GpuError::Lost`], [`GpuError::OutOfMemory`], [`GpuError::Refused`].
    pub(crate) fn submit(&self, commands: CommandBuffer) -> Result<(), GpuError> {
        self.0.queue.submit([commands]);
        self.check()
    }

    /// So many bytes from the start of each of some buffers made for [`Usage::Reading`], once all that was submitted is done.
    ///
    /// # Errors
    /// As [`Self::submit`].
    pub(crate) fn read(&self, buffers: &[(&Storage, u64)]) -> Result<Vec<Vec<u8>>, GpuError> {
        let wanted = || buffers.iter().filter(|(_, bytes)| *bytes > 0);
        for (storage, bytes) in wanted() {
            // Whether it succeeded is asked below, for all of them.
            storage.buffer().map_async(MapMode::Read, ..*bytes, |_| {});
        }
        let contents = |(storage, bytes): &(&Storage, u64)| {
            if *bytes == 0 {
                return Ok(Vec::new());
            }
            let view = storage.buffer().get_mapped_range(..*bytes);
            view.map(|view| view.to_vec()).map_err(|error| GpuError::Lost(error.to_string()))
        };
        let contents = self.wait().and_then(|()| buffers.iter().map(contents).collect());
        wanted().for_each(|(storage, _)| storage.buffer().unmap());
        contents
    }

    /// What went wrong so far, if anything.
    ///
    /// # Errors
    /// That.
    fn check(&self) -> Result<(), GpuError> {
        match self.0.fault.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            Some(fault) => Err(fault),
            None => Ok(()),
        }
    }

    /// Loses the device, as if the card had been pulled out: for tests of what happens then.
    #[doc(hidden)]
    pub fn lose(&self) {
        self.0.device.destroy();
        note(&self.0.fault, GpuError::Lost("it was destroyed".to_owned()));
    }
}

/// The adapter that fits a choice.
fn choose(choice: &GpuChoice) -> Result<(Adapter, AdapterReport), GpuError> {
    let adapters = enumerate().into_iter().map(|adapter| {
        let report = report(&adapter);
        (adapter, report)
    });
    let fits = |report: &AdapterReport| {
        let wanted = choice.name.as_ref().map(|name| name.to_lowercase());
        let named = wanted.is_none_or(|wanted| report.name.to_lowercase().contains(&wanted));
        named && (choice.software || report.kind != AdapterKind::Software)
    };
    let rank = |report: &AdapterReport| match report.kind {
        _ if report.fault.is_some() => 5,
        AdapterKind::Discrete => 0,
        AdapterKind::Integrated => 1,
        AdapterKind::Virtual => 2,
        AdapterKind::Other => 3,
        AdapterKind::Software => 4,
    };
    let fitting = adapters.filter(|(_, report)| fits(report));
    // One card can be reached by several interfaces; kernels are tested on Vulkan.
    fitting.min_by_key(|(_, report)| (rank(report), report.api != "vulkan")).ok_or_else(|| {
        GpuError::NoAdapter(match &choice.name {
            Some(name) => format!("none has \"{name}\" in its name"),
            None if choice.software => "no driver offers any".to_owned(),
            None => "no driver offers any but in software".to_owned(),
        })
    })
}

/// Keeps the first fault, unless the device was lost.
fn note(place: &Mutex<Option<GpuError>>, fault: GpuError) {
    let mut place = place.lock().unwrap_or_else(PoisonError::into_inner);
    if place.is_none() || matches!(fault, GpuError::Lost(_)) {
        *place = Some(fault);
    }
}
