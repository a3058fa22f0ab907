//! Where work is to be done: on the CPU or on a GPU.

use crate::{Gpu, GpuChoice, GpuError, VolumeStore};
use std::fmt;
use std::str::FromStr;

/// Who is to do the arithmetic on samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// A real GPU if there is one that can, else the CPU; and the CPU from where a GPU fails.
    Auto,
    /// The CPU.
    #[default]
    Cpu,
    /// A GPU, be it one in software, or an error.
    Gpu,
}

/// A choice carried out.
#[derive(Clone, Debug)]
pub enum OpenedBackend {
    /// The CPU.
    Cpu,
    /// The CPU, as there is no GPU that can; why.
    FellBack(GpuError),
    /// A GPU.
    Gpu(VolumeStore),
}

impl BackendChoice {
    /// All of them, by name.
    pub const NAMES: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("cpu", Self::Cpu), ("gpu", Self::Gpu)];

    /// Opens what is chosen. `name`: a part of the name of the GPU to use, where there are several.
    ///
    /// # Errors
    /// For [`Self::Gpu`] alone, what [`Gpu::open`] and [`VolumeStore::new`] say.
    pub fn open(self, name: Option<&str>) -> Result<OpenedBackend, GpuError> {
        let open = |software: bool| {
            let name = name.map(str::to_owned);
            let gpu = Gpu::open(&GpuChoice { name, software, ..GpuChoice::default() })?;
            VolumeStore::new(&gpu)
        };
        match self {
            Self::Cpu => Ok(OpenedBackend::Cpu),
            Self::Gpu => open(true).map(OpenedBackend::Gpu),
            // A GPU in software would be slower than the CPU.
            Self::Auto => Ok(open(false).map_or_else(OpenedBackend::FellBack, OpenedBackend::Gpu)),
        }
    }
}

impl fmt::Display for BackendChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.into_iter().find(|(_, choice)| choice == self);
        f.write_str(name.expect("every choice has a name").0)
    }
}

impl FromStr for BackendChoice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = Self::NAMES.into_iter().find(|(own, _)| *own == name).map(|(_, choice)| choice);
        known.ok_or_else(|| format!("`{name}` is not one of auto, cpu, gpu"))
    }
}
