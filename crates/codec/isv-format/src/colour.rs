//! The colour part of a frame packet: its header, and segments that are entropy coded.

use crate::FormatError;
use crate::bytes::{ByteReader, put_varint};

/// Prediction of a frame's colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourKind {
    /// From blocks of the same frame alone.
    Intra,
    /// From the frame before too.
    Predicted,
    /// From the frame before too, but its symbols are coded without any frame before it, so that they can be read where one was lost.
    Resilient,
}

impl ColourKind {
    /// All kinds, by their codes.
    pub const ALL: [Self; 3] = [Self::Intra, Self::Predicted, Self::Resilient];

    /// Whether blocks may be predicted from the frame before.
    #[must_use]
    pub fn predicts(self) -> bool {
        self != Self::Intra
    }

    /// Whether intra blocks are predicted from one another alone (constrained intra prediction). Then nothing of the frame before
    /// reaches them.
    #[must_use]
    pub fn constrains_intra(self) -> bool {
        self == Self::Resilient
    }
}

/// The fields at the head of a colour part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColourHeader {
    /// Prediction of the blocks; [`ColourKind::Intra`] on keyframes.
    pub kind: ColourKind,
    /// Quantizer step of luma in 1/16 of an 8-bit step, `1 ..= 2^16 - 1`.
    pub luma_step: u16,
    /// Quantizer step of both colour differences, in the same unit.
    pub chroma_step: u16,
    /// Number of slices, 1 to 256.
    pub slices: u16,
    /// XXH64 of the decoded samples, if the frame carries it.
    pub hash: Option<u64>,
}

/// Bit of the first byte that says that a hash follows.
const HASHED: u8 = 1 << 7;

impl ColourHeader {
    /// Most slices a frame may have.
    pub const MAX_SLICES: u16 = 256;

    fn put(&self, out: &mut Vec<u8>) {
        let kind = ColourKind::ALL.iter().position(|kind| *kind == self.kind).unwrap_or(0) as u8;
        out.push(kind | if self.hash.is_some() { HASHED } else { 0 });
        put_varint(out, u32::from(self.luma_step));
        put_varint(out, u32::from(self.chroma_step));
        put_varint(out, u32::from(self.slices));
        if let Some(hash) = self.hash {
            out.extend(hash.to_le_bytes());
        }
    }

    fn parse(fields: &mut ByteReader) -> Result<Self, FormatError> {
        let at = fields.at();
        let code = fields.u8()?;
        let kind = ColourKind::ALL.get(usize::from(code & !HASHED)).copied();
        let kind =
            kind.ok_or_else(|| FormatError::malformed(at, format!("colour of kind {}", code & !HASHED)))?;
        let mut step = || {
            let at = fields.at();
            let step = fields.varint()?;
            match u16::try_from(step) {
                Ok(step) if step > 0 => Ok(step),
                _ => Err(FormatError::malformed(at, format!("colour quantizer step {step}"))),
            }
        };
        let (luma_step, chroma_step) = (step()?, step()?);
        let at = fields.at();
        let slices = fields.varint()?;
        if slices == 0 {
            return Err(FormatError::malformed(at, "no slices of colour"));
        }
        if slices > u32::from(Self::MAX_SLICES) {
            let (asked, allowed) = (u64::from(slices), u64::from(Self::MAX_SLICES));
            return Err(FormatError::LimitExceeded { at, what: "slices of colour", asked, allowed });
        }
        let hash = if code & HASHED != 0 { Some(fields.u64()?) } else { None };
        Ok(Self { kind, luma_step, chroma_step, slices: slices as u16, hash })
    }
}

/// A colour part taken apart.
///
/// The modes of all slices come first, then the coefficients of all slices, layer by layer. A reader of coarse layers
/// can stop before the fine ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourPayload<'a> {
    /// Header of the part.
    pub header: ColourHeader,
    /// Modes and depths of blocks, by slice.
    pub modes: Vec<&'a [u8]>,
    /// Coefficients, by layer and slice.
    pub layers: Vec<Vec<&'a [u8]>>,
}

impl<'a> ColourPayload<'a> {
    /// The part as bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.header.put(&mut out);
        let segments = || self.modes.iter().chain(self.layers.iter().flatten());
        segments().for_each(|segment| put_varint(&mut out, segment.len() as u32));
        segments().for_each(|segment| out.extend(*segment));
        out
    }

    /// Takes a part apart. `at` is where it begins in the stream, `layers` the number of colour layers that the stream has.
    ///
    /// # Errors
    /// Fields out of range, segments that do not fill the part exactly.
    pub fn parse(bytes: &'a [u8], at: u64, layers: u8) -> Result<Self, FormatError> {
        let mut fields = ByteReader::new(bytes, at, "a frame's colour");
        let header = ColourHeader::parse(&mut fields)?;
        let slices = usize::from(header.slices);
        let count = slices * (1 + usize::from(layers));
        let lengths = (0..count).map(|_| fields.varint()).collect::<Result<Vec<_>, _>>()?;
        let segments = lengths.iter().map(|n| fields.take(*n as usize)).collect::<Result<Vec<_>, _>>()?;
        if !fields.is_empty() {
            return Err(FormatError::malformed(fields.at(), "bytes left over after a frame's colour"));
        }
        let (modes, layers) = segments.split_at(slices);
        Ok(Self { header, modes: modes.to_vec(), layers: layers.chunks(slices).map(<[_]>::to_vec).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: ColourHeader = ColourHeader {
        kind: ColourKind::Predicted,
        luma_step: 512,
        chroma_step: 717,
        slices: 2,
        hash: Some(0x0123_4567_89ab_cdef),
    };

    fn payload(header: ColourHeader) -> ColourPayload<'static> {
        ColourPayload {
            header,
            modes: vec![&[1, 2], &[]],
            layers: vec![vec![&[3; 200], &[4]], vec![&[], &[5]]],
        }
    }

    #[test]
    fn payload_roundtrips() {
        for kind in ColourKind::ALL {
            for hash in [None, HEADER.hash] {
                let payload = payload(ColourHeader { kind, hash, ..HEADER });
                assert_eq!(ColourPayload::parse(&payload.to_bytes(), 0, 2).unwrap(), payload);
            }
        }
    }

    #[test]
    fn every_prefix_and_one_byte_more_fail() {
        let mut bytes = payload(HEADER).to_bytes();
        for length in 0..bytes.len() {
            assert!(ColourPayload::parse(&bytes[..length], 0, 2).is_err(), "{length} bytes");
        }
        assert!(ColourPayload::parse(&bytes, 0, 1).is_err() && ColourPayload::parse(&bytes, 0, 3).is_err());
        bytes.push(0);
        assert!(ColourPayload::parse(&bytes, 0, 2).is_err());
    }

    #[test]
    fn fields_out_of_range_are_refused_by_place() {
        let wrong = [
            (1, ColourHeader { luma_step: 0, ..HEADER }),
            (3, ColourHeader { chroma_step: 0, ..HEADER }),
            (5, ColourHeader { slices: 0, ..HEADER }),
        ];
        for (place, header) in wrong {
            match ColourPayload::parse(&payload(header).to_bytes(), 0, 2) {
                Err(FormatError::Malformed { at, .. }) => assert_eq!(at, place),
                other => panic!("{other:?}"),
            }
        }
        let bytes = payload(ColourHeader { slices: 257, ..HEADER }).to_bytes();
        assert!(matches!(
            ColourPayload::parse(&bytes, 0, 2),
            Err(FormatError::LimitExceeded { at: 5, asked: 257, .. })
        ));
        let mut bytes = payload(HEADER).to_bytes();
        bytes[0] = 3;
        assert!(ColourPayload::parse(&bytes, 0, 2).is_err());
    }
}
