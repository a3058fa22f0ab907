//! Content of files that isv does not keep: sound, and textures, materials and colours where they are dropped.

use crate::linked::Linked;
use crate::obj::mtl;
use crate::text::{lines, words};
use crate::{Colours, Format, e57, las, text};
use serde_json::Value;
use std::fs::{self, File};
use std::io::Read;
use std::path::Path;

/// Bytes of a file that are looked at. Headers and the first records of text lie there.
const LOOKED_AT: u64 = 1 << 20;

/// Largest file that is looked at whole, where the format has no header that tells.
const LARGEST: u64 = 1 << 28;

/// Endings of sound files.
const SOUNDS: [&str; 8] = ["aac", "aif", "flac", "m4a", "mp3", "ogg", "opus", "wav"];

/// Names of what a frame's file and its folder hold and isv does not keep, such as `textures`; none if there is nothing. `colours`: how
/// the file is read.
///
/// The start of the file is looked at, or the XML of E57. A file that cannot be read holds nothing here: reading it tells.
#[must_use]
pub fn passed_over(path: &Path, colours: Colours) -> Vec<String> {
    let mut found: Vec<String> = match colours {
        Colours::Keep => missing_library(path).into_iter().collect(),
        Colours::Drop => in_file(path).unwrap_or_default().into_iter().map(str::to_owned).collect(),
    };
    let sounds = path
        .parent()
        .and_then(|folder| sound_in(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }));
    found.extend(sounds.map(|name| format!("sound ({name})")));
    found
}

/// The materials of an OBJ file none of whose libraries is there. A library is named in its first lines.
fn missing_library(path: &Path) -> Option<String> {
    Format::of_path(path).filter(|format| *format == Format::Obj)?;
    let (_, start) = start_of(path)?;
    let start = text::decode(&start);
    let named = lines(&start).filter_map(|line| match text::first_word(line) {
        Some((b"mtllib", name)) => Some(mtl::name(name)),
        _ => None,
    });
    let named: Vec<String> = named.collect();
    let linked = Linked::beside(path);
    // One name with blanks, or several names.
    let is_there =
        |name: &String| linked.is_there(name) || name.split_whitespace().any(|name| linked.is_there(name));
    match named.first() {
        Some(first) if !named.iter().any(is_there) => Some(format!("materials ({first} is not there)")),
        _ => None,
    }
}

fn in_file(path: &Path) -> Option<Vec<&'static str>> {
    let format = Format::of_path(path)?;
    let (mut file, mut start) = start_of(path)?;
    Some(match format {
        Format::Ply => in_ply(&text::decode(&start)),
        Format::Obj => in_obj(&text::decode(&start)),
        Format::Pcd | Format::Xyz => in_columns(&text::decode(&start)),
        Format::Las | Format::Laz => las::has_colours(&start).then_some("colours").into_iter().collect(),
        Format::E57 if file.metadata().ok()?.len() <= LARGEST => {
            file.read_to_end(&mut start).ok()?;
            e57::has_colours(&start).then_some("colours").into_iter().collect()
        }
        Format::Glb | Format::Gltf => in_gltf(&start)?,
        Format::Off | Format::Stl | Format::E57 => Vec::new(),
    })
}

/// A file and its start, which has been read. Not of pipes and devices.
fn start_of(path: &Path) -> Option<(File, Vec<u8>)> {
    let mut file = File::open(path).ok().filter(|file| file.metadata().is_ok_and(|data| data.is_file()))?;
    let mut start = Vec::new();
    Read::by_ref(&mut file).take(LOOKED_AT).read_to_end(&mut start).ok()?;
    Some((file, start))
}

fn in_ply(start: &[u8]) -> Vec<&'static str> {
    let (mut textures, mut colours) = (false, false);
    for line in lines(start) {
        let line = line.to_ascii_lowercase();
        let words: Vec<&[u8]> = words(&line).collect();
        match words[..] {
            [b"end_header"] => break,
            [b"comment", b"texturefile", ..] => textures = true,
            [b"property", .., b"red" | b"r" | b"diffuse_red"] => colours = true,
            _ => {}
        }
    }
    named([(textures, "textures"), (colours, "vertex colours")])
}

fn in_obj(start: &[u8]) -> Vec<&'static str> {
    let (mut materials, mut colours) = (false, false);
    for line in lines(start) {
        let mut words = words(line);
        match words.next() {
            Some(b"mtllib" | b"usemtl") => materials = true,
            Some(b"v") => colours |= words.count() >= 6,
            _ => {}
        }
    }
    named([(materials, "materials and textures"), (colours, "vertex colours")])
}

/// Columns that a line of names has: `FIELDS` of PCD, or the first lines of XYZ.
fn in_columns(start: &[u8]) -> Vec<&'static str> {
    const COLOURS: [&[u8]; 7] = [b"rgb", b"rgba", b"r", b"red", b"rf", b"g", b"green"];
    let is_colour = |line: &[u8]| {
        let line = line.to_ascii_lowercase();
        let separates = |b: &u8| b.is_ascii_whitespace() || matches!(b, b',' | b';' | b'/' | b'#');
        line.split(separates).any(|word| COLOURS.contains(&word))
    };
    named([(lines(start).take(16).any(is_colour), "colours")])
}

fn in_gltf(start: &[u8]) -> Option<Vec<&'static str>> {
    // The JSON of GLB comes first, after 20 bytes; a longer one is not looked at.
    let json = match start.strip_prefix(b"glTF") {
        Some(rest) => {
            let length = u32::from_le_bytes(*rest.get(8..)?.first_chunk()?) as usize;
            start.get(20..)?.get(..length)?
        }
        None => start,
    };
    let json = text::decode(json);
    let padding = json.iter().rev().take_while(|b| **b == 0 || b.is_ascii_whitespace()).count();
    let document: Value = serde_json::from_slice(&json[..json.len() - padding]).ok()?;
    let has = |key: &str| document[key].as_array().is_some_and(|list| !list.is_empty());
    let colours = document["meshes"].as_array().into_iter().flatten().any(|mesh| {
        let mut parts = mesh["primitives"].as_array().into_iter().flatten();
        parts.any(|part| !part["attributes"]["COLOR_0"].is_null())
    });
    Some(named([(has("images") || has("textures"), "textures"), (colours, "vertex colours")]))
}

fn named<const N: usize>(found: [(bool, &'static str); N]) -> Vec<&'static str> {
    found.into_iter().filter(|(is_there, _)| *is_there).map(|(_, name)| name).collect()
}

/// The name of a sound file in a folder, the first by name.
fn sound_in(folder: &Path) -> Option<String> {
    let names = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.file_name());
    let is_sound = |name: &std::ffi::OsString| {
        let ending = Path::new(name).extension().and_then(|ending| ending.to_str());
        ending.is_some_and(|ending| SOUNDS.iter().any(|sound| ending.eq_ignore_ascii_case(sound)))
    };
    names.filter(is_sound).map(|name| name.to_string_lossy().into_owned()).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, bytes: &[u8]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), bytes).unwrap();
        passed_over(&folder.path().join(name), Colours::Drop)
    }

    #[test]
    fn a_library_of_materials_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame.obj");
        let found = |text: &str| {
            fs::write(&path, text).unwrap();
            passed_over(&path, Colours::Keep)
        };
        let none: [&str; 0] = [];
        assert_eq!(found("v 0 0 0\n"), none);
        assert_eq!(found("mtllib my skin.mtl\nv 0 0 0\n"), ["materials (my skin.mtl is not there)"]);
        fs::write(folder.path().join("my skin.mtl"), "newmtl a").unwrap();
        assert_eq!(found("mtllib my skin.mtl\nv 0 0 0\n"), none);
        fs::write(folder.path().join("b.mtl"), "newmtl b").unwrap();
        assert_eq!(found("mtllib a.mtl b.mtl\n"), none);
    }

    #[test]
    fn each_format_tells_what_is_not_kept() {
        let ply = |more: &str| {
            format!("ply\nformat ascii 1.0\n{more}element vertex 0\nproperty float x\nend_header\n")
        };
        let glb = |json: &str| {
            let length = |bytes: usize| (bytes as u32).to_le_bytes();
            [b"glTF\x02\0\0\0", &length(20 + json.len())[..], &length(json.len()), b"JSON", json.as_bytes()]
                .concat()
        };
        let textured = r#"{"asset": {"version": "2.0"}, "images": [{}]}"#;
        let coloured = r#"{"meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}}]}]}"#;
        for (name, bytes, expected) in [
            ("a.ply", ply("").into_bytes(), &[][..]),
            ("a.ply", ply("comment TextureFile a.png\n").into_bytes(), &["textures"]),
            ("a.ply", ply("element vertex 1\nproperty uchar red\n").into_bytes(), &["vertex colours"]),
            (
                "a.obj",
                b"mtllib a.mtl\nv 0 0 0 1 1 1\n".to_vec(),
                &["materials and textures", "vertex colours"],
            ),
            ("a.obj", b"v 0 0 0 1\nvt 0 0\n".to_vec(), &[]),
            ("a.xyz", b"//X;Y;Z;Rf;Gf;Bf\n1;2;3;0;0;0\n".to_vec(), &["colours"]),
            ("a.xyz", b"1 2 3\n".to_vec(), &[]),
            ("a.pcd", b"VERSION .7\nFIELDS x y z rgb\nPOINTS 0\nDATA ascii\n".to_vec(), &["colours"]),
            ("a.gltf", textured.as_bytes().to_vec(), &["textures"]),
            ("a.glb", glb(textured), &["textures"]),
            ("a.glb", glb(coloured), &["vertex colours"]),
            ("a.glb", b"glTF".to_vec(), &[]),
            ("a.stl", b"solid".to_vec(), &[]),
        ] {
            assert_eq!(of(name, &bytes), expected, "{name}: {}", String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn kept_colours_are_not_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.obj");
        fs::write(&path, "mtllib a.mtl\nv 0 0 0 1 1 1\n").unwrap();
        fs::write(folder.path().join("a.mtl"), "newmtl a\n").unwrap();
        assert!(passed_over(&path, Colours::Keep).is_empty());
        assert_eq!(passed_over(&path, Colours::Drop).len(), 2);
    }

    #[test]
    fn a_sound_beside_the_frames_is_told_of() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["f_1.obj", "b.WAV", "a.mp3", "notes.txt"] {
            fs::write(folder.path().join(name), "v 0 0 0\n").unwrap();
        }
        assert_eq!(passed_over(&folder.path().join("f_1.obj"), Colours::Drop), ["sound (a.mp3)"]);
        assert_eq!(passed_over(&folder.path().join("gone.obj"), Colours::Drop), ["sound (a.mp3)"]);
    }
}
