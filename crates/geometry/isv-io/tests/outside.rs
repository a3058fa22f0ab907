//! No name that stands in data leads to a file outside of what the user named.

use isv_io::{DepthSequence, FrameStream, Unit, read_geometry};
use std::fs;
use std::path::Path;

const CAMERA: &str = r#""width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5"#;
/// A triangle whose positions lie in another file.
const TRIANGLE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}],
 "buffers": [{"byteLength": 36, "uri": "URI"}]}"#;

fn positions() -> Vec<u8> {
    [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

/// A folder with a secret beside the capture `take`.
fn folders() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("take")).unwrap();
    fs::create_dir_all(folder.path().join("secret")).unwrap();
    fs::write(folder.path().join("secret/0.png"), b"secret").unwrap();
    fs::write(folder.path().join("secret.bin"), positions()).unwrap();
    folder
}

#[test]
fn lists_of_images_stay_in_their_folder() {
    let folder = folders();
    let take = folder.path().join("take");
    let absolute = folder.path().join("secret/0.png");
    for name in ["../secret/0.png", "a/../../secret/0.png", absolute.to_str().unwrap()] {
        fs::write(take.join("depth.txt"), format!("1.0 {name}\n")).unwrap();
        fs::write(take.join("groundtruth.txt"), "1.0 0 0 0 0 0 0 1\n").unwrap();
        let error = DepthSequence::open(&take).unwrap_err().to_string();
        assert!(error.contains("an image lies in another folder"), "{name}: {error}");
    }
    fs::remove_file(take.join("depth.txt")).unwrap();
    let absolute = folder.path().join("secret");
    for name in ["../secret", "../secret/*.png", absolute.to_str().unwrap()] {
        let rig = format!(
            r#"{{"fps": 30, "cameras": [{{"name": "a", {CAMERA},
             "camera_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "images": "{name}"}}]}}"#
        );
        fs::write(take.join("rig.json"), rig).unwrap();
        let error = DepthSequence::open(&take).unwrap_err().to_string();
        assert!(error.contains("leads out of its folder"), "{name}: {error}");
    }
}

#[test]
fn buffers_lie_beside_a_file_and_nowhere_else() {
    let folder = folders();
    let take = folder.path().join("take");
    let write = |uri: &str| fs::write(take.join("a.gltf"), TRIANGLE.replace("URI", uri)).unwrap();
    fs::write(take.join("own.bin"), positions()).unwrap();
    write("own.bin");
    read_geometry(&take.join("a.gltf"), Unit::Metre).unwrap();
    for uri in ["../secret.bin", "%2e%2e/secret.bin", folder.path().join("secret.bin").to_str().unwrap()] {
        write(uri);
        let error = read_geometry(&take.join("a.gltf"), Unit::Metre).unwrap_err().to_string();
        assert!(error.contains("buffers must lie beside"), "{uri}: {error}");
    }
}

/// Whatever an archive calls its files: they are never on the disk, so nothing lies beside them.
#[test]
fn what_comes_through_a_pipe_reads_no_file() {
    let folder = folders();
    for name in ["a.gltf", "../a.gltf", folder.path().join("a.gltf").to_str().unwrap()] {
        let gltf = TRIANGLE.replace("URI", "secret.bin");
        let mut header = tar::Header::new_gnu();
        header.set_size(gltf.len() as u64);
        // As a writer with bad intentions does it: the library refuses such names.
        let bytes = name.as_bytes();
        header.as_old_mut().name[..bytes.len()].copy_from_slice(bytes);
        header.set_cksum();
        let mut archive = tar::Builder::new(Vec::new());
        archive.append(&header, gltf.as_bytes()).unwrap();
        let archive = archive.into_inner().unwrap();
        let error = FrameStream::new(&archive[..], Unit::Metre).unwrap().next().unwrap().unwrap_err();
        assert!(error.to_string().contains("came without any"), "{name}: {error}");
        assert!(!Path::new(name).exists());
    }
}
