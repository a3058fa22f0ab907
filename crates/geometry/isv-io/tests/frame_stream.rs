//! Frames from a pipe, in pieces of any size, whole and broken.

use glam::DVec3;
use isv_io::{
    Format, FrameStream, FrameStreamError, Geometry, MAX_FRAME_BYTES, Unit, write_mesh_to, write_points_to,
};
use isv_testfiles::ply::text_of;
use isv_testfiles::tar::{archive, long_name, with_others, with_pax_records};
use isv_volume::{PointCloud, TriangleMesh};
use proptest::prelude::*;
use std::io::{self, Read};
use std::path::PathBuf;
use tar::Header;

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
        appearance: None,
    }
}

fn ply(number: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, &mesh(number), Format::Ply).unwrap();
    bytes
}

fn ascii_ply(number: usize) -> Vec<u8> {
    text_of(&mesh(number))
}

/// Three frames among what is passed over; the last one's name is longer than a header holds.
fn take() -> (Vec<u8>, Vec<String>) {
    let names = ["take/b.ply".to_owned(), "take/a.ply".to_owned(), long_name()];
    let files: Vec<_> = (0..3).map(ply).collect();
    (with_others(names.iter().map(String::as_str).zip(files.iter().map(Vec::as_slice))), names.to_vec())
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
    let (bytes, names) = take();
    assert_meshes(frames(&bytes), &names);
}

#[test]
fn pax_records_name_and_size_files() {
    let bytes = with_pax_records("given by pax.ply", &ply(0));
    assert_meshes(frames(&bytes), &["given by pax.ply".to_owned()]);
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
    let points = PointCloud {
        positions: vec![DVec3::X, DVec3::Y],
        normals: vec![],
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    };
    let mut file = Vec::new();
    write_points_to(&mut file, &points, Format::Pcd).unwrap();
    for item in frames(&archive([("0.pcd", &file[..]), ("1.pcd", &file)])) {
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
    assert!(
        message(&archive([("readme.txt", &b"none"[..])])).starts_with("pipe: no frames in the archive; ")
    );
}

#[test]
fn kinds_are_not_mixed() {
    let items = frames(&archive([("a.ply", &ply(0)[..]), ("b.xyz", b"1 2 3\n")]));
    let message = items[1].as_ref().unwrap_err().to_string();
    assert_eq!(message, "b.xyz: the frames before are .ply files; a pipe holds one kind of them");
    assert_eq!(items.len(), 2);
}

#[test]
fn a_bad_frame_does_not_hide_the_next_one() {
    let items = frames(&archive([("a.ply", &b"plywood\n"[..]), ("b.ply", &ply(0))]));
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
    let (tar, _) = take();
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
    let mut bytes = archive([("a.ply", &ply(0)[..])]);
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
            0 => take().0,
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
