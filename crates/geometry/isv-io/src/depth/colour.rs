//! Colour images beside depth images: which there are, and what their pixels mean.

use super::camera_json::lens_of;
use super::distortion::{Distortion, DistortionKeys};
use super::error::DepthFileError;
use super::json::{Number, WrittenPose};
use super::listing::list_files;
use super::times;
use super::{BadPose, DepthSequence, Optics, Poses, rig};
use crate::Colours;
use crate::image::{decode, read_file};
use crate::inside::inside;
use crate::text::parse_billionths;
use glam::DVec2;
use isv_volume::{CameraPose, ColourView, Image, Intrinsics, MAX_PIXELS};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folders of colour images that are looked for where `camera.json` names none.
const FOLDERS: [&str; 3] = ["color", "colour", "rgb"];

/// Extensions of the names of colour images, in lower case. KTX2 is for textures.
const EXTENSIONS: [&str; 4] = ["png", "jpg", "jpeg", "webp"];

/// Focal lengths (pixels) that tell the first Kinect's depth camera, and that of the colour camera beside it, in images of 640 x 480. Its
/// images are not registered where the depth camera has a lens of its own.
const KINECT_DEPTH: Range<f64> = 575.0..595.0;
const KINECT_COLOUR: f64 = 525.0;
const KINECT_SIZE: [u32; 2] = [640, 480];

/// Share by which the shape of an image may differ from its lens's: sizes of video are rounded to even numbers.
const SHAPE_TOLERANCE: f64 = 0.01;

/// The key that names colour images. Only `colour` is this format's own: what else stands under the other names, as other programs
/// write it, is passed over.
#[derive(Debug, Deserialize)]
pub(crate) struct ColourKey {
    colour: Option<Value>,
    color: Option<Value>,
    rgb: Option<Value>,
}

impl ColourKey {
    /// Whether there is any such key.
    pub(crate) fn is_given(&self) -> bool {
        self.colour.is_some() || self.color.is_some() || self.rgb.is_some()
    }

    /// The colour images that the key names, if they are kept. `needs_images`: whether nothing else names them.
    pub(crate) fn keys(
        self,
        keep: Colours,
        needs_images: bool,
        beside: &Beside,
    ) -> Result<Option<ColourKeys>, DepthFileError> {
        if keep == Colours::Drop {
            return Ok(None);
        }
        if let Some(own) = self.colour {
            let why = |_| beside.flaw("`colour` is neither a place of images nor a camera".to_owned());
            return serde_json::from_value(own).map(Some).map_err(why);
        }
        let is_usable = |keys: &ColourKeys| match keys {
            ColourKeys::Place(_) => needs_images,
            ColourKeys::Camera(camera) => !needs_images || camera.images.is_some(),
        };
        let others = [self.color, self.rgb].into_iter().flatten();
        Ok(others.filter_map(|other| serde_json::from_value(other).ok()).find(is_usable))
    }
}

/// Colour images of cameras: a place alone, or a camera of its own.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum ColourKeys {
    Place(ImagePlace),
    Camera(Box<ColourCameraKeys>),
}

/// Place of colour images.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum ImagePlace {
    /// A folder or a pattern.
    Folder(String),
    /// A file a frame; `null` for a frame without one.
    List(Vec<Option<String>>),
}

/// A colour camera with a lens or a place of its own.
#[derive(Debug, Deserialize)]
pub(crate) struct ColourCameraKeys {
    images: Option<ImagePlace>,
    width: Option<u32>,
    height: Option<u32>,
    fx: Option<Number>,
    fy: Option<Number>,
    cx: Option<Number>,
    cy: Option<Number>,
    /// From the colour camera to the depth camera.
    to_depth: Option<WrittenPose>,
    /// From the colour camera to the world, of a camera that stands still.
    camera_to_world: Option<WrittenPose>,
    #[serde(flatten)]
    distortion: DistortionKeys,
}

/// Colour images of one camera.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ColourCamera {
    pub(crate) intrinsics: Intrinsics,
    pub(crate) distortion: Option<Distortion>,
    pub(crate) poses: Poses,
    /// One a frame, where there is one.
    pub(crate) paths: Vec<Option<PathBuf>>,
    /// Number of the depth camera beside it.
    pub(crate) depth_camera: Option<usize>,
    /// Whether its calibration was assumed.
    pub(crate) is_rough: bool,
}

/// A depth camera, or what a rig says of the place of a colour camera without one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beside<'a> {
    /// The folder of the capture.
    pub(crate) folder: &'a Path,
    /// The file that describes it.
    pub(crate) file: &'a Path,
    /// Name of the camera, if cameras have names.
    pub(crate) name: Option<&'a str>,
    pub(crate) optics: &'a Optics,
    pub(crate) poses: &'a Poses,
    /// Depth images, and the number of their camera.
    pub(crate) depth: Option<(usize, &'a [PathBuf])>,
}

impl ColourKeys {
    /// The images that the keys name, beside a depth camera.
    pub(crate) fn open(self, beside: &Beside) -> Result<ColourCamera, DepthFileError> {
        match self {
            Self::Place(place) => Ok(ColourCamera::registered(beside, place.paths(beside)?)),
            Self::Camera(keys) => {
                let images = keys.images.as_ref();
                let images = images.ok_or_else(|| beside.flaw("`colour` names no images".to_owned()))?;
                keys.camera(beside, images.paths(beside)?)
            }
        }
    }
}

impl ColourCameraKeys {
    /// The camera of some images, one a frame.
    pub(crate) fn camera(
        &self,
        beside: &Beside,
        paths: Vec<Option<PathBuf>>,
    ) -> Result<ColourCamera, DepthFileError> {
        let (intrinsics, distortion) = self.lens(beside)?;
        let poses = self.poses(beside)?;
        let depth_camera = beside.depth.map(|(camera, _)| camera);
        Ok(ColourCamera { intrinsics, distortion, poses, paths, depth_camera, is_rough: false })
    }

    /// The lens of its own, or that of the depth camera.
    fn lens(&self, beside: &Beside) -> Result<(Intrinsics, Option<Distortion>), DepthFileError> {
        let numbers = [&self.fx, &self.fy, &self.cx, &self.cy];
        if numbers.iter().all(|number| number.is_none()) {
            if !matches!(self.distortion.check(), Ok(None)) {
                let why = "the colour camera has a distortion, so it needs fx, fy, cx and cy, too";
                return Err(beside.flaw(why.to_owned()));
            }
            return Ok((beside.optics.intrinsics, beside.optics.distortion));
        }
        let [Some(fx), Some(fy), Some(cx), Some(cy)] = numbers else {
            let why = "the colour camera has some of fx, fy, cx and cy: give all of them or none";
            return Err(beside.flaw(why.to_owned()));
        };
        let Intrinsics { width, height, .. } = beside.optics.intrinsics;
        let intrinsics = Intrinsics {
            width: self.width.unwrap_or(width),
            height: self.height.unwrap_or(height),
            focal: DVec2::new(fx.0, fy.0),
            principal: DVec2::new(cx.0, cy.0),
        };
        Ok((intrinsics, lens_of(intrinsics, &self.distortion, beside.file, beside.name)?))
    }

    /// The place of its own, or that of the depth camera.
    fn poses(&self, beside: &Beside) -> Result<Poses, DepthFileError> {
        let named = |cause| DepthFileError::Camera {
            path: beside.file.to_owned(),
            camera: beside.name.map(str::to_owned),
            cause,
        };
        match (&self.to_depth, &self.camera_to_world) {
            (None, None) => Ok(beside.poses.clone()),
            (None, Some(pose)) => pose.pose().map(Poses::Fixed).map_err(named),
            (Some(to_depth), None) => Ok(beside.poses.of(&to_depth.pose().map_err(named)?)),
            (Some(_), Some(_)) => {
                Err(beside.flaw("the colour camera has both to_depth and camera_to_world".to_owned()))
            }
        }
    }
}

impl Beside<'_> {
    /// Names what is wrong with the colour camera.
    fn flaw(&self, why: String) -> DepthFileError {
        let camera = self.name.map(str::to_owned);
        DepthFileError::Distortion { path: self.file.to_owned(), camera, why }
    }

    /// The path of a name that the capture gives.
    fn inside(&self, name: &str) -> Result<PathBuf, DepthFileError> {
        inside(self.folder, name)
            .ok_or_else(|| DepthFileError::Outside { path: self.file.to_owned(), name: name.to_owned() })
    }
}

impl ImagePlace {
    /// The image of each frame.
    fn paths(&self, beside: &Beside) -> Result<Vec<Option<PathBuf>>, DepthFileError> {
        match self {
            Self::Folder(name) => {
                let place = beside.inside(name)?;
                let images = list_files(&place, is_colour_image)?;
                if images.is_empty() {
                    return Err(DepthFileError::NoColourImages { path: place });
                }
                paired(&place, images, beside)
            }
            Self::List(names) => {
                let (found, expected) = (names.len(), beside.depth.map_or(names.len(), |(_, d)| d.len()));
                if found != expected {
                    return Err(count_error(beside.file.to_owned(), found, expected));
                }
                names.iter().map(|name| name.as_ref().map(|name| beside.inside(name)).transpose()).collect()
            }
        }
    }
}

/// Colour images without a partner each.
fn count_error(path: PathBuf, found: usize, expected: usize) -> DepthFileError {
    DepthFileError::Count {
        path,
        found,
        what: "colour images",
        expected,
        expected_what: "depth images, and their names do not say which belong together".to_owned(),
    }
}

/// The colour image of each depth image: the nearest in time, if their names are times. Otherwise images belong together in order if they
/// are equally many, else by the numbers in their names.
fn paired(
    place: &Path,
    images: Vec<PathBuf>,
    beside: &Beside,
) -> Result<Vec<Option<PathBuf>>, DepthFileError> {
    if let Some(paths) = beside.depth.and_then(|(_, depths)| nearest_in_time(&images, depths)) {
        return Ok(paths);
    }
    let Some((_, depths)) = beside.depth.filter(|(_, depths)| depths.len() != images.len()) else {
        return Ok(images.into_iter().map(Some).collect());
    };
    let found = images.len();
    let mut by_number: BTreeMap<u64, PathBuf> = BTreeMap::new();
    for path in images {
        if let Some(number) = number_in(&path) {
            by_number.insert(number, path);
        }
    }
    let paths: Vec<Option<PathBuf>> =
        depths.iter().map(|depth| by_number.remove(&number_in(depth)?)).collect();
    match paths.iter().any(Option::is_some) {
        true => Ok(paths),
        false => Err(count_error(place.to_owned(), found, depths.len())),
    }
}

/// The colour image nearest in time to each depth image, if names are seconds. It is at most half as far away as colour images are from
/// each other. `None` where no image is, and where equally many images are as far apart in order, all of them: clocks may differ.
fn nearest_in_time(images: &[PathBuf], depths: &[PathBuf]) -> Option<Vec<Option<PathBuf>>> {
    let (by_time, depths_by_time) = (in_time(images)?, in_time(depths)?);
    let stamps: Vec<i128> = by_time.iter().map(|(time, _)| *time).collect();
    let half_step_s = times::median_step(&stamps).map_or(0.0, |step| 0.5 * step);
    let limit = (half_step_s.max(times::COLOUR_LIMIT_S) * 1e9) as i128;
    if images.len() == depths.len() {
        let apart = || by_time.iter().zip(&depths_by_time).map(|(colour, depth)| colour.0 - depth.0);
        if apart().max()? - apart().min()? <= limit {
            return None;
        }
    }
    let nearest = |path| times::nearest(&by_time, time_in(path)?, limit).map(|(_, path)| (*path).clone());
    let paths: Vec<Option<PathBuf>> = depths.iter().map(|path| nearest(path)).collect();
    paths.iter().any(Option::is_some).then_some(paths)
}

/// Images by time, if their names are seconds, all of them different.
fn in_time(paths: &[PathBuf]) -> Option<Vec<(i128, &PathBuf)>> {
    let mut by_time: Vec<_> = paths.iter().map(|path| Some((time_in(path)?, path))).collect::<Option<_>>()?;
    by_time.sort_unstable();
    by_time.windows(2).all(|pair| pair[0].0 < pair[1].0).then_some(by_time)
}

/// The time that the name of a file is, in nanoseconds: seconds as digits, a point and digits.
fn time_in(path: &Path) -> Option<i128> {
    let stem = path.file_stem()?.to_str()?;
    let (whole, fraction) = stem.split_once('.')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(whole) && is_number(fraction)).then(|| parse_billionths(stem))?
}

/// The last number in the name of a file, its extension left out.
fn number_in(path: &Path) -> Option<u64> {
    let stem = path.file_stem()?.to_str()?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let digits = stem[..end].trim_end_matches(|c: char| c.is_ascii_digit()).len();
    stem[digits..end].parse().ok()
}

fn is_colour_image(path: &Path) -> bool {
    let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    extension.is_some_and(|extension| EXTENSIONS.iter().any(|known| extension == *known))
}

/// The colour images that lie beside a depth camera without being named: in one of [`FOLDERS`]. None if no folder has any image, or if
/// their number fits nothing. None either if the first cannot be read or has another shape than the camera.
pub(crate) fn unnamed(beside: &Beside) -> Option<ColourCamera> {
    let paths = FOLDERS.iter().find_map(|folder| {
        let place = beside.folder.join(folder);
        let images = list_files(&place, is_colour_image).ok().filter(|images| !images.is_empty())?;
        paired(&place, images, beside).ok()
    })?;
    let camera = ColourCamera::assumed(beside, paths);
    let first = camera.paths.iter().flatten().next()?;
    let image = read_file(first).and_then(|bytes| decode(&bytes)).ok()?;
    camera.lens_for(&image).map(|_| camera)
}

impl ColourCamera {
    /// Images that were registered to the depth camera: pixel by pixel they show the same.
    pub(crate) fn registered(beside: &Beside, paths: Vec<Option<PathBuf>>) -> Self {
        let Optics { intrinsics, distortion, .. } = *beside.optics;
        let depth_camera = beside.depth.map(|(camera, _)| camera);
        Self { intrinsics, distortion, poses: beside.poses.clone(), paths, depth_camera, is_rough: false }
    }

    /// Images of which nothing is known: registered, unless the depth camera is the first Kinect's with its own lens.
    fn assumed(beside: &Beside, paths: Vec<Option<PathBuf>>) -> Self {
        let mut camera = Self::registered(beside, paths);
        let Intrinsics { width, height, focal, .. } = camera.intrinsics;
        if [width, height] == KINECT_SIZE && focal.to_array().iter().all(|f| KINECT_DEPTH.contains(f)) {
            camera.intrinsics.focal = DVec2::splat(KINECT_COLOUR);
        }
        Self { is_rough: true, ..camera }
    }

    /// Reads the image of a frame, if there is one; one that nobody named, if it can be read. `pixels`: those of the frame so far.
    fn read(&self, frame: usize, pixels: &mut u64) -> Result<Option<ColourView>, DepthFileError> {
        match self.read_named(frame, pixels) {
            Err(DepthFileError::ColourImage { .. } | DepthFileError::ColourShape { .. }) if self.is_rough => {
                Ok(None)
            }
            read => read,
        }
    }

    fn read_named(&self, frame: usize, pixels: &mut u64) -> Result<Option<ColourView>, DepthFileError> {
        let Some(path) = &self.paths[frame] else { return Ok(None) };
        let pose = self.poses.at(frame)?;
        let flaw = |cause| DepthFileError::ColourImage { path: path.clone(), frame, cause };
        let image = read_file(path).and_then(|bytes| decode(&bytes)).map_err(flaw)?;
        *pixels += u64::from(image.width()) * u64::from(image.height());
        if *pixels > MAX_PIXELS {
            let (found, what) = (*pixels, "pixels in the colour images of a frame");
            return Err(DepthFileError::TooLarge { path: path.clone(), found, what, limit: MAX_PIXELS });
        }
        let lens = self.lens_for(&image).ok_or_else(|| DepthFileError::ColourShape {
            path: path.clone(),
            frame,
            found: [image.width(), image.height()],
            expected: [self.intrinsics.width, self.intrinsics.height],
        })?;
        let (image, shown) = match &self.distortion {
            Some(distortion) => distortion.undistort_colours(&lens, &image),
            None => (image, Vec::new()),
        };
        let view = ColourView::new(Arc::new(image), lens, pose).expect("the lens has the image's size");
        let view = view.with_shown(shown).with_depth_image(self.depth_camera);
        Ok(Some(view.with_rough_calibration(self.is_rough)))
    }

    /// The lens of images of another size and the same shape.
    fn lens_for(&self, image: &Image) -> Option<Intrinsics> {
        let lens = self.intrinsics;
        let scale = DVec2::new(
            f64::from(image.width()) / f64::from(lens.width),
            f64::from(image.height()) / f64::from(lens.height),
        );
        let is_alike = (scale.x / scale.y - 1.0).abs() <= SHAPE_TOLERANCE;
        is_alike.then(|| Intrinsics {
            width: image.width(),
            height: image.height(),
            focal: lens.focal * scale,
            // Whole numbers are the middles of pixels; what scales lies at their edges.
            principal: (lens.principal + 0.5) * scale - 0.5,
        })
    }
}

impl Poses {
    /// The pose of a frame.
    pub(crate) fn at(&self, frame: usize) -> Result<CameraPose, DepthFileError> {
        match self {
            Self::Fixed(pose) => Ok(*pose),
            Self::Moving { file, poses } => {
                poses[frame].as_ref().copied().map_err(|why| why.at_frame(file, frame))
            }
        }
    }

    /// Poses of a camera that stands beside the one that has these.
    fn of(&self, other: &CameraPose) -> Self {
        match self {
            Self::Fixed(pose) => Self::Fixed(pose.of(other)),
            Self::Moving { file, poses } => {
                let moved = |pose: &Result<CameraPose, BadPose>| pose.clone().map(|pose| pose.of(other));
                Self::Moving { file: file.clone(), poses: poses.iter().map(moved).collect() }
            }
        }
    }
}

/// Colour images of the calibrated cameras of a capture, frame after frame. Images are read when they are asked for.
///
/// ```no_run
/// let rig = isv_io::ColourSequence::open("stage/rig.json".as_ref())?;
/// for view in rig.read(0)? {
///     println!("{} x {}", view.image().width(), view.image().height());
/// }
/// # Ok::<(), isv_io::DepthFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ColourSequence {
    cameras: Vec<ColourCamera>,
    frames: usize,
}

impl ColourSequence {
    /// Opens the colour images of a folder with `rig.json`, `depth.txt` or `camera.json`, or of such a file. Cameras of a rig need no depth
    /// images.
    ///
    /// # Errors
    /// See [`DepthFileError`]; [`DepthFileError::NoColour`] if no camera has colour images whose calibration is known.
    pub fn open(path: &Path) -> Result<Self, DepthFileError> {
        let (folder, name) = match path.is_file() {
            true => (path.parent().unwrap_or(Path::new("")), path.file_name()),
            false => (path, None),
        };
        let is_rig = match name {
            Some(name) => name == super::RIG,
            None => folder.join(super::RIG).is_file(),
        };
        if name.is_some_and(|name| !is_rig && name != super::CAMERA && name != super::TUM) {
            return Err(DepthFileError::NoCalibration { folder: path.to_owned() });
        }
        let sequence = match is_rig {
            true => rig::open(folder, &folder.join(super::RIG), Colours::Keep)?,
            false => DepthSequence::open_with(folder, Colours::Keep)?,
        };
        match sequence.colours.iter().all(|camera| camera.is_rough) {
            true => Err(DepthFileError::NoColour { path: path.to_owned() }),
            false => Ok(Self { frames: sequence.selected.len(), cameras: sequence.colours }),
        }
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Number of cameras with colour images.
    #[must_use]
    pub fn cameras(&self) -> usize {
        self.cameras.len()
    }

    /// Reads the colour images of a frame. Cameras without an image of the frame are left out.
    ///
    /// # Errors
    /// See [`DepthFileError`].
    ///
    /// # Panics
    /// If there are not so many frames.
    pub fn read(&self, frame: usize) -> Result<Vec<ColourView>, DepthFileError> {
        assert!(frame < self.frames, "frame {frame} of {}", self.frames);
        read_views(&self.cameras, frame)
    }
}

/// Reads the colour images of a frame, those that there are.
pub(crate) fn read_views(cameras: &[ColourCamera], frame: usize) -> Result<Vec<ColourView>, DepthFileError> {
    let mut pixels = 0;
    cameras.iter().filter_map(|camera| camera.read(frame, &mut pixels).transpose()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_of_a_name_counts_frames() {
        for (name, expected) in [
            ("frame-000012.color.png", Some(12)),
            ("12.jpg", Some(12)),
            ("cam2_0007.jpg", Some(7)),
            ("a7b.jpeg2", Some(7)),
            ("a.png", None),
            ("99999999999999999999999.png", None),
        ] {
            assert_eq!(number_in(Path::new(name)), expected, "{name}");
        }
    }

    #[test]
    fn names_that_are_times_pair_the_nearest_images() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let pair = |colours: &[&str], depths: &[&str]| nearest_in_time(&paths(colours), &paths(depths));
        let names = |names: &[Option<&str>]| Some(names.iter().map(|name| name.map(PathBuf::from)).collect());
        // The last number is that of another second; images are dropped on both sides.
        let colours =
            ["100.190.jpg", "100.310.jpg", "100.410.jpg", "105.200.jpg", "105.310.jpg", "109.400.jpg"];
        let depths = ["100.200.png", "100.300.png", "100.400.png", "102.000.png", "105.201.png"];
        let expected = [Some(colours[0]), Some(colours[1]), Some(colours[2]), None, Some(colours[3])];
        assert_eq!(pair(&colours, &depths), names(&expected));
        // The colour camera is 30 ms late, at 10 images a second, and has one more image.
        let late = ["1.030.jpg", "1.130.jpg", "1.230.jpg", "1.330.jpg"];
        let expected = [Some(late[0]), Some(late[1]), Some(late[2])];
        assert_eq!(pair(&late, &["1.000.png", "1.100.png", "1.200.png"]), names(&expected));
        // A clock that is a second ahead, and names that are no times: in order.
        assert_eq!(pair(&["2.0.jpg", "2.5.jpg", "3.0.jpg"], &["1.0.png", "1.5.png", "2.0.png"]), None);
        assert_eq!(pair(&["1.1.jpg", "1.10.jpg", "1.2.jpg"], &["1.1.png", "1.10.png"]), None);
        // Other clocks and names that are no times say nothing.
        assert_eq!(pair(&["5.0.jpg", "5.1.jpg"], &["900.0.png", "900.1.png"]), None);
        assert_eq!(pair(&["1.jpg", "2.jpg"], &["1.png", "2.png"]), None);
        assert_eq!(pair(&["frame-000001.color.png"], &["frame-000001.depth.png"]), None);
    }
}
