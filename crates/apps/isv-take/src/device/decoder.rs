//! A stream's decoder on any device.

use super::fall_back::FallBack;
use super::workers::{DecodeWorker, DecodedVolume};
use crate::DeviceError;
use isv_decode::DecodeError;
use isv_decode::colour::ColourFrame;
use isv_format::Packet;
use isv_surface::SurfaceOptions;
use isv_volume::{BlockSet, TriangleMesh};
use std::sync::Arc;

/// Bytes of packets that are kept to begin again with on the CPU.
const MOST_KEPT_BYTES: usize = 256 << 20;

/// A frame as decoded.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The volume.
    pub volume: DecodedVolume,
    /// Blocks that were coded, not extrapolated: see [`isv_decode::Decoder::coded_blocks`].
    pub coded_blocks: Option<BlockSet>,
    /// Colour of the frame, if it has any and it was asked for.
    pub colour: Option<Arc<ColourFrame>>,
    /// Surface of the frame, if the device extracted it: see [`StreamDecoder::with_surfaces`].
    pub surface: Option<TriangleMesh>,
    /// Hash that the stream states, if any.
    pub stated_hash: Option<u64>,
    /// Blocks that may not be as they were encoded: see [`isv_decode::DecodedFrame::inexact_blocks`].
    pub inexact_blocks: usize,
}

/// A decoder of a stream's packets in order. Behind a GPU that failed it goes on from the last keyframe on the CPU, if that is wanted.
pub struct StreamDecoder {
    decoder: FallBack<dyn DecodeWorker>,
    recovers: bool,
    /// The packets since the last keyframe and with it, if they are wanted and not too many.
    kept: Option<KeptPackets>,
}

impl StreamDecoder {
    pub(super) fn new(decoder: FallBack<dyn DecodeWorker>) -> Self {
        Self { decoder, recovers: false, kept: None }
    }

    /// Extracts the surfaces of frames with them, where a GPU decodes: there they need not leave it to be meshed.
    ///
    /// # Errors
    /// [`DeviceError`] for a GPU that fails.
    pub fn with_surfaces(mut self, options: SurfaceOptions) -> Result<Self, DeviceError> {
        self.decoder.worker_mut().extract_surfaces(options)?;
        Ok(self)
    }

    /// Goes on behind losses: see [`isv_decode::Decoder::recover`].
    pub fn recover(&mut self, wanted: bool) {
        self.recovers = wanted;
        self.decoder.worker_mut().recover(wanted);
    }

    /// Takes a packet for lost: see [`isv_decode::Decoder::lose_packet`].
    pub fn lose_packet(&mut self) {
        self.decoder.worker_mut().lose_packet();
        self.kept = None;
    }

    /// Decodes a frame packet.
    ///
    /// # Errors
    /// See [`isv_decode::Decoder::decode`].
    pub fn decode(&mut self, packet: &Packet) -> Result<Decoded, DecodeError> {
        self.decode_with(packet, false)
    }

    /// Decodes a frame packet and compares the hash that it states, if it states one.
    ///
    /// # Errors
    /// See [`isv_decode::Decoder::decode_and_verify`].
    pub fn decode_and_verify(&mut self, packet: &Packet) -> Result<Decoded, DecodeError> {
        self.decode_with(packet, true)
    }

    fn decode_with(&mut self, packet: &Packet, verify: bool) -> Result<Decoded, DecodeError> {
        let before = self.kept.take();
        if !self.decoder.can_fall_back() {
            return self.decoder.worker_mut().decode(packet, verify);
        }
        let Some(kept) = KeptPackets::with(before, packet) else {
            return self.decoder.worker_mut().decode(packet, verify);
        };
        let recovers = self.recovers;
        let catch_up = |decoder: &mut (dyn DecodeWorker + 'static)| {
            decoder.recover(recovers);
            let (_, others) = kept.packets.split_last().expect("the packet that is decoded is kept");
            for packet in others {
                let decoded = decoder.decode(packet, false).map(drop);
                // What could not be decoded the first time cannot now.
                if !recovers {
                    decoded?;
                }
            }
            Ok(())
        };
        let frame = self.decoder.run_after(catch_up, |decoder| decoder.decode(packet, verify));
        self.kept = Some(kept);
        frame
    }
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
