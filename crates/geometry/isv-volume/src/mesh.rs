//! Triangle meshes.

use crate::{Appearance, AppearanceError};
use glam::DVec3;
use std::sync::Arc;
use thiserror::Error;

/// A mesh that cannot be worked with.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum MeshError {
    /// A NaN or infinite coordinate.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that is not there.
    #[error("face {face} names vertex {vertex} of {vertices}")]
    IndexPastEnd {
        /// Index of the triangle.
        face: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// No triangles at all.
    #[error("no faces")]
    NoFaces,
    /// Colours that do not fit the mesh.
    #[error(transparent)]
    Appearance(#[from] AppearanceError),
}

/// An indexed triangle mesh: positions in metres, triangles counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Positions in metres.
    pub vertices: Vec<DVec3>,
    /// Unit normals pointing outside, one a vertex; empty when the mesh has none.
    pub normals: Vec<DVec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Colours, which meshes that are made from this one share; `None` without any.
    pub appearance: Option<Arc<Appearance>>,
}

impl TriangleMesh {
    /// Corner positions of triangle `face`.
    #[must_use]
    #[inline]
    pub fn corners(&self, face: usize) -> [DVec3; 3] {
        self.triangles[face].map(|v| self.vertices[v as usize])
    }

    /// Normal of triangle `face` by the right-hand rule, as long as the triangle's area in square metres.
    #[must_use]
    #[inline]
    pub fn area_vector(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(c - a) / 2.0
    }

    /// Area of all triangles in square metres.
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|face| self.area_vector(face).length()).sum()
    }

    /// Checks what every consumer relies on: at least one face, finite vertices, indices in range, colours that fit.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), MeshError> {
        if self.triangles.is_empty() {
            return Err(MeshError::NoFaces);
        }
        if let Some(vertex) = self.vertices.iter().position(|v| !v.is_finite()) {
            return Err(MeshError::NotFinite { vertex });
        }
        for (face, triangle) in self.triangles.iter().enumerate() {
            if let Some(&vertex) = triangle.iter().find(|v| **v as usize >= self.vertices.len()) {
                return Err(MeshError::IndexPastEnd { face, vertex, vertices: self.vertices.len() });
            }
        }
        if let Some(appearance) = &self.appearance {
            appearance.validate(self.vertices.len(), self.triangles.len())?;
        }
        Ok(())
    }

    /// Smallest and largest corner of the bounding box of all triangles, so not of vertices that none of them has; `None` without
    /// triangles.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut corners =
            self.triangles.as_flattened().iter().filter_map(|vertex| self.vertices.get(*vertex as usize));
        let first = *corners.next()?;
        Some(corners.fold((first, first), |(lo, hi), v| (lo.min(*v), hi.max(*v))))
    }

    /// Mean normal of the faces around each vertex, weighted by their angle there; zero where no face has an area.
    ///
    /// The weights make it independent of how a flat part is cut into triangles.
    #[must_use]
    pub fn angle_weighted_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertices.len()];
        for (face, triangle) in self.triangles.iter().enumerate() {
            let corners = self.corners(face);
            let normal = self.area_vector(face).normalize_or_zero();
            for (i, &vertex) in triangle.iter().enumerate() {
                let [here, next, last] = [0, 1, 2].map(|step| corners[(i + step) % 3]);
                let (a, b) = (next - here, last - here);
                if a != DVec3::ZERO && b != DVec3::ZERO {
                    normals[vertex as usize] += normal * a.angle_between(b);
                }
            }
        }
        normals.into_iter().map(DVec3::normalize_or_zero).collect()
    }
}
