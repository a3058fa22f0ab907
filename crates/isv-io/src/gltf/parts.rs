//! The triangles of a mesh, with what may move their vertices.

use super::accessor::Accessors;
use super::fault::GltfFault;
use super::schema::{self, Document, ObjectName, Primitive, object};
use crate::error::{Flaw, quote};
use crate::polygon::strip;
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
}

impl VertexSource {
    /// `None` for a primitive without positions, which the specification leaves to extensions.
    fn of(primitive: &Primitive) -> Option<Self> {
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let set = |n: usize| Some((attribute(&format!("JOINTS_{n}"))?, attribute(&format!("WEIGHTS_{n}"))?));
        Some(Self {
            positions: attribute("POSITION")?,
            influences: (0..).map_while(set).collect(),
            targets: primitive.targets.iter().map(|target| target.get("POSITION").copied()).collect(),
        })
    }

    fn load(&self, accessors: &Accessors, named_by: ObjectName) -> Result<Part, Flaw> {
        let positions = accessors.floats(self.positions, "VEC3", named_by)?;
        let count = positions.len();
        // Counted before memory is taken for them.
        let influences = self.influences.iter().flat_map(|(joints, weights)| [*joints, *weights]);
        for index in influences.chain(self.targets.iter().flatten().copied()) {
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
        };
        for (joints, weights) in &self.influences {
            part.influences.push(Influences {
                joints: accessors.integers(*joints, "VEC4", named_by)?,
                weights: accessors.floats(*weights, "VEC4", named_by)?,
            });
        }
        for target in &self.targets {
            let displacements = target.map(|index| accessors.floats(index, "VEC3", named_by));
            part.targets.push(displacements.transpose()?.unwrap_or_default());
        }
        Ok(part)
    }
}

impl Shape {
    /// Loads mesh `index`, named by a node. Lines are left out.
    pub(super) fn load(
        document: &Document,
        accessors: &Accessors,
        index: usize,
        node: usize,
    ) -> Result<Self, Flaw> {
        let mesh = object(&document.meshes, "mesh", index, ("node", node))?;
        let mut shape = Self { parts: Vec::new(), targets: 0 };
        let mut places: BTreeMap<VertexSource, usize> = BTreeMap::new();
        for primitive in &mesh.primitives {
            refuse_compression(primitive).map_err(|fault| Flaw::in_object("mesh", index, fault))?;
            let is_read = primitive.mode == Primitive::POINTS || primitive.mode >= Primitive::TRIANGLES;
            let Some(source) = VertexSource::of(primitive).filter(|_| is_read) else {
                continue;
            };
            let place = match places.get(&source) {
                Some(place) => *place,
                None => {
                    shape.parts.push(source.load(accessors, ("mesh", index))?);
                    shape.targets = shape.targets.max(source.targets.len());
                    places.insert(source, shape.parts.len() - 1);
                    shape.parts.len() - 1
                }
            };
            let part = &mut shape.parts[place];
            append_triangles(part, primitive, accessors, ("mesh", index))?;
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

/// Compression leaves nothing to read for those who do not know it.
fn refuse_compression(primitive: &Primitive) -> Result<(), GltfFault> {
    match primitive.extensions.keys().find(|name| name.ends_with("_compression")) {
        Some(name) => Err(GltfFault::Extension { extension: quote(name.as_bytes()) }),
        None => Ok(()),
    }
}

/// Appends the triangles or points of a primitive whose vertices are those of `part`.
fn append_triangles(
    part: &mut Part,
    primitive: &Primitive,
    accessors: &Accessors,
    mesh: ObjectName,
) -> Result<(), Flaw> {
    let flaw = |fault: GltfFault| Flaw::in_object(mesh.0, mesh.1, fault);
    let corners: Vec<u32> = match primitive.indices {
        Some(indices) => accessors.integers::<1>(indices, "SCALAR", mesh)?.into_flattened(),
        None => (0..part.positions.len() as u32).collect(),
    };
    if let Some(&index) = corners.iter().find(|corner| **corner as usize >= part.positions.len()) {
        let last = (part.positions.len() as u32).saturating_sub(1);
        return Err(flaw(GltfFault::Index { kind: "vertex", index, last }));
    }
    accessors.limit.take(corners.len(), 3).map_err(flaw)?;
    match primitive.mode {
        Primitive::POINTS => part.points.extend(corners),
        Primitive::TRIANGLES => part.triangles.extend(corners.as_chunks().0),
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
