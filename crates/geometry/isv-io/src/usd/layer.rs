//! The scene of a USD file: prims, attributes and metadata, whatever the encoding.

use super::UsdStage;
use crate::own::COMMENT;
use glam::DVec3;

/// The values of an attribute at one time.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Array {
    Integers(Vec<i32>),
    Vectors(Vec<[f32; 3]>),
}

impl Array {
    pub(super) fn is_empty(&self) -> bool {
        match self {
            Self::Integers(values) => values.is_empty(),
            Self::Vectors(values) => values.is_empty(),
        }
    }
}

/// An attribute of the mesh whose values differ from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Track {
    Extent,
    Counts,
    Indices,
    Points,
    Normals,
    Colours,
}

impl Track {
    pub(super) const ALL: [Self; TRACKS] =
        [Self::Extent, Self::Counts, Self::Indices, Self::Points, Self::Normals, Self::Colours];

    fn attribute(self) -> Attribute {
        let (type_name, name) = match self {
            Self::Extent => ("float3[]", "extent"),
            Self::Counts => ("int[]", "faceVertexCounts"),
            Self::Indices => ("int[]", "faceVertexIndices"),
            Self::Points => ("point3f[]", "points"),
            Self::Normals => ("normal3f[]", "normals"),
            Self::Colours => ("color3f[]", "primvars:displayColor"),
        };
        Attribute {
            type_name,
            name,
            is_uniform: false,
            at_vertices: self.is_optional(),
            value: Value::Frames(self),
        }
    }

    /// Whether a mesh without values has no such attribute.
    fn is_optional(self) -> bool {
        matches!(self, Self::Normals | Self::Colours)
    }
}

/// Number of tracks.
pub(super) const TRACKS: usize = 6;

/// The arrays of a frame, in the order of [`Track::ALL`].
pub(super) type Frame = [Array; TRACKS];

/// A value of an attribute or of metadata.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Bool(bool),
    Double(f64),
    Double3([f64; 3]),
    String(&'static str),
    Token(&'static str),
    TokenArray(Vec<&'static str>),
    /// The arrays of all frames.
    Frames(Track),
}

#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) type_name: &'static str,
    pub(super) name: &'static str,
    /// Whether the value cannot change over time.
    pub(super) is_uniform: bool,
    /// Whether there is a value for each vertex, and the file says so (`interpolation`).
    pub(super) at_vertices: bool,
    pub(super) value: Value,
}

#[derive(Debug)]
pub(super) struct Prim {
    pub(super) type_name: &'static str,
    pub(super) name: &'static str,
    pub(super) attributes: Vec<Attribute>,
    pub(super) children: Vec<Prim>,
}

/// A whole file, without the arrays of its frames.
#[derive(Debug)]
pub(super) struct Layer {
    pub(super) metadata: Vec<(&'static str, Value)>,
    pub(super) root: Prim,
}

impl Layer {
    /// Puts a scene together. `end`: last time code at which something is new. `is_filled`: tracks that have values in some frame.
    pub(super) fn new(stage: &UsdStage, time_codes: &[f64], end: f64, is_filled: [bool; TRACKS]) -> Self {
        let tracks = Track::ALL.into_iter().zip(is_filled);
        let tracks = tracks.filter(|(track, is_filled)| *is_filled || !track.is_optional());
        let uniform = |type_name, name, value| Attribute {
            type_name,
            name,
            is_uniform: true,
            at_vertices: false,
            value,
        };
        let mut attributes = vec![
            uniform("token", "subdivisionScheme", Value::Token("none")),
            uniform("token", "orientation", Value::Token("rightHanded")),
            uniform("bool", "doubleSided", Value::Bool(true)),
        ];
        attributes.extend(tracks.map(|(track, _)| track.attribute()));
        let surface = Prim { type_name: "Mesh", name: "surface", attributes, children: Vec::new() };
        let attributes = translation(stage.translation);
        let root = Prim { type_name: "Xform", name: "take", attributes, children: vec![surface] };
        Self { metadata: metadata(stage, root.name, time_codes, end), root }
    }
}

fn metadata(
    stage: &UsdStage,
    root: &'static str,
    time_codes: &[f64],
    end: f64,
) -> Vec<(&'static str, Value)> {
    let mut metadata = vec![
        ("documentation", Value::String(COMMENT)),
        ("defaultPrim", Value::Token(root)),
        ("metersPerUnit", Value::Double(stage.metres_per_unit)),
        ("upAxis", Value::Token(if stage.z_up { "Z" } else { "Y" })),
    ];
    if let [first, _, ..] = time_codes {
        let times = [
            ("startTimeCode", *first),
            ("endTimeCode", end),
            ("timeCodesPerSecond", stage.frames_per_second),
            ("framesPerSecond", stage.frames_per_second),
        ];
        metadata.extend(times.map(|(name, value)| (name, Value::Double(value))));
    }
    metadata
}

fn translation(translation: DVec3) -> Vec<Attribute> {
    if translation == DVec3::ZERO {
        return Vec::new();
    }
    let (is_uniform, at_vertices) = (false, false);
    let name = "xformOp:translate";
    let value = Value::Double3(translation.to_array());
    let translate = Attribute { type_name: "double3", name, is_uniform, at_vertices, value };
    let (is_uniform, value) = (true, Value::TokenArray(vec![name]));
    let order = Attribute { type_name: "token[]", name: "xformOpOrder", is_uniform, at_vertices, value };
    vec![translate, order]
}
