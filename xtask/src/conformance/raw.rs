//! Streams and frames put together by hand: what no encoder would write can be in them.

use super::Stream;
use anyhow::{Result, ensure};
use isv::raw::decode::shared::syntax::block_set::{BlockSetModels, CellContext, DEPTH_BITS, MAX_DEPTH};
use isv::raw::decode::{DecodeError, Decoder, Limits, volume_hash};
use isv::raw::format::{
    FrameHeader, FramePayload, IndexEntry, PacketHeader, PacketKind, PacketReader, SlicePayload,
    StreamHeader, StreamIndex,
};
use isv::raw::volume::BlockCoord;
use isv_entropy::RangeEncoder;

/// A frame's payload, owned.
#[derive(Clone)]
pub(super) struct RawFrame {
    pub(super) header: FrameHeader,
    pub(super) block_set: Vec<u8>,
    pub(super) masks: Vec<u8>,
    /// Motion and coefficients.
    pub(super) slices: Vec<[Vec<u8>; 2]>,
}

impl RawFrame {
    pub(super) fn payload(&self) -> FramePayload<'_> {
        let Self { header, block_set, masks, slices } = self;
        let slices = slices.iter().map(|[modes, coefficients]| SlicePayload { modes, coefficients });
        FramePayload { header: *header, block_set, masks, slices: slices.collect() }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        self.payload().to_bytes()
    }
}

impl From<&FramePayload<'_>> for RawFrame {
    fn from(payload: &FramePayload) -> Self {
        let FramePayload { header, block_set, masks, slices } = payload;
        let slices = slices.iter().map(|slice| [slice.modes.to_vec(), slice.coefficients.to_vec()]);
        Self {
            header: *header,
            block_set: block_set.to_vec(),
            masks: masks.to_vec(),
            slices: slices.collect(),
        }
    }
}

/// A stream that grows by packets of any kind, their checksums right.
#[derive(Clone)]
pub(super) struct RawStream {
    pub(super) bytes: Vec<u8>,
    since_keyframe: u16,
    index: StreamIndex,
}

impl RawStream {
    pub(super) fn new(header: &StreamHeader) -> Self {
        Self { bytes: header.to_bytes().to_vec(), since_keyframe: 0, index: StreamIndex::default() }
    }

    /// Adds a frame packet with the next number.
    pub(super) fn frame(&mut self, keyframe: bool, timestamp_ns: u64, hashed: bool, payload: &[u8]) {
        self.frame_with(keyframe, timestamp_ns, hashed, payload, None);
    }

    /// Adds a frame packet with the next number and a colour part, if it is to have one.
    pub(super) fn frame_with(
        &mut self,
        keyframe: bool,
        timestamp_ns: u64,
        hashed: bool,
        geometry: &[u8],
        colour: Option<&[u8]>,
    ) {
        let payload = match colour {
            Some(colour) => [geometry, colour, &(colour.len() as u32).to_le_bytes()].concat(),
            None => geometry.to_vec(),
        };
        self.since_keyframe = if keyframe { 0 } else { self.since_keyframe.wrapping_add(1) };
        self.index.frames.push(IndexEntry { at: self.bytes.len() as u64, keyframe });
        self.packet(
            PacketKind::Frame { keyframe, hashed, colour: colour.is_some() },
            self.since_keyframe,
            timestamp_ns,
            &payload,
        );
    }

    /// Adds any packet.
    pub(super) fn packet(
        &mut self,
        kind: PacketKind,
        since_keyframe: u16,
        timestamp_ns: u64,
        payload: &[u8],
    ) {
        self.bytes.extend(PacketHeader::seal(kind, since_keyframe, timestamp_ns, payload));
        self.bytes.extend(payload);
    }

    /// Adds a packet of any type, known or not, with these flags.
    pub(super) fn unknown(
        &mut self,
        code: u8,
        flags: u8,
        since_keyframe: u16,
        timestamp_ns: u64,
        payload: &[u8],
    ) {
        let kind = PacketKind::Skippable { code };
        let mut header = PacketHeader::seal(kind, since_keyframe, timestamp_ns, payload);
        header[5] = flags;
        let checksum = crc32(&[&header[..20], payload].concat());
        header[20..].copy_from_slice(&checksum.to_le_bytes());
        self.bytes.extend(header);
        self.bytes.extend(payload);
    }

    /// Adds the index and the trailer.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let index = self.index.to_payload();
        self.finish_with(&index);
        self.bytes
    }

    /// Adds an index with this payload and the trailer.
    pub(super) fn finish_with(&mut self, index: &[u8]) {
        let at = self.bytes.len() as u64;
        self.packet(PacketKind::Index, 0, 0, index);
        self.bytes.extend(StreamIndex::trailer(at));
    }
}

/// Checksum of CRC-32.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// A segment of what is encoded into it.
pub(super) fn segment(write: impl FnOnce(&mut RangeEncoder)) -> Vec<u8> {
    let mut encoder = RangeEncoder::new();
    write(&mut encoder);
    encoder.finish()
}

/// The block-set segment of a keyframe with these blocks, its root at any depth that holds them all.
pub(super) fn octree(coords: &[[i32; 3]], depth: u32) -> Vec<u8> {
    let codes: Vec<u64> = sorted(coords).iter().map(|coord| coord.morton().0).collect();
    segment(|encoder| {
        encoder.encode_raw(depth, DEPTH_BITS);
        let root = codes[0] >> (3 * depth);
        for bit in (0..3 * (MAX_DEPTH - depth)).rev() {
            encoder.encode_raw((root >> bit & 1) as u32, 1);
        }
        let mut models = BlockSetModels::default();
        let mut cells = vec![root];
        for level in (0..depth).rev() {
            let mut context = CellContext::new(level, &cells, None);
            let mut children: Vec<u64> = Vec::new();
            for parent in cells {
                let first = children.len();
                for cell in 8 * parent..8 * parent + 8 {
                    let present = codes.iter().any(|code| code >> (3 * level) == cell);
                    if cell % 8 != 7 || children.len() > first {
                        encoder.encode(&mut models.cell[context.model(cell)], present);
                    }
                    if present {
                        context.occupy(cell);
                        children.push(cell);
                    }
                }
            }
            cells = children;
        }
    })
}

/// Blocks in Morton order.
pub(super) fn sorted(coords: &[[i32; 3]]) -> Vec<BlockCoord> {
    let mut coords: Vec<_> = coords.iter().map(|coord| BlockCoord::from(*coord)).collect();
    coords.sort_unstable_by_key(|coord| coord.morton());
    coords.dedup();
    coords
}

/// What our decoder makes of a stream: the hashes of its frames, and why it stopped before the end.
pub(super) fn judge(bytes: &[u8]) -> (Vec<u64>, Option<DecodeError>) {
    let mut hashes = Vec::new();
    let error = decode(bytes, &mut hashes).err();
    (hashes, error)
}

fn decode(bytes: &[u8], hashes: &mut Vec<u64>) -> Result<(), DecodeError> {
    let mut reader = PacketReader::new(bytes)?;
    let mut decoder = Decoder::new(reader.header(), Limits::default());
    while let Some(packet) = reader.next_frame()? {
        hashes.push(volume_hash(decoder.decode_and_verify(&packet)?.volume));
    }
    Ok(())
}

/// A stream of frames, each with whether it is a keyframe, that states their hashes.
pub(super) fn stream_of(header: &StreamHeader, frames: &[(bool, RawFrame)]) -> Result<Stream> {
    let write = |hashes: Option<&[u64]>| {
        let mut stream = RawStream::new(header);
        for (index, (keyframe, frame)) in frames.iter().enumerate() {
            let mut frame = frame.clone();
            frame.header.volume_hash = hashes.map(|hashes| hashes[index]);
            let timestamp = header.frame_rate.timestamp_ns(index as u64);
            stream.frame(*keyframe, timestamp, hashes.is_some(), &frame.to_bytes());
        }
        stream.finish()
    };
    let (hashes, error) = judge(&write(None));
    if let Some(error) = error {
        return Err(error.into());
    }
    let bytes = write(Some(&hashes));
    let (found, error) = judge(&bytes);
    ensure!(error.is_none() && found == hashes, "hashes do not change what is decoded");
    Ok((bytes, hashes))
}
