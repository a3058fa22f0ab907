//! LASzip, Martin Isenburg's compression of LAS records, by the crate `laz`.
//!
//! `laz` trusts what it reads. It reserves the chunk table by its count, which may say 64 GiB, and fills
//! layers by their length, up to 4 GiB each. It indexes tables by what the record says, and fills the stack
//! if times say so. So the record and that count are checked here first, and times are read here. What is
//! left to go wrong inside, an index past a table that the arithmetic decoder leads to, is caught.

use super::gps_times::GpsTimes;
use super::header::{Header, RECORD_BYTES, take, u16_at};
use crate::error::Flaw;
use isv_foreign::catch_panic;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LasZipError, LazItemRecordBuilder, LazItemType, LazVlr};
use std::io::Cursor;

/// Bytes of the record before its items.
const RECORD_HEAD_BYTES: usize = 34;

/// The three ways to lay out compressed points, by their number in the record.
const POINTWISE: u16 = 1;
const POINTWISE_CHUNKED: u16 = 2;
const LAYERED_CHUNKED: u16 = 3;

/// Calls `sink` with every record, with its colour if that is asked for.
pub(super) fn decompress(
    bytes: &[u8],
    header: &Header,
    colours: bool,
    sink: impl FnMut(&[u8]),
) -> Result<(), Flaw> {
    let data = header.laszip.clone().ok_or_else(|| {
        Flaw::unreadable(
            "LAZ",
            header.points_offset,
            &"the header has no LASzip record, or only a part of it",
        )
    })?;
    let record = Record::parse(&bytes[data.clone()], header)
        .map_err(|why| Flaw::unreadable("LAZ", data.start, &why))?;
    let points_flaw = |why: &dyn std::fmt::Display| Flaw::unreadable("LAZ", header.points_offset, why);
    let decompressed = catch_panic(|| match record.layout {
        LAYERED_CHUNKED => layered(bytes, header, (&record, colours), sink),
        _ => pointwise(bytes, header, &record, sink),
    });
    decompressed
        .ok_or_else(|| points_flaw(&"its compressed points are damaged"))?
        .map_err(|why| points_flaw(&why))
}

/// LASzip's record, checked.
struct Record {
    vlr: LazVlr,
    layout: u16,
}

impl Record {
    fn parse(data: &[u8], header: &Header) -> Result<Self, String> {
        if data.len() < RECORD_HEAD_BYTES {
            return Err("its LASzip record is too short".to_owned());
        }
        let layout = u16_at(data, 0);
        let mut data = data.to_vec();
        if layout == POINTWISE {
            // All points are one chunk then, whatever the field says; `laz` looks for a table if it says "variable".
            data[12..16].copy_from_slice(&1u32.to_le_bytes());
        }
        let vlr = LazVlr::from_buffer(&data).map_err(|error| error.to_string())?;
        let extra_bytes = header.record_bytes - RECORD_BYTES[usize::from(header.format)];
        let expected = LazItemRecordBuilder::default_for_point_format_id(header.format, extra_bytes as u16)
            .map_err(|error| error.to_string())?;
        let parts = |items: &[laz::LazItem]| -> Vec<_> {
            items.iter().map(|item| (item.item_type(), item.size())).collect()
        };
        if parts(vlr.items()) != parts(&expected) {
            return Err("its LASzip record does not fit its point format".to_owned());
        }
        let layered = vlr.items().iter().all(|item| matches!(item.version(), 3 | 4));
        let pointwise = vlr.items().iter().all(|item| matches!(item.version(), 1 | 2));
        match layout {
            LAYERED_CHUNKED if layered => {}
            POINTWISE | POINTWISE_CHUNKED if pointwise => {}
            _ => return Err(format!("its LASzip record has layout {layout}, which its items do not")),
        }
        Ok(Self { vlr, layout })
    }
}

/// Point formats 0 to 5: one arithmetic code a chunk.
fn pointwise(
    bytes: &[u8],
    header: &Header,
    record: &Record,
    mut sink: impl FnMut(&[u8]),
) -> Result<(), LasZipError> {
    let mut source = Cursor::new(bytes);
    source.set_position(header.points_offset as u64);
    let mut chunks = ChunkSizes::read(bytes, header, record, &mut source)?;
    let mut point = vec![0; header.record_bytes];
    let mut left = header.points;
    while left > 0 {
        let points = chunks.next().ok_or_else(ends_early)?.min(left);
        if points == 0 {
            continue;
        }
        let mut decompressor = pointwise_decompressor(source, record)?;
        for _ in 0..points {
            decompressor.decompress_next(&mut point)?;
            sink(&point);
        }
        left -= points;
        // The next chunk comes right after.
        source = decompressor.into_inner();
    }
    Ok(())
}

/// The decompressor of a chunk's points: that of `laz`, but for times.
fn pointwise_decompressor<'a>(
    source: Cursor<&'a [u8]>,
    record: &Record,
) -> Result<SequentialPointRecordDecompressor<'a, Cursor<&'a [u8]>>, LasZipError> {
    let mut decompressor = SequentialPointRecordDecompressor::new(source);
    for item in record.vlr.items() {
        match (item.item_type(), item.version()) {
            (LazItemType::GpsTime, 2) => decompressor.add_field_decompressor(GpsTimes::default()),
            // It adds to what is there.
            _ => decompressor.set_fields_from(&vec![*item])?,
        }
    }
    Ok(decompressor)
}

/// The points of each chunk.
enum ChunkSizes {
    Equal(u64),
    Listed(std::vec::IntoIter<ChunkTableEntry>),
}

impl ChunkSizes {
    /// Leaves `source` where the first chunk starts.
    fn read(
        bytes: &[u8],
        header: &Header,
        record: &Record,
        source: &mut Cursor<&[u8]>,
    ) -> Result<Self, LasZipError> {
        if record.layout == POINTWISE {
            return Ok(Self::Equal(u64::MAX));
        }
        check_chunk_count(bytes, header).ok_or(LasZipError::MissingChunkTable)?;
        if record.vlr.uses_variable_size_chunks() {
            let table = ChunkTable::read_from(source, &record.vlr)?;
            return Ok(Self::Listed(table.as_ref().to_vec().into_iter()));
        }
        source.set_position((header.points_offset + ChunkTable::OFFSET_SIZE) as u64);
        Ok(Self::Equal(record.vlr.chunk_size().into()))
    }
}

impl Iterator for ChunkSizes {
    type Item = u64;

    fn next(&mut self) -> Option<u64> {
        match self {
            Self::Equal(points) => Some(*points),
            Self::Listed(chunks) => chunks.next().map(|chunk| chunk.point_count),
        }
    }
}

/// Makes sure that the chunk table, where there is one, has no more chunks than the file has room for. Every
/// chunk starts with a whole record.
fn check_chunk_count(bytes: &[u8], header: &Header) -> Option<()> {
    let is_place = |at: i64| at > header.points_offset as i64;
    let start = bytes.get(header.points_offset..)?.first_chunk().map(|at| i64::from_le_bytes(*at))?;
    // A writer that could not go back to the start leaves the place of the table at the very end.
    let at = [start, i64::from_le_bytes(*bytes.last_chunk()?)].into_iter().find(|at| is_place(*at))?;
    let (_version, table) = bytes.get(usize::try_from(at).ok()?..)?.split_first_chunk::<4>()?;
    let count = u32::from_le_bytes(*table.first_chunk()?);
    (count as usize <= bytes.len() / header.record_bytes).then_some(())
}

/// Point formats 6 to 10: a chunk is a record, the number of its points, the lengths of its layers, and the layers.
/// Only those that hold the coordinates and the flags are decompressed, and the colours if they are asked for.
fn layered(
    bytes: &[u8],
    header: &Header,
    (record, colours): (&Record, bool),
    mut sink: impl FnMut(&[u8]),
) -> Result<(), LasZipError> {
    let colours = if colours { DecompressionSelection::RGB } else { 0 };
    let wanted = DecompressionSelection(DecompressionSelection::Z | DecompressionSelection::FLAGS | colours);
    let mut point = vec![0; header.record_bytes];
    let mut left = header.points;
    let mut at = header.points_offset + ChunkTable::OFFSET_SIZE;
    while left > 0 {
        let chunk = Chunk::at(bytes, at, record).ok_or_else(ends_early)?;
        let mut decompressor = LayeredPointRecordDecompressor::new(Cursor::new(chunk.bytes));
        decompressor.set_fields_from(record.vlr.items())?;
        decompressor.set_selection(wanted);
        for _ in 0..left.min(chunk.points) {
            decompressor.decompress_next(&mut point)?;
            sink(&point);
        }
        left = left.saturating_sub(chunk.points);
        at += chunk.bytes.len();
    }
    Ok(())
}

fn ends_early() -> LasZipError {
    std::io::Error::new(std::io::ErrorKind::UnexpectedEof, "its compressed points end early").into()
}

struct Chunk<'a> {
    bytes: &'a [u8],
    points: u64,
}

impl<'a> Chunk<'a> {
    /// The chunk that starts at a place, if all of it is there and it is not empty.
    fn at(bytes: &'a [u8], at: usize, record: &Record) -> Option<Self> {
        let bytes = bytes.get(at..)?;
        let first_record = record.vlr.items_size() as usize;
        let points = u32::from_le_bytes(*bytes.get(first_record..)?.first_chunk()?);
        let lengths = first_record + 4;
        let layers: usize = record.vlr.items().iter().map(|item| layers_of(item.item_type())).sum();
        let mut end = lengths + 4 * layers;
        for length in bytes.get(lengths..end)?.chunks_exact(4) {
            end = end.checked_add(u32::from_le_bytes(take(length, 0)) as usize)?;
        }
        (points > 0).then_some(Self { bytes: bytes.get(..end)?, points: points.into() })
    }
}

/// Layers of an item in a chunk.
fn layers_of(item: LazItemType) -> usize {
    match item {
        LazItemType::Point14 => 9,
        LazItemType::RGB14 | LazItemType::WavePacket14 => 1,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(count) => count.into(),
        _ => 0,
    }
}
