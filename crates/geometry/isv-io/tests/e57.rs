//! E57, whole and broken.

use glam::DVec3;
use isv_io::{Geometry, ReadError, Unit, parse_geometry};
use isv_testfiles::e57::{cartesian, file, of_all_types, quarter_turn, seal, spherical};
use isv_volume::{PointCloud, ScanPlace};
use proptest::prelude::*;
use std::path::Path;

fn parse(bytes: &[u8]) -> Result<PointCloud, ReadError> {
    parse_geometry(Path::new("scan.e57"), bytes, Unit::Metre).map(|geometry| match geometry {
        Geometry::Points(points) => points,
        Geometry::Mesh(_) => panic!("a mesh"),
    })
}

fn assert_close(found: &[DVec3], expected: &[[f64; 3]]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!(a.distance(DVec3::from(*b)) < 1e-9, "{a} is not {b:?}");
    }
}

#[test]
fn one_scan_is_moved_by_its_pose_and_seen_from_its_scanner() {
    let points = parse(&file(vec![cartesian(Some(quarter_turn()))])).unwrap();
    assert_close(&points.positions, &[[8.0, 1.0, 3.0], [10.0, -2.5, 0.5]]);
    assert_close(&points.normals, &[[-1.0, 0.0, 0.0]; 2]);
    assert_eq!(points.viewpoint, Some(DVec3::new(10.0, 0.0, 0.0)));
}

#[test]
fn several_scans_are_joined() {
    let points = parse(&file(vec![cartesian(None), spherical()])).unwrap();
    assert_close(
        &points.positions,
        &[[1.0, 2.0, 3.0], [-2.5, 0.0, 0.5], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]],
    );
    assert_close(&points.normals, &[[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [0.0; 3]]);
    assert_eq!(points.viewpoint, None);
    let alone = parse(&file(vec![spherical()])).unwrap();
    assert_eq!((alone.normals.len(), alone.viewpoint), (0, None));
}

#[test]
fn each_of_several_scans_is_seen_from_its_own_place() {
    let place = |points, viewpoint| ScanPlace { points, viewpoint };
    let points = parse(&file(vec![cartesian(Some(quarter_turn())), spherical(), cartesian(None)])).unwrap();
    assert_eq!(points.viewpoint, None);
    // The scans without a pose stand at the origin, as another one has a pose.
    let places =
        [place(0..2, DVec3::new(10.0, 0.0, 0.0)), place(2..5, DVec3::ZERO), place(5..7, DVec3::ZERO)];
    assert_eq!(points.scans, places);
    // Of scans without any pose, nobody knows where they were taken.
    assert!(parse(&file(vec![cartesian(None), spherical()])).unwrap().scans.is_empty());
    let bytes = file(vec![cartesian(Some(quarter_turn())), spherical()]);
    let Ok(Geometry::Points(points)) = parse_geometry(Path::new("scan.e57"), &bytes, Unit::Millimetre) else {
        panic!("no points");
    };
    let moved = Geometry::Points(points).relative_to([1.0, 0.0, 0.0]);
    let Geometry::Points(points) = moved else { panic!("a mesh") };
    let places: Vec<DVec3> = points.scans.iter().map(|scan| scan.viewpoint).collect();
    assert_eq!(places, [DVec3::new(-0.99, 0.0, 0.0), DVec3::NEG_X], "in metres, from the new origin");
}

#[test]
fn coordinates_of_every_type_are_read() {
    let points = parse(&file(vec![of_all_types()])).unwrap();
    let expected: Vec<_> = (0..10).map(f64::from).map(|i| [i / 2.0, i - 5.0, i / 8.0]).collect();
    assert_close(&points.positions, &expected);
}

/// A file of many pages, both kinds of scans in it.
fn large() -> Vec<u8> {
    let mut scans = vec![cartesian(Some(quarter_turn())), spherical()];
    scans.iter_mut().for_each(|scan| scan.points = vec![scan.points.clone(); 40].concat());
    file(scans)
}

#[test]
fn every_truncation_fails() {
    let file = large();
    assert!(parse(&file).is_ok());
    for length in 0..file.len() {
        let error = parse(&file[..length]).unwrap_err();
        assert!(matches!(error, ReadError::Malformed { .. }), "cut at {length}: {error}");
    }
}

#[test]
fn a_changed_byte_is_noticed_by_its_page() {
    let mut file = large();
    let at = file.len() / 3;
    file[at] ^= 1;
    let message = parse(&file).unwrap_err().to_string();
    assert!(message.starts_with("scan.e57: not a readable E57 file: "), "{message}");
    let message = parse(b"PK").unwrap_err().to_string();
    assert_eq!(message, "scan.e57: no E57 file, as it does not start with `ASTM-E57` (byte 0)");
}

/// A file with something in its XML replaced, and the pages filled up with blanks.
fn with_xml(file: &[u8], from: &str, to: &str) -> Vec<u8> {
    let data: Vec<u8> = file.chunks(1024).flat_map(|page| page[..1020].to_vec()).collect();
    let at = data.windows(from.len()).position(|window| window == from.as_bytes()).expect("it is there");
    let mut changed = data.clone();
    changed.splice(at..at + from.len(), to.bytes());
    changed.resize(changed.len().max(data.len()).next_multiple_of(1020), b' ');
    let changed: Vec<u8> = changed.chunks_exact(1020).flat_map(|data| [data, &[0; 4]].concat()).collect();
    let mut file = changed;
    let length = u64::from_le_bytes(file[32..40].try_into().unwrap()) + to.len() as u64 - from.len() as u64;
    file[32..40].copy_from_slice(&length.to_le_bytes());
    let bytes = file.len() as u64;
    file[16..24].copy_from_slice(&bytes.to_le_bytes());
    seal(&mut file);
    file
}

#[test]
fn what_the_xml_claims_is_held_against_the_file() {
    let whole = large();
    let same = with_xml(&whole, "recordCount=\"120\"", "recordCount=\"120\"");
    assert_eq!(parse(&same).unwrap(), parse(&whole).unwrap());
    let refused = |from: &str, to: &str, expected: &str| {
        let message = parse(&with_xml(&whole, from, to)).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    };
    let count = |count: &str| format!("recordCount=\"{count}\"");
    refused(&count("120"), &count("99999999999"), "more than the file holds");
    refused(&count("120"), &count("18446744073709551615"), "more than the file holds");
    refused(&count("120"), &count("121"), "not a readable E57 file");
    let many = "<rowIndex type=\"Integer\" minimum=\"1\" maximum=\"1\"/>".repeat(64);
    refused("<rowIndex type", &(many + "<rowIndex type"), "attributes");
    refused(
        "<rotation type=\"Structure\">\n<w type=\"Float\">0.7",
        "<rotation type=\"Structure\">\n<w type=\"Float\">7.7",
        "no rotation",
    );
    let namespaces: String = (0..99).map(|i| format!(" xmlns:a{i}=\"b{i}\"")).collect();
    refused("<e57Root", &format!("<e57Root{namespaces}"), "its XML declares 101 namespaces");
    let attributes: String = (0..200).map(|i| format!(" a{i} = '>'")).collect();
    refused("<e57Root", &format!("<e57Root{attributes}"), "an element of its XML has 20");
    let deep = "<a>".repeat(200_000);
    refused("<e57Root", &format!("{deep}<e57Root"), "not a readable E57 file");
    let mut length = whole.clone();
    length[32..40].copy_from_slice(&40_000_000u64.to_le_bytes());
    seal(&mut length);
    let message = parse(&length).unwrap_err().to_string();
    assert!(message.contains("its XML section has 40000000 bytes"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn changed_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        sealed in prop::bool::weighted(0.9),
    ) {
        thread_local! {
            static WHOLE: Vec<u8> = file(vec![cartesian(Some(quarter_turn())), spherical()]);
        }
        let mut file = WHOLE.with(Clone::clone);
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        if sealed {
            seal(&mut file);
        }
        let _ = parse(&file);
    }
}

#[test]
fn only_attributes_count_as_attributes() {
    let whole = large();
    let signs = "=".repeat(500);
    let passed_over =
        format!("<!-- {signs} --><text type=\"String\" note='{signs}'>{signs}</text><?note {signs}?>");
    let with_signs = with_xml(&whole, "<data3D", &format!("{passed_over}<data3D"));
    assert_eq!(parse(&with_signs).unwrap(), parse(&whole).unwrap());
}
