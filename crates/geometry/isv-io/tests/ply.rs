//! PLY in all its flavours, whole and broken.

use glam::DVec3;
use isv_io::{
    Format, Geometry, Malformation, Position, ReadError, Unit, parse_geometry, parse_mesh, write_mesh_to,
};
use isv_testfiles::ply::{ENCODINGS, POINTS, STRIPS, TYPES, baroque, pyramid, triangle_of_type, with_rows};
use isv_volume::{MeshError, TriangleMesh};
use proptest::prelude::*;
use std::path::Path;

fn parse(bytes: &[u8]) -> Result<TriangleMesh, ReadError> {
    parse_mesh(Path::new("frame.ply"), bytes, Unit::Metre)
}

fn written(mesh: &TriangleMesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, mesh, Format::Ply).unwrap();
    bytes
}

#[test]
fn every_encoding_reads_the_same_mesh_past_what_it_does_not_need() {
    for encoding in ENCODINGS {
        assert_eq!(parse(&baroque(encoding)).unwrap(), pyramid(), "{encoding}");
    }
}

#[test]
fn numbers_of_every_type_are_read() {
    for (encoding, kind) in ENCODINGS.into_iter().flat_map(|encoding| TYPES.map(|kind| (encoding, kind))) {
        let mesh = parse(&triangle_of_type(encoding, kind)).unwrap();
        assert_eq!(mesh.vertices, [DVec3::ZERO, DVec3::X, 2.0 * DVec3::Y], "{encoding}, {kind}");
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }
}

#[test]
fn what_is_written_reads_back() {
    let mut mesh = pyramid();
    assert_eq!(parse(&written(&mesh)).unwrap(), mesh);
    mesh.normals = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y].to_vec();
    assert_eq!(parse(&written(&mesh)).unwrap(), mesh);
}

#[test]
fn written_bytes_never_change() {
    let mesh = TriangleMesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::new(0.0, -2.0, 0.0)],
        normals: Vec::new(),
        triangles: vec![[0, 1, 2]],
        appearance: None,
    };
    let mut expected =
        b"ply\nformat binary_little_endian 1.0\ncomment made by isv\nelement vertex 3\nproperty float x\n\
        property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
            .to_vec();
    for value in [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -2.0, 0.0] {
        expected.extend(value.to_le_bytes());
    }
    expected.extend([3, 0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
    assert_eq!(written(&mesh), expected);
}

#[test]
fn units_become_metres() {
    let mesh = parse_mesh(Path::new("x.ply"), &written(&pyramid()), Unit::Inch).unwrap();
    assert_eq!(mesh.vertices[4].y, -2.25 * 0.0254);
}

#[test]
fn normals_are_kept_at_length_one_or_not_at_all() {
    let file = |normal: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty \
             float nx\nproperty float ny\nproperty float nz\nelement face 1\nproperty list uchar int vertex_indices\n\
             end_header\n0 0 0 0 0 2\n1 0 0 0 0 2\n0 1 0 {normal}\n3 0 1 2\n"
        )
    };
    assert_eq!(parse(file("0 0 0.5").as_bytes()).unwrap().normals, [DVec3::Z; 3]);
    for unusable in ["0 0 0", "nan 0 0", "0 inf 0"] {
        assert!(parse(file(unusable).as_bytes()).unwrap().normals.is_empty(), "{unusable}");
    }
}

#[test]
fn every_truncation_fails_and_says_where() {
    for encoding in ENCODINGS {
        let file = baroque(encoding);
        // The last row of the text file ends in a number, a separator and line ends, without which it is still whole.
        let needed = if encoding == "ascii" { file.trim_ascii_end().len() } else { file.len() };
        for length in 0..needed {
            let error = parse(&file[..length]).unwrap_err();
            assert!(matches!(error, ReadError::Malformed { .. }), "{encoding} cut at {length}: {error}");
        }
        assert!(parse(&file[..needed]).is_ok());
    }
}

#[test]
fn a_cut_file_names_what_is_missing() {
    let file = written(&pyramid());
    let body = file.len() - 6 * 13 - 5 * 12;
    let error = parse(&file[..body + 2 * 12 + 5]).unwrap_err();
    let expected = format!(
        "frame.ply: truncated: header promises 5 vertices, data ends after 2 (byte {})",
        body + 2 * 12 + 5
    );
    assert_eq!(error.to_string(), expected);
}

#[test]
fn absurd_counts_fail_without_the_memory_they_ask_for() {
    for (vertices, faces) in [(4_000_000_000, 1), (u64::MAX, 1), (0, u64::MAX)] {
        let text = with_rows(vertices, faces, "");
        let binary = String::from_utf8(text.clone()).unwrap().replace("ascii", "binary_big_endian");
        for mut file in [text, binary.into_bytes()] {
            file.extend([b'1'; 700]);
            assert!(matches!(parse(&file), Err(ReadError::Malformed { .. })));
        }
    }
    // A list that claims 2^32 - 1 items in an element nobody needs.
    let mut file =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
        property float z\nelement junk 1\nproperty list uint double d\nend_header\n"
            .to_vec();
    file.extend([0xff; 50]);
    assert!(matches!(
        parse(&file),
        Err(ReadError::Malformed { why: Malformation::Truncated { promised: 1, found: 0, .. }, .. })
    ));
}

fn why(file: &[u8]) -> (Position, Malformation) {
    match parse(file).unwrap_err() {
        ReadError::Malformed { at, why, .. } => (at, why),
        other => panic!("{other}"),
    }
}

#[test]
fn faults_in_rows_name_their_line() {
    let text = |t: &str| t.to_owned();
    let fault = |rows: &str| why(&with_rows(3, 1, rows));
    let first_row = 10;
    let line = Position::Line;
    let few = "0 0 0\n0 1\n1 0 0\n3 0 1 2\n";
    assert_eq!(fault(few), (line(first_row + 1), Malformation::LineLength { too_many: false }));
    let many = "0 0 0\n0 1 0 9\n1 0 0\n3 0 1 2\n";
    assert_eq!(fault(many), (line(first_row + 1), Malformation::LineLength { too_many: true }));
    assert_eq!(fault("0 0 0 0\n"), (line(first_row), Malformation::LineLength { too_many: true }));
    assert_eq!(fault("0 0 0\n\n0 zero 0\n"), (line(12), Malformation::Number { text: text("zero") }));
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    let face = |row: &str| fault(&format!("{corners}{row}\n"));
    assert_eq!(face("3 0 1 -2"), (line(13), Malformation::Index { text: text("-2") }));
    assert_eq!(face("256 0 1 2"), (line(13), Malformation::Number { text: text("256") }));
    assert_eq!(face("3 0 1 2.5"), (line(13), Malformation::Number { text: text("2.5") }));
    let signed = String::from_utf8(with_rows(3, 1, &format!("{corners}-3 0 1 2\n"))).unwrap();
    let signed = signed.replace("list uchar", "list char");
    assert_eq!(why(signed.as_bytes()), (line(13), Malformation::ListLength { length: -3 }));
}

#[test]
fn headers_without_a_mesh_are_refused() {
    let head = "ply\nformat ascii 1.0\n";
    let missing = |text: &str| why(format!("{head}{text}end_header\n").as_bytes()).1;
    assert_eq!(missing(""), Malformation::Missing { what: "vertex element" });
    let xy = "element vertex 1\nproperty float x\nproperty float y\n";
    let what = "vertex properties x, y and z";
    assert_eq!(missing(xy), Malformation::Missing { what });
    assert_eq!(missing(&format!("{xy}property list uchar float z\n")), Malformation::Missing { what });
    let face = format!("{xy}property float z\nelement face 1\n");
    let what = "face property vertex_indices";
    assert_eq!(missing(&format!("{face}property list uchar int corners\n")), Malformation::Missing { what });
    assert_eq!(
        missing(&format!("{face}property list uchar double vertex_indices\n")),
        Malformation::PropertyType { text: "double".into() }
    );
}

#[test]
fn strips_of_triangles_are_faces() {
    assert_eq!(parse(STRIPS.as_bytes()).unwrap().triangles, [[0, 1, 2], [2, 1, 3], [4, 2, 3], [2, 1, 4]]);
    let wrong = STRIPS.replace("3 2 1 4", "3 2 1 -2");
    assert_eq!(why(wrong.as_bytes()), (Position::Line(16), Malformation::Index { text: "-2".into() }));
}

#[test]
fn quads_with_a_reflex_corner_are_split_there() {
    let rows = "0 0 0\n4 1 0\n0 2 0\n1 1 0\n4 0 1 2 3\n";
    let mut triangles = parse(&with_rows(4, 1, rows)).unwrap().triangles;
    triangles.iter_mut().for_each(|t| t.sort_unstable());
    triangles.sort_unstable();
    assert_eq!(triangles, [[0, 1, 3], [1, 2, 3]]);
}

#[test]
fn vertices_without_faces_are_points() {
    let path = Path::new("scan.ply");
    let Geometry::Points(points) = parse_geometry(path, POINTS.as_bytes(), Unit::Centimetre).unwrap() else {
        panic!("a mesh without faces");
    };
    assert_eq!(points.positions, [DVec3::new(0.01, 0.02, 0.03), DVec3::new(0.04, 0.05, 0.06)]);
    assert_eq!(points.normals, [DVec3::Z, DVec3::ZERO], "of unit length, or zero where there is none");
    let message = parse_mesh(path, POINTS.as_bytes(), Unit::Metre).unwrap_err().to_string();
    assert_eq!(message, "scan.ply: points without faces, where a mesh is needed");
    let none = parse_geometry(path, &with_rows(0, 0, ""), Unit::Metre).unwrap();
    assert!(none.is_empty(), "nobody was there");
}

#[test]
fn unusable_meshes_are_told_from_broken_files() {
    let mesh_error = |vertices, faces, rows: &str| match parse(&with_rows(vertices, faces, rows)).unwrap_err()
    {
        ReadError::Mesh { cause, .. } => cause,
        other => panic!("{other}"),
    };
    assert!(parse(&with_rows(0, 1, "0\n")).unwrap().triangles.is_empty(), "a frame without surface");
    assert_eq!(mesh_error(2, 1, "0 0 0\n1 1 1\n2 0 1\n"), MeshError::NoFaces);
    let corners = "0 0 0\n1 0 0\n0 1 0\n";
    assert_eq!(
        mesh_error(3, 2, &format!("{corners}3 0 1 2\n3 0 1 3\n")),
        MeshError::IndexPastEnd { face: 1, vertex: 3, vertices: 3 }
    );
    for bad in ["nan", "inf", "-inf", "1e999"] {
        let rows = format!("0 0 0\n1 {bad} 0\n0 1 0\n3 0 1 2\n");
        assert_eq!(mesh_error(3, 1, &rows), MeshError::NotFinite { vertex: 1 }, "{bad}");
    }
}

#[test]
fn coordinates_beyond_reach_are_refused() {
    let error = parse(&with_rows(3, 1, "0 0 0\n1 0 -2e9\n0 1 0\n3 0 1 2\n")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "frame.ply: vertex 1 lies 2e9 m from the origin along an axis, the limit is 1e9 m; check --units"
    );
}

proptest! {
    #[test]
    fn arbitrary_bytes_after_a_header_never_panic(
        encoding in prop::sample::select(ENCODINGS.to_vec()),
        counts in [any::<u32>(), any::<u32>()],
        types in prop::collection::vec(
            prop::sample::select(TYPES.to_vec()), 6),
        small in any::<bool>(),
        body in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let [a, b, c, length, item, junk] = types[..] else { unreachable!() };
        let [vertices, faces] = counts.map(|n| if small { n % 8 } else { n });
        let mut file = format!(
            "ply\nformat {encoding} 1.0\nelement junk 1\nproperty {junk} j\nelement vertex {vertices}\nproperty {a} x\n\
             property {b} y\nproperty {c} z\nelement face {faces}\nproperty list {length} {item} vertex_index\n\
             end_header\n"
        ).into_bytes();
        file.extend(body);
        let _ = parse(&file);
    }

    #[test]
    fn arbitrary_headers_never_panic(
        words in prop::collection::vec(prop::sample::select(vec![
            "ply", "format", "ascii", "1.0", "element", "vertex", "face", "3", "99999999999999999999", "property",
            "list", "uchar", "float", "x", "vertex_index", "end_header", "\n", "\n", "\n", "\r\n", "\u{0}",
        ]), 0..60),
    ) {
        let _ = parse(format!("ply\nformat ascii 1.0\n{}\nend_header\n1 2 3", words.join(" ")).as_bytes());
    }

    #[test]
    fn one_changed_byte_never_panics(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut file = baroque("binary_little_endian");
        let at = at.index(file.len());
        file[at] = byte;
        let _ = parse(&file);
    }
}
