//! Differences between programs that write the same. There is one table of formats. For each kind of
//! difference, all formats that it can touch give the same geometry as the plain file.

use isv_io::{Format, Geometry, ReadError, Unit, parse_geometry};
use std::path::PathBuf;

/// A tetrahedron, or its corners, as plain text: UTF-8 without a mark, lines that end in LF.
fn plain(format: Format) -> &'static str {
    match format {
        Format::Ply => {
            "ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 4\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
        }
        Format::Obj => "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
        Format::Off => "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
        Format::Stl => {
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid a\n"
        }
        Format::Xyz => "0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        Format::Pcd => "VERSION 0.7\nFIELDS x y z\nPOINTS 4\nDATA ascii\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n",
        Format::Gltf => {
            "{\n\"asset\": {\"version\": \"2.0\"},\n\"nodes\": [{\"mesh\": 0}],\n\"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0}}]}],\n\
             \"accessors\": [{\"bufferView\": 0, \"componentType\": 5126, \"count\": 3, \"type\": \"VEC3\"}],\n\
             \"bufferViews\": [{\"buffer\": 0, \"byteLength\": 36}],\n\
             \"buffers\": [{\"byteLength\": 36, \"uri\": \"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]\n}\n"
        }
        Format::Glb | Format::Las | Format::Laz | Format::E57 => unreachable!("no text"),
    }
}

const TEXTS: [Format; 7] =
    [Format::Ply, Format::Obj, Format::Off, Format::Stl, Format::Xyz, Format::Pcd, Format::Gltf];

fn read(format: Format, bytes: &[u8]) -> Result<Geometry, ReadError> {
    parse_geometry(&PathBuf::from(format!("a.{format}")), bytes, Unit::Metre)
}

/// Reads a changed file of each format and compares it with the plain one.
fn all_same(formats: &[Format], change: impl Fn(Format, &str) -> Vec<u8>) {
    for format in formats {
        let expected = read(*format, plain(*format).as_bytes()).unwrap();
        assert!(!expected.is_empty());
        let changed = change(*format, plain(*format));
        let found = read(*format, &changed);
        let found = found.unwrap_or_else(|why| panic!("{why}\n{}", String::from_utf8_lossy(&changed)));
        assert_eq!(found, expected, "{format}");
    }
}

#[test]
fn a_byte_order_mark_is_dropped() {
    all_same(&TEXTS, |_, text| [b"\xef\xbb\xbf", text.as_bytes()].concat());
}

#[test]
fn utf_16_is_read_with_a_mark_and_without() {
    let wide = |text: &str, unit: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    all_same(&TEXTS, |_, text| [b"\xff\xfe", &wide(text, u16::to_le_bytes)[..]].concat());
    all_same(&TEXTS, |_, text| [b"\xfe\xff", &wide(text, u16::to_be_bytes)[..]].concat());
    all_same(&TEXTS, |_, text| wide(text, u16::to_le_bytes));
    all_same(&TEXTS, |_, text| wide(text, u16::to_be_bytes));
}

#[test]
fn lines_end_in_any_way() {
    for end in ["\r", "\r\n", "\r\n\r\n", "\n\n", " \r", "\t\n"] {
        // An empty line is nothing in any of them but in the head of PLY files, where words alone count.
        all_same(&TEXTS, |_, text| text.replace('\n', end).into_bytes());
    }
    // One line ends so, the next otherwise.
    all_same(&TEXTS, |_, text| {
        let ends = ["\r", "\n", "\r\n"].iter().cycle();
        text.lines().zip(ends).map(|(line, end)| format!("{line}{end}")).collect::<String>().into_bytes()
    });
    // The last line needs no end.
    all_same(&TEXTS, |_, text| text.trim_end().as_bytes().to_vec());
}

#[test]
fn keywords_come_in_either_case() {
    all_same(&[Format::Ply, Format::Off, Format::Stl, Format::Pcd], |_, text| {
        text.to_uppercase().into_bytes()
    });
    all_same(&[Format::Ply, Format::Off, Format::Stl, Format::Pcd], |_, text| {
        text.to_lowercase().into_bytes()
    });
    let named = "X Y Z\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
    all_same(&[Format::Xyz], |_, _| named.into());
}

#[test]
fn values_are_separated_by_any_white_space() {
    // Everything behind the header on one line, or a value a line.
    let body = |format, text: &str, separator: &str| {
        let head = match format {
            Format::Ply => text.find("end_header\n").unwrap() + "end_header\n".len(),
            _ => "OFF\n4 4 6\n".len(),
        };
        let values: Vec<_> = text[head..].split_whitespace().collect();
        format!("{}{}\n", &text[..head], values.join(separator)).into_bytes()
    };
    for separator in [" ", "\n", "\r", "\t", " \n "] {
        all_same(&[Format::Ply, Format::Off], |format, text| body(format, text, separator));
    }
    // Two lines a vertex, as RealSense writes colours.
    let coloured = plain(Format::Ply).replace("property float z\n", "property float z\nproperty uchar red\n");
    let coloured = ["0 0 0\n", "1 0 0\n", "0 1 0\n", "0 0 1\n"]
        .iter()
        .fold(coloured, |text, row| text.replacen(row, &format!("{}\n200\n", row.trim_end()), 1));
    all_same(&[Format::Ply], |_, _| coloured.clone().into_bytes());
    // Counts glued to the keyword, and on lines of their own.
    for head in [
        "OFF4 4 6\n",
        "OFF 4 4 6\n",
        " OFF \n\n 4 4 6 \n",
        "OFF\n4\n4\n6\n",
        "4 4 6\n",
        "off\n4 4\n",
        "OFF # a\n# b\n4 4 0\n",
    ] {
        all_same(&[Format::Off], |_, text| text.replacen("OFF\n4 4 6\n", head, 1).into_bytes());
    }
}

#[test]
fn columns_that_no_surface_needs_stop_nothing() {
    let with = |row: &str, properties: &str| {
        let text =
            plain(Format::Ply).replace("property float z\n", &format!("property float z\n{properties}"));
        ["0 0 0\n", "1 0 0\n", "0 1 0\n", "0 0 1\n"]
            .iter()
            .fold(text, |text, old| text.replacen(old, &format!("{} {row}\n", old.trim_end()), 1))
    };
    for (properties, row) in [
        ("property uchar red\n", "0.5"),
        ("property uchar red\n", "-nan(ind)"),
        ("property uchar red\n", "300"),
        ("property int64 id\n", "9223372036854775807"),
        ("property float quality\nproperty float quality\n", "1 x"),
        ("property list uchar float weights\n", "2 nan oops"),
    ] {
        all_same(&[Format::Ply], |_, _| with(row, properties).into_bytes());
    }
    let pcd = "FIELDS x y z rgb rgb\nSIZE 4 4 4 4 4\nTYPE F F F U U\nPOINTS 4\nDATA ascii\n\
               0 0 0 -nan(ind) a\n1 0 0 1 2\n0 1 0 1.5 3\n0 0 1 x 4\n";
    all_same(&[Format::Pcd], |_, _| pcd.into());
    all_same(&[Format::Xyz], |_, _| "x y z i\n0 0 0 nan\n1 0 0 -nan(ind)\n0 1 0 x\n0 0 1 1.#QNAN\n".into());
}

#[test]
fn not_a_number_as_windows_prints_it_is_an_unknown_normal_and_no_place() {
    for word in ["nan", "-nan(ind)", "nan(snan)", "1.#QNAN", "-1.#IND", "1.#INF"] {
        let xyz = format!("x y z nx ny nz\n0 0 0 0 0 1\n1 0 0 {word} 0 0\n");
        let pcd = format!(
            "FIELDS x y z normal_x normal_y normal_z\nPOINTS 2\nDATA ascii\n0 0 0 0 0 1\n1 0 0 {word} {word} 0\n"
        );
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty float ny\nproperty float nz\nend_header\n0 0 0 0 0 1\n1 0 0 {word} 0 0\n"
        );
        let obj = format!("v 0 0 0\nv 1 0 0\nvn 0 0 1\nvn {word} 0 0\n");
        for (format, text) in [(Format::Xyz, xyz), (Format::Pcd, pcd), (Format::Ply, ply), (Format::Obj, obj)]
        {
            let Geometry::Points(points) = read(format, text.as_bytes()).unwrap() else { panic!("points") };
            assert_eq!(points.normals, [glam::DVec3::Z, glam::DVec3::ZERO], "{format}: {word}");
            // The same word as a coordinate.
            let broken = text.replacen("1 0 0", &format!("{word} 0 0"), 1);
            let message = read(format, broken.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("point 1 is not finite"), "{message}");
        }
    }
}

#[test]
fn a_vertex_that_no_face_uses_may_be_nowhere() {
    let obj = |stray: &str| format!("v {stray}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 2 3 4\n");
    let off = |stray: &str| format!("OFF\n4 1 0\n{stray}\n0 0 0\n1 0 0\n0 1 0\n3 1 2 3\n");
    let ply = |stray: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n{stray}\n0 0 0\n1 0 0\n0 1 0\n3 1 2 3\n"
        )
    };
    for stray in ["nan nan nan", "inf 0 0", "1e300 0 0"] {
        for (format, text) in
            [(Format::Obj, obj(stray)), (Format::Off, off(stray)), (Format::Ply, ply(stray))]
        {
            let Geometry::Mesh(mesh) = read(format, text.as_bytes()).unwrap() else { panic!("a mesh") };
            assert_eq!((mesh.triangles.len(), mesh.validate()), (1, Ok(())));
            // A face that uses it.
            let used = text.replace("f 2 3 4", "f 1 3 4").replace("3 1 2 3", "3 0 2 3");
            let message = read(format, used.as_bytes()).unwrap_err().to_string();
            assert!(message.contains("vertex 0 "), "{message}");
        }
    }
}

#[test]
fn a_frame_without_surface_is_a_frame() {
    for (format, text) in [
        (
            Format::Ply,
            "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n",
        ),
        (Format::Ply, "ply\nformat binary_little_endian 1.0\nelement vertex 0\nelement face 0\nend_header\n"),
        (Format::Obj, "# nobody\n"),
        (Format::Obj, "o nobody\ng nobody\n"),
        (Format::Off, "OFF\n0 0 0\n"),
        (Format::Stl, "solid nobody\nendsolid nobody\n"),
        (Format::Xyz, "0\n"),
        (Format::Xyz, "x y z nx ny nz\n"),
        (Format::Pcd, "FIELDS x y z\nWIDTH 0\nHEIGHT 1\nPOINTS 0\nDATA ascii\n"),
        (Format::Gltf, "{\"asset\": {\"version\": \"2.0\"}}"),
    ] {
        assert!(read(format, text.as_bytes()).unwrap().is_empty(), "{text}");
    }
    let binary_stl = [&[b' '; 80][..], &[0; 4]].concat();
    assert!(read(Format::Stl, &binary_stl).unwrap().is_empty());
    // What is cut, or is something else, is none.
    for (format, text) in [
        (Format::Ply, "ply\nformat ascii 1.0\n"),
        (Format::Obj, "hello world\n"),
        (Format::Off, "OFF\n"),
        (Format::Xyz, "\n"),
        (Format::Stl, "solid a\n"),
    ] {
        assert!(read(format, text.as_bytes()).is_err(), "{text}");
    }
}

#[test]
fn an_element_of_no_rows_needs_no_properties() {
    let points = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement face 0\nend_header\n1 2 3\n";
    let Geometry::Points(points) = read(Format::Ply, points.as_bytes()).unwrap() else { panic!("points") };
    assert_eq!(points.positions, [glam::DVec3::new(1.0, 2.0, 3.0)]);
}

#[test]
fn a_binary_body_follows_a_header_of_any_line_end() {
    // The first byte of the body is that of an LF: 10, a float of 1.4e-44.
    let body: Vec<u8> = [10u32, 0, 0].iter().flat_map(|bits| bits.to_le_bytes()).collect();
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let pcd = "FIELDS x y z\nPOINTS 1\nDATA binary\n";
    for (format, head) in [(Format::Ply, head), (Format::Pcd, pcd)] {
        for end in ["\n", "\r", "\r\n"] {
            let file = [head.replace('\n', end).as_bytes(), &body].concat();
            let Geometry::Points(points) = read(format, &file).unwrap() else { panic!("points") };
            assert_eq!(points.positions[0].x, f64::from(f32::from_bits(10)), "{format} {end:?}");
        }
    }
}

#[test]
fn stl_as_programs_write_it() {
    let text = plain(Format::Stl);
    for changed in [
        text.replace("endloop", "end loop").replace("endfacet", "end facet").replace("endsolid", "end solid"),
        text.replace("facet normal", "color 0.5 0.5 0.5\nfacet normal"),
        format!("# made by hand\n\n{text}"),
        format!("; made by hand\n// and again\n{text}"),
        text.replace("outer loop", "outer  loop").replace("vertex", "  VERTEX"),
    ] {
        all_same(&[Format::Stl], |_, _| changed.clone().into_bytes());
    }
}

#[test]
fn xyz_columns_may_be_named_in_a_comment() {
    let expected = read(Format::Xyz, b"x y z nx ny nz\n1 2 3 0 0 1\n4 5 6 0 1 0\n").unwrap();
    for text in [
        "//X;Y;Z;Nx;Ny;Nz\n2\n1;2;3;0;0;1\n4;5;6;0;1;0\n",
        "2\n//X,Y,Z,Nx,Ny,Nz\n1,2,3,0,0,1\n4,5,6,0,1,0\n",
        "# x y z nx ny nz\n1 2 3 0 0 1\n4 5 6 0 1 0\n",
        "# made by hand\n#x y z normal_x normal_y normal_z\n1 2 3 0 0 1\n4 5 6 0 1 0\n",
        "2\nx y z nx ny nz\n1 2 3 0 0 1\n4 5 6 0 1 0\n",
        "x y z nx ny nz\n2\n1 2 3 0 0 1\n4 5 6 0 1 0\n",
    ] {
        assert_eq!(read(Format::Xyz, text.as_bytes()).unwrap(), expected, "{text}");
    }
    let coloured = "//X;Y;Z;Rf;Gf;Bf;Nx;Ny;Nz\n1\n1;2;3;0.1;0.2;0.3;0;0;1\n";
    let Geometry::Points(points) = read(Format::Xyz, coloured.as_bytes()).unwrap() else { panic!("points") };
    assert_eq!(points.normals, [glam::DVec3::Z]);
}
