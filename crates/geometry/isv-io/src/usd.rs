//! Universal Scene Description: a mesh over time, as text (`.usda`).

use crate::own::COMMENT;
use crate::{AtomicFile, WriteError};
use glam::DVec3;
use isv_volume::{TriangleMesh, linear_from_srgb};
use openusd::gf::{Vec3d, Vec3f};
use openusd::sdf::{ChildrenKey, Data, FieldKey, Path as PrimPath, SpecType, Specifier, Value, Variability};
use openusd::tf::Token;
use openusd::usda::TextWriter;
use std::io;
use std::path::{Path, PathBuf};

/// Root prim, which others refer to.
const ROOT: &str = "/take";
/// The mesh below it.
const MESH: &str = "/take/surface";

/// What a USD file says of all its frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsdStage {
    /// Time codes a second. Frames at this rate have whole time codes.
    pub frames_per_second: f64,
    /// Unit of coordinates in metres: `metersPerUnit`.
    pub metres_per_unit: f64,
    /// Whether Z points up, not Y: `upAxis`. USD has no other axes.
    pub z_up: bool,
    /// Translation of all frames, in double precision.
    pub translation: DVec3,
}

impl UsdStage {
    /// The time code of a time in seconds. Times are sums of nanoseconds: what is nearly a whole time code is one.
    fn time_code(&self, seconds: f64) -> f64 {
        (seconds * self.frames_per_second * 1e6).round() / 1e6
    }
}

/// Writes meshes, whose triangles may differ from frame to frame, as one USD file that plays them.
///
/// A prim of type `Mesh` has a time sample a frame of its points, faces, normals, extent and, as linear light, `displayColor`. A single frame
/// has default values and no time samples. The mesh is no subdivision surface, and it is seen from both sides. Materials and textures are
/// not written.
///
/// All frames are held in memory until the end, up to a limit. The file appears whole or not at all.
#[derive(Debug)]
pub struct UsdWriter {
    path: PathBuf,
    output: AtomicFile,
    stage: UsdStage,
    frames: Vec<Frame>,
    /// Bytes of all frames.
    held: u64,
    limit: u64,
}

/// The values of a frame.
#[derive(Debug)]
struct Frame {
    time_code: f64,
    points: Vec<Vec3f>,
    normals: Vec<Vec3f>,
    colours: Vec<Vec3f>,
    indices: Vec<i32>,
}

impl UsdWriter {
    /// Starts a file to be known as `path`. `limit`: bytes that the frames may take together.
    ///
    /// # Errors
    /// [`WriteError`] as [`AtomicFile::create`].
    pub fn create(path: &Path, stage: UsdStage, limit: u64) -> Result<Self, WriteError> {
        let output = AtomicFile::create(path)?;
        Ok(Self { path: path.to_owned(), output, stage, frames: Vec::new(), held: 0, limit })
    }

    /// Appends a frame that is shown from `start_s` on, in seconds. Coordinates are rounded to `f32`.
    ///
    /// # Errors
    /// [`WriteError`] if a time does not follow the last one, a coordinate is not finite, an index does not fit, or the frames take more
    /// memory than the limit.
    pub fn push(&mut self, start_s: f64, mesh: &TriangleMesh) -> Result<(), WriteError> {
        let frame = self.frame(start_s, mesh).map_err(|cause| WriteError::new(&self.path, cause))?;
        self.frames.push(frame);
        Ok(())
    }

    fn frame(&mut self, start_s: f64, mesh: &TriangleMesh) -> io::Result<Frame> {
        let time_code = self.stage.time_code(start_s);
        let follows = self.frames.last().is_none_or(|last| last.time_code < time_code);
        if !time_code.is_finite() || !follows {
            return Err(invalid(format!("{start_s} s is no time of a frame")));
        }
        let colours = mesh.appearance.as_ref().map_or(&[][..], |appearance| &appearance.vertex_colours);
        let vectors = (mesh.vertices.len() + mesh.normals.len() + colours.len()) as u64;
        let bytes = 12 * vectors + (12 + 12) * mesh.triangles.len() as u64;
        self.held = self.held.saturating_add(bytes);
        if self.held > self.limit {
            let message = format!(
                "a USD file is put together in memory, and the frames up to {} take more than {} MiB",
                self.frames.len(),
                self.limit >> 20
            );
            return Err(io::Error::new(io::ErrorKind::OutOfMemory, message));
        }
        let points: Vec<Vec3f> = mesh.vertices.iter().map(|vertex| vector(*vertex)).collect();
        if points.iter().any(|p| !(p.x.is_finite() && p.y.is_finite() && p.z.is_finite())) {
            return Err(invalid("a vertex is not finite".to_owned()));
        }
        let index =
            |vertex: &u32| i32::try_from(*vertex).map_err(|_| invalid("too many vertices".to_owned()));
        let indices = mesh.triangles.as_flattened().iter().map(index).collect::<io::Result<_>>()?;
        let light = |value: u8| linear_from_srgb(f32::from(value) / 255.0);
        let colour = |[red, green, blue]: [u8; 3]| Vec3f { x: light(red), y: light(green), z: light(blue) };
        Ok(Frame {
            time_code,
            points,
            normals: mesh.normals.iter().map(|normal| vector(*normal)).collect(),
            colours: colours.iter().copied().map(colour).collect(),
            indices,
        })
    }

    /// Writes all frames, of which the last one is shown until `end_s`, in seconds, and gives the file its name.
    ///
    /// # Errors
    /// [`WriteError`]; also if there are no frames.
    pub fn finish(self, end_s: f64) -> Result<(), WriteError> {
        let Self { path, mut output, stage, frames, .. } = self;
        let written = if frames.is_empty() {
            Err(invalid("a sequence needs at least one frame".to_owned()))
        } else {
            layer(&stage, frames, end_s).and_then(|layer| write(&layer, &mut output))
        };
        written.map_err(|cause| WriteError::new(&path, cause))?;
        output.commit()
    }
}

fn invalid(message: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}

fn vector(v: DVec3) -> Vec3f {
    Vec3f { x: v.x as f32, y: v.y as f32, z: v.z as f32 }
}

/// Writes a layer.
fn write(layer: &Data, output: &mut AtomicFile) -> io::Result<()> {
    let written = TextWriter::write(layer, output);
    written.map_err(|error| error.downcast::<io::Error>().unwrap_or_else(io::Error::other))
}

/// Puts the scene together.
fn layer(stage: &UsdStage, frames: Vec<Frame>, end_s: f64) -> io::Result<Data> {
    let (first, last) = (frames[0].time_code, frames[frames.len() - 1].time_code);
    let is_animated = frames.len() > 1;
    // A frame is shown until the next one; the last code is the last instant at which something is new.
    let end = last.max(stage.time_code(end_s).ceil() - 1.0);
    let mut layer = Data::new();
    let root = layer.create_spec(PrimPath::abs_root(), SpecType::PseudoRoot);
    root.add(FieldKey::Documentation, Value::String(COMMENT.to_owned()));
    root.add(FieldKey::DefaultPrim, token(&ROOT[1..]));
    root.add("metersPerUnit", Value::Double(stage.metres_per_unit));
    root.add("upAxis", token(if stage.z_up { "Z" } else { "Y" }));
    if is_animated {
        root.add(FieldKey::StartTimeCode, Value::Double(first));
        root.add(FieldKey::EndTimeCode, Value::Double(end));
        root.add(FieldKey::TimeCodesPerSecond, Value::Double(stage.frames_per_second));
        root.add(FieldKey::FramesPerSecond, Value::Double(stage.frames_per_second));
    }
    root.add(ChildrenKey::PrimChildren, tokens(&[&ROOT[1..]]));

    let mut take = Prim::new(&mut layer, ROOT, "Xform")?;
    if stage.translation != DVec3::ZERO {
        let DVec3 { x, y, z } = stage.translation;
        take.value("double3", "xformOp:translate", Value::Vec3d(Vec3d { x, y, z }))?;
        take.uniform("token[]", "xformOpOrder", tokens(&["xformOp:translate"]))?;
    }
    take.finish(&["surface"]);

    let mut surface = Prim::new(&mut layer, MESH, "Mesh")?;
    surface.uniform("token", "subdivisionScheme", token("none"))?;
    surface.uniform("token", "orientation", token("rightHanded"))?;
    surface.uniform("bool", "doubleSided", Value::Bool(true))?;
    let [has_normals, has_colours] = [
        frames.iter().any(|frame| !frame.normals.is_empty()),
        frames.iter().any(|frame| !frame.colours.is_empty()),
    ];
    let mut attributes = Attributes::default();
    for frame in frames {
        let Frame { time_code, points, normals, colours, indices } = frame;
        attributes.extent.push((time_code, Value::Vec3fVec(extent(&points))));
        attributes.counts.push((time_code, Value::IntVec(vec![3; indices.len() / 3])));
        attributes.indices.push((time_code, Value::IntVec(indices)));
        attributes.points.push((time_code, Value::Vec3fVec(points)));
        attributes.normals.push((time_code, Value::Vec3fVec(normals)));
        attributes.colours.push((time_code, Value::Vec3fVec(colours)));
    }
    surface.samples("float3[]", "extent", attributes.extent, None)?;
    surface.samples("int[]", "faceVertexCounts", attributes.counts, None)?;
    surface.samples("int[]", "faceVertexIndices", attributes.indices, None)?;
    surface.samples("point3f[]", "points", attributes.points, None)?;
    if has_normals {
        surface.samples("normal3f[]", "normals", attributes.normals, Some("vertex"))?;
    }
    if has_colours {
        surface.samples("color3f[]", "primvars:displayColor", attributes.colours, Some("vertex"))?;
    }
    surface.finish(&[]);
    Ok(layer)
}

/// The values of the mesh at each time.
#[derive(Default)]
struct Attributes {
    extent: Vec<(f64, Value)>,
    counts: Vec<(f64, Value)>,
    indices: Vec<(f64, Value)>,
    points: Vec<(f64, Value)>,
    normals: Vec<(f64, Value)>,
    colours: Vec<(f64, Value)>,
}

/// Least and greatest coordinates; nothing of no points.
fn extent(points: &[Vec3f]) -> Vec<Vec3f> {
    let Some(first) = points.first() else { return Vec::new() };
    let (mut least, mut most) = (*first, *first);
    for p in points {
        least = Vec3f { x: least.x.min(p.x), y: least.y.min(p.y), z: least.z.min(p.z) };
        most = Vec3f { x: most.x.max(p.x), y: most.y.max(p.y), z: most.z.max(p.z) };
    }
    vec![least, most]
}

fn token(name: &str) -> Value {
    Value::Token(Token::from(name))
}

fn tokens(names: &[&str]) -> Value {
    Value::TokenVec(names.iter().map(|name| Token::from(*name)).collect())
}

/// A prim that is being put together.
struct Prim<'a> {
    layer: &'a mut Data,
    path: PrimPath,
    properties: Vec<String>,
}

impl<'a> Prim<'a> {
    fn new(layer: &'a mut Data, path: &str, type_name: &str) -> io::Result<Self> {
        let path = PrimPath::new(path).map_err(io::Error::other)?;
        let spec = layer.create_spec(path.clone(), SpecType::Prim);
        spec.add(FieldKey::Specifier, Value::Specifier(Specifier::Def));
        spec.add(FieldKey::TypeName, token(type_name));
        Ok(Self { layer, path, properties: Vec::new() })
    }

    /// Adds an attribute of the same value at all times.
    fn value(&mut self, type_name: &str, name: &str, value: Value) -> io::Result<()> {
        self.attribute(type_name, name, [(FieldKey::Default.as_str(), value)])
    }

    /// Adds an attribute that cannot change over time.
    fn uniform(&mut self, type_name: &str, name: &str, value: Value) -> io::Result<()> {
        let uniform = Value::Variability(Variability::Uniform);
        self.attribute(
            type_name,
            name,
            [(FieldKey::Variability.as_str(), uniform), (FieldKey::Default.as_str(), value)],
        )
    }

    /// Adds an attribute over time; of one value alone, at all times. `interpolation`: between the mesh's vertices.
    fn samples(
        &mut self,
        type_name: &str,
        name: &str,
        mut samples: Vec<(f64, Value)>,
        interpolation: Option<&str>,
    ) -> io::Result<()> {
        let values = match samples.len() {
            1 => (FieldKey::Default.as_str(), samples.remove(0).1),
            _ => (FieldKey::TimeSamples.as_str(), Value::TimeSamples(samples)),
        };
        let interpolation = interpolation.map(|name| ("interpolation", token(name)));
        self.attribute(type_name, name, interpolation.into_iter().chain([values]))
    }

    fn attribute(
        &mut self,
        type_name: &str,
        name: &str,
        fields: impl IntoIterator<Item = (&'static str, Value)>,
    ) -> io::Result<()> {
        let path = self.path.append_property(name).map_err(io::Error::other)?;
        let spec = self.layer.create_spec(path, SpecType::Attribute);
        spec.add(FieldKey::TypeName, token(type_name));
        for (field, value) in fields {
            spec.add(field, value);
        }
        self.properties.push(name.to_owned());
        Ok(())
    }

    /// Ends the prim, which has children of these names.
    fn finish(self, children: &[&str]) {
        let properties: Vec<&str> = self.properties.iter().map(String::as_str).collect();
        if let Some(spec) = self.layer.spec_mut(&self.path) {
            if !properties.is_empty() {
                spec.add(ChildrenKey::PropertyChildren, tokens(&properties));
            }
            if !children.is_empty() {
                spec.add(ChildrenKey::PrimChildren, tokens(children));
            }
        }
    }
}
