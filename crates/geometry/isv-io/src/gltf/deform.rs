//! What moves the vertices of a shape: morph targets, then the joints of a skin.

use super::accessor::Accessors;
use super::fault::GltfFault;
use super::hierarchy::affine_of_columns;
use super::parts::Part;
use super::schema::{Document, object};
use crate::error::Flaw;
use glam::{DAffine3, DVec3, Vec3};

/// The joints that a skinned shape hangs on.
#[derive(Debug)]
pub(super) struct Skin {
    /// Joints of the skin, as nodes.
    pub(super) joints: Vec<usize>,
    /// From the space of the shape to that of each joint at rest.
    inverse_bind: Vec<DAffine3>,
}

impl Part {
    /// Place of a vertex by the morph targets.
    pub(super) fn morphed(&self, vertex: usize, weights: &[f64]) -> DVec3 {
        let displacements =
            self.targets.iter().zip(weights).filter(|(target, weight)| **weight != 0.0 && !target.is_empty());
        let position = Vec3::from(self.positions[vertex]).as_dvec3();
        displacements
            .fold(position, |p, (target, weight)| p + *weight * Vec3::from(target[vertex]).as_dvec3())
    }

    /// Place of a vertex by the joints: the mean of where each would put it, by their weights. One without
    /// weights follows the first of its joints.
    pub(super) fn skinned(&self, vertex: usize, position: DVec3, joints: &[DAffine3]) -> DVec3 {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for set in &self.influences {
            for (joint, weight) in set.joints[vertex].iter().zip(set.weights[vertex]) {
                if weight != 0.0 {
                    sum += f64::from(weight) * joints[*joint as usize].transform_point3(position);
                    total += f64::from(weight);
                }
            }
        }
        if total != 0.0 {
            return sum / total;
        }
        let first = self.influences[0].joints[vertex][0] as usize;
        joints.get(first).map_or(position, |joint| joint.transform_point3(position))
    }
}

impl Skin {
    pub(super) fn load(document: &Document, accessors: &Accessors, index: usize) -> Result<Self, Flaw> {
        let skin = &document.skins[index];
        for &joint in &skin.joints {
            object(&document.nodes, "node", joint, ("skin", index))?;
        }
        let Some(matrices) = skin.inverse_bind_matrices else {
            let inverse_bind = vec![DAffine3::IDENTITY; skin.joints.len()];
            return Ok(Self { joints: skin.joints.clone(), inverse_bind });
        };
        let matrices = accessors.floats::<16>(matrices, "MAT4", ("skin", index))?;
        if matrices.len() < skin.joints.len() {
            let (wanted, found) = (skin.joints.len() as u64, matrices.len() as u64);
            return Err(Flaw::in_object("skin", index, GltfFault::Count { wanted, found }));
        }
        let inverse_bind = matrices.iter().map(|m| affine_of_columns(&m.map(f64::from))).collect();
        Ok(Self { joints: skin.joints.clone(), inverse_bind })
    }

    /// From the space of the shape to the scene, for each joint.
    pub(super) fn transforms(&self, of_nodes: &[DAffine3]) -> Vec<DAffine3> {
        self.joints
            .iter()
            .zip(&self.inverse_bind)
            .map(|(joint, inverse)| of_nodes[*joint] * *inverse)
            .collect()
    }
}
