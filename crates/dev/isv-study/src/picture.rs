//! Pictures of one frame as each codec gives it back, beside what went in.

use crate::cubes::cubes;
use crate::{Alike, Metric, Peers, Record, StudyError};
use glam::DVec3;
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_render::{Background, Camera, ErrorScale, Picture, Style, colour_bar, render, render_errors};
use isv_spatial::Bvh;
use std::borrow::Cow;

/// Width and height of a picture of the whole, in pixels.
const WHOLE: [usize; 2] = [360, 480];

/// Width and height of a close-up.
const CLOSE_UP: [usize; 2] = [480, 480];

/// Part of the take's height that the close-up shows, from the top: of a person, head and shoulders.
const CLOSE_UP_SHARE: f64 = 0.22;

/// Direction of the camera: degrees about the up axis, and above the horizon.
const VIEW: [f64; 2] = [20.0, 5.0];

/// Width of the legend in pixels.
const LEGEND_WIDTH: usize = 480;

/// A codec's picture frame, drawn.
#[derive(Clone, Debug)]
pub struct CodecPicture {
    /// Name of the codec; none for what went in.
    pub codec: Option<String>,
    /// Under the pictures.
    pub caption: String,
    /// All of it.
    pub whole: View,
    /// Top of the mesh.
    pub close_up: View,
}

/// A mesh through one camera, as PNG files.
#[derive(Clone, Debug)]
pub struct View {
    /// Coloured by normal.
    pub normals: Vec<u8>,
    /// Coloured by distance from what went in; none for what went in.
    pub errors: Option<Vec<u8>>,
}

/// All pictures of a study.
#[derive(Clone, Debug)]
pub struct CodecPictures {
    /// What went in first, then each codec.
    pub codecs: Vec<CodecPicture>,
    /// The colours of errors and what they mean, as a PNG file.
    pub legend: Vec<u8>,
    /// Number of the frame in the take.
    pub frame: usize,
    /// What the codecs' points are alike in.
    pub alike: Alike,
    /// The level that they are near to, with its unit.
    pub level: String,
}

impl CodecPictures {
    /// Draws a frame as it was and as each codec gives it back, all through one camera. `decoded`: a frame of each of the peers, in
    /// order. The scale of errors ends at `range_m` metres.
    ///
    /// # Errors
    /// Pictures that cannot be made into files.
    pub fn new(
        original: &TriangleMesh,
        peers: &Peers,
        decoded: &[Geometry],
        range_m: f64,
        frame: usize,
    ) -> Result<Self, StudyError> {
        let bounds = original.bounds().unwrap_or_default();
        let view = |bounds, size| Camera::fitting(bounds, size).from_direction(VIEW[0], VIEW[1]);
        let setup = PictureSetup {
            whole: view(bounds, WHOLE),
            close_up: view(crop(original, top_of(bounds)), CLOSE_UP),
            scale: ErrorScale::new(range_m)
                .ok_or_else(|| StudyError::Chart("no range of errors".to_owned()))?,
        };
        let mut codecs = vec![setup.original(original)?];
        // A decoded frame was compared with the original, which therefore has faces.
        let surface = (!decoded.is_empty()).then(|| Bvh::new(original));
        for ((record, shape), surface) in peers.records.iter().zip(decoded).zip(surface.iter().cycle()) {
            let mesh = match shape {
                Geometry::Mesh(mesh) => Cow::Borrowed(mesh),
                Geometry::Points(points) => {
                    Cow::Owned(cubes(points, record.point_step_m.unwrap_or_default()))
                }
            };
            codecs.push(setup.decoded(record, &mesh, surface)?);
        }
        let legend = png(&colour_bar(&setup.scale, LEGEND_WIDTH, Background::Light))?;
        Ok(Self { codecs, legend, frame, alike: peers.alike, level: peers.level_text() })
    }
}

/// The top of a box: of a person, head and shoulders.
pub(crate) fn top_of((low, high): Bounds) -> Bounds {
    let from_y = high.y - CLOSE_UP_SHARE * (high.y - low.y);
    (DVec3 { y: from_y, ..low }, high)
}

/// The box around the part of a mesh that lies in another box.
pub(crate) fn crop(mesh: &TriangleMesh, within: Bounds) -> Bounds {
    let inside = mesh.vertices.iter().filter(|v| v.cmpge(within.0).all() && v.cmple(within.1).all());
    inside
        .fold(None, |bounds: Option<Bounds>, v| {
            Some(bounds.map_or((*v, *v), |(low, high)| (low.min(*v), high.max(*v))))
        })
        .unwrap_or(within)
}

/// Smallest and largest corner, in metres.
pub(crate) type Bounds = (DVec3, DVec3);

/// The cameras, and the colours of errors.
struct PictureSetup {
    whole: Camera,
    close_up: Camera,
    scale: ErrorScale,
}

impl PictureSetup {
    fn original(&self, mesh: &TriangleMesh) -> Result<CodecPicture, StudyError> {
        Ok(CodecPicture {
            codec: None,
            caption: format!("as captured, {} faces", mesh.triangles.len()),
            whole: self.view(mesh, None, &self.whole)?,
            close_up: self.view(mesh, None, &self.close_up)?,
        })
    }

    fn decoded(
        &self,
        record: &Record,
        mesh: &TriangleMesh,
        original: &Bvh,
    ) -> Result<CodecPicture, StudyError> {
        let both = record.value(Metric::PointToSurface).map(|mm| format!(", {mm:.2} mm"));
        let one = || {
            Some(format!(", {:.2} mm from its points to the source", record.value(Metric::DecodedToSource)?))
        };
        let distance = both.or_else(one).unwrap_or_default();
        Ok(CodecPicture {
            codec: Some(record.codec.clone()),
            caption: format!("{}: {:.2} Mbps{distance}", record.point, record.geometry_mbps()),
            whole: self.view(mesh, Some(original), &self.whole)?,
            close_up: self.view(mesh, Some(original), &self.close_up)?,
        })
    }

    fn view(&self, mesh: &TriangleMesh, original: Option<&Bvh>, camera: &Camera) -> Result<View, StudyError> {
        let style = Style::default();
        let errors = original.map(|original| {
            png(&render_errors(mesh, camera, &style, &self.scale, |point| original.distance(point)).picture)
        });
        Ok(View { normals: png(&render(mesh, camera, &style))?, errors: errors.transpose()? })
    }
}

/// A picture as a PNG file.
pub(crate) fn png(picture: &Picture) -> Result<Vec<u8>, StudyError> {
    let mut bytes = Vec::new();
    picture.write_png(&mut bytes).map_err(|error| StudyError::Chart(error.to_string()))?;
    Ok(bytes)
}
