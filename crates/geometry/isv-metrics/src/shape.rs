//! What can be measured.

use glam::DVec3;
use isv_volume::{PointCloud, TriangleMesh};

/// A frame's geometry: a surface, or points on one.
#[derive(Clone, Copy, Debug)]
pub enum Shape<'a> {
    /// Triangles, which are sampled. Valid by [`TriangleMesh::validate`], or empty.
    Mesh(&'a TriangleMesh),
    /// Points, which are taken as they are. Valid by [`PointCloud::validate`], or empty.
    Points(&'a PointCloud),
}

impl<'a> From<&'a TriangleMesh> for Shape<'a> {
    fn from(mesh: &'a TriangleMesh) -> Self {
        Self::Mesh(mesh)
    }
}

impl<'a> From<&'a PointCloud> for Shape<'a> {
    fn from(points: &'a PointCloud) -> Self {
        Self::Points(points)
    }
}

impl Shape<'_> {
    /// Whether there are colours.
    pub(crate) fn has_colours(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.appearance.is_some(),
            Self::Points(points) => !points.colours.is_empty(),
        }
    }

    /// The longest side of the bounding box, in metres; 0 if nothing is there. Vertices without a triangle do not count.
    pub(crate) fn longest_side(&self) -> f64 {
        const NOTHING: (DVec3, DVec3) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let widen = |(lo, hi): (DVec3, DVec3), p: DVec3| (lo.min(p), hi.max(p));
        let (lo, hi) = match self {
            Self::Mesh(mesh) => {
                let corners = mesh.triangles.iter().flatten().map(|v| mesh.vertices[*v as usize]);
                corners.fold(NOTHING, widen)
            }
            Self::Points(points) => points.positions.iter().copied().fold(NOTHING, widen),
        };
        (hi - lo).max_element().max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_side_is_that_of_what_can_be_seen() {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y * -3.0, DVec3::Z * 50.0];
        let mesh =
            TriangleMesh { vertices, normals: Vec::new(), triangles: vec![[0, 1, 2]], appearance: None };
        assert_eq!(Shape::from(&mesh).longest_side(), 3.0);
        let points = PointCloud { positions: mesh.vertices, ..PointCloud::default() };
        assert_eq!(Shape::from(&points).longest_side(), 50.0);
        assert_eq!(Shape::from(&PointCloud::default()).longest_side(), 0.0);
    }
}
