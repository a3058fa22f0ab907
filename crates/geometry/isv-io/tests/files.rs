//! Meshes and sequences on a real file system.

use glam::{DVec3, Vec3};
use isv_io::{
    Format, FrameSequence, ReadError, SequenceError, Unit, parse_mesh, read_mesh, write_mesh, write_mesh_to,
};
use isv_testfiles::text::MESHES;
use isv_testkit::capture;
use isv_volume::TriangleMesh;
use proptest::prelude::*;
use std::fs;
use std::path::Path;

fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.0, 0.0, 0.1)],
        normals: Vec::new(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        appearance: None,
    }
}

/// Corners of all triangles, in single precision.
fn corners(mesh: &TriangleMesh) -> Vec<[Vec3; 3]> {
    (0..mesh.triangles.len()).map(|face| mesh.corners(face).map(DVec3::as_vec3)).collect()
}

#[test]
fn every_mesh_format_reads_back_what_was_written() {
    let folder = tempfile::tempdir().unwrap();
    for &format in Format::ALL.iter().filter(|format| format.writes_mesh()) {
        let path = folder.path().join("frame").with_extension(format.extension().to_uppercase());
        let mut mesh = tetrahedron();
        for normals in [vec![], vec![DVec3::Y; 4]] {
            mesh.normals = normals;
            write_mesh(&path, &mesh, format).unwrap();
            let read = read_mesh(&path, Unit::Metre).unwrap();
            assert_eq!(read.vertices.len(), 4);
            assert_eq!(corners(&read), corners(&mesh), "equal as f32, in {format}");
            // Others give normals to the corners of faces, where they are not read, or do not say what they mean.
            assert_eq!(read.normals, if format == Format::Ply { mesh.normals.clone() } else { vec![] });
        }
    }
}

#[test]
fn formats_that_are_only_read_say_so() {
    for &format in Format::ALL.iter().filter(|format| !format.writes_mesh()) {
        let error = write_mesh_to(Vec::new(), &tetrahedron(), format).unwrap_err();
        assert_eq!(error.to_string(), format!("meshes cannot be written as {format}"));
    }
}

#[test]
fn written_obj_is_text_that_never_changes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    write_mesh(&path, &tetrahedron(), Format::Obj).unwrap();
    let expected =
        "# made by isv\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    assert_eq!(fs::read_to_string(&path).unwrap(), expected);
}

#[test]
fn errors_start_with_the_name_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.ply");
    let error = read_mesh(&missing, Unit::Metre).unwrap_err();
    assert!(matches!(error, ReadError::Io { .. }));
    assert!(error.to_string().starts_with(missing.to_str().unwrap()));
    let error = read_mesh(Path::new("scan.doc"), Unit::Metre).unwrap_err();
    let expected = "scan.doc: not a file of meshes or points that can be read: the extension must be one of ";
    assert_eq!(error.to_string(), expected.to_owned() + &Format::names(Format::ALL, "."));
    let error = parse_mesh(Path::new("a.obj"), b"v 0 0 0\nf 1 1 0\n", Unit::Metre).unwrap_err();
    assert_eq!(error.to_string(), "a.obj: `0` does not name a vertex (line 2)");
    let error = parse_mesh(Path::new("a.obj"), b"v 0 0 0\nf 1 1 2\n", Unit::Metre).unwrap_err();
    assert_eq!(error.to_string(), "a.obj: face 0 names vertex 1 of 1");
}

/// Small valid files of text formats and binary STL; those of glTF have tests of their own.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let mut stl = Vec::new();
    write_mesh_to(&mut stl, &tetrahedron(), Format::Stl).unwrap();
    let text = MESHES.iter().map(|(name, text)| (*name, text.as_bytes().to_vec()));
    text.chain([("binary.stl", stl)]).collect()
}

proptest! {
    #[test]
    fn changed_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in any::<prop::sample::Index>(),
    ) {
        for (name, mut bytes) in samples() {
            assert!(parse_mesh(Path::new(name), &bytes, Unit::Metre).is_ok());
            for (at, byte) in &changes {
                let at = at.index(bytes.len());
                bytes[at] = *byte;
            }
            let _ = parse_mesh(Path::new(name), &bytes, Unit::Metre);
            bytes.truncate(cut.index(bytes.len()));
            let _ = parse_mesh(Path::new(name), &bytes, Unit::Metre);
        }
    }

    #[test]
    fn arbitrary_text_never_panics(
        words in prop::collection::vec(prop::sample::select(vec![
            "solid", "endsolid", "facet", "vertex", "endfacet", "OFF", "COFF", "3", "4", "0", "1", "-1", "nan", "1e400",
            "18446744073709551615", "#", "\n", "\n", "\r\n", "\u{ff}",
        ]), 0..80),
    ) {
        for (name, start) in [("a.stl", "solid\n"), ("a.off", "OFF ")] {
            let _ = parse_mesh(Path::new(name), (start.to_owned() + &words.join(" ")).as_bytes(), Unit::Metre);
        }
    }

    #[test]
    fn arbitrary_obj_text_never_panics(
        words in prop::collection::vec(prop::sample::select(vec![
            "v", "f", "vn", "1", "-1", "0", "2/3/4", "//", "1e400", "nan", "\\", "#", "\n", "\n", "\r\n", "\u{ff}",
        ]), 0..80),
    ) {
        let _ = parse_mesh(Path::new("a.obj"), words.join(" ").as_bytes(), Unit::Metre);
    }
}

/// A folder of empty files.
fn folder_of(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        fs::write(folder.path().join(name), "").unwrap();
    }
    folder
}

fn names(sequence: &FrameSequence) -> Vec<&str> {
    sequence.paths().iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect()
}

fn open(folder: &tempfile::TempDir, name: &str) -> Result<FrameSequence, SequenceError> {
    FrameSequence::open(folder.path().join(name))
}

#[test]
fn a_folder_is_its_mesh_files_in_natural_order() {
    let folder = folder_of(&["f_10.ply", "f_2.PLY", "f_1.ply", "notes.txt", "f_0.ply.part", "._f_1.ply"]);
    fs::create_dir(folder.path().join("f_3.ply")).unwrap();
    assert_eq!(names(&open(&folder, "").unwrap()), ["f_1.ply", "f_2.PLY", "f_10.ply"]);
}

#[test]
fn a_pattern_names_the_files_that_match() {
    let folder = folder_of(&["a_10.ply", "a_9.ply", "b_1.ply", "a_1.obj", "a_[1].ply", "a*.ply"]);
    assert_eq!(names(&open(&folder, "a_?.ply").unwrap()), ["a_9.ply"]);
    assert_eq!(names(&open(&folder, "a_*.ply").unwrap()), ["a_9.ply", "a_10.ply", "a_[1].ply"]);
    // Files whose names look like patterns are themselves.
    assert_eq!(names(&open(&folder, "a_[1].ply").unwrap()), ["a_[1].ply"]);
    assert_eq!(names(&open(&folder, "a*.ply").unwrap()), ["a*.ply"]);
    assert!(matches!(open(&folder, "c*.ply"), Err(SequenceError::NoFrames { .. })));
    assert!(matches!(open(&folder, "x*/a_1.ply"), Err(SequenceError::NoFrames { .. })));
    assert!(matches!(open(&folder, "x/*.ply"), Err(SequenceError::Io { .. })));
}

#[test]
fn a_take_may_have_a_folder_for_each_frame() {
    let folder = folder_of(&[]);
    for frame in ["10", "9", "1"] {
        fs::create_dir(folder.path().join(frame)).unwrap();
        fs::write(folder.path().join(frame).join("mesh.obj"), "").unwrap();
        fs::write(folder.path().join(frame).join("texture.png"), "").unwrap();
    }
    let expected = ["1/mesh.obj", "9/mesh.obj", "10/mesh.obj"].map(|name| folder.path().join(name));
    for sequence in
        [open(&folder, "").unwrap(), open(&folder, "*/mesh.obj").unwrap(), open(&folder, "?*/*.obj").unwrap()]
    {
        assert_eq!(sequence.paths(), expected);
        assert_eq!(sequence.times(), &isv_io::FrameTimes::Numbered(vec![0, 8, 9]));
    }
    fs::write(folder.path().join("9/other.obj"), "").unwrap();
    let message = open(&folder, "").unwrap_err().to_string();
    assert!(
        message.contains("9: 2 files of meshes or points") && message.contains("take/*/mesh.obj"),
        "{message}"
    );
    assert_eq!(open(&folder, "*/mesh.obj").unwrap().paths().len(), 3);
    fs::remove_file(folder.path().join("9/other.obj")).unwrap();
    // Folders of other things are passed over; a numbered one without its file is a frame that was lost.
    fs::create_dir(folder.path().join("textures")).unwrap();
    fs::create_dir(folder.path().join("11")).unwrap();
    let lost = folder.path().join("11/mesh.obj");
    assert_eq!(open(&folder, "").unwrap().paths(), [&expected[..], &[lost]].concat());
}

#[test]
fn folders_of_other_things_are_no_take() {
    let folder = folder_of(&[]);
    let add = |name: &str| {
        fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
        fs::write(folder.path().join(name), "").unwrap();
    };
    add("bunny/bunny.ply");
    add("dragon/dragon.ply");
    assert!(matches!(open(&folder, ""), Err(SequenceError::NoFrames { .. })));
    // Folders may number files that are numbered themselves.
    let folder = folder_of(&[]);
    for frame in ["0001", "0002", "0004", "0005"] {
        let inner = folder.path().join(frame);
        fs::create_dir(&inner).unwrap();
        fs::write(inner.join(format!("scan_{frame}.ply")), "").unwrap();
    }
    for sequence in [open(&folder, "").unwrap(), open(&folder, "*/*.ply").unwrap()] {
        assert_eq!(sequence.times(), &isv_io::FrameTimes::Numbered(vec![0, 1, 3, 4]));
    }
}

#[test]
fn inputs_without_one_clear_sequence_are_refused() {
    let mixed = folder_of(&["a.ply", "a.obj"]);
    let message = open(&mixed, "").unwrap_err().to_string();
    assert!(message.contains("files of more than one kind"), "{message}");
    assert!(matches!(open(&mixed, "*"), Err(SequenceError::MixedFormats { .. })));
    assert_eq!(names(&open(&mixed, "a.obj").unwrap()), ["a.obj"]);
    let none = folder_of(&["readme.md"]);
    assert!(matches!(open(&none, ""), Err(SequenceError::NoFrames { .. })));
    assert!(matches!(open(&none, "readme.md"), Err(SequenceError::NoFrames { .. })));
    assert!(matches!(open(&none, "gone.ply"), Err(SequenceError::NotFound { .. })));
}

#[test]
fn ranges_select_frames_or_say_how_many_there_are() {
    let folder = folder_of(&["0.ply", "1.ply", "2.ply"]);
    let all = open(&folder, "").unwrap();
    assert_eq!(names(&all.select(1..3).unwrap()), ["1.ply", "2.ply"]);
    assert_eq!(all.select(0..3).unwrap(), all);
    #[expect(clippy::reversed_empty_ranges)]
    for bad in [0..4, 3..3, 2..1, 7..9, 0..usize::MAX] {
        let message = all.select(bad.clone()).unwrap_err().to_string();
        let expected = format!("frames {}..{} asked for, but there are 3 (0..3)", bad.start, bad.end);
        assert!(message.contains(&expected), "{message}");
    }
}

#[test]
fn captured_frames_read_whole() {
    for (sequence, frames, vertices, faces) in [("dancer", 16, 19_724, 39_372), ("flag", 30, 6_945, 13_678)] {
        let Some(folder) = capture(sequence) else { continue };
        let paths = FrameSequence::open(&folder).unwrap();
        assert_eq!(paths.paths().len(), frames);
        let mesh = read_mesh(&paths.paths()[0], Unit::Metre).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (vertices, faces));
        let mut bytes = Vec::new();
        write_mesh_to(&mut bytes, &mesh, Format::Ply).unwrap();
        assert_eq!(parse_mesh(Path::new("again.ply"), &bytes, Unit::Metre).unwrap(), mesh);
    }
}
