//! Streams that lose frames: what a decoder says is exact behind a loss is what a decoder without loss has, whoever made the stream.

use crate::sealing::with_checksums;
use crate::stream::{LIMITS, check, open};
use isv::raw::decode::{DecodeError, Decoder};
use isv::raw::format::{Packet, StreamHeader};
use isv::raw::volume::SparseVolume;

/// Decodes the first frames of a stream, whose checksums are made to fit first, with and without some of its packets. Which are lost is
/// for the bytes to say; keyframes are not, as a decoder cannot notice the loss of a whole GOP.
pub(crate) fn lose(bytes: &[u8]) {
    let bytes = with_checksums(bytes);
    let Some((header, packets)) = open(&bytes) else { return };
    let whole = decode(&header, &packets);
    let lost = crc32fast::hash(&bytes);
    let mut decoder = Decoder::new(&header, LIMITS);
    decoder.recover(true);
    for (frame, (packet, whole)) in packets.iter().zip(&whole).enumerate() {
        if lost >> frame & 1 == 1 && !packet.is_keyframe() {
            continue;
        }
        let volume = match decoder.decode(packet) {
            Ok(decoded) => decoded.volume.clone(),
            Err(DecodeError::MissingFrame { .. } | DecodeError::NoReference { .. }) => continue,
            Err(error) => panic!("frame {frame} is refused behind a loss alone: {error}"),
        };
        check(&volume);
        let Some(exact) = decoder.exact_blocks() else {
            assert!(volume == *whole, "frame {frame} is said to be exact");
            continue;
        };
        assert!(volume.coords() == whole.coords(), "the blocks of a resilient frame are exact");
        for block in (0..volume.block_count()).filter(|block| exact.contains(*block)) {
            assert!(volume.block(block) == whole.block(block), "frame {frame}, block {block}");
        }
    }
    // A stream can be entered at any resilient frame.
    let mut decoder = Decoder::new(&header, LIMITS);
    decoder.recover(true);
    if let Some((packet, whole)) = packets.iter().zip(&whole).next_back()
        && decoder.decode(packet).is_ok()
    {
        assert!(decoder.volume().is_some_and(|volume| volume.coords() == whole.coords()));
    }
}

/// The frames up to the first one that is refused.
fn decode(header: &StreamHeader, packets: &[Packet]) -> Vec<SparseVolume> {
    let mut decoder = Decoder::new(header, LIMITS);
    let frames =
        packets.iter().map_while(|packet| decoder.decode(packet).ok().map(|frame| frame.volume.clone()));
    frames.collect()
}
