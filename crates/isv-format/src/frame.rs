//! The payload of a frame packet: its header, and segments that are entropy coded.

use crate::FormatError;
use crate::bytes::{ByteReader, put_varint};

/// Where the prediction of a frame's blocks comes from (Sec. 3.4 and 3.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Prediction {
    /// Nothing: intra-coded blocks.
    None,
    /// The same block of the frame before.
    ZeroMotion,
    /// The frame before, translated a block at a time.
    ThreeDof,
    /// The frame before, translated and rotated a block at a time.
    SixDof,
}

impl Prediction {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::None, Self::ZeroMotion, Self::ThreeDof, Self::SixDof];

    /// Whether blocks carry motion vectors.
    #[must_use]
    pub fn has_motion(self) -> bool {
        self >= Self::ThreeDof
    }

    fn code(self) -> u8 {
        self as u8
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.code() == code)
    }
}

/// How a frame's blocks are split into slices: runs in Morton order of equal length, the first ones a block longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SliceLayout {
    blocks: usize,
    slices: usize,
}

impl SliceLayout {
    /// `blocks` blocks in `slices` slices; at least one slice.
    #[must_use]
    pub fn new(blocks: usize, slices: usize) -> Self {
        Self { blocks, slices: slices.max(1) }
    }

    /// Block ranges of the slices, in order.
    pub fn ranges(self) -> impl ExactSizeIterator<Item = std::ops::Range<usize>> {
        let (length, longer) = (self.blocks / self.slices, self.blocks % self.slices);
        (0..self.slices).map(move |s| {
            let start = s * length + s.min(longer);
            start..start + length + usize::from(s < longer)
        })
    }
}

/// The fields at the head of a frame payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// How blocks are predicted; [`Prediction::None`] on keyframes.
    pub prediction: Prediction,
    /// Number of blocks.
    pub blocks: u32,
    /// Number of slices, 1 to 256.
    pub slices: u16,
    /// XXH64 of the decoded volume, if the frame carries it.
    pub volume_hash: Option<u64>,
}

impl FrameHeader {
    /// Most slices a frame may have.
    pub const MAX_SLICES: u16 = 256;
}

/// The entropy-coded segments of one slice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlicePayload<'a> {
    /// Motion vectors; empty without motion.
    pub motion: &'a [u8],
    /// Quantized coefficients.
    pub coefficients: &'a [u8],
}

/// A frame payload taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePayload<'a> {
    /// Its header.
    pub header: FrameHeader,
    /// The set of blocks.
    pub block_set: &'a [u8],
    /// Unobserved voxels.
    pub masks: &'a [u8],
    /// Motion and coefficients of each slice.
    pub slices: Vec<SlicePayload<'a>>,
}

impl<'a> FramePayload<'a> {
    /// The payload as bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = vec![self.header.prediction.code()];
        put_varint(&mut out, self.header.blocks);
        put_varint(&mut out, u32::from(self.header.slices));
        if let Some(hash) = self.header.volume_hash {
            out.extend(hash.to_le_bytes());
        }
        let segments = || {
            let slices = self.slices.iter().flat_map(|s| [s.motion, s.coefficients]);
            [self.block_set, self.masks].into_iter().chain(slices)
        };
        segments().for_each(|segment| put_varint(&mut out, segment.len() as u32));
        segments().for_each(|segment| out.extend(segment));
        out
    }

    /// Takes a payload apart. `at` is where it begins in the stream, `hashed` the flag in its packet's header.
    ///
    /// # Errors
    /// Fields out of range, segments that do not fill the payload exactly.
    pub fn parse(bytes: &'a [u8], at: u64, hashed: bool) -> Result<Self, FormatError> {
        let mut fields = ByteReader::new(bytes, at, "a frame header");
        let code = fields.u8()?;
        let prediction = Prediction::from_code(code)
            .ok_or_else(|| FormatError::malformed(at, format!("prediction {code} is not known")))?;
        let blocks = fields.varint()?;
        let slices_at = fields.at();
        let slices = fields.varint()?;
        if !(1..=u32::from(FrameHeader::MAX_SLICES)).contains(&slices) {
            return Err(FormatError::malformed(slices_at, format!("{slices} slices")));
        }
        let volume_hash = if hashed { Some(fields.u64()?) } else { None };
        let header = FrameHeader { prediction, blocks, slices: slices as u16, volume_hash };
        let lengths = (0..2 + 2 * slices).map(|_| fields.varint()).collect::<Result<Vec<_>, _>>()?;
        let segments = lengths.iter().map(|n| fields.take(*n as usize)).collect::<Result<Vec<_>, _>>()?;
        if !fields.is_empty() {
            return Err(FormatError::malformed(fields.at(), "bytes left over after a frame's segments"));
        }
        let slices = segments[2..].chunks_exact(2).map(|s| SlicePayload { motion: s[0], coefficients: s[1] });
        Ok(Self { header, block_set: segments[0], masks: segments[1], slices: slices.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn payload() -> FramePayload<'static> {
        FramePayload {
            header: FrameHeader {
                prediction: Prediction::ThreeDof,
                blocks: 4500,
                slices: 2,
                volume_hash: Some(0x0123_4567_89ab_cdef),
            },
            block_set: &[1, 2, 3],
            masks: &[],
            slices: vec![
                SlicePayload { motion: &[4], coefficients: &[5; 200] },
                SlicePayload { motion: &[], coefficients: &[6] },
            ],
        }
    }

    #[test]
    fn payload_roundtrips() {
        let bytes = payload().to_bytes();
        assert_eq!(FramePayload::parse(&bytes, 0, true).unwrap(), payload());
    }

    #[test]
    fn every_prefix_and_one_byte_more_fail() {
        let mut bytes = payload().to_bytes();
        for length in 0..bytes.len() {
            assert!(FramePayload::parse(&bytes[..length], 0, true).is_err(), "{length} bytes");
        }
        bytes.push(0);
        assert!(FramePayload::parse(&bytes, 0, true).is_err());
    }

    #[test]
    fn slices_cover_the_blocks_in_order() {
        for (blocks, slices) in [(0, 1), (7, 3), (3, 7), (4500, 4)] {
            let ranges: Vec<_> = SliceLayout::new(blocks, slices).ranges().collect();
            assert_eq!(ranges.len(), slices);
            assert_eq!(ranges.iter().cloned().flatten().collect::<Vec<_>>(), (0..blocks).collect::<Vec<_>>());
        }
    }
}
