//! `--backend`: who does the arithmetic on samples.

use crate::drivers;
use crate::memory;
use crate::output::say;
use anyhow::Result;
use isv::decode::{BackendError, Decoder, Lod};
use isv::encode::EncoderSettings;
use isv::format::StreamHeader;
use isv::fusion::{FusionError, FusionSettings};
use isv::gpu::{
    AnyAccumulator, AnyCoder, AnyDecoder, AnyFusion, AnyMeshIngester, BackendChoice, GpuError,
    GpuIngestError, OpenedBackend, VolumeStore,
};
use isv::ingest::MeshIngest;
use std::env;

/// The environment variable with a part of the name of the GPU to use.
pub(crate) const GPU_VARIABLE: &str = "ISV_GPU";

/// The choice of a backend.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct BackendArgs {
    /// Who does the arithmetic: cpu; gpu, which is an error where there is none; or auto, a real GPU if there is one that can,
    /// else the CPU. What is decoded is the same. ISV_GPU in the environment names one of several, see `isv backends`
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t)]
    backend: BackendChoice,
}

impl BackendArgs {
    /// The CPU, whatever the user wants elsewhere.
    pub(crate) const CPU: Self = Self { backend: BackendChoice::Cpu };

    /// A decoder of a stream at a level of detail, and a line on standard error if it is on another backend than it might be.
    pub(crate) fn decoder(self, header: &StreamHeader, lod: Lod) -> Result<AnyDecoder> {
        let limits = memory::limits();
        let on_cpu =
            || anyhow::Ok(AnyDecoder::on_cpu(header, limits, Decoder::with_lod(header, limits, lod)?));
        if lod != Lod::Full && self.backend != BackendChoice::Cpu {
            say("reduced resolution is decoded on the CPU");
            return on_cpu();
        }
        match self
            .open()?
            .on_gpu(|store, falls_back| AnyDecoder::on_gpu(header, limits, store, falls_back))?
        {
            Some(decoder) => Ok(decoder),
            None => on_cpu(),
        }
    }

    /// Opens it, with such a line.
    pub(crate) fn open(self) -> Result<Backend> {
        let name = env::var(GPU_VARIABLE).ok();
        let store = match drivers::quietly(|| self.backend.open(name.as_deref()))? {
            OpenedBackend::Cpu => None,
            OpenedBackend::FellBack(why) => {
                notify(&why);
                None
            }
            OpenedBackend::Gpu(store) => Some(store),
        };
        Ok(Backend { store, falls_back: self.backend == BackendChoice::Auto })
    }
}

/// A backend ready to work: all that a command does shares one GPU.
#[derive(Clone, Debug)]
pub(crate) struct Backend {
    /// Of the GPU, if there is one.
    store: Option<VolumeStore>,
    falls_back: bool,
}

impl Backend {
    /// The CPU.
    pub(crate) const CPU: Self = Self { store: None, falls_back: false };

    /// A coder of a stream, and a line on standard error if it is on another backend than it might be.
    pub(crate) fn coder(&self, header: &StreamHeader, settings: EncoderSettings) -> Result<AnyCoder> {
        let on_gpu =
            self.on_gpu(|store, falls_back| AnyCoder::on_gpu(header, settings, store, falls_back))?;
        Ok(on_gpu.unwrap_or_else(|| AnyCoder::on_cpu(header, settings)))
    }

    /// What makes volumes of meshes, with such a line.
    pub(crate) fn mesh_ingester(&self, settings: MeshIngest) -> Result<AnyMeshIngester> {
        let on_gpu = self.on_gpu(|store, falls_back| AnyMeshIngester::on_gpu(settings, store, falls_back))?;
        Ok(on_gpu.unwrap_or_else(|| AnyMeshIngester::on_cpu(settings)))
    }

    /// What fuses the depth images of one instant, with such a line.
    pub(crate) fn fusion(&self) -> Result<AnyFusion> {
        let on_gpu = self.on_gpu(|store, falls_back| AnyFusion::on_gpu(store.gpu(), falls_back))?;
        Ok(on_gpu.unwrap_or_else(AnyFusion::on_cpu))
    }

    /// What fuses them with all that came before. If it is left to us this is done on the CPU, which cannot go on from the sums of
    /// a GPU that fails.
    pub(crate) fn accumulator(&self, settings: FusionSettings) -> Result<AnyAccumulator> {
        match &self.store {
            Some(store) if !self.falls_back => Ok(AnyAccumulator::on_gpu(store.gpu(), settings)?),
            Some(_) => {
                say("depth images are accumulated on the CPU");
                Ok(AnyAccumulator::on_cpu(settings))
            }
            None => Ok(AnyAccumulator::on_cpu(settings)),
        }
    }

    /// What a GPU gives, told whether it may fall back to the CPU; nothing where the CPU is to be used.
    fn on_gpu<T>(&self, make: impl FnOnce(&VolumeStore, bool) -> Result<T, GpuError>) -> Result<Option<T>> {
        let Some(store) = &self.store else { return Ok(None) };
        match make(store, self.falls_back) {
            Err(why) if self.falls_back => {
                notify(&why);
                Ok(None)
            }
            made => Ok(Some(made?)),
        }
    }
}

/// Whether it is a GPU that failed, and not what it was given.
pub(crate) fn has_failed(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.is::<GpuError>()
            || cause.is::<BackendError>()
            || matches!(cause.downcast_ref(), Some(GpuIngestError::Gpu(_)))
            || matches!(cause.downcast_ref(), Some(FusionError::Backend(_)))
    })
}

/// Says why the CPU does what a GPU was to do.
pub(crate) fn notify(why: &dyn std::error::Error) {
    say(format_args!("{why}: working on the CPU"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use isv::ingest::IngestError;

    #[test]
    fn failures_of_a_gpu_are_told_from_bad_frames() {
        let lost = GpuError::Lost("unplugged".to_owned());
        let fusion = FusionError::Backend("unplugged".to_owned());
        let coding = BackendError::DeviceFailed("unplugged".to_owned());
        let failed = [
            anyhow::Error::from(lost.clone()),
            GpuIngestError::Gpu(lost).into(),
            fusion.into(),
            coding.into(),
        ];
        for error in failed {
            assert!(has_failed(&Err::<(), _>(error).context("frame_0001.ply").unwrap_err()));
        }
        assert!(!has_failed(&GpuIngestError::Ingest(IngestError::NoNormals).into()));
    }
}
