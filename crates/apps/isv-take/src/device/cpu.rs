//! The CPU, in a build without GPUs. Names and signatures are those of `gpu.rs`.

use super::{Device, DeviceError};
use crate::{Event, Observer, StreamFault};
use isv_decode::{BackendError, DecodeError, Decoder, Limits, Lod};
use isv_format::{Packet, StreamHeader};
use isv_surface::SurfaceOptions;
use isv_volume::{BlockSet, SparseVolume, TriangleMesh};
use std::convert::Infallible;

impl From<Infallible> for DeviceError {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// A device ready to work.
#[derive(Clone, Debug)]
pub struct OpenDevice(());

impl OpenDevice {
    /// The CPU.
    pub const CPU: Self = Self(());

    /// Opens a device. The observer is told why the CPU is used where a GPU was to be.
    ///
    /// # Errors
    /// [`DeviceError`] for [`Device::Gpu`].
    pub fn open(device: Device, _name: Option<&str>, observer: &dyn Observer) -> Result<Self, DeviceError> {
        let missing = DeviceError::new("no GPU: this build of isv has no code for one");
        match device {
            Device::Cpu => {}
            Device::Auto => observer.event(&Event::FellBack(missing)),
            Device::Gpu => return Err(missing),
        }
        Ok(Self::CPU)
    }

    /// Makes a decoder.
    ///
    /// # Errors
    /// [`StreamFault`] for a level of detail that the stream does not have.
    pub fn decoder(
        &self,
        header: &StreamHeader,
        limits: Limits,
        lod: Lod,
        _observer: &dyn Observer,
    ) -> Result<AnyDecoder, StreamFault> {
        Ok(AnyDecoder(Decoder::with_lod(header, limits, lod)?))
    }
}

/// A decoded volume.
#[derive(Clone, Debug)]
pub enum AnyVolume {
    /// On the CPU.
    Cpu(SparseVolume),
}

impl AnyVolume {
    /// The volume on the CPU.
    ///
    /// # Errors
    /// None without a GPU.
    pub fn into_sparse(self) -> Result<SparseVolume, Infallible> {
        let Self::Cpu(volume) = self;
        Ok(volume)
    }
}

/// A frame as decoded.
#[derive(Clone, Debug)]
pub struct AnyFrame {
    /// The volume.
    pub volume: AnyVolume,
    /// Blocks that were coded, not extrapolated: see [`Decoder::coded_blocks`].
    pub coded_blocks: Option<BlockSet>,
    /// Surface of the frame, if it was extracted on a GPU.
    pub surface: Option<TriangleMesh>,
    /// Hash that the stream states, if any.
    pub stated_hash: Option<u64>,
    /// Blocks that may not be as they were encoded: see [`isv_decode::DecodedFrame::inexact_blocks`].
    pub inexact_blocks: usize,
}

/// A [`Decoder`].
#[derive(Debug)]
pub struct AnyDecoder(Decoder);

impl AnyDecoder {
    /// The decoder itself: surfaces are extracted with frames on a GPU alone.
    ///
    /// # Errors
    /// None without a GPU.
    pub fn with_surfaces(self, _options: SurfaceOptions) -> Result<Self, Infallible> {
        Ok(self)
    }

    /// Goes on behind losses: see [`Decoder::recover`].
    pub fn recover(&mut self, wanted: bool) {
        self.0.recover(wanted);
    }

    /// Takes a packet for lost: see [`Decoder::lose_packet`].
    pub fn lose_packet(&mut self) {
        self.0.lose_packet();
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// See [`Decoder::decode`].
    pub fn decode(&mut self, packet: &Packet) -> Result<AnyFrame, DecodeError> {
        let frame = self.0.decode(packet)?;
        let (volume, stated_hash, inexact_blocks) =
            (frame.volume.clone(), frame.stated_hash, frame.inexact_blocks);
        Ok(self.frame(volume, stated_hash, inexact_blocks))
    }

    /// Decodes a frame packet and compares the hash that it states, if it states one.
    ///
    /// # Errors
    /// See [`Decoder::decode_and_verify`].
    pub fn decode_and_verify(&mut self, packet: &Packet) -> Result<AnyFrame, DecodeError> {
        let frame = self.0.decode_and_verify(packet)?;
        let (volume, stated_hash, inexact_blocks) =
            (frame.volume.clone(), frame.stated_hash, frame.inexact_blocks);
        Ok(self.frame(volume, stated_hash, inexact_blocks))
    }

    fn frame(&self, volume: SparseVolume, stated_hash: Option<u64>, inexact_blocks: usize) -> AnyFrame {
        let coded_blocks = self.0.coded_blocks().cloned();
        AnyFrame { volume: AnyVolume::Cpu(volume), coded_blocks, surface: None, stated_hash, inexact_blocks }
    }

    /// Nothing: it was on the CPU from the start.
    pub fn take_notice(&mut self) -> Option<BackendError> {
        None
    }
}

#[cfg(feature = "encode")]
pub(crate) use encode::{AnyAccumulator, AnyCoder, AnyFusion, AnyMeshIngester, GpuIngestError};

#[cfg(feature = "encode")]
mod encode {
    use super::{DeviceError, OpenDevice};
    use crate::Observer;
    use isv_decode::BackendError;
    use isv_decode::backend::Cpu;
    use isv_encode::{EncoderSettings, FrameCoder, UnwrittenFrame};
    use isv_format::StreamHeader;
    use isv_fusion::{Accumulator, FusionError, FusionSettings, fuse};
    use isv_ingest::{IngestError, MeshIngest, MeshIngester, SignDecision};
    use isv_volume::{DepthImage, SparseVolume, TriangleMesh};
    use std::convert::Infallible;
    use thiserror::Error;

    impl OpenDevice {
        pub(crate) fn coder(
            &self,
            header: &StreamHeader,
            settings: EncoderSettings,
            _observer: &dyn Observer,
        ) -> Result<AnyCoder, DeviceError> {
            Ok(AnyCoder(FrameCoder::on_cpu(header, settings)))
        }

        pub(crate) fn mesh_ingester(
            &self,
            settings: MeshIngest,
            _observer: &dyn Observer,
        ) -> Result<AnyMeshIngester, DeviceError> {
            Ok(AnyMeshIngester(MeshIngester::new(settings)))
        }

        pub(crate) fn fusion(&self, _observer: &dyn Observer) -> Result<AnyFusion, DeviceError> {
            Ok(AnyFusion)
        }

        pub(crate) fn accumulator(
            &self,
            settings: FusionSettings,
            _observer: &dyn Observer,
        ) -> Result<AnyAccumulator, DeviceError> {
            Ok(AnyAccumulator(Accumulator::new(settings)))
        }
    }

    #[derive(Debug)]
    pub(crate) struct AnyCoder(FrameCoder<Cpu, Cpu>);

    impl AnyCoder {
        pub(crate) fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, BackendError> {
            self.0.code(volume)
        }

        pub(crate) fn reconstruction(&self) -> Result<Option<SparseVolume>, Infallible> {
            Ok(self.0.reconstruction().cloned())
        }

        pub(crate) fn take_notice(&mut self) -> Option<BackendError> {
            None
        }
    }

    pub(crate) struct AnyMeshIngester(MeshIngester);

    /// Why a mesh cannot become a volume.
    #[derive(Debug, Error)]
    pub(crate) enum GpuIngestError {
        #[error(transparent)]
        Ingest(IngestError),
        #[error(transparent)]
        #[expect(dead_code, reason = "a build with GPUs makes it")]
        Gpu(Infallible),
    }

    impl AnyMeshIngester {
        pub(crate) fn ingest(
            &mut self,
            mesh: &TriangleMesh,
            sign: SignDecision,
        ) -> Result<SparseVolume, GpuIngestError> {
            self.0.ingest(mesh, sign).map_err(GpuIngestError::Ingest)
        }

        pub(crate) fn take_notice(&mut self) -> Option<Infallible> {
            None
        }
    }

    #[derive(Debug)]
    pub(crate) struct AnyFusion;

    impl AnyFusion {
        pub(crate) fn fuse(
            &mut self,
            images: &[DepthImage],
            settings: &FusionSettings,
        ) -> Result<SparseVolume, FusionError> {
            fuse(images, settings)
        }

        pub(crate) fn take_notice(&mut self) -> Option<Infallible> {
            None
        }
    }

    #[derive(Debug)]
    pub(crate) struct AnyAccumulator(Accumulator);

    impl AnyAccumulator {
        pub(crate) fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
            self.0.integrate(images)
        }

        pub(crate) fn volume(&mut self) -> Result<SparseVolume, FusionError> {
            Ok(self.0.volume())
        }
    }
}
