//! The workers of a GPU.

use super::workers::{
    CodeWorker, DecodeWorker, DecodedVolume, DeviceVolume, FuseWorker, GpuWorkers, IngestFault,
    IntegrateWorker, MeshWorker,
};
use super::{Decoded, DeviceError};
use isv_decode::{BackendError, DecodeError, Decoder, Limits};
use isv_encode::{ColourRate, EncoderSettings, FrameCoder, UnwrittenFrame};
use isv_format::{Packet, StreamHeader};
use isv_fusion::{Accumulator, FusionError, FusionSettings, fuse_on};
use isv_gpu::{
    Gpu, GpuBackend, GpuChoice, GpuError, GpuFusion, GpuIngestError, GpuMeshIngester, GpuMotionSearch,
    GpuSurfaceExtractor, GpuVolume, VolumeStore, frame_coder,
};
use isv_ingest::{MeshIngest, MeshIngester, SignDecision};
use isv_surface::SurfaceOptions;
use isv_volume::{DepthImage, SparseVolume, TriangleMesh};
use std::sync::Arc;

impl From<GpuError> for DeviceError {
    fn from(error: GpuError) -> Self {
        Self::new(error)
    }
}

/// A GPU, and the memory that its workers share.
#[derive(Debug)]
pub(super) struct OpenGpu(VolumeStore);

impl OpenGpu {
    /// Opens the GPU with this part of a name, or any. `software`: whether one that computes on the processor will do.
    pub(super) fn open(name: Option<&str>, software: bool) -> Result<Self, GpuError> {
        let name = name.map(str::to_owned);
        let gpu = Gpu::open(&GpuChoice { name, software, ..GpuChoice::default() })?;
        Ok(Self(VolumeStore::new(&gpu)?))
    }
}

impl GpuWorkers for OpenGpu {
    fn decoder(&self, header: &StreamHeader, limits: Limits) -> Result<Box<dyn DecodeWorker>, DeviceError> {
        let decoder = Decoder::with_backend(header, limits, GpuBackend::new(&self.0)?);
        Ok(Box::new(GpuDecoder { decoder, extractor: None }))
    }

    fn coder(
        &self,
        header: &StreamHeader,
        settings: EncoderSettings,
    ) -> Result<Box<dyn CodeWorker>, DeviceError> {
        Ok(Box::new(frame_coder(header, settings, &self.0)?))
    }

    fn mesh_ingest(&self, settings: MeshIngest) -> Result<Box<dyn MeshWorker>, DeviceError> {
        let on_gpu = GpuMeshIngester::new(&self.0, settings)?;
        Ok(Box::new(GpuMeshWorker { on_gpu, sheets: MeshIngester::new(settings) }))
    }

    fn fuser(&self) -> Result<Box<dyn FuseWorker>, DeviceError> {
        Ok(Box::new(GpuFusion::new(self.0.gpu())?))
    }

    fn integrator(&self, settings: FusionSettings) -> Result<Box<dyn IntegrateWorker>, DeviceError> {
        Ok(Box::new(Accumulator::with_backend(GpuFusion::new(self.0.gpu())?, settings)))
    }
}

impl DeviceVolume for GpuVolume {
    fn download(&self) -> Result<SparseVolume, DeviceError> {
        Ok(self.download()?)
    }
}

/// A decoder, and what makes its surfaces before they leave the GPU.
struct GpuDecoder {
    decoder: Decoder<GpuBackend>,
    extractor: Option<GpuSurfaceExtractor>,
}

impl DecodeWorker for GpuDecoder {
    fn decode(&mut self, packet: &Packet, verify: bool) -> Result<Decoded, DecodeError> {
        let decoder = &mut self.decoder;
        let frame = if verify { decoder.decode_and_verify(packet) } else { decoder.decode(packet) }?;
        let extract = |extractor: &mut GpuSurfaceExtractor| extractor.extract(frame.volume)?.download();
        let surface = self.extractor.as_mut().map(extract).transpose().map_err(BackendError::from)?;
        let volume = DecodedVolume::Device(Arc::new(frame.volume.clone()));
        let (stated_hash, inexact_blocks) = (frame.stated_hash, frame.inexact_blocks);
        let (coded_blocks, colour) = (self.decoder.coded_blocks().cloned(), self.decoder.colour().cloned());
        Ok(Decoded { volume, coded_blocks, surface, colour, stated_hash, inexact_blocks })
    }

    fn keep_colour(&mut self) {
        self.decoder.keep_colour(true);
    }

    fn recover(&mut self, wanted: bool) {
        self.decoder.recover(wanted);
    }

    fn lose_packet(&mut self) {
        self.decoder.lose_packet();
    }

    fn extract_surfaces(&mut self, options: SurfaceOptions) -> Result<(), DeviceError> {
        self.extractor = Some(GpuSurfaceExtractor::new(self.decoder.backend().store(), options)?);
        Ok(())
    }
}

impl CodeWorker for FrameCoder<GpuBackend, GpuMotionSearch> {
    fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, DeviceError> {
        self.code(volume).map_err(DeviceError::new)
    }

    fn reconstruction(&self) -> Result<Option<SparseVolume>, DeviceError> {
        match self {
            Self::Paper(coder) => Ok(coder.reconstruction().map(GpuVolume::download).transpose()?),
            Self::Main(encoder) => Ok(encoder.reconstruction().cloned()),
        }
    }

    fn colour_rate(&mut self) -> ColourRate<'_> {
        self.colour_rate()
    }
}

/// An ingester of meshes, which leaves single sheets to the CPU.
struct GpuMeshWorker {
    on_gpu: GpuMeshIngester,
    sheets: MeshIngester,
}

impl MeshWorker for GpuMeshWorker {
    fn ingest(&mut self, mesh: &TriangleMesh, sign: SignDecision) -> Result<SparseVolume, IngestFault> {
        if sign == SignDecision::Sheet {
            return Ok(self.sheets.ingest(mesh, sign)?);
        }
        self.on_gpu.ingest(mesh, sign).map_err(|error| match error {
            GpuIngestError::Ingest(error) => error.into(),
            other => IngestFault::Device(DeviceError::new(other)),
        })
    }
}

impl FuseWorker for GpuFusion {
    fn fuse(
        &mut self,
        images: &[DepthImage],
        settings: &FusionSettings,
    ) -> Result<SparseVolume, FusionError> {
        fuse_on(self, images, settings)
    }
}

impl IntegrateWorker for Accumulator<GpuFusion> {
    fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
        self.integrate(images)
    }

    fn volume(&mut self) -> Result<SparseVolume, FusionError> {
        self.try_volume()
    }
}

#[cfg(test)]
mod tests;
