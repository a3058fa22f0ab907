//! The payload of a frame packet: its header, and segments that are entropy coded.

use crate::bytes::{ByteReader, put_varint};
use crate::header::STEP_LIMIT;
use crate::{FormatError, Profile};

/// Source of the prediction of a frame's blocks (Sec. 3.4 and 3.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Prediction {
    /// Nothing: intra-coded blocks.
    None,
    /// The frame before, each block from the one at its own place.
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
        Self::ALL.into_iter().find(|prediction| prediction.code() == code)
    }
}

/// Prediction of a frame of profile `main`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// Prediction from blocks of the same frame alone. The frame before may still tell where blocks and masks are.
    Intra,
    /// The frame before too, translated a block at a time.
    Predicted {
        /// Whether cells of 4x4x4 blocks may be skipped: they stay as they were in the frame before. The specification calls them
        /// still cells.
        skip_cells: bool,
    },
    /// The frame before too, but its symbols are coded without any frame before it, so that they can be read where one was lost.
    Resilient,
}

impl FrameKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [
        Self::Intra,
        Self::Predicted { skip_cells: false },
        Self::Predicted { skip_cells: true },
        Self::Resilient,
    ];

    /// Whether blocks may be predicted from the frame before.
    #[must_use]
    pub fn predicts(self) -> bool {
        self != Self::Intra
    }

    /// Whether cells may be skipped.
    #[must_use]
    pub fn skips_cells(self) -> bool {
        self == Self::Predicted { skip_cells: true }
    }

    /// Whether the frame's symbols can be read where the frame before was lost.
    #[must_use]
    pub fn is_resilient(self) -> bool {
        self == Self::Resilient
    }

    /// The first byte of a payload: the code of the prediction, and bits of what else there is.
    fn code(self) -> u8 {
        const TRANSLATION: u8 = Prediction::ThreeDof as u8;
        const SKIP_CELLS: u8 = 1 << 2;
        const RESILIENT: u8 = 1 << 3;
        match self {
            Self::Intra => Prediction::None.code(),
            Self::Predicted { skip_cells: false } => TRANSLATION,
            Self::Predicted { skip_cells: true } => TRANSLATION | SKIP_CELLS,
            Self::Resilient => TRANSLATION | RESILIENT,
        }
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }

    /// Whether a payload with this first byte is of a resilient frame.
    pub(crate) fn of_payload_is_resilient(code: u8, profile: &Profile) -> bool {
        *profile == Profile::Main && code == Self::Resilient.code()
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

/// The fields of a frame header that are a profile's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameCoding {
    /// Fields of profile `paper`: the stream header states all else.
    Paper {
        /// How blocks are predicted; [`Prediction::None`] on keyframes.
        prediction: Prediction,
    },
    /// Fields of profile `main`.
    Main(MainFrameHeader),
}

/// What each frame of profile `main` states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MainFrameHeader {
    /// Prediction of the blocks; [`FrameKind::Intra`] on keyframes.
    pub kind: FrameKind,
    /// Quantizer step of all coefficients in sixteenths of a code, `1 ..= 2^20`.
    pub step: u32,
    /// Strength of the in-loop filter in sixty-fourths, `0 ..= 25`; 0 is off.
    pub filter: u8,
    /// The most that the in-loop filter changes a sample by, in codes; 0 if the filter is off.
    pub filter_limit: u8,
    /// Whether motion vectors count half voxels instead of quarters.
    pub half_voxel_vectors: bool,
    /// Whether blocks that are not predicted from the frame before are predicted by zero and not from their neighbours.
    pub no_spatial_prediction: bool,
}

impl MainFrameHeader {
    /// Largest [`Self::step`].
    pub const MAX_STEP: u32 = STEP_LIMIT;
    /// Largest [`Self::filter`].
    pub const MAX_FILTER: u8 = 25;

    /// Step of new motion vectors in quarter voxels.
    #[must_use]
    pub fn vector_step(&self) -> i32 {
        if self.half_voxel_vectors { 2 } else { 1 }
    }

    /// Bit of the filter's byte that holds [`Self::half_voxel_vectors`].
    const HALF_VOXEL_VECTORS: u8 = 1 << 6;

    /// Bit of the same byte that holds [`Self::no_spatial_prediction`].
    const NO_SPATIAL_PREDICTION: u8 = 1 << 7;

    fn put(&self, out: &mut Vec<u8>) {
        put_varint(out, self.step);
        let half = if self.half_voxel_vectors { Self::HALF_VOXEL_VECTORS } else { 0 };
        let zero = if self.no_spatial_prediction { Self::NO_SPATIAL_PREDICTION } else { 0 };
        out.push(self.filter | half | zero);
        if self.filter > 0 {
            out.push(self.filter_limit);
        }
    }

    fn parse(fields: &mut ByteReader, kind: FrameKind) -> Result<Self, FormatError> {
        let at = fields.at();
        let step = fields.varint()?;
        if !(1..=Self::MAX_STEP).contains(&step) {
            return Err(FormatError::malformed(at, format!("quantizer step {step}")));
        }
        let at = fields.at();
        let byte = fields.u8()?;
        let filter = byte & !(Self::HALF_VOXEL_VECTORS | Self::NO_SPATIAL_PREDICTION);
        if filter > Self::MAX_FILTER {
            return Err(FormatError::malformed(at, format!("filter strength {filter}")));
        }
        let filter_limit = if filter > 0 { fields.u8()? } else { 0 };
        Ok(Self {
            kind,
            step,
            filter,
            filter_limit,
            half_voxel_vectors: byte & Self::HALF_VOXEL_VECTORS != 0,
            no_spatial_prediction: byte & Self::NO_SPATIAL_PREDICTION != 0,
        })
    }
}

/// The fields at the head of a frame payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// Number of blocks.
    pub blocks: u32,
    /// Number of slices, 1 to 256.
    pub slices: u16,
    /// Fields of the stream's profile.
    pub coding: FrameCoding,
    /// XXH64 of the decoded volume, if the frame carries it.
    pub volume_hash: Option<u64>,
}

impl FrameHeader {
    /// Most slices a frame may have.
    pub const MAX_SLICES: u16 = 256;

    /// How blocks are predicted; [`Prediction::None`] on keyframes.
    #[must_use]
    pub fn prediction(&self) -> Prediction {
        match self.coding {
            FrameCoding::Paper { prediction } => prediction,
            FrameCoding::Main(main) if main.kind.predicts() => Prediction::ThreeDof,
            FrameCoding::Main(_) => Prediction::None,
        }
    }

    fn put(&self, out: &mut Vec<u8>) {
        out.push(match self.coding {
            FrameCoding::Paper { prediction } => prediction.code(),
            FrameCoding::Main(main) => main.kind.code(),
        });
        put_varint(out, self.blocks);
        put_varint(out, u32::from(self.slices));
        if let FrameCoding::Main(main) = &self.coding {
            main.put(out);
        }
        if let Some(hash) = self.volume_hash {
            out.extend(hash.to_le_bytes());
        }
    }

    fn parse(fields: &mut ByteReader, hashed: bool, profile: &Profile) -> Result<Self, FormatError> {
        let at = fields.at();
        let code = fields.u8()?;
        let unknown = || {
            let profile = profile.name();
            FormatError::malformed(at, format!("prediction {code} is not known in profile {profile}"))
        };
        let (prediction, kind) = match profile {
            Profile::Paper(_) => (Prediction::from_code(code).ok_or_else(unknown)?, FrameKind::Intra),
            Profile::Main => (Prediction::None, FrameKind::from_code(code).ok_or_else(unknown)?),
        };
        let blocks = fields.varint()?;
        let at = fields.at();
        let slices = fields.varint()?;
        if slices == 0 {
            return Err(FormatError::malformed(at, "no slices"));
        }
        if slices > u32::from(Self::MAX_SLICES) {
            let (asked, allowed) = (u64::from(slices), u64::from(Self::MAX_SLICES));
            return Err(FormatError::LimitExceeded { at, what: "slices", asked, allowed });
        }
        let coding = match profile {
            Profile::Paper(_) => FrameCoding::Paper { prediction },
            Profile::Main => FrameCoding::Main(MainFrameHeader::parse(fields, kind)?),
        };
        let volume_hash = if hashed { Some(fields.u64()?) } else { None };
        Ok(Self { blocks, slices: slices as u16, coding, volume_hash })
    }
}

/// The entropy-coded segments of one slice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlicePayload<'a> {
    /// Modes of blocks in profile `main`, motion vectors in profile `paper`; empty without prediction from another frame. The
    /// specification calls it the motion segment.
    pub modes: &'a [u8],
    /// Quantized coefficients.
    pub coefficients: &'a [u8],
}

/// A frame payload taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePayload<'a> {
    /// Header of the frame.
    pub header: FrameHeader,
    /// The set of blocks.
    pub block_set: &'a [u8],
    /// Unobserved voxels.
    pub masks: &'a [u8],
    /// Modes and coefficients of each slice.
    pub slices: Vec<SlicePayload<'a>>,
}

impl<'a> FramePayload<'a> {
    /// The payload as bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.header.put(&mut out);
        let segments = || {
            let slices = self.slices.iter().flat_map(|s| [s.modes, s.coefficients]);
            [self.block_set, self.masks].into_iter().chain(slices)
        };
        segments().for_each(|segment| put_varint(&mut out, segment.len() as u32));
        segments().for_each(|segment| out.extend(segment));
        out
    }

    /// Takes a payload apart. `at` is where it begins in the stream, `hashed` the flag in its packet's header, `profile` the
    /// stream's.
    ///
    /// # Errors
    /// Fields out of range, segments that do not fill the payload exactly.
    pub fn parse(bytes: &'a [u8], at: u64, hashed: bool, profile: &Profile) -> Result<Self, FormatError> {
        let mut fields = ByteReader::new(bytes, at, "a frame's payload");
        let header = FrameHeader::parse(&mut fields, hashed, profile)?;
        let lengths = (0..2 + 2 * header.slices).map(|_| fields.varint()).collect::<Result<Vec<_>, _>>()?;
        let segments = lengths.iter().map(|n| fields.take(*n as usize)).collect::<Result<Vec<_>, _>>()?;
        if !fields.is_empty() {
            return Err(FormatError::malformed(fields.at(), "bytes left over after a frame's segments"));
        }
        let slices = segments[2..].chunks_exact(2).map(|s| SlicePayload { modes: s[0], coefficients: s[1] });
        Ok(Self { header, block_set: segments[0], masks: segments[1], slices: slices.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PaperParameters;

    const PAPER: Profile = Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 });
    const MAIN_HEADER: MainFrameHeader = MainFrameHeader {
        step: 1 << 20,
        filter: 25,
        filter_limit: 255,
        half_voxel_vectors: true,
        no_spatial_prediction: true,
        kind: FrameKind::Predicted { skip_cells: true },
    };

    fn payload(coding: FrameCoding) -> FramePayload<'static> {
        FramePayload {
            header: FrameHeader { blocks: 4500, slices: 2, coding, volume_hash: Some(0x0123_4567_89ab_cdef) },
            block_set: &[1, 2, 3],
            masks: &[],
            slices: vec![
                SlicePayload { modes: &[4], coefficients: &[5; 200] },
                SlicePayload { modes: &[], coefficients: &[6] },
            ],
        }
    }

    /// A payload of each profile.
    fn payloads() -> [(Profile, FramePayload<'static>); 2] {
        let paper = FrameCoding::Paper { prediction: Prediction::ThreeDof };
        [(PAPER, payload(paper)), (Profile::Main, payload(FrameCoding::Main(MAIN_HEADER)))]
    }

    /// Asserts that a payload is refused for the field at byte `place`.
    fn assert_malformed(payload: &FramePayload, profile: &Profile, place: u64) {
        match FramePayload::parse(&payload.to_bytes(), 0, true, profile) {
            Err(FormatError::Malformed { at, .. }) => assert_eq!(at, place, "{:?}", payload.header),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn payload_roundtrips() {
        for (profile, payload) in payloads() {
            let bytes = payload.to_bytes();
            assert_eq!(FramePayload::parse(&bytes, 0, true, &profile).unwrap(), payload);
        }
    }

    #[test]
    fn fields_of_main_roundtrip() {
        let headers = [
            MAIN_HEADER,
            MainFrameHeader {
                step: 1,
                filter: 0,
                filter_limit: 0,
                half_voxel_vectors: false,
                no_spatial_prediction: false,
                kind: FrameKind::Resilient,
            },
            MainFrameHeader {
                step: 1024,
                filter: 0,
                filter_limit: 0,
                half_voxel_vectors: true,
                no_spatial_prediction: false,
                kind: FrameKind::Resilient,
            },
            MainFrameHeader {
                step: 1024,
                filter: 1,
                filter_limit: 0,
                half_voxel_vectors: false,
                no_spatial_prediction: false,
                kind: FrameKind::Resilient,
            },
        ];
        for header in headers {
            let payload = payload(FrameCoding::Main(header));
            let bytes = payload.to_bytes();
            assert_eq!(FramePayload::parse(&bytes, 0, true, &Profile::Main).unwrap(), payload);
        }
    }

    #[test]
    fn fields_of_main_follow_the_slices() {
        let header = MainFrameHeader {
            step: 300,
            filter: 20,
            filter_limit: 40,
            half_voxel_vectors: true,
            no_spatial_prediction: true,
            kind: FrameKind::Predicted { skip_cells: true },
        };
        let bytes = payload(FrameCoding::Main(header)).to_bytes();
        assert_eq!(bytes[..9], [6, 0x94, 0x23, 2, 0xac, 0x02, 0xd4, 40, 0xef]);
    }

    #[test]
    fn fields_out_of_range_are_refused_by_place() {
        let wrong = [
            (4, MainFrameHeader { step: 0, ..MAIN_HEADER }),
            (4, MainFrameHeader { step: (1 << 20) + 1, ..MAIN_HEADER }),
            (7, MainFrameHeader { filter: 33, ..MAIN_HEADER }),
            (7, MainFrameHeader { filter: 26, ..MAIN_HEADER }),
        ];
        for (place, header) in wrong {
            assert_malformed(&payload(FrameCoding::Main(header)), &Profile::Main, place);
        }
        for (profile, mut payload) in payloads() {
            payload.header.slices = 0;
            assert_malformed(&payload, &profile, 3);
            payload.header.slices = 257;
            let error = FramePayload::parse(&payload.to_bytes(), 0, true, &profile).unwrap_err();
            assert!(
                matches!(error, FormatError::LimitExceeded { at: 3, asked: 257, allowed: 256, .. }),
                "{error}"
            );
        }
    }

    /// In profile `main` blocks are translated or not predicted. Cells are skipped only where something is predicted, and not in
    /// a frame that is to be read without the one before.
    #[test]
    fn main_has_four_kinds_of_frames() {
        let bytes = payload(FrameCoding::Main(MAIN_HEADER)).to_bytes();
        let read: Vec<_> = (0..=u8::MAX)
            .filter_map(|code| {
                let bytes = [&[code], &bytes[1..]].concat();
                let payload = FramePayload::parse(&bytes, 0, true, &Profile::Main).ok()?;
                let FrameCoding::Main(main) = payload.header.coding else { panic!("profile main") };
                assert_eq!(
                    FrameKind::of_payload_is_resilient(code, &Profile::Main),
                    main.kind.is_resilient()
                );
                assert_eq!(payload.header.prediction() != Prediction::None, main.kind.predicts());
                Some((code, main.kind))
            })
            .collect();
        let [intra, predicted, skipping, resilient] = FrameKind::ALL;
        assert_eq!(read, [(0, intra), (2, predicted), (6, skipping), (10, resilient)]);
        let paper = payload(FrameCoding::Paper { prediction: Prediction::None }).to_bytes();
        let read = (0..=u8::MAX).filter(|code| {
            let bytes = [&[*code], &paper[1..]].concat();
            FramePayload::parse(&bytes, 0, true, &PAPER).is_ok()
        });
        assert_eq!(read.collect::<Vec<_>>(), [0, 1, 2, 3]);
    }

    #[test]
    fn every_prefix_and_one_byte_more_fail() {
        for (profile, payload) in payloads() {
            let mut bytes = payload.to_bytes();
            for length in 0..bytes.len() {
                assert!(FramePayload::parse(&bytes[..length], 0, true, &profile).is_err(), "{length} bytes");
            }
            bytes.push(0);
            assert!(FramePayload::parse(&bytes, 0, true, &profile).is_err());
        }
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
