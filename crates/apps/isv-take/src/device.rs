//! Devices that do the arithmetic on samples: the CPU, or a GPU with the CPU to fall back on.
//!
//! Workers are the same traits on each device (`workers`), so that all is compiled with and without GPUs. Where a GPU fails, one piece of
//! code turns to the CPU (`fall_back`).

mod decoder;
mod fall_back;
#[cfg(feature = "gpu")]
mod gpu;
mod workers;

use crate::{Event, Observer, StreamFault};
use fall_back::FallBack;
use isv_decode::{Decoder, Limits, Lod};
use isv_format::StreamHeader;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use thiserror::Error;
use workers::{DecodeWorker, GpuWorkers};

#[cfg(feature = "encode")]
pub(crate) use encode::{Coder, Fuser, Integrator, MeshIngest};
#[cfg(feature = "encode")]
pub(crate) use workers::IngestFault;

pub use decoder::{Decoded, StreamDecoder};
pub use workers::{DecodedVolume, DeviceVolume};

/// A device that does the arithmetic on samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
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

/// A device ready to work: all parts of a job share one GPU.
#[derive(Clone, Debug)]
pub struct OpenDevice {
    gpu: Option<Arc<dyn GpuWorkers>>,
    falls_back: bool,
}

impl OpenDevice {
    /// The CPU.
    pub const CPU: Self = Self { gpu: None, falls_back: false };

    /// Opens a device. `name`: a part of the name of the GPU to use, where there are several. The observer is told why the CPU is used
    /// where a GPU was to be.
    ///
    /// # Errors
    /// [`DeviceError`] for [`Device::Gpu`] where no GPU can do the work.
    pub fn open(device: Device, name: Option<&str>, observer: &dyn Observer) -> Result<Self, DeviceError> {
        let gpu = match device {
            Device::Cpu => None,
            Device::Gpu => Some(open_gpu(name, true)?),
            // A GPU in software would be slower than the CPU.
            Device::Auto => open_gpu(name, false).map_err(|why| observer.event(&Event::FellBack(why))).ok(),
        };
        Ok(Self { gpu, falls_back: device == Device::Auto })
    }

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

    /// Makes a decoder. `observer` is told why the CPU is used where a GPU was to be.
    ///
    /// # Errors
    /// [`StreamFault`] for a level of detail that the stream does not have, and for a GPU that fails.
    pub fn decoder(
        &self,
        header: &StreamHeader,
        limits: Limits,
        lod: Lod,
        colour: bool,
        observer: &Arc<dyn Observer>,
    ) -> Result<StreamDecoder, StreamFault> {
        let coloured = move |mut worker: Box<dyn DecodeWorker>| {
            if colour {
                worker.keep_colour();
            }
            worker
        };
        if lod != Lod::Full {
            let worker = coloured(Box::new(Decoder::with_lod(header, limits, lod)?));
            return Ok(StreamDecoder::new(FallBack::none(worker, observer)));
        }
        let header = *header;
        let on_cpu = move || coloured(Box::new(Decoder::new(&header, limits)));
        let on_gpu = |gpu: &dyn GpuWorkers| gpu.decoder(&header, limits).map(coloured);
        Ok(StreamDecoder::new(self.start(on_gpu, on_cpu, observer)?))
    }

    /// Starts a worker on the GPU if there is one, with the CPU to fall back on if that is wanted.
    fn start<W: ?Sized>(
        &self,
        on_gpu: impl FnOnce(&dyn GpuWorkers) -> Result<Box<W>, DeviceError>,
        on_cpu: impl FnOnce() -> Box<W> + Send + 'static,
        observer: &Arc<dyn Observer>,
    ) -> Result<FallBack<W>, DeviceError> {
        let Some(gpu) = &self.gpu else { return Ok(FallBack::none(on_cpu(), observer)) };
        match on_gpu(&**gpu) {
            Ok(worker) if self.falls_back => Ok(FallBack::to(worker, on_cpu, observer)),
            Ok(worker) => Ok(FallBack::none(worker, observer)),
            Err(why) if self.falls_back => {
                observer.event(&Event::FellBack(why));
                Ok(FallBack::none(on_cpu(), observer))
            }
            Err(why) => Err(why),
        }
    }
}

#[cfg(feature = "gpu")]
fn open_gpu(name: Option<&str>, software: bool) -> Result<Arc<dyn GpuWorkers>, DeviceError> {
    Ok(Arc::new(gpu::OpenGpu::open(name, software)?))
}

#[cfg(not(feature = "gpu"))]
fn open_gpu(_name: Option<&str>, _software: bool) -> Result<Arc<dyn GpuWorkers>, DeviceError> {
    Err(DeviceError::new("no GPU: this build of isv has no code for one"))
}

#[cfg(feature = "encode")]
mod encode {
    use super::workers::{CodeWorker, FuseWorker, IngestFault, IntegrateWorker, MeshWorker};
    use super::{DeviceError, FallBack, OpenDevice};
    use crate::{Event, Observer};
    use isv_encode::{ColourRate, EncoderSettings, FrameCoder, UnwrittenFrame};
    use isv_format::StreamHeader;
    use isv_fusion::{Accumulator, FusionError, FusionSettings};
    use isv_ingest::{MeshIngester, SignDecision};
    use isv_volume::{DepthImage, SparseVolume, TriangleMesh};
    use std::sync::Arc;

    impl OpenDevice {
        /// Makes a coder of volumes.
        pub(crate) fn coder(
            &self,
            header: &StreamHeader,
            settings: EncoderSettings,
            observer: &Arc<dyn Observer>,
        ) -> Result<Coder, DeviceError> {
            let header = *header;
            let on_cpu = move || -> Box<dyn CodeWorker> { Box::new(FrameCoder::on_cpu(&header, settings)) };
            Ok(Coder(self.start(|gpu| gpu.coder(&header, settings), on_cpu, observer)?))
        }

        /// Makes what turns meshes into volumes.
        pub(crate) fn mesh_ingest(
            &self,
            settings: isv_ingest::MeshIngest,
            observer: &Arc<dyn Observer>,
        ) -> Result<MeshIngest, DeviceError> {
            let on_cpu = move || -> Box<dyn MeshWorker> { Box::new(MeshIngester::new(settings)) };
            Ok(MeshIngest(self.start(|gpu| gpu.mesh_ingest(settings), on_cpu, observer)?))
        }

        /// Makes what fuses the depth images of one time.
        pub(crate) fn fuser(&self, observer: &Arc<dyn Observer>) -> Result<Fuser, DeviceError> {
            let on_cpu = || -> Box<dyn FuseWorker> { Box::new(super::workers::FuseOnCpu) };
            Ok(Fuser(self.start(|gpu| gpu.fuser(), on_cpu, observer)?))
        }

        /// Makes what fuses images with all that came before. If the device is left to us this is done on the CPU, which cannot go on
        /// from the sums of a GPU that fails.
        pub(crate) fn integrator(
            &self,
            settings: FusionSettings,
            observer: &Arc<dyn Observer>,
        ) -> Result<Integrator, DeviceError> {
            Ok(Integrator(match &self.gpu {
                Some(gpu) if !self.falls_back => gpu.integrator(settings)?,
                gpu => {
                    if gpu.is_some() {
                        observer.event(&Event::OnCpu("depth images are accumulated"));
                    }
                    Box::new(Accumulator::new(settings))
                }
            }))
        }
    }

    /// A coder of volumes. Behind a GPU that failed it goes on with a keyframe.
    pub(crate) struct Coder(FallBack<dyn CodeWorker>);

    impl Coder {
        pub(crate) fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, DeviceError> {
            self.0.run(|worker| worker.code(volume))
        }

        /// What the decoder will have after the last frame; nothing before the first.
        pub(crate) fn reconstruction(&self) -> Result<Option<SparseVolume>, DeviceError> {
            self.0.worker().reconstruction()
        }

        /// Rate control of the colour of the frame coded last.
        pub(crate) fn colour_rate(&mut self) -> ColourRate<'_> {
            self.0.worker_mut().colour_rate()
        }
    }

    /// Meshes to volumes.
    pub(crate) struct MeshIngest(FallBack<dyn MeshWorker>);

    impl MeshIngest {
        pub(crate) fn ingest(
            &mut self,
            mesh: &TriangleMesh,
            sign: SignDecision,
        ) -> Result<SparseVolume, IngestFault> {
            self.0.run(|worker| worker.ingest(mesh, sign))
        }
    }

    /// Depth images of one time to volumes.
    pub(crate) struct Fuser(FallBack<dyn FuseWorker>);

    impl Fuser {
        pub(crate) fn fuse(
            &mut self,
            images: &[DepthImage],
            settings: &FusionSettings,
        ) -> Result<SparseVolume, FusionError> {
            self.0.run(|worker| worker.fuse(images, settings))
        }
    }

    /// Depth images of all times so far to volumes.
    pub(crate) struct Integrator(Box<dyn IntegrateWorker>);

    impl Integrator {
        /// Adds the images of one time.
        pub(crate) fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
            self.0.integrate(images)
        }

        /// The volume of all that was seen so far.
        pub(crate) fn volume(&mut self) -> Result<SparseVolume, FusionError> {
            self.0.volume()
        }
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
