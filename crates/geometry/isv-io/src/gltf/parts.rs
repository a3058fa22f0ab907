//! The triangles of a mesh, with what may move their vertices.

use super::accessor::Accessors;
use super::draco::DracoMesh;
use super::fault::GltfFault;
use super::looks::Looks;
use super::schema::{self, Document, Draco, ObjectName, Primitive, object};
use crate::error::{Flaw, quote};
use crate::polygon::strip;
use isv_volume::{Rgb, srgb_from_linear};
use std::collections::BTreeMap;

/// A mesh of the file: vertices and triangles in the space of the node that shows it.
#[derive(Debug)]
pub(super) struct Shape {
    pub(super) parts: Vec<Part>,
    /// How many weights its morph targets take.
    pub(super) targets: usize,
}

/// All triangles of a mesh that share their vertices, from one primitive or several.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Vertices that are points to be seen.
    pub(super) points: Vec<u32>,
    /// Four joints and their weights for each vertex, as many times as the file has sets of them; none if unskinned.
    pub(super) influences: Vec<Influences>,
    /// Displacements of each vertex by each morph target; none for a target that moves nothing.
    pub(super) targets: Vec<Vec<[f32; 3]>>,
    /// Colour of each vertex; empty if the file has none, or nobody asks.
    pub(super) colours: Vec<Rgb>,
    /// Material of each triangle, and texture coordinates of its corners; empty if nobody asks.
    pub(super) materials: Vec<u16>,
    pub(super) coordinates: Vec<[[f32; 2]; 3]>,
}

/// A set of four joints for each vertex.
#[derive(Debug)]
pub(super) struct Influences {
    pub(super) joints: Vec<[u32; 4]>,
    pub(super) weights: Vec<[f32; 4]>,
}

/// The accessors that a part's vertices come from: two primitives with the same ones share them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct VertexSource {
    positions: usize,
    influences: Vec<(usize, usize)>,
    targets: Vec<Option<usize>>,
    colours: Option<usize>,
    /// The stream that some of the accessors stand for.
    draco: Option<Draco>,
}

impl VertexSource {
    /// `None` for a primitive without positions, which the specification leaves to extensions.
    fn from_primitive(primitive: &Primitive, keeps_colours: bool) -> Option<Self> {
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let set = |n: usize| Some((attribute(&format!("JOINTS_{n}"))?, attribute(&format!("WEIGHTS_{n}"))?));
        Some(Self {
            positions: attribute("POSITION")?,
            influences: (0..).map_while(set).collect(),
            targets: primitive.targets.iter().map(|target| target.get("POSITION").copied()).collect(),
            colours: attribute("COLOR_0").filter(|_| keeps_colours),
            draco: primitive.extensions.draco.clone(),
        })
    }

    /// The numbers of an attribute that the Draco stream has, or else its accessor.
    fn floats<const N: usize>(
        &self,
        accessors: &Accessors,
        draco: Option<&DracoMesh>,
        name: &str,
        (index, wanted): (usize, &'static str),
        named_by: ObjectName,
    ) -> Result<Vec<[f32; N]>, Flaw> {
        let id = self.draco.as_ref().and_then(|stream| stream.attributes.get(name));
        let (Some(mesh), Some(id)) = (draco, id) else {
            return accessors.floats(index, wanted, named_by);
        };
        let divisor = accessors.divisor(index, named_by)?;
        let flaw = |fault: GltfFault| Flaw::in_object(named_by.0, named_by.1, fault);
        let mut values = mesh.floats::<N>(*id, &accessors.limit).map_err(flaw)?;
        if divisor != 1.0 {
            values.as_flattened_mut().iter_mut().for_each(|value| *value = (*value / divisor).max(-1.0));
        }
        Ok(values)
    }

    fn load(
        &self,
        accessors: &Accessors,
        draco: Option<&DracoMesh>,
        named_by: ObjectName,
    ) -> Result<Part, Flaw> {
        let positions = self.floats(accessors, draco, "POSITION", (self.positions, "VEC3"), named_by)?;
        let count = positions.len();
        // Counted before memory is taken for them. A stream has all its attributes for every vertex.
        let in_stream = |name: String| {
            draco.is_some() && self.draco.as_ref().is_some_and(|stream| stream.attributes.contains_key(&name))
        };
        let influences = self.influences.iter().enumerate().flat_map(|(set, (joints, weights))| {
            let joints = (!in_stream(format!("JOINTS_{set}"))).then_some(*joints);
            [joints, (!in_stream(format!("WEIGHTS_{set}"))).then_some(*weights)]
        });
        let colours = self.colours.filter(|_| !in_stream("COLOR_0".to_owned()));
        for index in influences.flatten().chain(self.targets.iter().flatten().copied()).chain(colours) {
            let found = accessors.count(index, named_by)?;
            if found != count {
                let fault = GltfFault::Count { wanted: count as u64, found: found as u64 };
                return Err(Flaw::in_object("accessor", index, fault));
            }
        }
        let mut part = Part {
            positions,
            triangles: Vec::new(),
            points: Vec::new(),
            influences: Vec::new(),
            targets: Vec::new(),
            colours: self.load_colours(accessors, draco, named_by)?,
            materials: Vec::new(),
            coordinates: Vec::new(),
        };
        for (set, (joints, weights)) in self.influences.iter().enumerate() {
            let [joints_name, weights_name] = ["JOINTS", "WEIGHTS"].map(|name| format!("{name}_{set}"));
            let joints = match in_stream(joints_name.clone()) {
                // Joints have at most 16 bits, which floats hold.
                true => self
                    .floats::<4>(accessors, draco, &joints_name, (*joints, "VEC4"), named_by)?
                    .into_iter()
                    .map(|joints| joints.map(|joint| joint as u32))
                    .collect(),
                false => accessors.integers(*joints, "VEC4", named_by)?,
            };
            let weights = self.floats(accessors, draco, &weights_name, (*weights, "VEC4"), named_by)?;
            part.influences.push(Influences { joints, weights });
        }
        for target in &self.targets {
            let displacements = target.map(|index| accessors.floats(index, "VEC3", named_by));
            part.targets.push(displacements.transpose()?.unwrap_or_default());
        }
        Ok(part)
    }
}

impl VertexSource {
    /// Colours of the vertices, which are linear in the file; alpha is dropped.
    fn load_colours(
        &self,
        accessors: &Accessors,
        draco: Option<&DracoMesh>,
        named_by: ObjectName,
    ) -> Result<Vec<Rgb>, Flaw> {
        let Some(index) = self.colours else { return Ok(Vec::new()) };
        let (shape, largest) = accessors.shape_and_largest(index, named_by)?;
        let byte = |light: f32| {
            let light = light / largest;
            if light.is_nan() { 255 } else { (255.0 * srgb_from_linear(light.clamp(0.0, 1.0))).round() as u8 }
        };
        let from_light = |[red, green, blue]: [f32; 3]| [byte(red), byte(green), byte(blue)];
        let name = "COLOR_0";
        if shape == "VEC4" {
            let colours = self.floats::<4>(accessors, draco, name, (index, "VEC4"), named_by)?;
            return Ok(colours
                .into_iter()
                .map(|[red, green, blue, _]| from_light([red, green, blue]))
                .collect());
        }
        let colours = self.floats::<3>(accessors, draco, name, (index, "VEC3"), named_by)?;
        Ok(colours.into_iter().map(from_light).collect())
    }
}

impl Shape {
    /// Loads mesh `index`, named by a node, with its looks if they are asked for. Lines are left out.
    pub(super) fn load(
        document: &Document,
        accessors: &Accessors,
        mut looks: Option<&mut Looks>,
        index: usize,
        node: usize,
    ) -> Result<Self, Flaw> {
        let mesh = object(&document.meshes, "mesh", index, ("node", node))?;
        let mut shape = Self { parts: Vec::new(), targets: 0 };
        let mut places: BTreeMap<VertexSource, usize> = BTreeMap::new();
        for primitive in &mesh.primitives {
            refuse_compression(primitive).map_err(|fault| Flaw::in_object("mesh", index, fault))?;
            let is_read = primitive.mode == Primitive::POINTS || primitive.mode >= Primitive::TRIANGLES;
            let Some(source) = VertexSource::from_primitive(primitive, looks.is_some()).filter(|_| is_read)
            else {
                continue;
            };
            let draco = source.draco.as_ref().map(|stream| {
                let bytes = accessors.bytes(stream.buffer_view, ("mesh", index))?;
                DracoMesh::decode(bytes, &accessors.limit)
                    .map_err(|fault| Flaw::in_object("mesh", index, fault))
            });
            let draco = draco.transpose()?;
            let place = match places.get(&source) {
                Some(place) => *place,
                None => {
                    shape.parts.push(source.load(accessors, draco.as_ref(), ("mesh", index))?);
                    shape.targets = shape.targets.max(source.targets.len());
                    places.insert(source.clone(), shape.parts.len() - 1);
                    shape.parts.len() - 1
                }
            };
            let part = &mut shape.parts[place];
            append_triangles(part, primitive, accessors, draco.as_ref(), ("mesh", index))?;
            if let Some(looks) = looks.as_deref_mut() {
                append_looks(part, (primitive, &source), accessors, draco.as_ref(), looks, index)?;
            }
        }
        shape.parts.retain(|part| !part.triangles.is_empty() || !part.points.is_empty());
        Ok(shape)
    }

    /// Weights of the morph targets at rest: the node's own, else the mesh's, else zero.
    pub(super) fn weights_at_rest(&self, mesh: &schema::Mesh, node: &schema::Node) -> Vec<f64> {
        let listed = if node.weights.is_empty() { &mesh.weights } else { &node.weights };
        // A file may list more weights than there are targets; a copy of those would stay with every instance of the mesh.
        let mut weights = Vec::with_capacity(self.targets);
        weights.extend(listed.iter().take(self.targets));
        weights.resize(self.targets, 0.0);
        weights
    }
}

/// Refuses compression that is not known: it leaves nothing to read.
fn refuse_compression(primitive: &Primitive) -> Result<(), GltfFault> {
    match primitive.extensions.others.keys().find(|name| name.ends_with("_compression")) {
        Some(name) => Err(GltfFault::Extension { extension: quote(name.as_bytes()) }),
        None => Ok(()),
    }
}

/// Appends the triangles or points of a primitive whose vertices are those of `part`.
fn append_triangles(
    part: &mut Part,
    primitive: &Primitive,
    accessors: &Accessors,
    draco: Option<&DracoMesh>,
    mesh: ObjectName,
) -> Result<(), Flaw> {
    let flaw = |fault: GltfFault| Flaw::in_object(mesh.0, mesh.1, fault);
    let corners: Vec<u32> = match (draco, primitive.indices) {
        (Some(stream), _) => stream.corners(),
        (None, Some(indices)) => accessors.integers::<1>(indices, "SCALAR", mesh)?.into_flattened(),
        (None, None) => (0..part.positions.len() as u32).collect(),
    };
    if let Some(&index) = corners.iter().find(|corner| **corner as usize >= part.positions.len()) {
        let last = (part.positions.len() as u32).saturating_sub(1);
        return Err(flaw(GltfFault::Index { kind: "vertex", index, last }));
    }
    accessors.limit.take(corners.len(), 3).map_err(flaw)?;
    match primitive.mode {
        Primitive::POINTS => part.points.extend(corners),
        Primitive::TRIANGLES => part.triangles.extend(corners.as_chunks().0),
        // A stream holds triangles, whatever they are made from.
        Primitive::TRIANGLE_STRIP if draco.is_some() => part.triangles.extend(corners.as_chunks().0),
        Primitive::TRIANGLE_STRIP => part.triangles.extend(strip(&corners)),
        Primitive::TRIANGLE_FAN => {
            if let [apex, rim @ ..] = corners.as_slice() {
                part.triangles.extend(rim.windows(2).map(|edge| [*apex, edge[0], edge[1]]));
            }
        }
        mode => {
            let modes = Primitive::TRIANGLE_FAN as usize + 1;
            return Err(flaw(GltfFault::NoSuch {
                kind: "primitive mode",
                index: mode as usize,
                count: modes,
            }));
        }
    }
    Ok(())
}

/// Appends the material and the texture coordinates of the triangles that a primitive has appended to `part`.
fn append_looks(
    part: &mut Part,
    (primitive, source): (&Primitive, &VertexSource),
    accessors: &Accessors,
    draco: Option<&DracoMesh>,
    looks: &mut Looks,
    mesh: usize,
) -> Result<(), Flaw> {
    let flaw = |fault: GltfFault| Flaw::in_object("mesh", mesh, fault);
    let start = part.materials.len();
    if part.triangles.len() == start {
        return Ok(());
    }
    let surface = looks.surface(primitive.material(), accessors, mesh)?;
    accessors.limit.take(part.triangles.len() - start, 7).map_err(flaw)?;
    part.materials.resize(part.triangles.len(), surface.material);
    let set = surface.coordinates.and_then(|(set, transform)| {
        let name = format!("TEXCOORD_{set}");
        primitive.attributes.get(&name).map(|index| (name, *index, transform))
    });
    let Some((name, index, transform)) = set else {
        part.coordinates.resize(part.triangles.len(), [[f32::NAN; 2]; 3]);
        return Ok(());
    };
    let mut coordinates = source.floats::<2>(accessors, draco, &name, (index, "VEC2"), ("mesh", mesh))?;
    if coordinates.len() != part.positions.len() {
        let (wanted, found) = (part.positions.len() as u64, coordinates.len() as u64);
        return Err(Flaw::in_object("accessor", index, GltfFault::Count { wanted, found }));
    }
    coordinates.iter_mut().for_each(|coordinate| *coordinate = transform.place(*coordinate));
    let corners = part.triangles[start..].iter();
    part.coordinates.extend(corners.map(|triangle| triangle.map(|vertex| coordinates[vertex as usize])));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_without_a_target_take_no_memory() {
        let shape = Shape { parts: Vec::new(), targets: 3 };
        let many: Vec<f64> = (0..50_000).map(f64::from).collect();
        let mesh = |weights: &[f64]| schema::Mesh {
            primitives: Vec::new(),
            weights: weights.to_vec(),
            extensions: schema::Extensions::new(),
        };
        let node = |weights: &[f64]| schema::Node { weights: weights.to_vec(), ..schema::Node::default() };
        for weights in
            [shape.weights_at_rest(&mesh(&many), &node(&[])), shape.weights_at_rest(&mesh(&[]), &node(&many))]
        {
            assert_eq!(weights, [0.0, 1.0, 2.0]);
            assert!(weights.capacity() < 100, "room for {} weights", weights.capacity());
        }
        assert_eq!(shape.weights_at_rest(&mesh(&[5.0]), &node(&[])), [5.0, 0.0, 0.0]);
    }
}
