//! A glTF file as a mesh over time.

use super::accessor::Accessors;
use super::appearance::Side;
use super::buffers::Buffers;
use super::container::{Container, MAGIC};
use super::fault::GltfFault;
use super::limit::Limit;
use super::looks::{DecodedImages, Looks};
use super::scene::{Channel, Scene};
use super::schema::{Document, parse_json};
use crate::error::Flaw;
use crate::text;
use crate::{Colours, Geometry, InvalidPoints, ReadError, ReadOptions, Unit};
use isv_volume::{Appearance, PointCloud, TriangleMesh};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Longest animation, in seconds: a day. Keyframes beyond it are damage, and would be sampled for ever.
pub const MAX_DURATION_S: f64 = 86_400.0;

/// The triangles of a glTF file's default scene, at rest or moving.
///
/// Nodes that move, skins (any number of sets of four joints) and morph targets are played back, by linear, stepped and
/// cubic keyframes. A node scaled to zero is hidden. Lines are left out, and points beside triangles; normals are not kept. Buffers of a
/// `.gltf` must lie in its folder or below. Everything is held in memory, which is bounded by the size of the file and its
/// buffers.
///
/// Colours are read where the options keep them: [`Self::open_with`]. Images are decoded for the poses that show them. Poses in a row
/// that show the same parts share one [`Appearance`].
///
/// ```no_run
/// # fn main() -> Result<(), isv_io::ReadError> {
/// let animation = isv_io::Animation::open("walk.glb".as_ref(), isv_io::Unit::Metre)?;
/// for frame in 0..animation.frame_count(30.0) {
///     let mesh = animation.mesh_at(frame as f64 / 30.0)?;
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Animation {
    path: PathBuf,
    options: ReadOptions,
    scene: Scene,
    clips: Vec<Clip>,
    /// The clip that plays.
    playing: usize,
    /// Colours of the pose asked for last.
    look: Mutex<Option<Look>>,
}

/// The colours of all poses that show the same sides of the same parts.
#[derive(Debug)]
struct Look {
    sides: Vec<Side>,
    appearance: Option<Arc<Appearance>>,
    images: DecodedImages,
}

/// One of the animations of a file.
#[derive(Debug)]
struct Clip {
    name: String,
    channels: Vec<Channel>,
}

impl Animation {
    /// Reads a `.glb` or `.gltf` file and the buffers that it names; coordinates in `unit` (glTF itself asks for metres). Its
    /// first animation is the one that plays.
    ///
    /// # Errors
    /// [`ReadError::Io`], and [`ReadError::Malformed`] with a [`GltfFault`].
    pub fn open(path: &Path, unit: Unit) -> Result<Self, ReadError> {
        Self::open_with(path, &ReadOptions::new(unit))
    }

    /// Reads a file as [`Self::open`] does, with its colours if the options ask for them.
    ///
    /// # Errors
    /// Errors of [`Self::open`]; [`Malformation::Image`](crate::Malformation::Image) names an image whose address leads nowhere.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let bytes = crate::regular_file::read(path)
            .map_err(|cause| ReadError::Io { path: path.to_owned(), cause })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse_in(Some(folder), path, &bytes, options)
    }

    /// Opens an animation as [`Self::open`] does, from bytes; `path` names the file in errors. Buffers in
    /// other files are refused: nothing is read from the disk.
    ///
    /// # Errors
    /// As [`Self::open`], without [`ReadError::Io`].
    pub fn parse(path: &Path, bytes: &[u8], unit: Unit) -> Result<Self, ReadError> {
        Self::parse_with(path, bytes, &ReadOptions::new(unit))
    }

    /// Reads bytes as [`Self::parse`] does, with their colours if the options ask for them. Images in other files are refused, too.
    ///
    /// # Errors
    /// Errors of [`Self::open_with`], without [`ReadError::Io`].
    pub fn parse_with(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Self, ReadError> {
        Self::parse_in(None, path, bytes, options)
    }

    /// Reads bytes, with buffers and images in the files of a folder if there is one.
    fn parse_in(
        folder: Option<&Path>,
        path: &Path,
        bytes: &[u8],
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let (scene, clips) = load(folder, bytes, options.colours).map_err(|flaw| flaw.in_file(path))?;
        let (path, options, look) = (path.to_owned(), *options, Mutex::new(None));
        Ok(Self { path, options, scene, clips, playing: 0, look })
    }

    /// Says what becomes of points that are nowhere.
    #[must_use]
    pub fn with_invalid_points(self, invalid: InvalidPoints) -> Self {
        Self { options: self.options.with_invalid_points(invalid), ..self }
    }

    /// The names of the file's animations; many have none.
    pub fn names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.clips.iter().map(|clip| clip.name.as_str())
    }

    /// Chooses the animation that plays, counted from 0.
    ///
    /// # Errors
    /// [`GltfFault::NoSuchAnimation`].
    pub fn select(&mut self, index: usize) -> Result<(), ReadError> {
        let count = self.clips.len();
        if index >= count {
            let fault = GltfFault::NoSuchAnimation { index, count };
            return Err(Flaw::in_object("animation", index, fault).in_file(&self.path));
        }
        self.playing = index;
        Ok(())
    }

    /// Whether time makes a difference.
    #[must_use]
    pub fn is_animated(&self) -> bool {
        self.duration_s() > 0.0
    }

    /// Time of the last keyframe that moves a triangle, in seconds; at most [`MAX_DURATION_S`], 0 at rest.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.channels().iter().fold(0.0, |end, channel| channel.curve.end_s().max(end))
    }

    /// Time of the first keyframe that moves a triangle, in seconds; 0 at rest. All is still before it.
    #[must_use]
    pub fn start_s(&self) -> f64 {
        self.channels().iter().map(|channel| channel.curve.start_s()).reduce(f64::min).unwrap_or(0.0)
    }

    /// Number of frames at `fps` frames a second: those that start before the end, or one if nothing moves.
    /// The first is at time 0, frame `i` at `i / fps`. The pose of the very end is not among them, even if it
    /// falls on a frame. Where an animation is made to repeat it is the first again.
    ///
    /// # Panics
    /// If `fps` is not a positive number.
    #[must_use]
    pub fn frame_count(&self, fps: f64) -> u64 {
        assert!(fps > 0.0 && fps.is_finite(), "frames a second are a positive number");
        // Times are stored as f32: an end at a frame may be rounded to just behind it.
        const ROUNDING: f64 = 1e-6;
        ((self.duration_s() * fps * (1.0 - ROUNDING)).ceil() as u64).max(1)
    }

    /// Triangles at an instant, in metres, or points if the file has nothing else. Before the first and after
    /// the last keyframe they are those of the keyframe. Empty while nothing is to be seen.
    ///
    /// # Errors
    /// [`ReadError::Mesh`] or [`ReadError::Points`] if a vertex is nowhere, [`ReadError::OutOfRange`].
    /// [`Malformation::Image`](crate::Malformation::Image) names an image that cannot be read.
    pub fn geometry_at(&self, seconds: f64) -> Result<Geometry, ReadError> {
        let mut pose = self.scene.pose(self.channels(), seconds);
        let geometry = match self.scene.is_points() {
            true => Geometry::Points(PointCloud {
                positions: pose.points,
                colours: pose.point_colours,
                ..PointCloud::default()
            }),
            false => {
                if self.options.colours == Colours::Keep && !pose.mesh.triangles.is_empty() {
                    pose.mesh.appearance = self.appearance(pose.sides)?;
                }
                Geometry::Mesh(pose.mesh)
            }
        };
        geometry.checked(&self.path, &self.options)
    }

    /// The colours of a pose with these sides: those of the pose before, if it had the same.
    fn appearance(&self, sides: Vec<Side>) -> Result<Option<Arc<Appearance>>, ReadError> {
        // Nothing is half done where a thread panics: a look is put in whole.
        let last = || self.look.lock().unwrap_or_else(PoisonError::into_inner);
        let known = match &*last() {
            Some(look) if look.sides == sides => return Ok(look.appearance.clone()),
            Some(look) => look.images.clone(),
            None => DecodedImages::new(),
        };
        // Other threads go on while images are decoded.
        let shown = self.scene.appearance(&sides, &known).map_err(|flaw| flaw.in_file(&self.path))?;
        let (appearance, images) = shown.map(|(appearance, images)| (Arc::new(appearance), images)).unzip();
        let images = images.unwrap_or_default();
        *last() = Some(Look { sides, appearance: appearance.clone(), images });
        Ok(appearance)
    }

    /// The mesh at an instant, in metres; before the first and after the last keyframe that of the keyframe. Empty while nothing is to be
    /// seen.
    ///
    /// # Errors
    /// As [`Self::geometry_at`], and [`ReadError::NotAMesh`].
    pub fn mesh_at(&self, seconds: f64) -> Result<TriangleMesh, ReadError> {
        match self.geometry_at(seconds)? {
            Geometry::Mesh(mesh) => Ok(mesh),
            Geometry::Points(_) => Err(ReadError::NotAMesh { path: self.path.clone() }),
        }
    }

    fn channels(&self) -> &[Channel] {
        self.clips.get(self.playing).map_or(&[], |clip| &clip.channels)
    }
}

fn load(folder: Option<&Path>, bytes: &[u8], colours: Colours) -> Result<(Scene, Vec<Clip>), Flaw> {
    let text = if bytes.starts_with(MAGIC) { Cow::Borrowed(bytes) } else { text::decode(bytes) };
    let bytes = &*text;
    let container = Container::parse(bytes)?;
    let document = Document::parse(container.json, container.json_offset)?;
    let buffers = Buffers::load(&document.buffers, folder, container.binary)?;
    let keeps_colours = colours == Colours::Keep;
    let limit = Limit::for_bytes(bytes.len().saturating_add(buffers.total_bytes()), keeps_colours);
    let accessors = Accessors::new(&document, buffers, limit);
    let looks = match keeps_colours {
        true => Some(Looks::new(parse_json(container.json, container.json_offset)?, folder)),
        false => None,
    };
    let scene = Scene::load(&document, &accessors, looks)?;
    let mut clips = Vec::new();
    for (index, animation) in document.animations.iter().enumerate() {
        let channels = scene.load_channels(&accessors, animation, index)?;
        clips.push(Clip { name: animation.name.clone(), channels });
    }
    Ok((scene, clips))
}
