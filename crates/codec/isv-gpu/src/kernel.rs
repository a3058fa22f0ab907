//! Kernels: what the GPU runs.

use crate::error::one_line;
use crate::{Gpu, GpuError};
use naga::front::wgsl;
use naga::{AddressSpace, Module, StorageAccess};
use std::borrow::Cow;
use std::fmt::Display;
use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, BufferBindingType,
    ComputePipeline, ComputePipelineDescriptor, ErrorFilter, PipelineCompilationOptions,
    PipelineLayoutDescriptor, ShaderModuleDescriptor, ShaderSource, ShaderStages,
};

/// A shader: parts of WGSL that make a module together, one of which has the entry points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shader {
    /// Name in messages, which no other shader has.
    pub(crate) name: &'static str,
    /// Parts of the text; what is used comes before what uses it.
    pub(crate) parts: &'static [&'static str],
}

impl Shader {
    /// The module's text, for pools whose segments hold `2^segment_bits` blocks.
    pub(crate) fn source(&self, segment_bits: u32) -> String {
        let constants = format!("const SEGMENT_BITS = {segment_bits}u;\n");
        let parts = self.parts.iter().copied();
        [constants.as_str()].into_iter().chain(parts).collect::<Vec<_>>().join("\n")
    }
}

/// Group of the sample pool's segments in all shaders.
pub(crate) const POOL_GROUP: u32 = 0;
/// Group of everything else: parameters at binding 0, then buffers.
pub(crate) const OWN_GROUP: u32 = 1;

/// What tells one kernel of a device from another: shader, entry point and segment bits.
pub(crate) type KernelKey = (&'static str, &'static str, u32);

/// A compiled kernel. Copies share what was compiled.
#[derive(Clone, Debug)]
pub(crate) struct Kernel {
    /// Name of the entry point.
    pub(crate) name: &'static str,
    pub(crate) pipeline: ComputePipeline,
    /// Layouts of [`POOL_GROUP`] and [`OWN_GROUP`].
    pub(crate) groups: [BindGroupLayout; 2],
    /// Whether it looks at the sample pool.
    pub(crate) uses_pool: bool,
    /// Bindings of its own buffers.
    pub(crate) bindings: Vec<u32>,
    /// Whether it has parameters.
    pub(crate) has_parameters: bool,
}

impl Kernel {
    /// An entry point of a shader. A device compiles it once, whoever asks for it.
    ///
    /// # Errors
    /// [`GpuError::Refused`] if the shader is wrong or the driver does not take it.
    pub(crate) fn new(
        gpu: &Gpu,
        shader: &Shader,
        entry: &'static str,
        segment_bits: u32,
    ) -> Result<Self, GpuError> {
        let key = (shader.name, entry, segment_bits);
        let known = gpu.kernels().get(&key).cloned();
        if let Some(kernel) = known {
            return Ok(kernel);
        }
        // Two threads that ask at once compile it twice: nobody waits for kernels of others.
        let kernel = Self::compile(gpu, shader, entry, segment_bits)?;
        gpu.kernels().insert(key, kernel.clone());
        Ok(kernel)
    }

    fn compile(gpu: &Gpu, shader: &Shader, entry: &'static str, segment_bits: u32) -> Result<Self, GpuError> {
        let refused =
            |error: &dyn Display| GpuError::Refused(format!("{}, {entry}: {}", shader.name, one_line(error)));
        let module = wgsl::parse_str(&shader.source(segment_bits));
        let module = module.map_err(|error| refused(&error))?;
        let entries = [POOL_GROUP, OWN_GROUP].map(|group| entries(&module, group));
        let groups = entries.each_ref().map(|entries| {
            let descriptor = BindGroupLayoutDescriptor { label: Some(shader.name), entries };
            gpu.device().create_bind_group_layout(&descriptor)
        });
        let layout = gpu.device().create_pipeline_layout(&PipelineLayoutDescriptor {
            label: Some(shader.name),
            bind_group_layouts: &[Some(&groups[0]), Some(&groups[1])],
            ..PipelineLayoutDescriptor::default()
        });
        // Whatever goes wrong here is of this kernel. The driver's compiler fails with internal errors.
        let filters = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory];
        let scopes = filters.map(|filter| gpu.device().push_error_scope(filter));
        let source = ShaderSource::Naga(Cow::Owned(module));
        let module =
            gpu.device().create_shader_module(ShaderModuleDescriptor { label: Some(shader.name), source });
        let pipeline = gpu.device().create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            // Kernels write what they share before they read it.
            compilation_options: PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..PipelineCompilationOptions::default()
            },
            cache: None,
        });
        let errors = scopes.into_iter().rev().map(|scope| pollster::block_on(scope.pop()));
        if let Some(error) = errors.collect::<Vec<_>>().into_iter().flatten().next() {
            return Err(refused(&error));
        }
        let own = entries[1].iter().map(|entry| entry.binding);
        Ok(Self {
            name: entry,
            pipeline,
            groups,
            uses_pool: !entries[0].is_empty(),
            has_parameters: own.clone().any(|binding| binding == 0),
            bindings: own.filter(|binding| *binding != 0).collect(),
        })
    }
}

/// The bindings of a group, in order.
fn entries(module: &Module, group: u32) -> Vec<BindGroupLayoutEntry> {
    let globals = module.global_variables.iter().filter_map(|(_, global)| {
        let binding = global.binding.as_ref().filter(|binding| binding.group == group)?.binding;
        let ty = match global.space {
            AddressSpace::Uniform => BufferBindingType::Uniform,
            AddressSpace::Storage { access } => {
                BufferBindingType::Storage { read_only: !access.contains(StorageAccess::STORE) }
            }
            _ => return None,
        };
        Some(BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty: BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        })
    });
    let mut entries: Vec<_> = globals.collect();
    entries.sort_unstable_by_key(|entry| entry.binding);
    entries
}
