//! `isv backends`: what this machine can compute with.

use crate::drivers;
use crate::output::print;
use crate::table::table_of;
use anyhow::Result;
use isv::raw::gpu::{AdapterReport, adapters};
use isv::raw::kernels::simd::Instructions;
use serde::Serialize;
use std::thread;

/// List what there is to compute with: the CPU's instruction sets, and GPUs with their limits
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The names of the fields are the keys of `isv backends --json`.
#[derive(Debug, Serialize)]
struct Backends {
    cpu: CpuInfo,
    gpus: Vec<GpuInfo>,
}

#[derive(Debug, Serialize)]
struct CpuInfo {
    threads: usize,
    /// Names for `--simd`.
    instruction_sets: Vec<String>,
}

#[derive(Debug, Serialize)]
struct GpuInfo {
    name: String,
    /// discrete, integrated, virtual, software or other.
    kind: String,
    api: String,
    driver: String,
    /// Bytes of the largest buffer.
    buffer_bytes: u64,
    /// Bytes of a buffer that a kernel sees at most.
    binding_bytes: u64,
    /// Buffers that a kernel sees at most.
    bindings: u32,
    workgroup_threads: u32,
    workgroup_bytes: u32,
    timestamps: bool,
    usable: bool,
    /// Why it is not usable.
    fault: Option<String>,
}

impl From<AdapterReport> for GpuInfo {
    fn from(report: AdapterReport) -> Self {
        Self {
            name: report.name,
            kind: report.kind.to_string(),
            api: report.api,
            driver: report.driver,
            buffer_bytes: report.buffer_bytes,
            binding_bytes: report.binding_bytes,
            bindings: report.bindings,
            workgroup_threads: report.threads,
            workgroup_bytes: report.shared_bytes,
            timestamps: report.has_timestamps,
            usable: report.fault.is_none(),
            fault: report.fault.map(|fault| fault.to_string()),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let cpu = CpuInfo {
        threads: thread::available_parallelism().map_or(1, usize::from),
        instruction_sets: Instructions::available().map(|set| set.to_string()).collect(),
    };
    let backends =
        Backends { cpu, gpus: drivers::quietly(adapters).into_iter().map(GpuInfo::from).collect() };
    print(&if args.json { serde_json::to_string_pretty(&backends)? } else { backends.table() })
}

impl Backends {
    fn table(&self) -> String {
        let CpuInfo { threads, instruction_sets } = &self.cpu;
        let cpu = format!("CPU: {threads} threads; {}", instruction_sets.join(", "));
        if self.gpus.is_empty() {
            return format!("{cpu}\nno GPU: no driver of Vulkan, Metal or DX12 offers any");
        }
        let mut table =
            table_of(["GPU", "kind", "interface", "driver", "buffer", "in a kernel", "shared", "usable"]);
        for gpu in &self.gpus {
            let usable = gpu.fault.as_deref().unwrap_or("yes").to_owned();
            let sizes = [gpu.buffer_bytes, gpu.binding_bytes, gpu.workgroup_bytes.into()].map(size);
            let [buffer, binding, shared] = sizes;
            let names = [&gpu.name, &gpu.kind, &gpu.api, &gpu.driver].map(Clone::clone);
            table.add_row(names.into_iter().chain([buffer, binding, shared, usable]));
        }
        format!("{cpu}\n{table}")
    }
}

/// Bytes in words.
fn size(bytes: u64) -> String {
    match bytes {
        0x4000_0000.. => format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30)),
        0x10_0000.. => format!("{} MiB", bytes >> 20),
        _ => format!("{} KiB", bytes >> 10),
    }
}
