//! LAS and LAZ, whole and broken.

use isv_io::{Geometry, Malformation, ReadError, Unit, parse_geometry};
use isv_testfiles::lidar::{
    all_kinds, compressed, file, item_versions, laszip_record, points_offset, positions, without_chunks,
};
use isv_volume::PointCloud;
use proptest::prelude::*;
use std::path::Path;

fn parse(bytes: &[u8]) -> Result<PointCloud, ReadError> {
    parse_geometry(Path::new("scan.laz"), bytes, Unit::Metre).map(|geometry| match geometry {
        Geometry::Points(points) => points,
        Geometry::Mesh(_) => panic!("a mesh"),
    })
}

#[test]
fn every_point_format_reads_back_in_place_without_what_is_withheld() {
    let count = 120;
    let positions = positions(count);
    let kept: Vec<_> = (0..count).filter(|i| i % 10 != 9).map(|i| positions[i]).collect();
    for (name, file) in all_kinds(count) {
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

#[test]
fn the_oldest_layout_without_chunks_is_read() {
    let chunked = file(1, true, 0, 100);
    assert_eq!(parse(&without_chunks(&chunked)).unwrap(), parse(&chunked).unwrap());
}

#[test]
fn every_version_of_the_compression_gives_what_was_compressed() {
    for format in 0..=10 {
        for extra_bytes in [0, 3] {
            let plain = file(format, false, extra_bytes, 1000);
            let expected = parse(&plain).unwrap();
            for (version, items) in item_versions(format, extra_bytes).into_iter().enumerate() {
                for chunk_points in [7, 5000] {
                    let packed = compressed(&plain, items.clone(), chunk_points);
                    let found = parse(&packed).unwrap_or_else(|error| panic!("{format}, {version}: {error}"));
                    assert_eq!(
                        found, expected,
                        "format {format}, version {version}, {extra_bytes} extra bytes"
                    );
                }
            }
        }
    }
}

#[test]
fn every_truncation_fails_or_gives_all_points() {
    for (name, file) in all_kinds(60) {
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
fn times_that_switch_without_end_are_damage() {
    let file = include_bytes!("../../../../fuzz/regressions/laz/times_that_switch_sequences_without_end");
    let message = parse(file).unwrap_err().to_string();
    assert!(
        message.ends_with("its times switch from sequence to sequence without end (byte 347)"),
        "{message}"
    );
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
    for (name, whole) in all_kinds(60) {
        let mut many = whole.clone();
        many[107..111].fill(0xff);
        let error = parse(&many).unwrap_err();
        let ReadError::Malformed { why, .. } = error else { panic!("{name}: {error}") };
        match name.contains("compressed true") {
            true => assert!(matches!(why, Malformation::TooManyPoints { .. }), "{name}: {why}"),
            false => assert!(matches!(why, Malformation::Truncated { .. }), "{name}: {why}"),
        }
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
