//! Points as text and as PCD and PLY: what is written, what is read, and what is refused.

use glam::{DMat3, DVec3};
use isv_io::{
    Format, Geometry, Malformation, Position, ReadError, Unit, parse_geometry, write_mesh_to, write_points,
    write_points_to,
};
use isv_testfiles::pcd::{baroque_files, compressed};
use isv_testfiles::text::{NORMALS, TWO_POINTS};
use isv_volume::{PointCloud, PointsError, ScanPlace, TriangleMesh};
use proptest::prelude::*;
use std::io;
use std::path::Path;

fn parse(name: &str, bytes: &[u8]) -> Result<PointCloud, ReadError> {
    parse_geometry(Path::new(name), bytes, Unit::Metre).map(|geometry| match geometry {
        Geometry::Points(points) => points,
        Geometry::Mesh(_) => panic!("a mesh"),
    })
}

fn why(name: &str, bytes: &[u8]) -> (Position, Malformation) {
    match parse(name, bytes).unwrap_err() {
        ReadError::Malformed { at, why, .. } => (at, why),
        other => panic!("{other}"),
    }
}

/// Three points, coordinates exact in `f32`.
fn cloud() -> PointCloud {
    let positions = [[1.0, 2.0, 3.0], [-0.5, 0.25, 1e6], [0.0, 0.0, -7.5]].map(DVec3::from).to_vec();
    PointCloud {
        positions,
        normals: vec![DVec3::X, DVec3::ZERO, DVec3::NEG_Z],
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

fn written(points: &PointCloud, format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_points_to(&mut bytes, points, format).unwrap();
    bytes
}

#[test]
fn every_point_format_reads_back_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    for &format in Format::ALL.iter().filter(|format| format.writes_points()) {
        let path = folder.path().join("scan").with_extension(format.extension());
        let mut points = cloud();
        for normals in [points.normals.clone(), vec![]] {
            points.normals = normals;
            write_points(&path, &points, format).unwrap();
            let read = isv_io::read_geometry(&path, Unit::Metre).unwrap();
            assert_eq!(read, Geometry::Points(points.clone()), "{format}");
        }
    }
    let seen = PointCloud { viewpoint: Some(DVec3::new(0.5, -1.0, 2.0)), ..cloud() };
    assert_eq!(parse("a.pcd", &written(&seen, Format::Pcd)).unwrap(), seen);
}

#[test]
fn formats_that_do_not_write_say_so() {
    for &format in Format::ALL {
        let points = write_points_to(io::sink(), &cloud(), format);
        assert_eq!(points.is_ok(), format.writes_points(), "{format}");
        let mesh = write_mesh_to(io::sink(), &TriangleMesh::default(), format);
        assert_eq!(mesh.is_ok(), format.writes_mesh(), "{format}");
        if let Err(error) = mesh {
            assert_eq!(error.kind(), io::ErrorKind::Unsupported);
        }
    }
}

#[test]
fn written_pcd_never_changes() {
    let points = PointCloud {
        positions: vec![DVec3::new(1.0, -2.0, 0.5)],
        normals: vec![DVec3::Y],
        viewpoint: Some(DVec3::Z),
        scans: Vec::new(),
        colours: Vec::new(),
    };
    let mut expected =
        b"# made by isv\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\n\
        TYPE F F F F F F\nCOUNT 1 1 1 1 1 1\nWIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 1 1 0 0 0\nPOINTS 1\nDATA binary\n"
            .to_vec();
    for value in [1f32, -2.0, 0.5, 0.0, 1.0, 0.0] {
        expected.extend(value.to_le_bytes());
    }
    assert_eq!(written(&points, Format::Pcd), expected);
    assert_eq!(written(&points, Format::Xyz), b"1 -2 0.5 0 1 0\n");
}

#[test]
fn every_pcd_encoding_reads_the_same_points_past_what_is_not_needed() {
    let expected = PointCloud {
        positions: [[-3.0, 7.0, 9.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]].map(DVec3::from).to_vec(),
        normals: vec![DVec3::Z, DVec3::ZERO, DVec3::NEG_Y],
        viewpoint: Some(DVec3::new(1.0, 2.0, 3.0)),
        scans: Vec::new(),
        colours: Vec::new(),
    };
    for file in baroque_files() {
        assert_eq!(parse("a.pcd", &file).unwrap(), expected);
    }
}

/// Most programs write the viewpoint that changes nothing, whatever they know.
#[test]
fn a_viewpoint_that_changes_nothing_is_none() {
    let of = |viewpoint: &str| {
        let file = format!("FIELDS x y z\nVIEWPOINT {viewpoint}\nPOINTS 1\nDATA ascii\n1 2 3\n");
        parse("a.pcd", file.as_bytes()).unwrap().viewpoint
    };
    assert_eq!(of("0 0 0 1 0 0 0"), None);
    assert_eq!(of("0 0 0 0.6 0.8 0 0"), Some(DVec3::ZERO));
    assert_eq!(of("0 2 0 1 0 0 0"), Some(2.0 * DVec3::Y));
}

#[test]
fn decimal_commas_between_semicolons_are_told() {
    let fails = |file: &str| parse("a.xyz", file.as_bytes()).unwrap_err().to_string();
    assert!(fails("7,005;6,987;10,000\n").contains("7,005"));
    assert_eq!(parse("a.xyz", b"7.005;6.987;10\n").unwrap().positions, [DVec3::new(7.005, 6.987, 10.0)]);
    assert_eq!(parse("a.xyz", b"7,6,10;\n").unwrap().positions, [DVec3::new(7.0, 6.0, 10.0)]);
}

#[test]
fn long_repeats_are_unpacked() {
    let columns = [[1f32; 1000], [2.5; 1000], [-3.0; 1000]].concat();
    let bytes: Vec<u8> = columns.iter().flat_map(|v| v.to_le_bytes()).collect();
    let packed = compressed(&bytes);
    assert!(packed.len() < 300);
    let file = [b"FIELDS x y z\nPOINTS 1000\nDATA binary_compressed\n", &packed[..]].concat();
    assert_eq!(parse("a.pcd", &file).unwrap().positions, [DVec3::new(1.0, 2.5, -3.0); 1000]);
}

#[test]
fn more_points_than_scans_have_for_their_bytes_are_refused() {
    let file = |points: usize| {
        let head = format!("FIELDS x y z\nSIZE 1 1 1\nTYPE U U U\nPOINTS {points}\nDATA binary_compressed\n");
        [head.as_bytes(), &compressed(&vec![7; 3 * points])].concat()
    };
    assert_eq!(parse("flat.pcd", &file(2000)).unwrap().positions.len(), 2000);
    let (_, why) = why("flat.pcd", &file(10_000));
    let sentence = why.to_string();
    assert!(sentence.starts_with("10000 points are compressed to "), "{sentence}");
}

#[test]
fn every_truncated_pcd_fails_and_says_where() {
    for file in baroque_files() {
        // The last number of the text needs its first digit only.
        let is_text = file.ends_with(b"-.5");
        for length in 0..file.len() - if is_text { 1 } else { 0 } {
            let error = parse("a.pcd", &file[..length]).unwrap_err();
            assert!(matches!(error, ReadError::Malformed { .. }), "cut at {length}: {error}");
        }
    }
    let file = &baroque_files()[1];
    assert_eq!(
        parse("a.pcd", &file[..file.len() - 1]).unwrap_err().to_string(),
        format!("a.pcd: truncated: header promises 3 points, data ends after 2 (byte {})", file.len() - 1)
    );
}

#[test]
fn old_pcd_headers_are_read() {
    for head in ["COLUMNS x y z\nPOINTS 2\n", "VERSION 0.6\nFIELDS x y z\nWIDTH 2\nHEIGHT 1\n"] {
        let points = parse("a.pcd", format!("{head}DATA ascii\n1 2 3\n4 5 6\n").as_bytes()).unwrap();
        assert_eq!(points.positions[1], DVec3::new(4.0, 5.0, 6.0));
        assert_eq!((points.normals.len(), points.viewpoint), (0, None));
    }
}

#[test]
fn missing_points_are_dropped_from_organised_clouds_only() {
    let file = |width, height| {
        format!(
            "FIELDS x y z\nWIDTH {width}\nHEIGHT {height}\nDATA ascii\n1 2 3\nnan 1 1\n4 5 6\n1 nan nan\n"
        )
    };
    let organised = parse("a.pcd", file(2, 2).as_bytes()).unwrap();
    assert_eq!(organised.positions, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)]);
    let error = parse("a.pcd", file(4, 1).as_bytes()).unwrap_err();
    assert!(matches!(error, ReadError::Points { cause: PointsError::NotFinite { point: 1 }, .. }), "{error}");
}

#[test]
fn pcd_headers_that_contradict_themselves_are_refused() {
    let fault = |text: &str| why("a.pcd", text.as_bytes());
    let line = |text: &str| Malformation::HeaderLine { text: text.to_owned() };
    assert_eq!(
        fault("FIELDS x y\nPOINTS 1\nDATA ascii\n1 2\n").1,
        Malformation::Missing { what: "fields x, y and z" }
    );
    assert_eq!(fault("SIZE 4\n"), (Position::Line(1), line("SIZE 4")));
    assert_eq!(fault("FIELDS x y z\nSIZE 4 4\n"), (Position::Line(2), line("SIZE 4 4")));
    assert_eq!(fault("FIELDS x y z\nSIZE 4 4 3\n"), (Position::Line(2), line("SIZE 4 4 3")));
    assert_eq!(fault("FIELDS x y z\nVIEWPOINT nan 0 0 1 0 0 0\n").1, line("VIEWPOINT nan 0 0 1 0 0 0"));
    assert_eq!(fault("FIELDS x y x\n").1, Malformation::Duplicate { name: "x".to_owned() });
    assert_eq!(fault("FIELDS x y z\nDATA zip\n").1, line("DATA zip"));
    let counts = "FIELDS x y z\nWIDTH 2\nHEIGHT 2\nPOINTS 5\nDATA ascii\n";
    assert_eq!(fault(counts), (Position::Line(5), Malformation::PointCount { said: 4, found: 5 }));
    let tiny = "FIELDS x y z\nSIZE 2 2 2\nPOINTS 1\nDATA binary\n";
    assert_eq!(fault(tiny).1, Malformation::PropertyType { text: "F2".to_owned() });
    let row = |row: &str| fault(&format!("FIELDS x y z\nPOINTS 1\nDATA ascii\n{row}\n"));
    assert_eq!(row("1 2"), (Position::Line(4), Malformation::LineLength { too_many: false }));
    assert_eq!(row("1 2 3 4"), (Position::Line(4), Malformation::LineLength { too_many: true }));
    assert_eq!(row("1 2 z"), (Position::Line(4), Malformation::Number { text: "z".to_owned() }));
}

#[test]
fn absurd_pcd_counts_fail_without_the_memory_they_ask_for() {
    let max = u64::MAX;
    let counts = ["WIDTH 4000000000\nHEIGHT 4000000000\n".to_owned(), format!("POINTS {max}\n")];
    for encoding in ["ascii", "binary", "binary_compressed"] {
        for counts in &counts {
            let head =
                format!("FIELDS x y z d\nSIZE 8 8 8 8\nTYPE F F F F\nCOUNT 1 1 1 4294967295\n{counts}");
            let mut file = format!("{head}DATA {encoding}\n").into_bytes();
            file.extend([0xff; 100]);
            assert!(matches!(parse("a.pcd", &file), Err(ReadError::Malformed { .. })));
        }
    }
}

fn xyz(text: &str) -> PointCloud {
    parse("a.xyz", text.as_bytes()).unwrap()
}

#[test]
fn xyz_takes_separators_comments_counts_and_names() {
    let expected = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4e-1, 5.0, 6.5)];
    for text in TWO_POINTS {
        let points = xyz(text);
        assert_eq!((&points.positions[..], points.normals.len()), (&expected[..], 0), "{text}");
    }
}

#[test]
fn xyz_normals_are_named_or_of_length_one() {
    let normals = [DVec3::X, DVec3::ZERO, DVec3::new(0.6, 0.8, 0.0)];
    for text in NORMALS {
        let points = xyz(text);
        assert!(points.normals.iter().zip(normals).all(|(n, m)| n.distance(m) < 1e-12), "{text}");
        assert_eq!(points.positions, [DVec3::new(1.0, 2.0, 3.0); 3]);
    }
    assert!(xyz("1 2 3 0 0 0\n1 2 3 0 0 0\n").normals.is_empty(), "black, not normals");
    let later = "1 2 3 0 0 1\n".repeat(100) + "1 2 3 0 0 200\n";
    assert_eq!(xyz(&later).normals, [DVec3::Z; 101], "the first hundred lines decide");
}

#[test]
fn faults_in_xyz_name_their_line() {
    let fault = |text: &str| why("a.xyz", text.as_bytes());
    let number = |text: &str| Malformation::Number { text: text.to_owned() };
    assert_eq!(fault("1 2 3\n\n1 2\n"), (Position::Line(3), Malformation::LineLength { too_many: false }));
    assert_eq!(fault("1 2 3\n1 2 3 4\n"), (Position::Line(2), Malformation::LineLength { too_many: true }));
    assert_eq!(fault("1 2\n"), (Position::Line(1), Malformation::LineLength { too_many: false }));
    assert_eq!(fault("1 2 3\nx y z\n"), (Position::Line(2), number("x")));
    assert_eq!(fault("hello\n"), (Position::Line(1), number("hello")));
    assert_eq!(
        fault("a b c\n"),
        (Position::Line(1), Malformation::Missing { what: "columns named x, y and z" })
    );
    assert_eq!(fault("3\n1 2 3\n"), (Position::Line(2), Malformation::PointCount { said: 3, found: 1 }));
    assert_eq!(fault("1\n1 2 3\n4 5 6"), (Position::Line(3), Malformation::PointCount { said: 1, found: 2 }));
    let message = parse("a.xyz", b"1 2 3\n1 nan 3\n").unwrap_err().to_string();
    assert_eq!(message, "a.xyz: point 1 is not finite");
    for nothing in ["", "\n", "# a comment\n"] {
        let what = "first point";
        assert_eq!(fault(nothing), (Position::Line(1), Malformation::EndsBefore { what }), "{nothing}");
    }
    for name in ["a.txt", "a.csv", "a.asc"] {
        assert!(matches!(parse(name, b"1 2 3\n"), Err(ReadError::UnsupportedExtension { .. })));
    }
}

#[test]
fn a_viewpoint_has_the_unit_of_the_points() {
    let file = written(&PointCloud { viewpoint: Some(DVec3::ONE), ..cloud() }, Format::Pcd);
    let read = parse_geometry(Path::new("a.pcd"), &file, Unit::Centimetre).unwrap();
    let Geometry::Points(points) = read else { panic!("a mesh") };
    assert_eq!((points.viewpoint, points.positions[0].x), (Some(DVec3::splat(0.01)), 0.01));
}

proptest! {
    #[test]
    fn arbitrary_pcd_headers_never_panic(
        words in prop::collection::vec(prop::sample::select(vec![
            "VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA", "x", "y",
            "z", "F", "U", "4", "1", "0", "8", "99999999999999999999", "ascii", "binary", "\n", "\n", "\n", "\r\n",
        ]), 0..60),
    ) {
        let head = words.join(" ");
        for text in [head.clone(), format!("FIELDS x y z\n{head}\nPOINTS 3\nDATA binary_compressed\n{head}")] {
            let _ = parse("a.pcd", text.as_bytes());
        }
    }

    #[test]
    fn changed_bytes_of_pcd_never_panic(
        file in 0..3usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut file = baroque_files()[file].clone();
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        let _ = parse("a.pcd", &file);
    }

    #[test]
    fn arbitrary_xyz_never_panics(
        words in prop::collection::vec(prop::sample::select(vec![
            "x", "y", "z", "nx", "1", "-1", "0", "1e400", "nan", "#", "//", "/", ",", ";", "\n", "\n", "\r\n", "\u{ff}",
        ]), 0..80),
    ) {
        let _ = parse("a.xyz", words.join(" ").as_bytes());
    }
}

#[test]
fn places_of_scans_are_turned_with_their_points() {
    let scans = vec![ScanPlace { points: 0..1, viewpoint: DVec3::Z }];
    let cloud = PointCloud { positions: vec![DVec3::X], scans, ..PointCloud::default() };
    let up_is_z = DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y);
    let Geometry::Points(turned) = Geometry::Points(cloud).turned(up_is_z) else { panic!("points") };
    assert_eq!((turned.positions[0], turned.scans[0].viewpoint), (DVec3::X, DVec3::Y));
}
