//! `--backend`: who does the arithmetic on samples.

use crate::{drivers, memory, words};
use anyhow::Result;
use isv::raw::decode::Lod;
use isv::raw::take::stream::DecodeSettings;
use isv::raw::take::{Device, DeviceError, FrameRange, Observer, OpenDevice};
use std::env;

/// The environment variable with a part of the name of the GPU to use.
pub(crate) const GPU_VARIABLE: &str = "ISV_GPU";

/// The choice of a backend.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct BackendArgs {
    /// Device that does the arithmetic; `auto` falls back from a GPU to the CPU
    ///
    /// `gpu` is an error where there is no GPU. `auto` takes a real GPU, not one in software, and goes on on the
    /// CPU if it fails. What is decoded is the same on all of them. ISV_GPU in the environment holds a part of the
    /// name of the GPU to use: `isv backends` lists them.
    #[arg(help_heading = "Running", long, value_name = "auto|cpu|gpu", default_value_t)]
    backend: Device,
}

impl BackendArgs {
    /// Opens it to encode. The observer is told if another one is used than might be.
    pub(crate) fn open(self, observer: &dyn Observer) -> Result<OpenDevice, DeviceError> {
        self.open_for(Lod::Full, observer)
    }

    /// Opens it to decode at a level of detail.
    pub(crate) fn open_for(self, lod: Lod, observer: &dyn Observer) -> Result<OpenDevice, DeviceError> {
        let name = env::var(GPU_VARIABLE).ok();
        drivers::quietly(|| OpenDevice::open_for(self.backend, name.as_deref(), lod, observer))
    }

    /// How a stream is decoded there.
    pub(crate) fn decode_settings(self, frames: Option<FrameRange>, lod: Lod) -> Result<DecodeSettings> {
        let observer = words::observer();
        let device = self.open_for(lod, &*observer)?;
        Ok(DecodeSettings { frames, lod, colour: false, device, memory: memory::limit(), observer })
    }
}
