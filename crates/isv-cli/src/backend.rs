//! `--backend`: who does the arithmetic on samples.

use anyhow::Result;
use isv::decode::{Decoder, Limits, Lod};
use isv::format::StreamHeader;
use isv::gpu::{AnyDecoder, BackendChoice, OpenedBackend};
use std::env;

/// The environment variable with a part of the name of the GPU to use.
pub(crate) const GPU_VARIABLE: &str = "ISV_GPU";

/// The choice of a backend.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct BackendArgs {
    /// Who does the arithmetic: cpu; gpu, which is an error where there is none; or auto, a real GPU if there is one that can,
    /// else the CPU. The results are the same. ISV_GPU in the environment names one of several, see `isv backends`
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t)]
    backend: BackendChoice,
}

impl BackendArgs {
    /// The CPU, whatever the user wants elsewhere.
    pub(crate) const CPU: Self = Self { backend: BackendChoice::Cpu };

    /// A decoder of a stream at a level of detail, and a line on standard error if it is on another backend than it might be.
    pub(crate) fn decoder(self, header: &StreamHeader, limits: Limits, lod: Lod) -> Result<AnyDecoder> {
        let on_cpu =
            || anyhow::Ok(AnyDecoder::on_cpu(header, limits, Decoder::with_lod(header, limits, lod)?));
        if lod != Lod::Full && self.backend != BackendChoice::Cpu {
            eprintln!("reduced resolution is decoded on the CPU");
            return on_cpu();
        }
        let name = env::var(GPU_VARIABLE).ok();
        match self.backend.open(name.as_deref())? {
            OpenedBackend::Cpu => on_cpu(),
            OpenedBackend::FellBack(why) => {
                notify(&why);
                on_cpu()
            }
            OpenedBackend::Gpu(store) => {
                let falls_back = self.backend == BackendChoice::Auto;
                match AnyDecoder::on_gpu(header, limits, &store, falls_back) {
                    Err(why) if falls_back => {
                        notify(&why);
                        on_cpu()
                    }
                    decoder => Ok(decoder?),
                }
            }
        }
    }
}

/// Says why the CPU does what a GPU was to do.
pub(crate) fn notify(why: &dyn std::error::Error) {
    eprintln!("{why}: working on the CPU");
}
