//! A decoder on whatever there is.

use crate::{GpuBackend, GpuError, GpuSurfaceExtractor, GpuVolume, VolumeStore};
use isv_decode::{BackendError, DecodeError, Decoder, Limits};
use isv_format::{Packet, StreamHeader};
use isv_surface::SurfaceOptions;
use isv_volume::{BlockSet, SparseVolume, TriangleMesh};

/// Bytes of packets that are kept to begin again with on the CPU.
const MOST_KEPT_BYTES: usize = 256 << 20;

/// A decoded volume, on the CPU or on a GPU. Copies share its samples.
#[derive(Clone, Debug)]
pub enum AnyVolume {
    /// On the CPU.
    Cpu(SparseVolume),
    /// On a GPU.
    Gpu(GpuVolume),
}

impl AnyVolume {
    /// The volume on the CPU.
    ///
    /// # Errors
    /// What goes wrong on the GPU.
    pub fn into_sparse(self) -> Result<SparseVolume, GpuError> {
        match self {
            Self::Cpu(volume) => Ok(volume),
            Self::Gpu(volume) => volume.download(),
        }
    }
}

/// A frame as decoded.
#[derive(Clone, Debug)]
pub struct AnyFrame {
    /// The volume.
    pub volume: AnyVolume,
    /// Blocks that were coded, not extrapolated: see [`Decoder::coded_blocks`].
    pub coded_blocks: Option<BlockSet>,
    /// Its surface, if it was extracted on a GPU: see [`AnyDecoder::with_surfaces`].
    pub surface: Option<TriangleMesh>,
    /// Hash that the stream states, if any.
    pub stated_hash: Option<u64>,
    /// As [`isv_decode::DecodedFrame::inexact_blocks`].
    pub inexact_blocks: usize,
}

/// A [`Decoder`] on the CPU or on a GPU. If a GPU fails, it can go on from the last keyframe on the CPU.
#[derive(Debug)]
pub struct AnyDecoder {
    header: StreamHeader,
    limits: Limits,
    decoder: Inner,
    /// As [`Self::recover`] was told.
    recovers: bool,
    /// Why the GPU was given up, until somebody asks.
    notice: Option<BackendError>,
}

#[derive(Debug)]
enum Inner {
    Cpu(Decoder),
    Gpu {
        decoder: Box<Decoder<GpuBackend>>,
        extractor: Option<Box<GpuSurfaceExtractor>>,
        /// The packets since the last keyframe and with it, if they are wanted and not too many.
        kept: Option<KeptPackets>,
        falls_back: bool,
    },
}

impl AnyDecoder {
    /// A decoder on the CPU.
    #[must_use]
    pub fn on_cpu(header: &StreamHeader, limits: Limits, decoder: Decoder) -> Self {
        Self { header: *header, limits, decoder: Inner::Cpu(decoder), recovers: false, notice: None }
    }

    /// A decoder on a GPU. `falls_back`: whether it goes on on the CPU if the GPU fails.
    ///
    /// # Errors
    /// As [`GpuBackend::new`].
    pub fn on_gpu(
        header: &StreamHeader,
        limits: Limits,
        store: &VolumeStore,
        falls_back: bool,
    ) -> Result<Self, GpuError> {
        let decoder = Box::new(Decoder::with_backend(header, limits, GpuBackend::new(store)?));
        let decoder = Inner::Gpu { decoder, extractor: None, kept: None, falls_back };
        Ok(Self { header: *header, limits, decoder, recovers: false, notice: None })
    }

    /// The decoder with the surfaces of its frames, if it is on a GPU: there they need not leave it to be meshed.
    ///
    /// # Errors
    /// As [`GpuSurfaceExtractor::new`].
    pub fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self, GpuError> {
        if let Inner::Gpu { decoder, extractor, .. } = &mut self.decoder {
            *extractor = Some(Box::new(GpuSurfaceExtractor::new(decoder.backend().store(), options)?));
        }
        Ok(self)
    }

    /// As [`Decoder::recover`].
    pub fn recover(&mut self, wanted: bool) {
        self.recovers = wanted;
        match &mut self.decoder {
            Inner::Cpu(decoder) => decoder.recover(wanted),
            Inner::Gpu { decoder, .. } => decoder.recover(wanted),
        }
    }

    /// As [`Decoder::lose_packet`].
    pub fn lose_packet(&mut self) {
        match &mut self.decoder {
            Inner::Cpu(decoder) => decoder.lose_packet(),
            Inner::Gpu { decoder, kept, .. } => {
                decoder.lose_packet();
                *kept = None;
            }
        }
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// As [`Decoder::decode`].
    pub fn decode(&mut self, packet: &Packet) -> Result<AnyFrame, DecodeError> {
        self.decode_with(packet, false)
    }

    /// Decodes a frame packet and compares the hash that it states, if it states one.
    ///
    /// # Errors
    /// As [`Decoder::decode_and_verify`].
    pub fn decode_and_verify(&mut self, packet: &Packet) -> Result<AnyFrame, DecodeError> {
        self.decode_with(packet, true)
    }

    /// Why it turned from the GPU to the CPU, if it has since this was last asked.
    pub fn take_notice(&mut self) -> Option<BackendError> {
        self.notice.take()
    }

    fn decode_with(&mut self, packet: &Packet, verify: bool) -> Result<AnyFrame, DecodeError> {
        let (error, before) = match &mut self.decoder {
            Inner::Cpu(decoder) => return on_cpu(decoder, packet, verify),
            Inner::Gpu { decoder, extractor, kept, falls_back } => {
                let packets = if *falls_back { KeptPackets::with(kept.take(), packet) } else { None };
                match on_gpu(decoder, extractor.as_deref_mut(), packet, verify) {
                    Err(DecodeError::Backend(error)) => (error, packets),
                    frame => {
                        *kept = packets;
                        return frame;
                    }
                }
            }
        };
        let Some(KeptPackets { packets, .. }) = before else { return Err(error.into()) };
        let mut decoder = Decoder::new(&self.header, self.limits);
        let (last, others) = packets.split_last().expect("the packet that was to be decoded is kept");
        decoder.recover(self.recovers);
        for packet in others {
            let decoded = decoder.decode(packet).map(drop);
            // What could not be decoded the first time cannot now.
            if !self.recovers {
                decoded?;
            }
        }
        let frame = on_cpu(&mut decoder, last, verify);
        (self.decoder, self.notice) = (Inner::Cpu(decoder), Some(error));
        frame
    }
}

fn on_gpu(
    decoder: &mut Decoder<GpuBackend>,
    extractor: Option<&mut GpuSurfaceExtractor>,
    packet: &Packet,
    verify: bool,
) -> Result<AnyFrame, DecodeError> {
    let frame = if verify { decoder.decode_and_verify(packet) } else { decoder.decode(packet) }?;
    let extract = |extractor: &mut GpuSurfaceExtractor| extractor.extract(frame.volume)?.download();
    let surface = extractor.map(extract).transpose().map_err(BackendError::from)?;
    let volume = AnyVolume::Gpu(frame.volume.clone());
    let (stated_hash, inexact_blocks) = (frame.stated_hash, frame.inexact_blocks);
    let coded_blocks = decoder.coded_blocks().cloned();
    Ok(AnyFrame { volume, coded_blocks, surface, stated_hash, inexact_blocks })
}

fn on_cpu(decoder: &mut Decoder, packet: &Packet, verify: bool) -> Result<AnyFrame, DecodeError> {
    let frame = if verify { decoder.decode_and_verify(packet) } else { decoder.decode(packet) }?;
    let volume = AnyVolume::Cpu(frame.volume.clone());
    let (stated_hash, inexact_blocks) = (frame.stated_hash, frame.inexact_blocks);
    let coded_blocks = decoder.coded_blocks().cloned();
    Ok(AnyFrame { volume, coded_blocks, surface: None, stated_hash, inexact_blocks })
}

/// The packets from a keyframe on.
#[derive(Debug, Default)]
struct KeptPackets {
    packets: Vec<Packet>,
    bytes: usize,
}

impl KeptPackets {
    /// With the next packet, if the ones before it were kept and they are not too many.
    fn with(before: Option<Self>, packet: &Packet) -> Option<Self> {
        let mut kept = if packet.is_keyframe() { Self::default() } else { before? };
        kept.bytes += packet.total_bytes();
        kept.packets.push(packet.clone());
        (kept.bytes <= MOST_KEPT_BYTES).then_some(kept)
    }
}
