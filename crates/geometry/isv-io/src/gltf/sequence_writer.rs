//! A sequence of meshes as one animated GLB file.

use super::encoding::GlbEncoding;
use super::write::{
    Document, FLOAT, ShownMesh, accessor, file_bytes, move_node, numbers, too_large, write_head,
};
use crate::{AtomicFile, WriteError};
use glam::DVec3;
use isv_volume::TriangleMesh;
use serde_json::json;
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek};
use std::path::{Path, PathBuf};

/// Most bytes of JSON that a frame takes in the end.
const JSON_BYTES_OF_FRAME: u64 = 3072;

/// Most bytes of JSON that each primitive of a frame takes, with its material.
const JSON_BYTES_OF_PIECE: u64 = 3072;

/// Scales between which nodes step: rows of x, y, z. A frame that starts the sequence is seen and then
/// hidden. One in the middle is hidden, seen and hidden. The last one is hidden, seen and still seen at the
/// end. All are runs of this table.
const SCALES: [f32; 5] = [0.0, 1.0, 0.0, 1.0, 1.0];

/// Writes meshes, whose triangles may differ from frame to frame, as one GLB file that plays them.
///
/// Each frame is a node with a mesh of its own. An animation of steps scales it to 1 while it is seen and to
/// 0 otherwise. Viewers need no extension for that (docs/design/014-animated-glb.md). Those that play no
/// animations show the first frame, and [`Animation`](crate::Animation) reads the frames back. Vertex
/// colours, materials and textures may differ from frame to frame; an image that frames share is written
/// once.
///
/// Memory is bounded by the largest frame, and about 1 KB for each frame. Bytes go to a nameless file beside
/// the output, and behind the JSON when its length is known. The file appears whole or not at all.
#[derive(Debug)]
pub struct GlbAnimationWriter {
    path: PathBuf,
    output: AtomicFile,
    document: Document<BufWriter<File>>,
    frames: Vec<Frame>,
    /// Translation of all frames.
    translation: DVec3,
}

/// A frame that was written.
#[derive(Clone, Debug)]
struct Frame {
    /// When it is shown, in seconds.
    start: f32,
    /// Mesh of the frame; none for a frame without triangles.
    mesh: Option<ShownMesh>,
}

impl GlbAnimationWriter {
    /// Starts a file to be known as `path`.
    ///
    /// # Errors
    /// [`WriteError`] as [`AtomicFile::create`].
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let output = AtomicFile::create(path)?;
        let spool = spool_for(path).map_err(|cause| WriteError::new(path, cause))?;
        let document = Document::new(BufWriter::new(spool), GlbEncoding::Plain);
        Ok(Self { path: path.to_owned(), output, document, frames: Vec::new(), translation: DVec3::ZERO })
    }

    /// Moves all frames by this much. Vertices stay exact, as they are relative to it.
    #[must_use]
    pub fn moved_by(self, translation: DVec3) -> Self {
        Self { translation, ..self }
    }

    /// Writes meshes in another encoding than plain.
    ///
    /// # Panics
    /// If there are frames already.
    #[must_use]
    pub fn with_encoding(mut self, encoding: GlbEncoding) -> Self {
        assert!(self.frames.is_empty(), "the encoding is that of all frames");
        self.document.encoding = encoding;
        self
    }

    /// Appends a frame that is shown from `start_s` on, in seconds, and until the next one is. Times and coordinates are rounded to
    /// `f32`, times up where the frame would be shown no later than the last. Normals are written when every vertex has a usable one. A
    /// mesh without triangles is a frame in which nothing is seen.
    ///
    /// # Errors
    /// [`WriteError`] if the disk is full, the time is negative or not finite, a coordinate is not finite, or
    /// the file would pass 4 GiB. GLB can hold no more. But for the first case the frames so far are whole
    /// and can be [finished](Self::finish).
    pub fn push(&mut self, start_s: f64, mesh: &TriangleMesh) -> Result<(), WriteError> {
        let start = self.time(start_s)?;
        let pieces = JSON_BYTES_OF_PIECE * Document::<BufWriter<File>>::most_pieces(mesh);
        let json = self.document.json_bytes() + JSON_BYTES_OF_FRAME * (self.frames.len() as u64 + 2) + pieces;
        let binary = self.document.binary_bytes + self.document.bytes_of_mesh(mesh);
        let pushed = if file_bytes(json, binary) > u32::MAX.into() {
            Err(too_large())
        } else {
            self.document.push_mesh(mesh)
        };
        let mesh = pushed.map_err(|cause| WriteError::new(&self.path, cause))?;
        self.frames.push(Frame { start, mesh });
        Ok(())
    }

    /// A time after the last frame's start.
    fn time(&self, seconds: f64) -> Result<f32, WriteError> {
        let least = self.frames.last().map_or(0.0, |frame| frame.start.next_up());
        let time = (seconds as f32).max(least);
        if seconds >= 0.0 && time.is_finite() {
            return Ok(time);
        }
        let message = format!("{seconds} s is no time of a frame");
        Err(WriteError::new(&self.path, io::Error::new(io::ErrorKind::InvalidInput, message)))
    }

    /// Writes the animation, whose last frame is shown until `end_s`, in seconds, and gives the file its name.
    ///
    /// # Errors
    /// [`WriteError`]; also if there are no frames, or for a time that [`Self::push`] would not take.
    pub fn finish(self, end_s: f64) -> Result<(), WriteError> {
        let end = self.time(end_s)?;
        let Self { path, mut output, mut document, frames, translation } = self;
        if frames.is_empty() {
            let cause = io::Error::new(io::ErrorKind::InvalidInput, "a sequence needs at least one frame");
            return Err(WriteError::new(&path, cause));
        }
        let assembled = push_animation(&mut document, &frames, end, translation)
            .and_then(|()| assemble(document, &mut output));
        assembled.map_err(|cause| WriteError::new(&path, cause))?;
        output.commit()
    }
}

/// File that no name leads to, so that nothing is left of it however this ends. It lies on the disk of the
/// output, as the folder for temporary files may be small. For a pipe or a device it lies in that folder.
fn spool_for(path: &Path) -> io::Result<File> {
    if fs::metadata(path).is_ok_and(|output| !output.is_file()) {
        return tempfile::tempfile();
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    tempfile::tempfile_in(folder.unwrap_or(Path::new(".")))
}

/// Adds a node, a channel and a sampler for each frame. The keys of a frame are its own time and those of its
/// neighbours. So all of them are runs of one list of times.
fn push_animation(
    document: &mut Document<BufWriter<File>>,
    frames: &[Frame],
    end: f32,
    translation: DVec3,
) -> io::Result<()> {
    let time = |key: usize| frames.get(key).map_or(end, |frame| frame.start);
    let bytes_of = |values: f32| values.to_le_bytes();
    let times = document.push_view((0..=frames.len()).map(time).map(bytes_of), None)?;
    let scales = document.push_view(SCALES.iter().flat_map(|s| [*s; 3]).map(bytes_of), None)?;
    let mut scale_accessors = [None; SCALES.len()];
    for (frame, Frame { mesh, .. }) in frames.iter().enumerate() {
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
        if mesh.is_some() {
            move_node(&mut node, translation);
        }
        let node = document.push_node(mesh.as_ref(), node);
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
        let mesh =
            TriangleMesh { vertices, normals: Vec::new(), triangles: vec![[0, 1, 2]], appearance: None };
        let mut writer = GlbAnimationWriter::create(&path).unwrap();
        writer.push(0.0, &mesh).unwrap();
        let written = writer.document.binary_bytes;
        writer.document.binary_bytes = u64::from(u32::MAX) - 1000;
        let error = writer.push(0.1, &mesh).unwrap_err();
        assert_eq!(error.cause.kind(), io::ErrorKind::FileTooLarge);
        assert!(error.to_string().contains("at most 4 GiB"), "{error}");
        writer.document.binary_bytes = written;
        writer.finish(0.1).unwrap();
        assert_eq!(Animation::open(&path, Unit::Metre).unwrap().frame_count(10.0), 1);
    }

    /// All that an index of the JSON leads to is there. The animations have frames of which none has a
    /// surface, some have and all have.
    #[test]
    fn what_is_named_is_there_whatever_frames_are_empty() {
        let folder = tempfile::tempdir().unwrap();
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let triangle =
            TriangleMesh { vertices, normals: Vec::new(), triangles: vec![[0, 1, 2]], appearance: None };
        let nothing = TriangleMesh::default();
        for (name, frames) in [
            ("none", [&nothing, &nothing, &nothing]),
            ("some", [&nothing, &triangle, &nothing]),
            ("all", [&triangle, &triangle, &triangle]),
        ] {
            let path = folder.path().join(format!("{name}.glb"));
            let mut writer = GlbAnimationWriter::create(&path).unwrap();
            (0..).zip(frames).for_each(|(second, mesh)| writer.push(f64::from(second), mesh).unwrap());
            writer.finish(3.0).unwrap();
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
        let writer = GlbAnimationWriter::create(&folder.path().join("film.glb")).unwrap();
        // Its JSON is the longest.
        let mut writer = writer.with_encoding(GlbEncoding::Meshopt);
        let vertices = vec![DVec3::splat(-1.234_567_8e-30); 3];
        let mesh = TriangleMesh {
            vertices,
            normals: vec![DVec3::X; 3],
            triangles: vec![[0, 1, 2]],
            appearance: None,
        };
        let time = |frame: u8| 1.234_567_8e30 * f64::from(frame);
        (0..50).for_each(|frame| writer.push(time(frame), &mesh).unwrap());
        push_animation(
            &mut writer.document,
            &writer.frames,
            time(50) as f32,
            DVec3::splat(-1.234_567_890_123_4e-30),
        )
        .unwrap();
        assert!((writer.document.json().len() as u64) < 50 * JSON_BYTES_OF_FRAME);
    }
}
