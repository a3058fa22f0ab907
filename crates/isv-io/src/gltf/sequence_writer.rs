//! A sequence of meshes as one animated GLB file.

use super::write::{Document, FLOAT, accessor, file_bytes, numbers, too_large, write_head};
use crate::{AtomicFile, WriteError};
use isv_volume::TriangleMesh;
use serde_json::json;
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek};
use std::path::{Path, PathBuf};

/// Most bytes of JSON that a frame takes in the end.
const JSON_BYTES_OF_FRAME: u64 = 2048;

/// The scales between which nodes step: rows of x, y, z. A frame that starts the sequence is seen and then hidden, one in
/// the middle hidden, seen and hidden, the last one hidden, seen and still seen at the end. All are runs of this table.
const SCALES: [f32; 5] = [0.0, 1.0, 0.0, 1.0, 1.0];

/// Writes meshes, whose triangles may differ from frame to frame, as one GLB file that plays them.
///
/// Each frame is a node with a mesh of its own; an animation of steps scales it to 1 while it is seen and to 0 otherwise.
/// Viewers need no extension for that (docs/design/014-animated-glb.md), those that play no animations show the first frame,
/// and [`Animation`](crate::Animation) reads the frames back.
///
/// Memory is bounded by the largest frame, and about 1 KB for each frame: bytes go to a nameless file beside the output, and
/// behind the JSON when its length is known. The file appears whole or not at all.
#[derive(Debug)]
pub struct GlbAnimationWriter {
    path: PathBuf,
    output: AtomicFile,
    document: Document<BufWriter<File>>,
    /// The mesh of each frame; none for a frame without triangles.
    frames: Vec<Option<usize>>,
    fps: f64,
}

impl GlbAnimationWriter {
    /// Starts a file to be known as `path`, of `fps` frames a second.
    ///
    /// # Errors
    /// [`WriteError`] as [`AtomicFile::create`], or if `fps` is not a positive number.
    pub fn create(path: &Path, fps: f64) -> Result<Self, WriteError> {
        let named = |cause| WriteError::new(path, cause);
        if !(fps.is_finite() && fps > 0.0) {
            let message = format!("{fps} frames a second is not a positive number");
            return Err(named(io::Error::new(io::ErrorKind::InvalidInput, message)));
        }
        let output = AtomicFile::create(path)?;
        let spool = spool_for(path).map_err(named)?;
        let document = Document::new(BufWriter::new(spool));
        Ok(Self { path: path.to_owned(), output, document, frames: Vec::new(), fps })
    }

    /// Appends a frame. Coordinates are rounded to `f32`; normals are written when every vertex has a usable one. A mesh without
    /// triangles is a frame in which nothing is seen.
    ///
    /// # Errors
    /// [`WriteError`] if the disk is full, a coordinate is not finite, or the file would pass the 4 GiB that GLB can hold. In the
    /// last two cases the frames so far are whole and can be [finished](Self::finish).
    pub fn push(&mut self, mesh: &TriangleMesh) -> Result<(), WriteError> {
        let json = self.document.json_bytes() + JSON_BYTES_OF_FRAME * (self.frames.len() as u64 + 2);
        let binary = self.document.binary_bytes + Document::<File>::bytes_of_mesh(mesh);
        let pushed = if file_bytes(json, binary) > u32::MAX.into() {
            Err(too_large())
        } else {
            self.document.push_mesh(mesh)
        };
        let mesh = pushed.map_err(|cause| WriteError::new(&self.path, cause))?;
        self.frames.push(mesh);
        Ok(())
    }

    /// Writes the animation and gives the file its name.
    ///
    /// # Errors
    /// [`WriteError`]; also if there are no frames.
    pub fn finish(self) -> Result<(), WriteError> {
        let Self { path, mut output, mut document, frames, fps } = self;
        if frames.is_empty() {
            let cause = io::Error::new(io::ErrorKind::InvalidInput, "a sequence needs at least one frame");
            return Err(WriteError::new(&path, cause));
        }
        let assembled =
            push_animation(&mut document, &frames, fps).and_then(|()| assemble(document, &mut output));
        assembled.map_err(|cause| WriteError::new(&path, cause))?;
        output.commit()
    }
}

/// A file that no name leads to, so that nothing is left of it however this ends. It lies on the disk of the output, as the
/// folder for temporary files may be small; unless the output is a pipe or a device.
fn spool_for(path: &Path) -> io::Result<File> {
    if fs::metadata(path).is_ok_and(|output| !output.is_file()) {
        return tempfile::tempfile();
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    tempfile::tempfile_in(folder.unwrap_or(Path::new(".")))
}

/// Adds a node, a channel and a sampler for each frame. The keys of a frame are its own time and those of its neighbours, so
/// that all of them are runs of one list of times.
fn push_animation(
    document: &mut Document<BufWriter<File>>,
    frames: &[Option<usize>],
    fps: f64,
) -> io::Result<()> {
    let time = |frame: usize| (frame as f64 / fps) as f32;
    let bytes_of = |values: f32| values.to_le_bytes();
    let times = document.push_view((0..=frames.len()).map(time).map(bytes_of), None)?;
    let scales = document.push_view(SCALES.iter().flat_map(|s| [*s; 3]).map(bytes_of), None)?;
    let mut scale_accessors = [None; SCALES.len()];
    for (frame, mesh) in frames.iter().enumerate() {
        let last = frame + 1 == frames.len();
        let first_key = frame.saturating_sub(1);
        let keys = frame + 2 - first_key;
        let mut input = accessor(times, FLOAT, "SCALAR", keys);
        input["byteOffset"] = (4 * first_key).into();
        input["min"] = numbers(&[time(first_key)]);
        input["max"] = numbers(&[time(frame + 1)]);
        let input = document.push_accessor(&input);
        let row = match (frame == 0, last) {
            (false, false) => 0,
            (true, false) => 1,
            (false, true) => 2,
            (true, true) => 3,
        };
        let output = *scale_accessors[row].get_or_insert_with(|| {
            let mut output = accessor(scales, FLOAT, "VEC3", keys);
            output["byteOffset"] = (12 * row).into();
            document.push_accessor(&output)
        });
        let scale = u8::from(frame == 0);
        let mut node = json!({ "name": format!("frame_{frame}"), "scale": [scale, scale, scale] });
        if let Some(mesh) = mesh {
            node["mesh"] = (*mesh).into();
        }
        let node = document.nodes.push(&node);
        let sampler = json!({ "input": input, "output": output, "interpolation": "STEP" });
        let sampler = document.samplers.push(&sampler);
        let target = json!({ "node": node, "path": "scale" });
        document.channels.push(&json!({ "sampler": sampler, "target": target }));
    }
    Ok(())
}

/// Writes the file: what comes before the binary chunk, then the chunk as it was spooled.
fn assemble(document: Document<BufWriter<File>>, output: &mut AtomicFile) -> io::Result<()> {
    write_head(output, &document.json(), document.binary_bytes)?;
    let mut spool = document.binary.into_inner().map_err(io::IntoInnerError::into_error)?;
    spool.rewind()?;
    let copied = io::copy(&mut spool, output)?;
    if copied != document.binary_bytes {
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "its temporary file was cut"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Animation, Unit};
    use glam::DVec3;

    #[test]
    fn a_frame_that_would_pass_four_gibibytes_is_refused_and_the_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.glb");
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let mesh = TriangleMesh { vertices, normals: Vec::new(), triangles: vec![[0, 1, 2]] };
        let mut writer = GlbAnimationWriter::create(&path, 30.0).unwrap();
        writer.push(&mesh).unwrap();
        let written = writer.document.binary_bytes;
        writer.document.binary_bytes = u64::from(u32::MAX) - 1000;
        let error = writer.push(&mesh).unwrap_err();
        assert_eq!(error.cause.kind(), io::ErrorKind::FileTooLarge);
        assert!(error.to_string().contains("at most 4 GiB"), "{error}");
        writer.document.binary_bytes = written;
        writer.finish().unwrap();
        assert_eq!(Animation::open(&path, Unit::Metre).unwrap().frame_count(30.0), 1);
    }

    /// All that an index of the JSON leads to is there, in an animation of frames of which none has a surface, some have and all have.
    #[test]
    fn what_is_named_is_there_whatever_frames_are_empty() {
        let folder = tempfile::tempdir().unwrap();
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let triangle = TriangleMesh { vertices, normals: Vec::new(), triangles: vec![[0, 1, 2]] };
        let nothing = TriangleMesh::default();
        for (name, frames) in [
            ("none", [&nothing, &nothing, &nothing]),
            ("some", [&nothing, &triangle, &nothing]),
            ("all", [&triangle, &triangle, &triangle]),
        ] {
            let path = folder.path().join(format!("{name}.glb"));
            let mut writer = GlbAnimationWriter::create(&path, 30.0).unwrap();
            frames.iter().for_each(|mesh| writer.push(mesh).unwrap());
            writer.finish().unwrap();
            let bytes = fs::read(&path).unwrap();
            let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
            let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
            let count = |list: &str| json[list].as_array().map_or(0, Vec::len) as u64;
            let is_there = |list: &str, index: &serde_json::Value| index.as_u64().unwrap() < count(list);
            for sampler in json["animations"][0]["samplers"].as_array().unwrap() {
                assert!(
                    is_there("accessors", &sampler["input"]) && is_there("accessors", &sampler["output"]),
                    "{name}"
                );
            }
            for accessor in json["accessors"].as_array().unwrap() {
                assert!(is_there("bufferViews", &accessor["bufferView"]), "{name}");
            }
            for view in json["bufferViews"].as_array().unwrap() {
                let end = view["byteOffset"].as_u64().unwrap_or(0) + view["byteLength"].as_u64().unwrap();
                assert!(end <= json["buffers"][0]["byteLength"].as_u64().unwrap(), "{name}");
            }
            assert_eq!(json.get("meshes").is_some(), name != "none");
        }
    }

    #[test]
    fn the_reserve_for_a_frame_holds_what_it_takes() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = GlbAnimationWriter::create(&folder.path().join("film.glb"), 1e-30).unwrap();
        let vertices = vec![DVec3::splat(-1.234_567_8e-30); 3];
        let mesh = TriangleMesh { vertices, normals: vec![DVec3::X; 3], triangles: vec![[0, 1, 2]] };
        (0..50).for_each(|_| writer.push(&mesh).unwrap());
        push_animation(&mut writer.document, &writer.frames, writer.fps).unwrap();
        assert!((writer.document.json().len() as u64) < 50 * JSON_BYTES_OF_FRAME);
    }
}
