//! The public header block and the variable length record of LASzip.

use crate::error::{Flaw, Malformation};
use glam::DVec3;
use std::ops::Range;

/// Bytes of the header of LAS 1.0 to 1.2; later ones are longer.
const LEAST_BYTES: usize = 227;

/// Bytes of the header of LAS 1.4.
const BYTES_1_4: usize = 375;

/// Bytes of a variable length record before its data.
const VLR_HEADER_BYTES: usize = 54;

/// Bytes of the records of each point format, 0 to 10.
pub(super) const RECORD_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

#[derive(Debug)]
pub(super) struct Header {
    /// Point format, 0 to 10.
    pub(super) format: u8,
    /// Whether the records are those of LASzip.
    pub(super) compressed: bool,
    /// Bytes of a record: those of its format, and extra ones.
    pub(super) record_bytes: usize,
    /// Number of points as claimed; nothing is allocated by it.
    pub(super) points: u64,
    /// Metres, or whatever the file is in, that one step of the record's integers stands for.
    pub(super) scale: DVec3,
    /// What is added after scaling.
    pub(super) offset: DVec3,
    /// Start of the records, inside the file.
    pub(super) points_offset: usize,
    /// Place of the data of LASzip's variable length record.
    pub(super) laszip: Option<Range<usize>>,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, Flaw> {
        if !bytes.starts_with(b"LASF") {
            return Err(Flaw::at_byte(0, Malformation::Magic { format: "LAS", magic: "LASF" }));
        }
        let ends = |what| Flaw::at_byte(bytes.len(), Malformation::EndsBefore { what });
        let modern = bytes.get(25).is_some_and(|minor| *minor >= 4);
        if bytes.len() < if modern { BYTES_1_4 } else { LEAST_BYTES } {
            return Err(ends("first point"));
        }
        let points_offset = u32_at(bytes, 96) as usize;
        if points_offset > bytes.len() {
            return Err(ends("first point"));
        }
        // LASzip marks its records by the two highest bits of the format.
        let (format, compressed) = (bytes[104] & 0x3f, bytes[104] & 0xc0 != 0);
        let record_bytes = usize::from(u16_at(bytes, 105));
        match RECORD_BYTES.get(usize::from(format)) {
            None => return Err(Flaw::unreadable("LAS", 104, &format!("it has point format {format}"))),
            Some(least) if record_bytes < *least => {
                let why = format!("its records have {record_bytes} bytes, point format {format} {least}");
                return Err(Flaw::unreadable("LAS", 105, &why));
            }
            Some(_) => {}
        }
        let points = match u64::from(u32_at(bytes, 107)) {
            0 if modern => u64::from_le_bytes(take(bytes, 247)),
            points => points,
        };
        let vector =
            |at: usize| DVec3::from([0, 8, 16].map(|axis| f64::from_le_bytes(take(bytes, at + axis))));
        let (scale, offset) = (vector(131), vector(155));
        let laszip = find_laszip(bytes);
        Ok(Self { format, compressed, record_bytes, points, scale, offset, points_offset, laszip })
    }
}

/// Finds the data of LASzip's record among the variable length records that follow the header.
fn find_laszip(bytes: &[u8]) -> Option<Range<usize>> {
    let mut at = usize::from(u16_at(bytes, 94));
    for _ in 0..u32_at(bytes, 100) {
        let head = bytes.get(at..)?.first_chunk::<VLR_HEADER_BYTES>()?;
        let data = at + VLR_HEADER_BYTES..at + VLR_HEADER_BYTES + usize::from(u16_at(head, 20));
        if head[2..].starts_with(laz::LazVlr::USER_ID.as_bytes())
            && u16_at(head, 18) == laz::LazVlr::RECORD_ID
        {
            return (data.end <= bytes.len()).then_some(data);
        }
        at = data.end;
    }
    None
}

/// `N` bytes from a place that is known to be inside.
pub(super) fn take<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|byte| bytes[at + byte])
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(take(bytes, at))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(take(bytes, at))
}
