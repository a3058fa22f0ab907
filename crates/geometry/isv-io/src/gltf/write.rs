//! Writing binary glTF: meshes as `f32` positions or as integers, normals and colours where there are any, and the shortest indices
//! that do.

use super::container::{BIN_CHUNK, CHUNK_HEADER_BYTES, HEADER_BYTES, JSON_CHUNK, MAGIC, VERSION};
use super::encoding::{
    GlbEncoding, Lattice, MESHOPT, Quantized, compress_rows, compress_triangles, linear_colour, octahedral,
    quantized_normal,
};
use super::pieces::Piece;
use super::write_looks::Looks;
use crate::geometry::assert_appearance_fits;
use crate::own::GENERATOR;
use crate::placement::Placement;
use glam::{DVec3, Vec3};
use isv_volume::TriangleMesh;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Codes of the specification.
const BYTE: u32 = 5120;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
pub(super) const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Most vertices that 16-bit indices reach; the last index of a type is reserved.
const MOST_SHORT_VERTICES: usize = u16::MAX as usize;

/// Chunks and buffer views start at multiples of this.
const ALIGNMENT: u64 = 4;

/// Writes a mesh as a file of one node, which a placement moves: vertices stay exact, as they are relative to it.
pub(crate) fn write(out: impl Write, mesh: &TriangleMesh, placement: &Placement) -> io::Result<()> {
    write_glb_to(out, mesh, GlbEncoding::Plain, placement)
}

/// Writes a mesh as a GLB file to anything that takes bytes. A placement moves its node: vertices stay exact, as they are
/// relative to it. Vertex colours become linear light; materials and images are written with their texture coordinates, images as PNG.
///
/// # Errors
/// Whatever `out` says, and for a mesh that the format cannot hold.
///
/// # Panics
/// If the mesh has an appearance that does not fit it.
pub fn write_glb_to(
    mut out: impl Write,
    mesh: &TriangleMesh,
    encoding: GlbEncoding,
    placement: &Placement,
) -> io::Result<()> {
    let mut document = Document::new(Vec::new(), encoding);
    let mesh = document.push_mesh(mesh)?;
    let mut node = json!({});
    move_node(&mut node, placement.translation);
    document.push_node(mesh.as_ref(), node);
    let json = document.json();
    write_head(&mut out, &json, document.binary_bytes)?;
    out.write_all(&document.binary)
}

/// Gives a node a translation, unless it stays where it is.
pub(super) fn move_node(node: &mut Value, translation: DVec3) {
    if translation != DVec3::ZERO {
        node["translation"] = translation.to_array().to_vec().into();
    }
}

/// The JSON of a file that grows, and its binary chunk on the way to `binary`.
#[derive(Debug)]
pub(super) struct Document<W> {
    pub(super) encoding: GlbEncoding,
    pub(super) binary: W,
    pub(super) binary_bytes: u64,
    /// Bytes of the buffer that compressed views become.
    fallback_bytes: u64,
    nodes: List,
    /// Nodes that are no children of others.
    roots: Vec<usize>,
    pub(super) channels: List,
    pub(super) samplers: List,
    meshes: List,
    accessors: List,
    views: List,
    looks: Looks,
}

/// A mesh of the file, as a node shows it.
#[derive(Clone, Debug)]
pub(super) struct ShownMesh {
    index: usize,
    /// The entries of a node that turn its integers into metres.
    placing: Option<Value>,
}

/// A view of elements to write.
struct Elements<'a> {
    bytes: Vec<u8>,
    count: usize,
    stride: usize,
    target: u32,
    /// Mode, filter and compressed bytes, where they are compressed.
    compressed: Option<(&'a str, &'a str, Vec<u8>)>,
}

impl<W: Write> Document<W> {
    pub(super) fn new(binary: W, encoding: GlbEncoding) -> Self {
        let list = List::default;
        let (nodes, channels, samplers) = (list(), list(), list());
        let (meshes, accessors, views) = (list(), list(), list());
        let (binary_bytes, fallback_bytes, roots) = (0, 0, Vec::new());
        Self {
            encoding,
            binary,
            binary_bytes,
            fallback_bytes,
            nodes,
            roots,
            channels,
            samplers,
            meshes,
            accessors,
            views,
            looks: Looks::new(),
        }
    }

    /// Adds a node with these entries to the scene, which shows a mesh, and gives its index.
    pub(super) fn push_node(&mut self, mesh: Option<&ShownMesh>, mut node: Value) -> usize {
        match mesh {
            Some(ShownMesh { index, placing: None }) => node["mesh"] = (*index).into(),
            Some(ShownMesh { index, placing: Some(placing) }) => {
                // A node of its own: the other one may be scaled by an animation.
                let mut child = placing.clone();
                child["mesh"] = (*index).into();
                node["children"] = json!([self.nodes.push(&child)]);
            }
            None => {}
        }
        let root = self.nodes.push(&node);
        self.roots.push(root);
        root
    }

    /// Adds a mesh and gives its index; nothing for one without triangles, as glTF has no empty ones. Nothing is written of a
    /// mesh that is refused.
    pub(super) fn push_mesh(&mut self, mesh: &TriangleMesh) -> io::Result<Option<ShownMesh>> {
        if mesh.triangles.is_empty() {
            return Ok(None);
        }
        let positions: Vec<Vec3> = mesh.vertices.iter().map(|v| v.as_vec3()).collect();
        if let Some(vertex) = positions.iter().position(|v| !v.is_finite()) {
            let message = format!("vertex {vertex} has no finite position in single precision");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        // Normals must have length 1, so that a mesh with one that has none cannot have any.
        let normals: Option<Vec<Vec3>> =
            mesh.normals.iter().map(|n| n.normalize_or_zero().as_vec3().try_normalize()).collect();
        let normals = normals.unwrap_or_default();
        assert_appearance_fits(mesh);
        let mut pieces = Piece::split(mesh, &normals);
        if self.encoding == GlbEncoding::Meshopt {
            pieces = pieces.into_iter().map(Piece::in_order).collect::<io::Result<_>>()?;
        }
        let lattice = (self.encoding != GlbEncoding::Plain)
            .then(|| Lattice::around(pieces.iter().flat_map(|piece| piece.vertices.iter())));
        let mut primitives = Vec::new();
        for piece in &pieces {
            let mut attributes = match lattice {
                None => self.push_plain(piece)?,
                Some(lattice) => self.push_quantized(piece, lattice)?,
            };
            if !piece.colours.is_empty() {
                let colours = piece.colours.iter().map(|colour| linear_colour(*colour));
                let bytes = colours.flatten().flat_map(u16::to_le_bytes).collect();
                let mut colours = self.push_rows(bytes, 8, UNSIGNED_SHORT, "VEC4")?;
                colours["normalized"] = true.into();
                attributes["COLOR_0"] = self.accessors.push(&colours).into();
            }
            if !piece.coordinates.is_empty() {
                let bytes = piece.coordinates.as_flattened().iter().flat_map(|c| c.to_le_bytes()).collect();
                let coordinates = self.push_rows(bytes, 8, FLOAT, "VEC2")?;
                attributes["TEXCOORD_0"] = self.accessors.push(&coordinates).into();
            }
            let indices = self.push_indices(piece)?;
            let material = self.push_material(piece)?;
            primitives.push(json!({ "attributes": attributes, "indices": indices, "material": material }));
        }
        let index = self.meshes.push(&json!({ "primitives": primitives }));
        let placing = lattice.map(|Lattice { origin, step }| {
            json!({ "translation": origin.to_array(), "scale": [step, step, step] })
        });
        Ok(Some(ShownMesh { index, placing }))
    }

    /// Index of a piece's material, with its image, which is written at its first use.
    fn push_material(&mut self, piece: &Piece) -> io::Result<usize> {
        // Views are added while the lists of materials are.
        let mut looks = std::mem::replace(&mut self.looks, Looks::new());
        let index = looks
            .push(piece.material.as_ref(), |bytes| self.push_view(bytes.iter().map(|byte| [*byte]), None));
        self.looks = looks;
        index
    }

    /// Adds the positions and normals of a piece as they are, and gives its attributes.
    fn push_plain(&mut self, piece: &Piece) -> io::Result<Value> {
        let positions: Vec<Vec3> = piece.vertices.iter().map(|v| v.as_vec3()).collect();
        let (low, high) = positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        let mut attributes = json!({ "POSITION": self.push_vectors(&positions, Some((low, high)))? });
        if !piece.normals.is_empty() {
            attributes["NORMAL"] = self.push_vectors(&piece.normals, None)?.into();
        }
        Ok(attributes)
    }

    /// Adds the positions and normals of a piece as integers, and gives its attributes.
    fn push_quantized(&mut self, piece: &Piece, lattice: Lattice) -> io::Result<Value> {
        let quantized = Quantized::new(&piece.vertices, lattice);
        let bytes = quantized.positions.as_flattened().iter().flat_map(|p| p.to_le_bytes()).collect();
        let mut positions = self.push_rows(bytes, 8, UNSIGNED_SHORT, "VEC3")?;
        let [low, high] = quantized.bounds();
        positions["min"] = json!(low);
        positions["max"] = json!(high);
        let mut attributes = json!({ "POSITION": self.accessors.push(&positions) });
        if !piece.normals.is_empty() {
            let count = piece.normals.len();
            let (bytes, compressed) = if self.encoding == GlbEncoding::Meshopt {
                let bytes = octahedral(&piece.normals)?;
                let compressed = compress_rows(&bytes, count, 4)?;
                (bytes, Some(("ATTRIBUTES", "OCTAHEDRAL", compressed)))
            } else {
                (piece.normals.iter().flat_map(|n| quantized_normal(*n).map(|c| c as u8)).collect(), None)
            };
            let view =
                self.push_elements(Elements { bytes, count, stride: 4, target: ARRAY_BUFFER, compressed })?;
            let mut normals = accessor(view, BYTE, "VEC3", count);
            normals["normalized"] = true.into();
            attributes["NORMAL"] = self.accessors.push(&normals).into();
        }
        Ok(attributes)
    }

    /// Adds rows of an attribute, compressed if the encoding asks for it, and gives the accessor that is to be added for them.
    fn push_rows(&mut self, bytes: Vec<u8>, stride: usize, component: u32, shape: &str) -> io::Result<Value> {
        let count = bytes.len() / stride;
        let compresses = self.encoding == GlbEncoding::Meshopt;
        let compressed = compresses.then(|| compress_rows(&bytes, count, stride)).transpose()?;
        let compressed = compressed.map(|bytes| ("ATTRIBUTES", "NONE", bytes));
        let view = self.push_elements(Elements { bytes, count, stride, target: ARRAY_BUFFER, compressed })?;
        Ok(accessor(view, component, shape, count))
    }

    /// Adds a view, whose bytes are compressed or not.
    fn push_elements(&mut self, elements: Elements<'_>) -> io::Result<usize> {
        let Elements { bytes, count, stride, target, compressed } = elements;
        let Some((mode, filter, compressed)) = compressed else {
            let start = self.push_bytes(bytes.iter().map(|byte| [*byte]))?;
            let view = json!({
                "buffer": 0, "byteOffset": start, "byteLength": bytes.len(), "byteStride": stride, "target": target,
            });
            return Ok(self.views.push(&view));
        };
        let start = self.push_bytes(compressed.iter().map(|byte| [*byte]))?;
        let mut extension = json!({
            "buffer": 0, "byteOffset": start, "byteLength": compressed.len(), "byteStride": stride,
            "count": count, "mode": mode,
        });
        if filter != "NONE" {
            extension["filter"] = filter.into();
        }
        let length = (count * stride) as u64;
        let mut view = json!({
            "buffer": 1, "byteOffset": self.fallback_bytes, "byteLength": length, "target": target,
            "extensions": { MESHOPT: extension },
        });
        if target == ARRAY_BUFFER {
            view["byteStride"] = stride.into();
        }
        self.fallback_bytes += length.next_multiple_of(ALIGNMENT);
        Ok(self.views.push(&view))
    }

    /// Most bytes of the binary chunk that [`Self::push_mesh`] takes.
    pub(super) fn bytes_of_mesh(&self, mesh: &TriangleMesh) -> u64 {
        let vectors = (mesh.vertices.len() + mesh.normals.len()) as u64;
        // A triangle that cannot be compressed takes up to 16 bytes, and each compressed view a head and a tail.
        const VIEWS: u64 = 1024;
        let plain = 12 * vectors + 16 * mesh.triangles.len() as u64 + VIEWS;
        let Some(appearance) = mesh.appearance.as_deref() else { return plain };
        let colours = 8 * appearance.vertex_colours.len() as u64;
        // Every corner may become a vertex, with a position, a normal, a colour and a texture coordinate.
        let split = if appearance.materials.len() > 1 || !appearance.texture_coordinates.is_empty() {
            3 * 40 * mesh.triangles.len() as u64
        } else {
            0
        };
        let views = VIEWS * Self::most_pieces(mesh);
        plain + colours + split + views + self.looks.bytes_of_images(&appearance.materials)
    }

    /// Most primitives that a mesh becomes.
    pub(super) fn most_pieces(mesh: &TriangleMesh) -> u64 {
        2 * mesh.appearance.as_ref().map_or(1, |appearance| appearance.materials.len().max(1)) as u64
    }

    fn push_vectors(&mut self, vectors: &[Vec3], bounds: Option<(Vec3, Vec3)>) -> io::Result<usize> {
        let bytes = vectors.iter().flat_map(Vec3::to_array).map(f32::to_le_bytes);
        let view = self.push_view(bytes, Some(ARRAY_BUFFER))?;
        let mut accessor = accessor(view, FLOAT, "VEC3", vectors.len());
        if let Some((low, high)) = bounds {
            accessor["min"] = numbers(&low.to_array());
            accessor["max"] = numbers(&high.to_array());
        }
        Ok(self.accessors.push(&accessor))
    }

    fn push_indices(&mut self, piece: &Piece) -> io::Result<usize> {
        let is_short = piece.vertices.len() <= MOST_SHORT_VERTICES;
        let count = 3 * piece.triangles.len();
        if self.encoding == GlbEncoding::Meshopt {
            let (stride, component) = if is_short { (2, UNSIGNED_SHORT) } else { (4, UNSIGNED_INT) };
            let compressed = Some(("TRIANGLES", "NONE", compress_triangles(&piece.triangles)?));
            let (bytes, target) = (Vec::new(), ELEMENT_ARRAY_BUFFER);
            let view = self.push_elements(Elements { bytes, count, stride, target, compressed })?;
            return Ok(self.accessors.push(&accessor(view, component, "SCALAR", count)));
        }
        let corners = piece.triangles.iter().flatten();
        let (view, component) = if is_short {
            let bytes = corners.map(|corner| (*corner as u16).to_le_bytes());
            (self.push_view(bytes, Some(ELEMENT_ARRAY_BUFFER))?, UNSIGNED_SHORT)
        } else {
            let bytes = corners.map(|corner| corner.to_le_bytes());
            (self.push_view(bytes, Some(ELEMENT_ARRAY_BUFFER))?, UNSIGNED_INT)
        };
        Ok(self.accessors.push(&accessor(view, component, "SCALAR", count)))
    }

    /// Adds numbers to the binary chunk and gives the index of their view; `target` says what of a mesh they are.
    pub(super) fn push_view<const N: usize>(
        &mut self,
        numbers: impl Iterator<Item = [u8; N]>,
        target: Option<u32>,
    ) -> io::Result<usize> {
        let start = self.binary_bytes;
        let length = self.push_counted(numbers)?;
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        Ok(self.views.push(&view))
    }

    /// Adds bytes to the binary chunk and gives where they start.
    fn push_bytes(&mut self, bytes: impl Iterator<Item = [u8; 1]>) -> io::Result<u64> {
        let start = self.binary_bytes;
        self.push_counted(bytes)?;
        Ok(start)
    }

    /// Adds numbers to the binary chunk and gives how many bytes they are.
    fn push_counted<const N: usize>(&mut self, numbers: impl Iterator<Item = [u8; N]>) -> io::Result<u64> {
        const PIECE: usize = 1 << 16;
        let start = self.binary_bytes;
        let mut piece = Vec::with_capacity(PIECE);
        for number in numbers {
            piece.extend(number);
            // Sizes of numbers divide that of a piece.
            if piece.len() == PIECE {
                self.binary.write_all(&piece)?;
                self.binary_bytes += PIECE as u64;
                piece.clear();
            }
        }
        let length = self.binary_bytes - start + piece.len() as u64;
        piece.resize(piece.len().next_multiple_of(ALIGNMENT as usize), 0);
        self.binary.write_all(&piece)?;
        self.binary_bytes += piece.len() as u64;
        Ok(length)
    }

    /// Adds an accessor and gives its index.
    pub(super) fn push_accessor(&mut self, accessor: &Value) -> usize {
        self.accessors.push(accessor)
    }

    /// Bytes of the JSON so far, nearly.
    pub(super) fn json_bytes(&self) -> u64 {
        let Self { nodes, channels, samplers, meshes, accessors, views, looks, .. } = self;
        let lists = [nodes, channels, samplers, meshes, accessors, views];
        let of_looks = [&looks.materials, &looks.textures, &looks.images, &looks.samplers];
        lists.iter().chain(&of_looks).map(|list| list.text.len() as u64).sum()
    }

    /// The JSON, with all nodes that are no children in the scene. Lists without objects are left out, as glTF has it.
    pub(super) fn json(&self) -> String {
        let mut json = format!(r#"{{"asset":{{"version":"2.0",{GENERATOR}}},"scene":0"#);
        let extensions = self.encoding.extensions();
        if self.meshes.len > 0 && !extensions.is_empty() {
            let names = json!(extensions);
            json += &format!(r#","extensionsUsed":{names},"extensionsRequired":{names}"#);
        }
        let scene: Vec<_> = self.roots.iter().map(ToString::to_string).collect();
        json += &format!(r#","scenes":[{{"nodes":[{}]}}],"nodes":[{}]"#, scene.join(","), self.nodes.text);
        if self.meshes.len > 0 {
            let Looks { materials, textures, images, samplers, .. } = &self.looks;
            json += &format!(r#","meshes":[{}],"materials":[{}]"#, self.meshes.text, materials.text);
            for (name, list) in [("textures", textures), ("images", images), ("samplers", samplers)] {
                if list.len > 0 {
                    json += &format!(r#","{name}":[{}]"#, list.text);
                }
            }
        }
        if self.accessors.len > 0 {
            let (accessors, views) = (&self.accessors.text, &self.views.text);
            json += &format!(r#","accessors":[{accessors}],"bufferViews":[{views}]"#);
            json += &format!(r#","buffers":[{{"byteLength":{}}}"#, self.binary_bytes);
            if self.fallback_bytes > 0 {
                let fallback = json!({
                    "byteLength": self.fallback_bytes, "extensions": { MESHOPT: { "fallback": true } },
                });
                json += &format!(",{fallback}");
            }
            json.push(']');
        }
        if self.channels.len > 0 {
            let (channels, samplers) = (&self.channels.text, &self.samplers.text);
            json += &format!(
                r#","animations":[{{"name":"frames","channels":[{channels}],"samplers":[{samplers}]}}]"#
            );
        }
        json.push('}');
        json
    }
}

pub(super) fn accessor(view: usize, component: u32, shape: &str, count: usize) -> Value {
    json!({ "bufferView": view, "componentType": component, "type": shape, "count": count })
}

/// The numbers as they are in single precision, to the last bit.
pub(super) fn numbers(values: &[f32]) -> Value {
    values.iter().map(|value| f64::from(*value)).collect()
}

/// Objects of the JSON as text, with commas between them: a fraction of what the objects would take.
#[derive(Debug, Default)]
pub(super) struct List {
    text: String,
    len: usize,
}

impl List {
    /// Appends an object and gives its index.
    pub(super) fn push(&mut self, object: &Value) -> usize {
        if self.len > 0 {
            self.text.push(',');
        }
        self.text += &object.to_string();
        self.len += 1;
        self.len - 1
    }
}

/// Bytes of a file around a JSON and a binary chunk, each as long as given.
pub(super) fn file_bytes(json: u64, binary: u64) -> u64 {
    let chunk = |length: u64| CHUNK_HEADER_BYTES as u64 + length.next_multiple_of(ALIGNMENT);
    HEADER_BYTES as u64 + chunk(json) + if binary > 0 { chunk(binary) } else { 0 }
}

/// Writes all of a file that comes before the bytes of its binary chunk.
pub(super) fn write_head(out: &mut impl Write, json: &str, binary: u64) -> io::Result<()> {
    let length = u32::try_from(file_bytes(json.len() as u64, binary)).map_err(|_| too_large())?;
    // Within the length of the file, both fit.
    let (json_bytes, binary_bytes) = ((json.len() as u32).next_multiple_of(ALIGNMENT as u32), binary as u32);
    out.write_all(MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&length.to_le_bytes())?;
    out.write_all(&json_bytes.to_le_bytes())?;
    out.write_all(JSON_CHUNK)?;
    out.write_all(json.as_bytes())?;
    for _ in json.len()..json_bytes as usize {
        out.write_all(b" ")?;
    }
    if binary > 0 {
        out.write_all(&binary_bytes.to_le_bytes())?;
        out.write_all(BIN_CHUNK)?;
    }
    Ok(())
}

pub(super) fn too_large() -> io::Error {
    let message =
        "a GLB file holds at most 4 GiB, which this would exceed; write fewer frames or one file a frame";
    io::Error::new(io::ErrorKind::FileTooLarge, message)
}
