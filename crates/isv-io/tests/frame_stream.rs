//! Frames from a pipe, in pieces of any size, whole and broken.

use glam::DVec3;
use isv_io::{
    Format, FrameStream, FrameStreamError, Geometry, MAX_FRAME_BYTES, Unit, write_mesh_to, write_points_to,
};
use isv_volume::{PointCloud, TriangleMesh};
use proptest::prelude::*;
use std::io::{self, Read};
use std::path::PathBuf;
use tar::{Builder, EntryType, Header};

type Item = Result<(PathBuf, Geometry), FrameStreamError>;

/// Gives bytes in pieces of some size at most.
struct Trickle<'a>(&'a [u8], usize);

impl Read for Trickle<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = buffer.len().min(self.1);
        self.0.read(&mut buffer[..most])
    }
}

fn frames(bytes: &[u8]) -> Vec<Item> {
    match FrameStream::new(Trickle(bytes, 1000), Unit::Metre) {
        Ok(stream) => stream.collect(),
        Err(error) => vec![Err(error)],
    }
}

/// A mesh that differs from number to number.
fn mesh(number: usize) -> TriangleMesh {
    let corner = |i: usize| DVec3::new(i as f64, (i % 7) as f64, number as f64);
    let corners = 3 + 500 * number;
    TriangleMesh {
        vertices: (0..corners).map(corner).collect(),
        normals: vec![],
        triangles: (0..corners as u32 - 2).map(|i| [i, i + 1, i + 2]).collect(),
    }
}

fn ply(number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, &mesh(number), Format::Ply).unwrap();
    bytes
}

fn ascii_ply(number: usize) -> Vec<u8> {
    let TriangleMesh { vertices, triangles, .. } = mesh(number);
    let mut text = format!(
        "ply\r\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face \
         {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        triangles.len()
    );
    vertices.iter().for_each(|v| text += &format!("{} {} {}\n", v.x, v.y, v.z));
    triangles.iter().for_each(|[a, b, c]| text += &format!("3 {a} {b} {c}\n"));
    text.into_bytes()
}

fn entry(archive: &mut Builder<Vec<u8>>, name: &str, bytes: &[u8]) {
    let mut header = Header::new_gnu();
    header.set_size(bytes.len() as u64);
    header.set_mode(0o644);
    archive.append_data(&mut header, name, bytes).unwrap();
}

/// Three frames among what is passed over; the last one's name is longer than a header holds.
fn archive() -> (Vec<u8>, Vec<String>) {
    let mut archive = Builder::new(Vec::new());
    let mut folder = Header::new_gnu();
    folder.set_entry_type(EntryType::Directory);
    folder.set_size(0);
    archive.append_data(&mut folder, "take.ply", io::empty()).unwrap();
    entry(&mut archive, "take/readme.txt", &[b'x'; 700]);
    let long = format!("{}/c.PLY", ["folder"; 40].join("/"));
    let names = vec!["take/b.ply".to_owned(), "take/a.ply".to_owned(), long];
    for (number, name) in names.iter().enumerate() {
        entry(&mut archive, name, &ply(number));
        entry(&mut archive, "take/._a.ply", b"resources of another system");
    }
    (archive.into_inner().unwrap(), names)
}

fn assert_meshes(items: Vec<Item>, names: &[String]) {
    assert_eq!(items.len(), names.len());
    for (number, (item, name)) in items.into_iter().zip(names).enumerate() {
        let (path, geometry) = item.unwrap();
        assert_eq!(path.to_str().unwrap(), name);
        assert_eq!(geometry, Geometry::Mesh(mesh(number)), "{name}");
    }
}

#[test]
fn a_tar_archive_gives_its_frames_in_its_order() {
    let (bytes, names) = archive();
    assert_meshes(frames(&bytes), &names);
}

#[test]
fn pax_records_name_and_size_files() {
    let mut archive = Builder::new(Vec::new());
    let frame = ply(0);
    let size = frame.len().to_string();
    archive
        .append_pax_extensions([("path", "given by pax.ply".as_bytes()), ("size", size.as_bytes())])
        .unwrap();
    let mut header = Header::new_ustar();
    header.set_path("short.obj").unwrap();
    header.set_size(frame.len() as u64);
    header.set_cksum();
    archive.append(&header, &frame[..]).unwrap();
    assert_meshes(frames(&archive.into_inner().unwrap()), &["given by pax.ply".to_owned()]);
}

#[test]
fn ply_files_follow_each_other_in_either_encoding() {
    let names: Vec<_> = (0..40).map(|number| format!("frame_{number:06}.ply")).collect();
    let file = |number| match number % 3 {
        0 => ascii_ply(number),
        1 => [&ply(number)[..], b"\n"].concat(),
        _ => ply(number),
    };
    let bytes: Vec<u8> = (0..40).flat_map(file).collect();
    assert_meshes(frames(&bytes), &names);
    // The last line of a text needs no end.
    let text = ascii_ply(0);
    assert_meshes(frames(text.trim_ascii_end()), &names[..1]);
}

#[test]
fn points_come_through_pipes_too() {
    let points = PointCloud { positions: vec![DVec3::X, DVec3::Y], normals: vec![], viewpoint: None };
    let mut archive = Builder::new(Vec::new());
    for name in ["0.pcd", "1.pcd"] {
        let mut bytes = Vec::new();
        write_points_to(&mut bytes, &points, Format::Pcd).unwrap();
        entry(&mut archive, name, &bytes);
    }
    for item in frames(&archive.into_inner().unwrap()) {
        assert_eq!(item.unwrap().1, Geometry::Points(points.clone()));
    }
}

#[test]
fn a_start_that_was_looked_at_may_be_put_back() {
    let file = ply(1);
    let (head, rest) = file.split_at(4);
    let stream = FrameStream::new(head.chain(rest), Unit::Centimetre).unwrap();
    let (_, geometry) = stream.map(Result::unwrap).next().unwrap();
    assert_eq!(geometry.bounds().unwrap().1.z, 0.01);
}

#[test]
fn other_pipes_are_refused_in_one_sentence() {
    let message = |bytes: &[u8]| match &frames(bytes)[..] {
        [Err(error)] => error.to_string(),
        other => panic!("{} items", other.len()),
    };
    assert_eq!(message(b""), "pipe: empty");
    let what = "pipe: neither a tar archive of frames nor PLY files one after another, which is what a pipe may hold";
    for bytes in [&b"solid x"[..], b"plywood", &[0; 1024], &[0x1f, 0x8b, 8, 0]] {
        assert_eq!(message(bytes), what);
    }
    let mut archive = Builder::new(Vec::new());
    entry(&mut archive, "readme.txt", b"none");
    assert!(message(&archive.into_inner().unwrap()).starts_with("pipe: no frames in the archive; "));
}

#[test]
fn kinds_are_not_mixed() {
    let mut archive = Builder::new(Vec::new());
    entry(&mut archive, "a.ply", &ply(0));
    entry(&mut archive, "b.xyz", b"1 2 3\n");
    let items = frames(&archive.into_inner().unwrap());
    let message = items[1].as_ref().unwrap_err().to_string();
    assert_eq!(message, "b.xyz: the frames before are .ply files; a pipe holds one kind of them");
    assert_eq!(items.len(), 2);
}

#[test]
fn a_bad_frame_does_not_hide_the_next_one() {
    let mut archive = Builder::new(Vec::new());
    entry(&mut archive, "a.ply", b"plywood\n");
    entry(&mut archive, "b.ply", &ply(0));
    let items = frames(&archive.into_inner().unwrap());
    assert!(matches!(&items[..], [Err(FrameStreamError::Frame(_)), Ok(_)]));
    // Points that are not finite, in a file that is well-formed.
    let bad = String::from_utf8(ascii_ply(0)).unwrap().replace("\n1 1 0\n", "\n1 nan 0\n");
    let items = frames(&[bad.as_bytes(), &ply(0)].concat());
    assert!(matches!(&items[..], [Err(FrameStreamError::Frame(_)), Ok(_)]));
    // A file that breaks its format: where the next one starts, nobody knows.
    let bad = String::from_utf8(ascii_ply(0)).unwrap().replace("\n1 1 0\n", "\n1 1 0 0\n");
    let items = frames(&[bad.as_bytes(), &ply(0)].concat());
    assert!(matches!(&items[..], [Err(FrameStreamError::Frame(_))]));
}

#[test]
fn every_cut_pipe_ends_in_an_error_after_its_whole_frames() {
    let (tar, _) = archive();
    let end = tar.len() - 1024;
    let text = [ascii_ply(0), ascii_ply(1)].concat();
    let binary = [ply(0), ply(1)].concat();
    for (bytes, needed) in [(&tar, end + 512), (&binary, binary.len()), (&text, text.len() - 1)] {
        let whole = frames(&bytes[..needed]);
        assert!(whole.len() > 1 && whole.iter().all(Result::is_ok));
        // A number that ends with the pipe is taken as it is: the last one of the text, 502, may lose two digits.
        let cuts = if bytes == &text { 1..needed - 2 } else { 1..needed };
        for length in cuts.step_by(7) {
            let items = frames(&bytes[..length]);
            let (last, before) = items.split_last().unwrap();
            // Between two PLY files nothing is missing.
            let between = [ply(0).len(), ascii_ply(0).len(), ascii_ply(0).len() - 1].contains(&length);
            assert!(last.is_err() || between, "cut at {length}");
            for (item, expected) in before.iter().zip(&whole) {
                assert_eq!(item.as_ref().unwrap(), expected.as_ref().unwrap());
            }
        }
    }
}

#[test]
fn sizes_that_do_not_come_take_no_memory() {
    let claim = |size: u64| {
        let mut header = Header::new_gnu();
        header.set_path("a.ply").unwrap();
        header.set_size(size);
        header.set_cksum();
        let items = frames(&[header.as_bytes(), &ply(0)[..]].concat());
        items.into_iter().next_back().unwrap().unwrap_err()
    };
    assert!(
        matches!(claim(MAX_FRAME_BYTES), FrameStreamError::CutFrame { missing, .. } if missing > 1 << 29)
    );
    for size in [MAX_FRAME_BYTES + 1, u64::MAX] {
        assert!(matches!(claim(size), FrameStreamError::TooLarge { .. }));
    }
    let text = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty \
                float z\nend_header\n1234";
    assert!(matches!(&frames(text.as_bytes())[..], [Err(FrameStreamError::Frame(_))]));
}

#[test]
fn a_damaged_header_names_its_block() {
    let mut archive = Builder::new(Vec::new());
    entry(&mut archive, "a.ply", &ply(0));
    let mut bytes = archive.into_inner().unwrap();
    let blocks = ply(0).len().div_ceil(512) + 1;
    bytes[blocks * 512] = 1;
    let items = frames(&bytes);
    let message = items[1].as_ref().unwrap_err().to_string();
    let expected = format!("pipe: block {blocks} of the archive is damaged or of a kind that is not read");
    assert_eq!(message, expected);
}

proptest! {
    #[test]
    fn changed_bytes_never_panic(
        kind in 0..3usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
    ) {
        let mut bytes = match kind {
            0 => archive().0,
            1 => [ply(0), ply(1), ascii_ply(1)].concat(),
            _ => ascii_ply(0),
        };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        prop_assert!(frames(&bytes).len() < 10);
    }
}
