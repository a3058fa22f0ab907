//! Devices that do the arithmetic on samples: the CPU, or a GPU with the CPU to fall back on.

#[cfg(not(feature = "gpu"))]
mod cpu;
#[cfg(feature = "gpu")]
mod gpu;

#[cfg(not(feature = "gpu"))]
use cpu as used;
#[cfg(feature = "gpu")]
use gpu as used;

use crate::{Event, Observer};
use isv_decode::Lod;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

#[cfg(feature = "encode")]
pub(crate) use used::{AnyAccumulator, AnyCoder, AnyFusion, AnyMeshIngester, GpuIngestError};
pub use used::{AnyDecoder, AnyFrame, AnyVolume, OpenDevice};

/// A device that does the arithmetic on samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// A real GPU if there is one that can, else the CPU; and the CPU from where a GPU fails.
    Auto,
    /// The CPU.
    #[default]
    Cpu,
    /// A GPU, be it one in software, or an error.
    Gpu,
}

impl Device {
    /// All devices, by name.
    pub const NAMES: [(&'static str, Self); 3] =
        [("auto", Self::Auto), ("cpu", Self::Cpu), ("gpu", Self::Gpu)];
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.into_iter().find(|(_, device)| device == self);
        f.write_str(name.expect("every device has a name").0)
    }
}

impl FromStr for Device {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = Self::NAMES.into_iter().find(|(own, _)| *own == name).map(|(_, device)| device);
        known.ok_or_else(|| format!("`{name}` is not one of auto, cpu, gpu"))
    }
}

impl OpenDevice {
    /// Opens a device to decode at a level of detail. No GPU is opened for reduced resolution, which is decoded on the CPU.
    ///
    /// # Errors
    /// See [`Self::open`].
    pub fn open_for(
        device: Device,
        name: Option<&str>,
        lod: Lod,
        observer: &dyn Observer,
    ) -> Result<Self, DeviceError> {
        if lod == Lod::Full || device == Device::Cpu {
            return Self::open(device, name, observer);
        }
        observer.event(&Event::OnCpu("reduced resolution is decoded"));
        Ok(Self::CPU)
    }
}

/// A GPU that is not there, failed, or cannot do what was asked of it. The sentence is the driver's.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct DeviceError(String);

impl DeviceError {
    /// An error with a sentence that says why.
    #[must_use]
    pub fn new(why: impl fmt::Display) -> Self {
        Self(why.to_string())
    }
}
