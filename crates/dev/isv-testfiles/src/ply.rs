//! PLY in all its flavours.

use glam::DVec3;
use isv_volume::TriangleMesh;

/// The encodings, by the names that a header has for them.
pub const ENCODINGS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

/// The types of numbers, by the older of their two names.
pub const TYPES: [&str; 8] = ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"];

/// A pyramid with a square base, coordinates exact in `f32`.
#[must_use]
pub fn pyramid() -> TriangleMesh {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.5], [0.0, 0.0, 1.5], [0.5, -2.25, 0.5]];
    TriangleMesh {
        vertices: corners.map(DVec3::from).to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0]],
        appearance: None,
    }
}

/// A file whose mesh is [`pyramid`], with everything PLY allows around it. It has an element before, between
/// and after, extra properties, lists among the vertices, unusual types, a polygon of four corners, and faces
/// before vertices.
#[must_use]
pub fn baroque(encoding: &str) -> Vec<u8> {
    let mut header = format!("ply\nformat {encoding} 1.0\ncomment made by a test\nobj_info x\n");
    header += "element camera 2\nproperty double fov\nproperty list uint short path\n";
    header += "element face 5\nproperty uchar red\nproperty list ushort uint vertex_index\n";
    header += "property list uchar float texcoord\n";
    header += "element nothing 4000000000000\n";
    header += "element vertex 5\nproperty int8 flag\nproperty double z\nproperty float x\n";
    header += "property list int int8 bones\nproperty float32 y\n";
    header += "element edge 1\nproperty int a\nend_header\n";
    let mut body = Body::new(encoding, header);
    for path in [&[][..], &[-7, 300]] {
        body.put(45.5f64.to_le_bytes(), 45.5);
        body.list((path.len() as u32).to_le_bytes(), path, |v| (v as i16).to_le_bytes());
        body.end();
    }
    for face in [&[0, 1, 2, 3][..], &[0, 4, 1], &[1, 4, 2], &[2, 4, 3], &[3, 4, 0]] {
        body.put([200], 200);
        body.list((face.len() as u16).to_le_bytes(), face, |v| (v as u32).to_le_bytes());
        body.list([2], &[8, 9], |v| (v as f32).to_le_bytes());
        body.end();
    }
    for (index, vertex) in pyramid().vertices.into_iter().enumerate() {
        body.put([0xff], -1);
        body.put(vertex.z.to_le_bytes(), vertex.z);
        body.put((vertex.x as f32).to_le_bytes(), vertex.x);
        let bones = vec![-3; index];
        body.list((index as i32).to_le_bytes(), &bones, |v| (v as i8).to_le_bytes());
        body.put((vertex.y as f32).to_le_bytes(), vertex.y);
        body.end();
    }
    body.put(1i32.to_le_bytes(), 1);
    body.end();
    body.bytes
}

/// A triangle with corners at 0, 1 along x and 2 along y, all of whose numbers are of one type. A floating
/// one is not used for indices.
#[must_use]
pub fn triangle_of_type(encoding: &str, kind: &str) -> Vec<u8> {
    let index = if matches!(kind, "float" | "double") { "int" } else { kind };
    let header = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
         element face 1\nproperty list {index} {index} vertex_indices\nend_header\n"
    );
    let mut body = Body::new(encoding, header);
    for corner in [[0, 0, 0], [1, 0, 0], [0, 2, 0]] {
        corner.into_iter().for_each(|value| body.put_as(kind, value));
        body.end();
    }
    [3, 0, 1, 2].into_iter().for_each(|value| body.put_as(index, value));
    body.end();
    body.bytes
}

struct Body {
    text: bool,
    big_endian: bool,
    bytes: Vec<u8>,
}

impl Body {
    fn new(encoding: &str, header: String) -> Self {
        let (text, big_endian) = (encoding == "ascii", encoding == "binary_big_endian");
        Self { text, big_endian, bytes: header.into_bytes() }
    }

    fn put<const N: usize>(&mut self, mut raw: [u8; N], shown: impl std::fmt::Display) {
        if self.text {
            self.bytes.extend(format!("{shown} \t").into_bytes());
        } else {
            if self.big_endian {
                raw.reverse();
            }
            self.bytes.extend(raw);
        }
    }

    fn put_as(&mut self, kind: &str, value: u8) {
        match kind {
            "char" | "uchar" => self.put([value], value),
            "short" | "ushort" => self.put(u16::from(value).to_le_bytes(), value),
            "int" | "uint" => self.put(u32::from(value).to_le_bytes(), value),
            "float" => self.put(f32::from(value).to_le_bytes(), value),
            _ => self.put(f64::from(value).to_le_bytes(), value),
        }
    }

    fn list<const L: usize, const N: usize>(
        &mut self,
        length: [u8; L],
        items: &[i64],
        raw: fn(i64) -> [u8; N],
    ) {
        self.put(length, items.len());
        for item in items {
            self.put(raw(*item), item);
        }
    }

    fn end(&mut self) {
        if self.text {
            self.bytes.extend(b"\r\n\n");
        }
    }
}

/// Text whose header promises so many vertices and faces, and the rows after it.
#[must_use]
pub fn with_rows(vertices: u64, faces: u64, rows: &str) -> Vec<u8> {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n{rows}"
    )
    .into_bytes()
}

/// A mesh as text.
#[must_use]
pub fn text_of(mesh: &TriangleMesh) -> Vec<u8> {
    let mut rows = String::new();
    mesh.vertices.iter().for_each(|v| rows += &format!("{} {} {}\n", v.x, v.y, v.z));
    mesh.triangles.iter().for_each(|[a, b, c]| rows += &format!("3 {a} {b} {c}\n"));
    with_rows(mesh.vertices.len() as u64, mesh.triangles.len() as u64, &rows)
}

/// Five vertices and two rows of strips of triangles, which -1 parts.
pub const STRIPS: &str = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
    element tristrips 2\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n\
    2 2 2\n9 0 1 2 3 -1 4 2 3 -1\n3 2 1 4\n";

/// Two points with normals, of which the second is none.
pub const POINTS: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
    property float nx\nproperty float ny\nproperty float nz\nend_header\n1 2 3 0 0 2\n4 5 6 0 0 0\n";
