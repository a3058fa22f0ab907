//! The shapes of the default scene, and their pose at an instant.

use super::accessor::Accessors;
use super::appearance::{Side, assemble};
use super::deform::Skin;
use super::fault::GltfFault;
use super::hierarchy::{Hierarchy, Transform, rest_transform};
use super::keyframes::{Curve, Moved};
use super::looks::{DecodedImages, Looks, Palette};
use super::parts::Shape;
use super::schema::{self, Document, Node, object};
use crate::error::Flaw;
use glam::{DAffine3, DMat3, DVec3};
use isv_volume::{Appearance, Rgb, TriangleMesh};

/// What of a scene can be seen.
#[derive(Debug)]
pub(super) struct Scene {
    hierarchy: Hierarchy,
    /// Transforms of all nodes at rest, to the space of their parents; and the same in parts, for those that move.
    rest: Vec<DAffine3>,
    rest_parts: Vec<Transform>,
    shapes: Vec<Shape>,
    skins: Vec<Skin>,
    instances: Vec<Instance>,
    /// Whether a node has a part in where a vertex is.
    matters: Vec<bool>,
    /// Materials of all parts; none if they say nothing of colours, or nobody asks.
    palette: Palette,
}

/// A scene at an instant.
#[derive(Debug, Default)]
pub(super) struct Pose {
    pub(super) mesh: TriangleMesh,
    pub(super) points: Vec<DVec3>,
    /// Colour of each point; empty if none of them has one.
    pub(super) point_colours: Vec<Rgb>,
    /// Every part of every instance, in order: what decides which colours the mesh has.
    pub(super) sides: Vec<Side>,
}

/// A shape in its place.
#[derive(Debug)]
struct Instance {
    node: usize,
    shape: usize,
    skin: Option<usize>,
    /// Weights of its morph targets at rest.
    weights: Vec<f64>,
}

/// A curve, and what it moves.
#[derive(Debug)]
pub(super) struct Channel {
    node: usize,
    moved: Moved,
    pub(super) curve: Curve,
}

impl Scene {
    /// Loads the default scene: the one that the file names, else the first, else all nodes. Its looks are loaded if they are asked for.
    pub(super) fn load(
        document: &Document,
        accessors: &Accessors,
        mut looks: Option<Looks>,
    ) -> Result<Self, Flaw> {
        let hierarchy = Hierarchy::new(&document.nodes)?;
        let default = document.scene.unwrap_or(0);
        let shown = shown_nodes(document, &hierarchy, default)?;
        let mut scene = Self {
            hierarchy,
            rest: document.nodes.iter().map(rest_transform).collect(),
            rest_parts: document.nodes.iter().map(Transform::of_node).collect(),
            shapes: Vec::new(),
            skins: Vec::new(),
            instances: Vec::new(),
            matters: vec![false; document.nodes.len()],
            palette: Palette::default(),
        };
        for skin in 0..document.skins.len() {
            scene.skins.push(Skin::load(document, accessors, skin)?);
        }
        scene.load_instances(document, accessors, looks.as_mut(), &shown)?;
        scene.palette = looks.map(Looks::into_palette).unwrap_or_default();
        // A scene with nobody in it is one; a scene of what cannot be read is not.
        if scene.instances.is_empty() && document.meshes.iter().any(|mesh| !mesh.primitives.is_empty()) {
            return Err(Flaw::in_object("scene", default, GltfFault::NoMeshes));
        }
        Ok(scene)
    }

    fn load_instances(
        &mut self,
        document: &Document,
        accessors: &Accessors,
        mut looks: Option<&mut Looks>,
        shown: &[bool],
    ) -> Result<(), Flaw> {
        let mut places = vec![None; document.meshes.len()];
        for (index, node) in document.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh.filter(|_| shown[index]) else { continue };
            if node.extensions.instancing.is_some() {
                let extension = "EXT_mesh_gpu_instancing".to_owned();
                return Err(Flaw::in_object("node", index, GltfFault::Extension { extension }));
            }
            let loaded = places.get(mesh).copied().flatten();
            let shape = match loaded {
                Some(shape) => shape,
                None => {
                    let looks = looks.as_deref_mut();
                    self.shapes.push(Shape::load(document, accessors, looks, mesh, index)?);
                    places[mesh] = Some(self.shapes.len() - 1);
                    self.shapes.len() - 1
                }
            };
            if self.shapes[shape].parts.is_empty() {
                continue;
            }
            self.check_instance(index, shape, node.skin, accessors)?;
            self.matters[index] = true;
            if let Some(skin) = node.skin {
                self.skins[skin].joints.iter().for_each(|joint| self.matters[*joint] = true);
            }
            let weights = self.shapes[shape].weights_at_rest(&document.meshes[mesh], node);
            self.instances.push(Instance { node: index, shape, skin: node.skin, weights });
        }
        self.hierarchy.mark_ancestors(&mut self.matters);
        Ok(())
    }

    /// Checks an instance before any memory is taken for it. The memory and the work which it and its pose
    /// take must be within the limit, and it must have all its joints.
    fn check_instance(
        &self,
        node: usize,
        shape: usize,
        skin: Option<usize>,
        accessors: &Accessors,
    ) -> Result<(), Flaw> {
        let flaw = |fault: GltfFault| Flaw::in_object("node", node, fault);
        let skin = skin.map(|skin| object(&self.skins, "skin", skin, ("node", node)));
        let skin = skin.transpose()?;
        let joints = skin.map_or(0, |skin| skin.joints.len());
        let shape = &self.shapes[shape];
        accessors.limit.take(shape.targets + joints, 1).map_err(flaw)?;
        for part in &shape.parts {
            let per_vertex = 1 + part.influences.len() + part.targets.len();
            accessors.limit.take(part.positions.len(), 3 * per_vertex).map_err(flaw)?;
            accessors.limit.take(part.triangles.len(), 3).map_err(flaw)?;
            // Corners have two coordinates each; the material is one number more.
            accessors.limit.take(part.coordinates.len(), 7).map_err(flaw)?;
            accessors.limit.take(part.points.len(), 3 * per_vertex).map_err(flaw)?;
            let Some(skin) = skin else { continue };
            let influences = part.influences.iter().flat_map(|set| set.joints.iter().zip(&set.weights));
            let used = influences.flat_map(|(joints, weights)| joints.iter().zip(weights));
            let worst = used.filter(|(_, weight)| **weight != 0.0).map(|(joint, _)| *joint).max();
            if let Some(index) = worst.filter(|joint| *joint as usize >= skin.joints.len()) {
                let last = (skin.joints.len() as u32).saturating_sub(1);
                return Err(flaw(GltfFault::Index { kind: "joint", index, last }));
            }
        }
        Ok(())
    }

    /// The channels of an animation that move anything to be seen, those of a node in a row.
    pub(super) fn load_channels(
        &self,
        accessors: &Accessors,
        animation: &schema::Animation,
        index: usize,
    ) -> Result<Vec<Channel>, Flaw> {
        let mut channels = Vec::new();
        for channel in &animation.channels {
            let sampler = object(&animation.samplers, "sampler", channel.sampler, ("animation", index))?;
            let Some(node) = channel.target.node else { continue };
            object(&self.rest, "node", node, ("animation", index))?;
            if let Some(moved) = self.moved(node, &channel.target.path) {
                let curve = Curve::load(accessors, sampler, moved, index)?;
                channels.push(Channel { node, moved, curve });
            }
        }
        channels.sort_by_key(|channel| channel.node);
        Ok(channels)
    }

    /// What a channel of a path moves at a node; `None` if that changes nothing.
    fn moved(&self, node: usize, path: &str) -> Option<Moved> {
        if !self.matters[node] {
            return None;
        }
        match path {
            "translation" => Some(Moved::Translation),
            "rotation" => Some(Moved::Rotation),
            "scale" => Some(Moved::Scale),
            "weights" => {
                let weights = self.instances[self.instance_of(node)?].weights.len();
                (weights > 0).then_some(Moved::Weights(weights))
            }
            _ => None,
        }
    }

    /// The instance at a node; they are in the order of their nodes.
    fn instance_of(&self, node: usize) -> Option<usize> {
        self.instances.binary_search_by_key(&node, |instance| instance.node).ok()
    }

    /// Whether there are points and nothing else.
    pub(super) fn is_points(&self) -> bool {
        let mut parts = self.shapes.iter().flat_map(|shape| &shape.parts).peekable();
        parts.peek().is_some() && parts.all(|part| part.triangles.is_empty())
    }

    /// The colours of a pose with these sides, and the images that they show; none if the file says nothing of them, or nobody asks.
    /// Images that are known are not decoded again.
    pub(super) fn appearance(
        &self,
        sides: &[Side],
        known: &DecodedImages,
    ) -> Result<Option<(Appearance, DecodedImages)>, Flaw> {
        let parts = self.instances.iter().flat_map(|instance| &self.shapes[instance.shape].parts);
        assemble(parts.zip(sides.iter().copied()), &self.palette, known)
    }

    /// The mesh at an instant, and the points. A shape that is scaled to nothing is hidden and gives none. The mesh has no colours yet.
    pub(super) fn pose(&self, channels: &[Channel], seconds: f64) -> Pose {
        let mut transforms = self.rest.clone();
        let mut weights: Vec<_> = self.instances.iter().map(|instance| instance.weights.clone()).collect();
        for of_node in channels.chunk_by(|a, b| a.node == b.node) {
            let node = of_node[0].node;
            let mut parts = self.rest_parts[node];
            for channel in of_node {
                match channel.moved {
                    Moved::Translation => parts.translation = channel.curve.vector(seconds),
                    Moved::Rotation => parts.rotation = channel.curve.rotation(seconds),
                    Moved::Scale => parts.scale = channel.curve.vector(seconds),
                    Moved::Weights(_) => {
                        if let Some(instance) = self.instance_of(node) {
                            weights[instance] = channel.curve.value(seconds);
                        }
                    }
                }
            }
            if of_node.iter().any(|channel| !matches!(channel.moved, Moved::Weights(_))) {
                transforms[node] = parts.affine();
            }
        }
        let transforms = self.hierarchy.to_scene(transforms);
        let mut pose = Pose::default();
        for (instance, weights) in self.instances.iter().zip(&weights) {
            self.append(instance, &transforms, weights, &mut pose);
        }
        // Points without colours are white beside others.
        if !pose.point_colours.is_empty() {
            pose.point_colours.resize(pose.points.len(), [255; 3]);
        }
        pose
    }

    /// Appends an instance, given the transforms of all nodes to the scene.
    fn append(&self, instance: &Instance, transforms: &[DAffine3], weights: &[f64], pose: &mut Pose) {
        let own = Placing::by(vec![transforms[instance.node]]);
        let joints = instance.skin.map(|skin| Placing::by(self.skins[skin].transforms(transforms)));
        for part in &self.shapes[instance.shape].parts {
            // Joints place a skinned shape in the scene by themselves: its node's own transform has no part in it.
            let joints = joints.as_ref().filter(|_| !part.influences.is_empty());
            let placing = joints.unwrap_or(&own);
            pose.sides.push(placing.side());
            if placing.hidden {
                continue;
            }
            let place = |vertex: usize| {
                let position = part.morphed(vertex, weights);
                match joints {
                    Some(joints) => part.skinned(vertex, position, &joints.transforms),
                    None => own.transforms[0].transform_point3(position),
                }
            };
            let first_point = pose.points.len();
            pose.points.extend(part.points.iter().map(|vertex| place(*vertex as usize)));
            if !part.points.is_empty() && !part.colours.is_empty() {
                pose.point_colours.resize(first_point, [255; 3]);
                let colours = part.points.iter().map(|vertex| part.colours[*vertex as usize]);
                pose.point_colours.extend(colours);
            }
            if part.triangles.is_empty() {
                continue;
            }
            let mesh = &mut pose.mesh;
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend((0..part.positions.len()).map(place));
            mesh.triangles.extend(part.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| first + vertex);
                if placing.mirrored { [a, c, b] } else { [a, b, c] }
            }));
        }
    }
}

/// What places an instance in the scene: the transform of its node, or those of its joints.
struct Placing {
    transforms: Vec<DAffine3>,
    /// Whether all of them scale to nothing.
    hidden: bool,
    /// Whether most of them turn triangles over.
    mirrored: bool,
}

impl Placing {
    /// Looks at each transform, which an instance does once. A mesh may have many parts and a skin many
    /// joints, and the limit counts their sum, not their product.
    fn by(transforms: Vec<DAffine3>) -> Self {
        #[cfg(test)]
        tests::LOOKED_AT.with(|looked_at| looked_at.set(looked_at.get() + transforms.len()));
        let hidden = transforms.iter().all(|transform| transform.matrix3 == DMat3::ZERO);
        let mirrors = transforms.iter().filter(|transform| transform.matrix3.determinant() < 0.0).count();
        let mirrored = 2 * mirrors > transforms.len();
        Self { transforms, hidden, mirrored }
    }

    fn side(&self) -> Side {
        match (self.hidden, self.mirrored) {
            (true, _) => Side::Hidden,
            (false, false) => Side::Front,
            (false, true) => Side::Turned,
        }
    }
}

/// Marks the nodes of a scene that are to be seen; of all nodes in a file without scenes.
fn shown_nodes(document: &Document, hierarchy: &Hierarchy, scene: usize) -> Result<Vec<bool>, Flaw> {
    let mut shown = nodes_of_scene(document, hierarchy, scene)?;
    let mut hidden: Vec<_> = document.nodes.iter().map(Node::is_hidden).collect();
    hierarchy.mark_descendants(&mut hidden);
    shown.iter_mut().zip(hidden).for_each(|(shown, hidden)| *shown &= !hidden);
    Ok(shown)
}

fn nodes_of_scene(document: &Document, hierarchy: &Hierarchy, scene: usize) -> Result<Vec<bool>, Flaw> {
    if document.scene.is_none() && document.scenes.is_empty() {
        return Ok(vec![true; document.nodes.len()]);
    }
    let mut shown = vec![false; document.nodes.len()];
    for &node in &object(&document.scenes, "scene", scene, ("scene", scene))?.nodes {
        object(&document.nodes, "node", node, ("scene", scene))?;
        shown[node] = true;
    }
    hierarchy.mark_descendants(&mut shown);
    Ok(shown)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::buffers::Buffers;
    use crate::gltf::limit::Limit;
    use serde_json::json;
    use std::cell::Cell;

    thread_local! {
        /// Transforms that [`Placing::by`] looked at.
        pub(super) static LOOKED_AT: Cell<usize> = const { Cell::new(0) };
    }

    #[test]
    fn joints_are_looked_at_once_however_many_parts_hang_on_them() {
        let (parts, joints) = (40, 30);
        let mut accessors = vec![
            json!({ "componentType": 5121, "count": 3, "type": "VEC4" }),
            json!({ "componentType": 5126, "count": 3, "type": "VEC4" }),
        ];
        accessors.resize(2 + parts, json!({ "componentType": 5126, "count": 3, "type": "VEC3" }));
        let primitive =
            |part| json!({ "attributes": { "POSITION": 2 + part, "JOINTS_0": 0, "WEIGHTS_0": 1 } });
        let json = json!({
            "accessors": accessors,
            "meshes": [{ "primitives": (0..parts).map(primitive).collect::<Vec<_>>() }],
            "skins": [{ "joints": vec![0; joints] }],
            "nodes": [{ "mesh": 0, "skin": 0 }],
        });
        let json = json.to_string().into_bytes();
        let document = Document::parse(&json, 0).unwrap();
        let buffers = Buffers::load(&document.buffers, None, None).unwrap();
        let accessors = Accessors::new(&document, buffers, Limit::for_bytes(json.len(), false));
        let scene = Scene::load(&document, &accessors, None).unwrap();
        assert_eq!(scene.pose(&[], 0.0).mesh.triangles.len(), parts);
        assert_eq!(LOOKED_AT.get(), joints + 1, "the joints, and the node itself");
    }
}
