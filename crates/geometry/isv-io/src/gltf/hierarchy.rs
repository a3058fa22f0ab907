//! Nodes, their parents and their transforms.

use super::fault::GltfFault;
use super::schema::{Node, object};
use crate::error::Flaw;
use glam::{DAffine3, DMat3, DQuat, DVec3};

/// A transform in its parts: scale first, then rotation, then translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    pub(super) scale: DVec3,
    pub(super) rotation: DQuat,
    pub(super) translation: DVec3,
}

impl Transform {
    /// The parts of a node's transform. A matrix is taken apart, which loses its shear if it has one.
    pub(super) fn of_node(node: &Node) -> Self {
        if let Some(matrix) = &node.matrix {
            let (scale, rotation, translation) = affine_of_columns(matrix).to_scale_rotation_translation();
            return Self { scale, rotation, translation };
        }
        Self {
            scale: node.scale.map_or(DVec3::ONE, DVec3::from),
            rotation: node.rotation.map_or(DQuat::IDENTITY, |[x, y, z, w]| unit_quaternion([x, y, z, w])),
            translation: node.translation.map_or(DVec3::ZERO, DVec3::from),
        }
    }

    pub(super) fn affine(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// A node's transform at rest.
pub(super) fn rest_transform(node: &Node) -> DAffine3 {
    match &node.matrix {
        Some(matrix) => affine_of_columns(matrix),
        None => Transform::of_node(node).affine(),
    }
}

/// A quaternion x, y, z, w at length 1; no rotation if it has no direction.
pub(super) fn unit_quaternion(components: [f64; 4]) -> DQuat {
    let quaternion = glam::DVec4::from(components).normalize_or(glam::DVec4::W);
    DQuat::from_vec4(quaternion)
}

/// A matrix as glTF stores it, column by column; its last row is always 0, 0, 0, 1.
pub(super) fn affine_of_columns(m: &[f64; 16]) -> DAffine3 {
    DAffine3 {
        matrix3: DMat3::from_cols_array(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]),
        translation: DVec3::new(m[12], m[13], m[14]),
    }
}

/// The forest of nodes.
#[derive(Debug)]
pub(super) struct Hierarchy {
    parents: Vec<Option<usize>>,
    /// All nodes, each after its parent.
    order: Vec<usize>,
}

impl Hierarchy {
    /// Refuses nodes with two parents and circles. Takes no more stack for deep trees.
    pub(super) fn new(nodes: &[Node]) -> Result<Self, Flaw> {
        let mut parents = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                object(nodes, "node", child, ("node", index))?;
                if parents[child].replace(index).is_some() {
                    return Err(Flaw::in_object("node", child, GltfFault::TwoParents));
                }
            }
        }
        let mut order: Vec<usize> = (0..nodes.len()).filter(|node| parents[*node].is_none()).collect();
        let mut at = 0;
        while let Some(&node) = order.get(at) {
            order.extend(&nodes[node].children);
            at += 1;
        }
        // Every node has one parent at most, so what no root leads to hangs on a circle.
        let mut reached = vec![false; nodes.len()];
        order.iter().for_each(|node| reached[*node] = true);
        if let Some(mut node) = reached.iter().position(|reached| !reached) {
            for _ in 0..nodes.len() {
                node = parents[node].unwrap_or(node);
            }
            return Err(Flaw::in_object("node", node, GltfFault::Cycle));
        }
        Ok(Self { parents, order })
    }

    /// Marks what is below marked nodes.
    pub(super) fn mark_descendants(&self, marks: &mut [bool]) {
        for &node in &self.order {
            marks[node] |= self.parents[node].is_some_and(|parent| marks[parent]);
        }
    }

    /// Marks what is above marked nodes.
    pub(super) fn mark_ancestors(&self, marks: &mut [bool]) {
        for &node in self.order.iter().rev() {
            if let Some(parent) = self.parents[node].filter(|_| marks[node]) {
                marks[parent] = true;
            }
        }
    }

    /// Transforms to the space of the scene, from those to the space of the parents.
    pub(super) fn to_scene(&self, mut transforms: Vec<DAffine3>) -> Vec<DAffine3> {
        for &node in &self.order {
            if let Some(parent) = self.parents[node] {
                transforms[node] = transforms[parent] * transforms[node];
            }
        }
        transforms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodes(children: &[&[usize]]) -> Vec<Node> {
        children.iter().map(|c| Node { children: c.to_vec(), ..Node::default() }).collect()
    }

    #[test]
    fn parents_come_first_however_deep() {
        let n = 300_000;
        let chain: Vec<Node> = (0..n)
            .map(|i| Node { children: (i > 0).then(|| i - 1).into_iter().collect(), ..Node::default() })
            .collect();
        let hierarchy = Hierarchy::new(&chain).unwrap();
        assert_eq!((hierarchy.order[0], hierarchy.order[n - 1]), (n - 1, 0));
        let moved = hierarchy.to_scene(vec![DAffine3::from_translation(DVec3::X); n]);
        assert_eq!(moved[0].translation.x, n as f64);
        let mut marks = vec![false; n];
        marks[5] = true;
        hierarchy.mark_descendants(&mut marks);
        assert_eq!(marks.iter().filter(|mark| **mark).count(), 6);
        hierarchy.mark_ancestors(&mut marks);
        assert!(marks.iter().all(|mark| *mark));
    }

    #[test]
    fn circles_and_shared_children_are_refused() {
        let why = |children: &[&[usize]]| Hierarchy::new(&nodes(children)).err().unwrap();
        assert_eq!(why(&[&[0]]), Flaw::in_object("node", 0, GltfFault::Cycle));
        // Node 1 hangs on the circle of 2 and 3.
        let circle = why(&[&[], &[], &[3, 1], &[2]]);
        assert!([2, 3].map(|n| Flaw::in_object("node", n, GltfFault::Cycle)).contains(&circle));
        assert_eq!(why(&[&[2], &[2], &[]]), Flaw::in_object("node", 2, GltfFault::TwoParents));
        let fault = GltfFault::NoSuch { kind: "node", index: 7, count: 1 };
        assert_eq!(why(&[&[7]]), Flaw::in_object("node", 0, fault));
    }

    #[test]
    fn a_matrix_is_stored_by_columns() {
        let mut matrix = [0.0; 16];
        (matrix[1], matrix[4], matrix[10], matrix[12], matrix[15]) = (1.0, -1.0, 2.0, 5.0, 1.0);
        let node = Node { matrix: Some(Box::new(matrix)), ..Node::default() };
        for transform in [rest_transform(&node), Transform::of_node(&node).affine()] {
            let moved = transform.transform_point3(DVec3::new(1.0, 0.0, 1.0));
            assert!(moved.distance(DVec3::new(5.0, 1.0, 2.0)) < 1e-12, "{moved}");
        }
    }
}
