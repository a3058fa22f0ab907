//! Real captures for tests: a reader for exactly the PLY layout they come in.

use glam::DVec3;
use isv_testkit::capture;
use isv_volume::TriangleMesh;

/// One frame of a sequence, if the data is there; says so plainly if it is not.
pub(crate) fn load(sequence: &str, frame: usize) -> Option<TriangleMesh> {
    let path = capture(&format!("{sequence}/frame_{frame:04}.ply"))?;
    Some(parse(&std::fs::read(path).expect("a file that can be read")))
}

/// Binary little-endian: vertices of three floats, faces of a byte 3 and three 32-bit indices.
fn parse(bytes: &[u8]) -> TriangleMesh {
    let body = bytes.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = std::str::from_utf8(&bytes[..body]).expect("a text header");
    let count = |element: &str| -> usize {
        let line = header.lines().find_map(|l| l.strip_prefix(element)).expect("a count");
        line.trim().parse().expect("a number")
    };
    let (vertices, faces) = bytes[body..].split_at(12 * count("element vertex"));
    let word = |b: &[u8], i: usize| <[u8; 4]>::try_from(&b[4 * i..4 * i + 4]).expect("four bytes");
    let axis = |b: &[u8], i: usize| f64::from(f32::from_le_bytes(word(b, i)));
    TriangleMesh {
        vertices: vertices.chunks_exact(12).map(|v| DVec3::new(axis(v, 0), axis(v, 1), axis(v, 2))).collect(),
        normals: Vec::new(),
        triangles: faces[..13 * count("element face")]
            .chunks_exact(13)
            .map(|f| [0, 1, 2].map(|i| u32::from_le_bytes(word(&f[1..], i))))
            .collect(),
        appearance: None,
    }
}
