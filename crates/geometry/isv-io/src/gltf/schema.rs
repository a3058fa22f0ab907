//! The JSON of glTF 2.0, as far as geometry needs it. All names are the specification's.

use super::container::VERSION;
use super::fault::GltfFault;
use crate::error::{Flaw, quote};
use crate::text;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;
use std::collections::BTreeMap;

/// Kind and index of an object, for messages.
pub(super) type ObjectName = (&'static str, usize);

/// Names of the extensions of an object; what they say is not read.
pub(super) type Extensions = BTreeMap<String, IgnoredAny>;

/// Beginnings of names of required extensions that do not change where triangles are, or that are read.
const HARMLESS: &[&str] = &[
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
    "EXT_meshopt_compression",
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_node_visibility",
    "KHR_techniques_webgl",
    "KHR_technique_webgl",
    "KHR_animation_pointer",
    "KHR_audio",
    "KHR_physics",
    "KHR_interactivity",
    "KHR_node_selectability",
    "KHR_node_hoverability",
    "EXT_structural_metadata",
    "EXT_feature_metadata",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_materials_",
    "EXT_mesh_manifold",
    "CESIUM_primitive_outline",
    "ADOBE_materials_",
    "AGI_stk_metadata",
    "FB_material",
    "GODOT_",
    "MSFT_lod",
    "NV_materials_",
    "OMI_",
    "MPEG_texture_",
    "MPEG_audio_",
    "VRM",
];

/// Required extensions that change where triangles are wherever they stand, in ways that are not read.
const MOVING: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "CESIUM_RTC",
    "AGI_articulations",
    "MPEG_mesh_linking",
    "MPEG_scene_dynamic",
];

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Document {
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) skins: Vec<Skin>,
    pub(super) animations: Vec<Animation>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    /// Column by column. Stands instead of the three below, which are rarely left out.
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<[f64; 3]>,
    /// A quaternion x, y, z, w.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) weights: Vec<f64>,
    pub(super) extensions: NodeExtensions,
}

/// Extensions that change which meshes there are.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<IgnoredAny>,
    #[serde(rename = "KHR_node_visibility")]
    visibility: Option<Visibility>,
    #[serde(flatten)]
    others: Extensions,
}

#[derive(Debug, Deserialize)]
struct Visibility {
    visible: Option<bool>,
}

impl Node {
    /// Whether it and what is below it is not to be seen.
    pub(super) fn is_hidden(&self) -> bool {
        self.extensions.visibility.as_ref().is_some_and(|visibility| visibility.visible == Some(false))
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct Mesh {
    #[serde(default)]
    pub(super) extensions: Extensions,
    pub(super) primitives: Vec<Primitive>,
    #[serde(default)]
    pub(super) weights: Vec<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    /// Whatever it is: it stops nobody who wants no colours.
    material: Option<Value>,
    #[serde(default = "Primitive::triangles")]
    pub(super) mode: u32,
    #[serde(default)]
    pub(super) targets: Vec<BTreeMap<String, usize>>,
    #[serde(default)]
    pub(super) extensions: PrimitiveExtensions,
}

/// Extensions that change where a primitive's data is.
#[derive(Debug, Default, Deserialize)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<Draco>,
    #[serde(flatten)]
    pub(super) others: Extensions,
}

/// The Draco stream of a primitive.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Draco {
    pub(super) buffer_view: usize,
    /// The attributes that are in the stream, by the identifiers that they have there.
    pub(super) attributes: BTreeMap<String, u32>,
}

impl Primitive {
    pub(super) const POINTS: u32 = 0;
    pub(super) const TRIANGLES: u32 = 4;
    pub(super) const TRIANGLE_STRIP: u32 = 5;
    pub(super) const TRIANGLE_FAN: u32 = 6;

    fn triangles() -> u32 {
        Self::TRIANGLES
    }

    /// Index of its material. What is no index is none.
    pub(super) fn material(&self) -> Option<usize> {
        usize::try_from(self.material.as_ref()?.as_u64()?).ok()
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) joints: Vec<usize>,
    pub(super) inverse_bind_matrices: Option<usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Animation {
    #[serde(default)]
    pub(super) name: String,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: Target,
}

#[derive(Debug, Deserialize)]
pub(super) struct Target {
    pub(super) node: Option<usize>,
    pub(super) path: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) output: usize,
    #[serde(default)]
    pub(super) interpolation: Interpolation,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: usize,
    /// `SCALAR`, `VEC3` and so on.
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<Box<Sparse>>,
    #[serde(default)]
    pub(super) extensions: Extensions,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: usize,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
    #[serde(default)]
    pub(super) extensions: ViewExtensions,
}

/// Extensions that change where a buffer view's bytes are.
#[derive(Debug, Default, Deserialize)]
pub(super) struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext_meshopt: Option<Box<Meshopt>>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<Box<Meshopt>>,
    #[serde(flatten)]
    pub(super) others: Extensions,
}

impl ViewExtensions {
    /// How the bytes are compressed, if they are.
    pub(super) fn meshopt(&self) -> Option<&Meshopt> {
        self.khr_meshopt.as_deref().or(self.ext_meshopt.as_deref())
    }
}

/// A buffer view as meshoptimizer compresses it.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Meshopt {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: usize,
    pub(super) count: usize,
    pub(super) mode: String,
    pub(super) filter: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: usize,
    #[serde(default)]
    pub(super) extensions: BufferExtensions,
}

/// Extensions that change what a buffer is for.
#[derive(Debug, Default, Deserialize)]
pub(super) struct BufferExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext_meshopt: Option<MeshoptBuffer>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<MeshoptBuffer>,
}

#[derive(Debug, Deserialize)]
struct MeshoptBuffer {
    #[serde(default)]
    fallback: bool,
}

impl Buffer {
    /// Whether its bytes are for readers without decompression, and may be left out of the file.
    pub(super) fn is_fallback(&self) -> bool {
        let BufferExtensions { ext_meshopt, khr_meshopt } = &self.extensions;
        [ext_meshopt, khr_meshopt].into_iter().flatten().any(|buffer| buffer.fallback)
    }
}

impl Document {
    /// Parses the JSON of a file, which starts at `offset` in it. Zero bytes behind it are padding, as some programs write it.
    pub(super) fn parse(json: &[u8], offset: usize) -> Result<Self, Flaw> {
        check_version(without_padding(&text::decode(json)), offset)?;
        let document: Self = parse_json(json, offset)?;
        match document.extensions_required.iter().find(|name| document.moves(name)) {
            Some(name) => {
                let extension = quote(name.as_bytes());
                Err(Flaw::at_byte(offset, GltfFault::Extension { extension }.into()))
            }
            None => Ok(document),
        }
    }

    /// Whether a required extension may change where triangles are. Of one that is not known, the places where it stands tell:
    /// what is said of materials, textures or the whole file moves nothing.
    fn moves(&self, name: &String) -> bool {
        if HARMLESS.iter().any(|harmless| name.starts_with(harmless)) {
            return false;
        }
        MOVING.contains(&name.as_str())
            || name.ends_with("_compression")
            || self.nodes.iter().any(|node| node.extensions.others.contains_key(name))
            || self.accessors.iter().any(|accessor| accessor.extensions.contains_key(name))
            || self.buffer_views.iter().any(|view| view.extensions.others.contains_key(name))
            || self.meshes.iter().any(|mesh| mesh.extensions.contains_key(name))
            || self
                .meshes
                .iter()
                .flat_map(|mesh| &mesh.primitives)
                .any(|part| part.extensions.others.contains_key(name))
    }
}

/// Parses a JSON, which starts at `offset` in its file.
pub(super) fn parse_json<T: DeserializeOwned>(json: &[u8], offset: usize) -> Result<T, Flaw> {
    let json = &text::decode(json);
    let json = without_padding(json);
    serde_json::from_slice(json).map_err(|error| json_flaw(json, offset, &error))
}

fn without_padding(json: &[u8]) -> &[u8] {
    let padding = json.iter().rev().take_while(|b| **b == 0 || b.is_ascii_whitespace()).count();
    &json[..json.len() - padding]
}

/// Refuses other versions by their names: what they hold may be of another shape.
fn check_version(json: &[u8], offset: usize) -> Result<(), Flaw> {
    #[derive(Deserialize)]
    struct File {
        asset: Option<Asset>,
    }
    #[derive(Deserialize)]
    struct Asset {
        version: Option<String>,
    }
    // What is not understood here is told of where all of it is parsed.
    let Ok(File { asset: Some(Asset { version: Some(version) }) }) = serde_json::from_slice(json) else {
        return Ok(());
    };
    match version.split('.').next().and_then(|major| major.trim().parse().ok()) {
        Some(version) if version != VERSION => {
            Err(Flaw::at_byte(offset, GltfFault::Version { version }.into()))
        }
        _ => Ok(()),
    }
}

fn json_flaw(json: &[u8], offset: usize, error: &serde_json::Error) -> Flaw {
    let lines = json.split_inclusive(|b| *b == b'\n').take(error.line().saturating_sub(1));
    let at = lines.map(<[u8]>::len).sum::<usize>() + error.column();
    // The parser ends its sentence with a line and a column, for which we have the byte.
    let text = error.to_string();
    let text = text.rsplit_once(" at line ").map_or(text.as_str(), |(text, _)| text);
    Flaw::at_byte(offset + at, GltfFault::Json { text: quote_long(text) }.into())
}

/// Quotes as [`quote`] does, with room for a sentence of the parser's.
fn quote_long(text: &str) -> String {
    text.chars().take(120).flat_map(char::escape_debug).collect()
}

/// The object of an index, or a flaw of the object that names it.
pub(super) fn object<'a, T>(
    list: &'a [T],
    kind: &'static str,
    index: usize,
    named_by: ObjectName,
) -> Result<&'a T, Flaw> {
    list.get(index).ok_or_else(|| {
        Flaw::in_object(named_by.0, named_by.1, GltfFault::NoSuch { kind, index, count: list.len() })
    })
}
