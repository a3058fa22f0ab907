//! The GPUs of this machine.

use crate::GpuError;
use pollster::block_on;
use std::fmt;
use wgpu::{Adapter, Backends, DeviceType, Features, Instance, InstanceDescriptor, Limits};

/// Storage buffers that a kernel binds at most: the four segments of the sample pool and eight more.
pub(crate) const STORAGE_BUFFERS: u32 = 12;
/// Threads of the largest workgroup.
pub(crate) const THREADS: u32 = 256;
/// Bytes that the threads of a workgroup share at most.
pub(crate) const SHARED_BYTES: u32 = 16 << 10;

/// What kind of thing a GPU is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterKind {
    /// A card with its own memory.
    Discrete,
    /// Part of the processor.
    Integrated,
    /// A GPU of the host, seen from a virtual machine.
    Virtual,
    /// A driver that computes on the processor: for tests.
    Software,
    /// The driver does not say.
    Other,
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Software => "software",
            Self::Other => "other",
        })
    }
}

/// A GPU of this machine as its driver describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterReport {
    /// The card's name.
    pub name: String,
    /// What kind it is.
    pub kind: AdapterKind,
    /// The interface that it is reached by: Vulkan, Metal, DX12.
    pub api: String,
    /// The driver and its version.
    pub driver: String,
    /// Bytes of the largest buffer.
    pub buffer_bytes: u64,
    /// Bytes of a buffer that a kernel sees at most.
    pub binding_bytes: u64,
    /// Buffers that a kernel sees at most.
    pub bindings: u32,
    /// Threads of the largest workgroup.
    pub threads: u32,
    /// Bytes that the threads of a workgroup share at most.
    pub shared_bytes: u32,
    /// Whether it tells the time between commands.
    pub has_timestamps: bool,
    /// Why it cannot be used, if it cannot.
    pub fault: Option<GpuError>,
}

/// The GPUs of this machine, in the order of its drivers. Those of one card by several interfaces are several.
#[must_use]
pub fn adapters() -> Vec<AdapterReport> {
    enumerate().iter().map(report).collect()
}

pub(crate) fn enumerate() -> Vec<Adapter> {
    let mut descriptor = InstanceDescriptor::new_without_display_handle();
    descriptor.backends = Backends::PRIMARY;
    block_on(Instance::new(descriptor).enumerate_adapters(Backends::PRIMARY))
}

/// What an adapter says of itself.
pub(crate) fn report(adapter: &Adapter) -> AdapterReport {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let kind = match info.device_type {
        DeviceType::DiscreteGpu => AdapterKind::Discrete,
        DeviceType::IntegratedGpu => AdapterKind::Integrated,
        DeviceType::VirtualGpu => AdapterKind::Virtual,
        DeviceType::Cpu => AdapterKind::Software,
        DeviceType::Other => AdapterKind::Other,
    };
    let driver = [info.driver, info.driver_info].into_iter().filter(|part| !part.is_empty());
    AdapterReport {
        kind,
        api: info.backend.to_string(),
        driver: driver.collect::<Vec<_>>().join(", "),
        buffer_bytes: limits.max_buffer_size,
        binding_bytes: limits.max_storage_buffer_binding_size,
        bindings: limits.max_storage_buffers_per_shader_stage,
        threads: limits.max_compute_invocations_per_workgroup,
        shared_bytes: limits.max_compute_workgroup_storage_size,
        has_timestamps: adapter.features().contains(Features::TIMESTAMP_QUERY),
        fault: check(&info.name, &limits).err(),
        name: info.name,
    }
}

/// Whether an adapter can do what all kernels need.
fn check(name: &str, limits: &Limits) -> Result<(), GpuError> {
    let needs = [
        ("storage buffers a kernel", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS),
        ("threads a workgroup", limits.max_compute_invocations_per_workgroup, THREADS),
        ("shared bytes a workgroup", limits.max_compute_workgroup_storage_size, SHARED_BYTES),
    ];
    for (what, found, needed) in needs {
        if found < needed {
            let adapter = name.to_owned();
            return Err(GpuError::TooSmall { adapter, what, found: found.into(), needed: needed.into() });
        }
    }
    Ok(())
}
