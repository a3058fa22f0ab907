//! LAS and LAZ, written by the crates `las` and `laz`.

use glam::DVec3;
use las::point::Format;
use las::{Builder, Point, Transform, Vector, Version, Writer};
use laz::las::{Point0, Point1, Point2, Point3, Point4, Point5, Point6, Point7, Point8, Point9, Point10};
use laz::{LasZipCompressor, LazItem, LazItemRecordBuilder as Items, LazVlr, LazVlrBuilder};
use std::io::{Cursor, Write};

/// The point formats that [`all_kinds`] has, with and without compression: those that the crate `las` compresses.
const FORMATS: [u8; 7] = [0, 1, 2, 3, 6, 7, 8];

/// Georeferenced points on a wavy patch; steps of a millimetre.
#[must_use]
pub fn positions(count: usize) -> Vec<DVec3> {
    let at = |i: usize| {
        let (u, v) = ((i % 37) as f64 * 0.113, (i / 37) as f64 * 0.217);
        DVec3::new(512_345.678 + u, 5_403_210.123 + v, 431.5 + (u * 3.0).sin() * (v * 2.0).cos())
    };
    (0..count).map(|i| (at(i) * 1000.0).round() / 1000.0).collect()
}

/// A file of points of a format, those of [`positions`]; every tenth one is withheld.
#[must_use]
pub fn file(format: u8, compressed: bool, extra_bytes: u16, count: usize) -> Vec<u8> {
    let minor = match format {
        ..=3 => 2,
        4..=5 => 3,
        _ => 4,
    };
    let mut builder = Builder::from(Version::new(1, minor));
    builder.point_format = Format::new(format).unwrap();
    builder.point_format.is_compressed = compressed;
    builder.point_format.extra_bytes = extra_bytes;
    let axis = |offset| Transform { scale: 0.001, offset };
    builder.transforms = Vector { x: axis(512_000.0), y: axis(5_403_000.0), z: axis(0.0) };
    let has = builder.point_format;
    let mut writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for (i, DVec3 { x, y, z }) in positions(count).into_iter().enumerate() {
        let point = Point {
            x,
            y,
            z,
            intensity: (i * 77) as u16,
            is_withheld: i % 10 == 9,
            gps_time: has.has_gps_time.then(|| time(i)),
            color: has.has_color.then(|| las::Color::new(i as u16, 2, 3)),
            nir: has.has_nir.then_some(i as u16),
            waveform: has.has_waveform.then(Default::default),
            extra_bytes: vec![i as u8; extra_bytes.into()],
            ..Point::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.into_inner().unwrap().into_inner()
}

/// Time of a point. Times are in runs of several points, of interleaved sequences, some of which end and
/// others begin. They go on evenly, stand still, and jump by all multiples of what was before.
fn time(point: usize) -> f64 {
    let sequence = point / 7 % 3 + point / 210 % 4;
    let step = point as i64 - i64::from(point % 11 == 10);
    let jump = if point % 5 == 4 { step.pow(3) % 200_000 - 50_000 } else { 0 };
    let ticks = if (point / 42).is_multiple_of(3) { 0 } else { 100 * step + jump };
    let start = (1000.0 * (1 + sequence) as f64).to_bits();
    f64::from_bits(start.wrapping_add_signed(ticks))
}

/// All kinds of files, by what they are: with and without compression, in one code a chunk and in layers.
#[must_use]
pub fn all_kinds(count: usize) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for format in FORMATS {
        for compressed in [false, true] {
            for extra_bytes in [0, 3] {
                let name = format!("format {format}, compressed {compressed}, {extra_bytes} extra bytes");
                files.push((name, file(format, compressed, extra_bytes, count)));
            }
        }
    }
    files
}

/// All versions of LASzip's codes for a point format, the older one first.
#[must_use]
pub fn item_versions(format: u8, extra_bytes: u16) -> [Vec<LazItem>; 2] {
    let n = extra_bytes;
    match format {
        0 => [Items::version_1_of::<Point0>(n), Items::version_2_of::<Point0>(n)],
        1 => [Items::version_1_of::<Point1>(n), Items::version_2_of::<Point1>(n)],
        2 => [Items::version_1_of::<Point2>(n), Items::version_2_of::<Point2>(n)],
        3 => [Items::version_1_of::<Point3>(n), Items::version_2_of::<Point3>(n)],
        4 => [Items::version_1_of::<Point4>(n), Items::version_2_of::<Point4>(n)],
        5 => [Items::version_1_of::<Point5>(n), Items::version_2_of::<Point5>(n)],
        6 => [Items::version_3_of::<Point6>(n), Items::version_4_of::<Point6>(n)],
        7 => [Items::version_3_of::<Point7>(n), Items::version_4_of::<Point7>(n)],
        8 => [Items::version_3_of::<Point8>(n), Items::version_4_of::<Point8>(n)],
        9 => [Items::version_3_of::<Point9>(n), Items::version_4_of::<Point9>(n)],
        10 => [Items::version_3_of::<Point10>(n), Items::version_4_of::<Point10>(n)],
        _ => panic!("there is no point format {format}"),
    }
}

/// A file of [`file()`] without compression as LASzip makes it of that, with these codes and so many points a
/// chunk. The crate `las` does not write such files.
#[must_use]
pub fn compressed(file: &[u8], items: Vec<LazItem>, chunk_points: u32) -> Vec<u8> {
    let header_bytes = usize::from(u16::from_le_bytes([file[94], file[95]]));
    let (described, points) = file.split_at(points_offset(file));
    let vlr = LazVlrBuilder::new(items).with_fixed_chunk_size(chunk_points).build();
    let mut record = Vec::new();
    vlr.write_to(&mut record).unwrap();
    let mut out = Cursor::new(Vec::new());
    let mut put = |bytes: &[u8]| out.write_all(bytes).unwrap();
    put(&described[..header_bytes]);
    put(&[0; 2]);
    put(format!("{:\0<16}", LazVlr::USER_ID).as_bytes());
    put(&LazVlr::RECORD_ID.to_le_bytes());
    put(&(record.len() as u16).to_le_bytes());
    put(&[0; 32]);
    put(&record);
    put(&described[header_bytes..]);
    let start = out.position() as u32;
    let mut compressor = LasZipCompressor::new(out, vlr).unwrap();
    compressor.compress_many(points).unwrap();
    compressor.done().unwrap();
    let mut file = compressor.into_inner().into_inner();
    file[96..100].copy_from_slice(&start.to_le_bytes());
    let records = u32::from_le_bytes([file[100], file[101], file[102], file[103]]);
    file[100..104].copy_from_slice(&(records + 1).to_le_bytes());
    file[104] |= 0x80;
    file
}

/// A compressed file of point formats 0 to 5 that is one chunk, in the oldest layout, which knows no chunks.
#[must_use]
pub fn without_chunks(chunked: &[u8]) -> Vec<u8> {
    let mut pointwise = chunked.to_vec();
    let (record, points) = (laszip_record(chunked), points_offset(chunked));
    pointwise[record..record + 2].copy_from_slice(&1u16.to_le_bytes());
    pointwise[record + 12..record + 16].fill(0xff);
    pointwise.drain(points..points + 8);
    pointwise
}

/// Start of LASzip's record in a file of this module, whose first record it is.
#[must_use]
pub fn laszip_record(file: &[u8]) -> usize {
    usize::from(u16::from_le_bytes([file[94], file[95]])) + 54
}

/// Start of the points of a file.
#[must_use]
pub fn points_offset(file: &[u8]) -> usize {
    u32::from_le_bytes([file[96], file[97], file[98], file[99]]) as usize
}
