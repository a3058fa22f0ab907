//! `--backend`: who does the arithmetic on samples.

use crate::{drivers, memory, words};
use anyhow::Result;
use isv::raw::decode::Lod;
use isv::raw::take::stream::DecodeSettings;
use isv::raw::take::{Device, DeviceError, Event, FrameRange, Observer, OpenDevice};
use std::env;
use std::sync::Arc;

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
    /// Opens it. The observer is told if another one is used than might be.
    pub(crate) fn open(self, observer: &dyn Observer) -> Result<OpenDevice, DeviceError> {
        let name = env::var(GPU_VARIABLE).ok();
        let (device, why) = drivers::quietly(|| OpenDevice::open(self.backend, name.as_deref()))?;
        if let Some(why) = why {
            observer.event(&Event::FellBack(why));
        }
        Ok(device)
    }

    /// How a stream is decoded there.
    pub(crate) fn decode_settings(self, frames: Option<FrameRange>, lod: Lod) -> Result<DecodeSettings> {
        let observer = words::observer();
        let device = match lod {
            Lod::Full => self.open(&*observer)?,
            // No GPU decodes these, so none is opened.
            _ if self.backend == Device::Cpu => OpenDevice::CPU,
            _ => {
                observer.event(&Event::OnCpu("reduced resolution is decoded"));
                OpenDevice::CPU
            }
        };
        Ok(DecodeSettings { frames, lod, device, memory: memory::limit(), observer: Arc::clone(&observer) })
    }
}
