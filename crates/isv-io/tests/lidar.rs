//! LAS and LAZ, whole and broken, written by the crate `las`.

use glam::DVec3;
use isv_io::{Geometry, Malformation, ReadError, Unit, parse_geometry};
use isv_volume::PointCloud;
use las::point::Format;
use las::{Builder, Point, Transform, Vector, Version, Writer};
use proptest::prelude::*;
use std::io::Cursor;
use std::path::Path;

fn parse(bytes: &[u8]) -> Result<PointCloud, ReadError> {
    parse_geometry(Path::new("scan.laz"), bytes, Unit::Metre).map(|geometry| match geometry {
        Geometry::Points(points) => points,
        Geometry::Mesh(_) => panic!("a mesh"),
    })
}

/// Georeferenced points on a wavy patch; steps of a millimetre.
fn positions(count: usize) -> Vec<DVec3> {
    let at = |i: usize| {
        let (u, v) = ((i % 37) as f64 * 0.113, (i / 37) as f64 * 0.217);
        DVec3::new(512_345.678 + u, 5_403_210.123 + v, 431.5 + (u * 3.0).sin() * (v * 2.0).cos())
    };
    (0..count).map(|i| (at(i) * 1000.0).round() / 1000.0).collect()
}

/// A file of points of a format; every tenth one is withheld.
fn file(format: u8, compressed: bool, extra_bytes: u16, count: usize) -> Vec<u8> {
    let mut builder = Builder::from(if format < 6 { Version::new(1, 2) } else { Version::new(1, 4) });
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
            gps_time: has.has_gps_time.then_some(i as f64 * 1e-5),
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

/// All kinds of files: with and without compression, in one code a chunk and in layers.
fn files(count: usize) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for format in [0, 1, 2, 3, 6, 7, 8] {
        for compressed in [false, true] {
            for extra_bytes in [0, 3] {
                let name = format!("format {format}, compressed {compressed}, {extra_bytes} extra bytes");
                files.push((name, file(format, compressed, extra_bytes, count)));
            }
        }
    }
    files
}

#[test]
fn every_point_format_reads_back_in_place_without_what_is_withheld() {
    let count = 120;
    let positions = positions(count);
    let kept: Vec<_> = (0..count).filter(|i| i % 10 != 9).map(|i| positions[i]).collect();
    for (name, file) in files(count) {
        let points = parse(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(points.positions.len(), kept.len(), "{name}");
        let apart = points.positions.iter().zip(&kept).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(apart < 1e-8, "{name}: {apart} m apart");
        assert!(points.normals.is_empty() && points.viewpoint.is_none());
    }
}

#[test]
fn several_chunks_read_in_order() {
    let count = 120_000;
    for format in [1, 6] {
        let points = parse(&file(format, true, 0, count)).unwrap().positions;
        assert_eq!(points.len(), count / 10 * 9);
        assert!(points.last().unwrap().distance(positions(count)[count - 2]) < 1e-8);
    }
}

/// Where LASzip's record starts in a file of the crate, whose only record it is.
fn laszip_record(file: &[u8]) -> usize {
    usize::from(u16::from_le_bytes([file[94], file[95]])) + 54
}

fn points_offset(file: &[u8]) -> usize {
    u32::from_le_bytes([file[96], file[97], file[98], file[99]]) as usize
}

#[test]
fn the_oldest_layout_without_chunks_is_read() {
    let chunked = file(1, true, 0, 100);
    let mut pointwise = chunked.clone();
    let (record, points) = (laszip_record(&chunked), points_offset(&chunked));
    pointwise[record..record + 2].copy_from_slice(&1u16.to_le_bytes());
    pointwise[record + 12..record + 16].fill(0xff);
    pointwise.drain(points..points + 8);
    assert_eq!(parse(&pointwise).unwrap(), parse(&chunked).unwrap());
}

#[test]
fn every_truncation_fails_or_gives_all_points() {
    for (name, file) in files(60) {
        let whole = parse(&file).unwrap();
        for length in 0..file.len() {
            match parse(&file[..length]) {
                Err(ReadError::Malformed { .. }) => {}
                Err(other) => panic!("{name}, cut at {length}: {other}"),
                // The chunk table at the end of a compressed file is not needed.
                Ok(points) => assert_eq!(points, whole, "{name}, cut at {length}"),
            }
        }
    }
}

#[test]
fn errors_name_the_file_and_the_reason() {
    let message = |file: &[u8]| parse(file).unwrap_err().to_string();
    assert_eq!(message(b"LASX"), "scan.laz: no LAS file, as it does not start with `LASF` (byte 0)");
    let whole = file(0, false, 0, 10);
    assert!(
        message(&whole[..whole.len() - 1])
            .starts_with("scan.laz: truncated: header promises 10 points, data ends after 9 (byte ")
    );
    let mut format = whole.clone();
    format[104] = 11;
    assert_eq!(message(&format), "scan.laz: not a readable LAS file: it has point format 11 (byte 104)");
    let compressed = file(0, true, 0, 1000);
    let cut = points_offset(&compressed) + 50;
    let expected = "scan.laz: not a readable LAZ file: ";
    assert!(message(&compressed[..cut]).starts_with(expected), "{}", message(&compressed[..cut]));
    let mut record = compressed.clone();
    let items = laszip_record(&record) + 34;
    record[items..items + 2].copy_from_slice(&8u16.to_le_bytes());
    assert!(message(&record).contains("its LASzip record does not fit its point format"));
}

#[test]
fn absurd_counts_fail_without_the_memory_they_ask_for() {
    for (name, whole) in files(60) {
        let mut many = whole.clone();
        many[107..111].fill(0xff);
        let error = parse(&many).unwrap_err();
        let truncated = matches!(error, ReadError::Malformed { why: Malformation::Truncated { .. }, .. });
        assert!(truncated, "{name}: {error}");
    }
    // The number of chunks, which `laz` would reserve 64 GiB for.
    let mut chunks = file(0, true, 0, 60);
    let points = points_offset(&chunks);
    let table = i64::from_le_bytes(chunks[points..points + 8].try_into().unwrap()) as usize;
    chunks[table + 4..table + 8].fill(0xff);
    assert!(matches!(parse(&chunks), Err(ReadError::Malformed { .. })));
    // The length of a layer, which `laz` would fill 4 GiB for.
    let mut layer = file(6, true, 0, 60);
    let length = points_offset(&layer) + 8 + 30 + 4;
    layer[length..length + 4].fill(0xff);
    assert!(matches!(parse(&layer), Err(ReadError::Malformed { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn changed_bytes_never_panic(
        format in prop::sample::select(vec![0u8, 3, 6, 8]),
        extra_bytes in prop::sample::select(vec![0u16, 2]),
        compressed in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        let mut file = file(format, compressed, extra_bytes, 40);
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        let _ = parse(&file);
    }
}
