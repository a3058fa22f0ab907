//! A GPU, if one is opened.

use super::{Device, DeviceError};
use crate::{Event, Observer, StreamFault};
use isv_decode::{Decoder, Limits, Lod};
use isv_encode::EncoderSettings;
use isv_format::StreamHeader;
use isv_fusion::FusionSettings;
use isv_gpu::{Gpu, GpuChoice, GpuError, VolumeStore};
use isv_ingest::MeshIngest;

pub(crate) use isv_gpu::{AnyAccumulator, AnyCoder, AnyFusion, AnyMeshIngester, GpuIngestError};
pub use isv_gpu::{AnyDecoder, AnyFrame, AnyVolume};

impl From<GpuError> for DeviceError {
    fn from(error: GpuError) -> Self {
        Self::new(error)
    }
}

/// A device ready to work: all parts of a job share one GPU.
#[derive(Clone, Debug)]
pub struct OpenDevice {
    /// Memory of the GPU, if there is one.
    store: Option<VolumeStore>,
    falls_back: bool,
}

impl OpenDevice {
    /// The CPU.
    pub const CPU: Self = Self { store: None, falls_back: false };

    /// Opens a device. `name`: a part of the name of the GPU to use, where there are several. The observer is told why the CPU is used
    /// where a GPU was to be.
    ///
    /// # Errors
    /// [`DeviceError`] for [`Device::Gpu`] where no GPU can do the work.
    pub fn open(device: Device, name: Option<&str>, observer: &dyn Observer) -> Result<Self, DeviceError> {
        let open = |software: bool| {
            let name = name.map(str::to_owned);
            let gpu = Gpu::open(&GpuChoice { name, software, ..GpuChoice::default() })?;
            VolumeStore::new(&gpu)
        };
        let store = match device {
            Device::Cpu => None,
            Device::Gpu => Some(open(true)?),
            // A GPU in software would be slower than the CPU.
            Device::Auto => open(false).map_err(|why| observer.event(&Event::FellBack(why.into()))).ok(),
        };
        Ok(Self { store, falls_back: device == Device::Auto })
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
        observer: &dyn Observer,
    ) -> Result<AnyDecoder, StreamFault> {
        if lod == Lod::Full
            && let Some(decoder) = self
                .on_gpu(|store, falls_back| AnyDecoder::on_gpu(header, limits, store, falls_back), observer)?
        {
            return Ok(decoder);
        }
        Ok(AnyDecoder::on_cpu(header, limits, Decoder::with_lod(header, limits, lod)?))
    }

    pub(crate) fn coder(
        &self,
        header: &StreamHeader,
        settings: EncoderSettings,
        observer: &dyn Observer,
    ) -> Result<AnyCoder, DeviceError> {
        let on_gpu =
            self.on_gpu(|store, falls_back| AnyCoder::on_gpu(header, settings, store, falls_back), observer)?;
        Ok(on_gpu.unwrap_or_else(|| AnyCoder::on_cpu(header, settings)))
    }

    pub(crate) fn mesh_ingester(
        &self,
        settings: MeshIngest,
        observer: &dyn Observer,
    ) -> Result<AnyMeshIngester, DeviceError> {
        let on_gpu =
            self.on_gpu(|store, falls_back| AnyMeshIngester::on_gpu(settings, store, falls_back), observer)?;
        Ok(on_gpu.unwrap_or_else(|| AnyMeshIngester::on_cpu(settings)))
    }

    pub(crate) fn fusion(&self, observer: &dyn Observer) -> Result<AnyFusion, DeviceError> {
        let on_gpu = self.on_gpu(|store, falls_back| AnyFusion::on_gpu(store.gpu(), falls_back), observer)?;
        Ok(on_gpu.unwrap_or_else(AnyFusion::on_cpu))
    }

    /// Makes what fuses images with all that came before. If the device is left to us this is done on the CPU, which cannot go on from
    /// the sums of a GPU that fails.
    pub(crate) fn accumulator(
        &self,
        settings: FusionSettings,
        observer: &dyn Observer,
    ) -> Result<AnyAccumulator, DeviceError> {
        match &self.store {
            Some(store) if !self.falls_back => Ok(AnyAccumulator::on_gpu(store.gpu(), settings)?),
            Some(_) => {
                observer.event(&Event::OnCpu("depth images are accumulated"));
                Ok(AnyAccumulator::on_cpu(settings))
            }
            None => Ok(AnyAccumulator::on_cpu(settings)),
        }
    }

    /// What a GPU gives, told whether it may fall back to the CPU; nothing where the CPU is to be used.
    fn on_gpu<T>(
        &self,
        make: impl FnOnce(&VolumeStore, bool) -> Result<T, GpuError>,
        observer: &dyn Observer,
    ) -> Result<Option<T>, DeviceError> {
        let Some(store) = &self.store else { return Ok(None) };
        match make(store, self.falls_back) {
            Err(why) if self.falls_back => {
                observer.event(&Event::FellBack(why.into()));
                Ok(None)
            }
            made => Ok(Some(made?)),
        }
    }
}
