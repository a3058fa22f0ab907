//! Jobs of a device, and how the CPU does them.

use super::{Decoded, DeviceError};
use isv_decode::{DecodeError, Decoder, Limits};
use isv_format::{Packet, StreamHeader};
use isv_surface::SurfaceOptions;
use isv_volume::SparseVolume;
use std::fmt;
use std::sync::Arc;

#[cfg(feature = "encode")]
pub(crate) use encode::{CodeWorker, FuseOnCpu, FuseWorker, IngestFault, IntegrateWorker, MeshWorker};

/// A GPU that makes workers.
pub(crate) trait GpuWorkers: fmt::Debug + Send + Sync {
    fn decoder(&self, header: &StreamHeader, limits: Limits) -> Result<Box<dyn DecodeWorker>, DeviceError>;

    #[cfg(feature = "encode")]
    fn coder(
        &self,
        header: &StreamHeader,
        settings: isv_encode::EncoderSettings,
    ) -> Result<Box<dyn CodeWorker>, DeviceError>;

    #[cfg(feature = "encode")]
    fn mesh_ingest(&self, settings: isv_ingest::MeshIngest) -> Result<Box<dyn MeshWorker>, DeviceError>;

    #[cfg(feature = "encode")]
    fn fuser(&self) -> Result<Box<dyn FuseWorker>, DeviceError>;

    #[cfg(feature = "encode")]
    fn integrator(
        &self,
        settings: isv_fusion::FusionSettings,
    ) -> Result<Box<dyn IntegrateWorker>, DeviceError>;
}

/// An error that may be a device's.
pub(crate) trait Fault {
    /// The error of the device, if the device failed and not its input.
    fn of_device(&self) -> Option<DeviceError>;
}

impl Fault for DeviceError {
    fn of_device(&self) -> Option<DeviceError> {
        Some(self.clone())
    }
}

impl Fault for DecodeError {
    fn of_device(&self) -> Option<DeviceError> {
        match self {
            Self::Backend(error) => Some(DeviceError::new(error)),
            _ => None,
        }
    }
}

/// Packets to volumes.
pub(crate) trait DecodeWorker: Send {
    /// Decodes a frame packet. `verify`: whether the hash that it states is compared.
    fn decode(&mut self, packet: &Packet, verify: bool) -> Result<Decoded, DecodeError>;

    /// See [`Decoder::keep_colour`].
    fn keep_colour(&mut self);

    /// See [`Decoder::recover`].
    fn recover(&mut self, wanted: bool);

    /// See [`Decoder::lose_packet`].
    fn lose_packet(&mut self);

    /// Extracts surfaces with frames from now on, where that is done on the device.
    fn extract_surfaces(&mut self, _options: SurfaceOptions) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A decoded volume, on the CPU or on another device. Copies share its samples there.
#[derive(Clone, Debug)]
pub enum DecodedVolume {
    /// On the CPU.
    Cpu(SparseVolume),
    /// On another device.
    Device(Arc<dyn DeviceVolume>),
}

/// A volume on a device.
pub trait DeviceVolume: fmt::Debug + Send + Sync {
    /// Copies it to the CPU.
    ///
    /// # Errors
    /// What the device says.
    fn download(&self) -> Result<SparseVolume, DeviceError>;
}

impl DecodedVolume {
    /// The volume on the CPU.
    ///
    /// # Errors
    /// What the device says that it is on.
    pub fn into_sparse(self) -> Result<SparseVolume, DeviceError> {
        match self {
            Self::Cpu(volume) => Ok(volume),
            Self::Device(volume) => volume.download(),
        }
    }
}

impl DecodeWorker for Decoder {
    fn decode(&mut self, packet: &Packet, verify: bool) -> Result<Decoded, DecodeError> {
        let frame = if verify { self.decode_and_verify(packet) } else { self.decode(packet) }?;
        let volume = DecodedVolume::Cpu(frame.volume.clone());
        let (stated_hash, inexact_blocks) = (frame.stated_hash, frame.inexact_blocks);
        let (coded_blocks, colour) = (self.coded_blocks().cloned(), self.colour().cloned());
        Ok(Decoded { volume, coded_blocks, surface: None, colour, stated_hash, inexact_blocks })
    }

    fn keep_colour(&mut self) {
        self.keep_colour(true);
    }

    fn recover(&mut self, wanted: bool) {
        self.recover(wanted);
    }

    fn lose_packet(&mut self) {
        self.lose_packet();
    }
}

#[cfg(feature = "encode")]
mod encode {
    use super::{DeviceError, Fault};
    use isv_decode::backend::Cpu;
    use isv_encode::{ColourRate, FrameCoder, UnwrittenFrame};
    use isv_fusion::{Accumulator, FusionError, FusionSettings, fuse};
    use isv_ingest::{IngestError, MeshIngester, SignDecision};
    use isv_volume::{DepthImage, SparseVolume, TriangleMesh};
    use thiserror::Error;

    /// Volumes to symbols.
    pub(crate) trait CodeWorker: Send {
        fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, DeviceError>;

        /// What the decoder will have after the last frame; nothing before the first.
        fn reconstruction(&self) -> Result<Option<SparseVolume>, DeviceError>;

        /// See [`FrameCoder::colour_rate`].
        fn colour_rate(&mut self) -> ColourRate<'_>;
    }

    /// Meshes to volumes.
    pub(crate) trait MeshWorker: Send {
        fn ingest(&mut self, mesh: &TriangleMesh, sign: SignDecision) -> Result<SparseVolume, IngestFault>;
    }

    /// Depth images of one time to volumes.
    pub(crate) trait FuseWorker: Send {
        fn fuse(
            &mut self,
            images: &[DepthImage],
            settings: &FusionSettings,
        ) -> Result<SparseVolume, FusionError>;
    }

    /// Depth images of all times so far to volumes.
    pub(crate) trait IntegrateWorker: Send {
        fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError>;

        fn volume(&mut self) -> Result<SparseVolume, FusionError>;
    }

    /// A mesh that cannot become a volume, or a device that cannot make one of it.
    #[derive(Debug, Error)]
    pub(crate) enum IngestFault {
        #[error(transparent)]
        Ingest(#[from] IngestError),
        #[error(transparent)]
        Device(#[from] DeviceError),
    }

    impl Fault for IngestFault {
        fn of_device(&self) -> Option<DeviceError> {
            match self {
                Self::Device(error) => Some(error.clone()),
                Self::Ingest(_) => None,
            }
        }
    }

    impl Fault for FusionError {
        fn of_device(&self) -> Option<DeviceError> {
            match self {
                Self::Backend(_) => Some(DeviceError::new(self)),
                _ => None,
            }
        }
    }

    impl CodeWorker for FrameCoder<Cpu, Cpu> {
        fn code(&mut self, volume: &SparseVolume) -> Result<UnwrittenFrame, DeviceError> {
            self.code(volume).map_err(DeviceError::new)
        }

        fn reconstruction(&self) -> Result<Option<SparseVolume>, DeviceError> {
            Ok(self.reconstruction().cloned())
        }

        fn colour_rate(&mut self) -> ColourRate<'_> {
            self.colour_rate()
        }
    }

    impl MeshWorker for MeshIngester {
        fn ingest(&mut self, mesh: &TriangleMesh, sign: SignDecision) -> Result<SparseVolume, IngestFault> {
            Ok(self.ingest(mesh, sign)?)
        }
    }

    /// Fusion on the CPU, which keeps nothing from frame to frame.
    pub(crate) struct FuseOnCpu;

    impl FuseWorker for FuseOnCpu {
        fn fuse(
            &mut self,
            images: &[DepthImage],
            settings: &FusionSettings,
        ) -> Result<SparseVolume, FusionError> {
            fuse(images, settings)
        }
    }

    impl IntegrateWorker for Accumulator {
        fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
            self.integrate(images)
        }

        fn volume(&mut self) -> Result<SparseVolume, FusionError> {
            Ok(Accumulator::volume(self))
        }
    }
}
