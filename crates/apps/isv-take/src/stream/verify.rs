//! Whether a stream is whole and sound.

use super::{DecodeSettings, StreamError, StreamFault, open};
use crate::Input;
use isv_decode::Lod;
use isv_format::{IndexEntry, StreamIndex};

/// Frames that are sound, up to the first that is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Verified {
    /// Number of frames.
    pub frames: usize,
    /// Number of frames that state a hash.
    pub hashed: usize,
}

/// Decodes a whole stream and checks it: checksums of packets, hashes of frames where they have them, index and end. `on_frame` is called
/// for each sound frame. Returns what is sound, and what is wrong if anything is.
pub fn verify(
    input: &Input,
    settings: &DecodeSettings,
    on_frame: impl FnMut(),
) -> (Verified, Result<(), StreamError>) {
    let mut verified = Verified::default();
    let checked = check(input, settings, &mut verified, on_frame);
    (verified, checked.map_err(|fault| fault.in_stream(&input.name())))
}

fn check(
    input: &Input,
    settings: &DecodeSettings,
    verified: &mut Verified,
    mut on_frame: impl FnMut(),
) -> Result<(), StreamFault> {
    let (mut packets, header) = open(input, settings.memory).map_err(|error| error.fault)?;
    let limits = settings.memory.decoder_limits();
    let mut decoder = settings.device.decoder(&header, limits, Lod::Full, true, &settings.observer)?;
    let mut found = StreamIndex::default();
    while let Some(packet) = packets.next_frame()? {
        let decoded = decoder.decode_and_verify(&packet)?;
        found.frames.push(IndexEntry { at: packet.at, keyframe: packet.is_keyframe() });
        verified.frames += 1;
        verified.hashed += usize::from(decoded.stated_hash.is_some());
        on_frame();
    }
    match packets.index() {
        None => return Err(StreamFault::NoIndex),
        Some(index) if *index != found => return Err(StreamFault::FalseIndex),
        Some(_) => {}
    }
    match packets.has_more()? {
        true => Err(StreamFault::BytesBehindEnd { at: packets.at() }),
        false => Ok(()),
    }
}
