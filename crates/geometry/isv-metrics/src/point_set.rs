//! The points that stand for a shape.

use crate::normals::SmoothNormals;
use crate::sampling::{Drawn, draw_in_order};
use glam::DVec3;
use isv_spatial::{PointTree, PositionSet, position_key};
use isv_volume::{PointCloud, TriangleMesh};
use rayon::prelude::*;

/// Samples that are worth a thread's while.
const MIN_SAMPLES: usize = 1024;

/// Points to measure from and to, with or without normals.
pub(crate) struct PointSet {
    tree: PointTree,
    /// Unit normals in the tree's order, zero where not known.
    normals: Option<Vec<DVec3>>,
}

impl PointSet {
    /// The samples that [`sample_surface`](crate::sample_surface) draws of a mesh, with interpolated normals.
    pub(crate) fn sampled(mesh: &TriangleMesh, normals: &SmoothNormals, spacing_m: f64, seed: u64) -> Self {
        let samples = draw_in_order(mesh, spacing_m, seed);
        let described = |drawn: &Drawn| (drawn.point, normals.at(drawn.face, drawn.weights));
        let (points, normals): (Vec<_>, Vec<_>) =
            samples.par_iter().with_min_len(MIN_SAMPLES).map(described).unzip();
        Self::new(points, Some(&normals))
    }

    /// The points of a cloud; of those at exactly the same position the first.
    pub(crate) fn of_cloud(cloud: &PointCloud) -> Self {
        let mut seen = PositionSet::default();
        let first: Vec<bool> = cloud.positions.iter().map(|p| seen.insert(position_key(*p))).collect();
        let only_first = |vectors: &[DVec3]| -> Vec<DVec3> {
            vectors.iter().zip(&first).filter_map(|(v, first)| first.then_some(*v)).collect()
        };
        let normals = only_first(&cloud.normals);
        Self::new(only_first(&cloud.positions), (!normals.is_empty()).then_some(&normals[..]))
    }

    fn new(points: Vec<DVec3>, normals: Option<&[DVec3]>) -> Self {
        let tree = PointTree::new(points);
        let in_tree_order = |normals: &[DVec3]| tree.origins().iter().map(|i| normals[*i as usize]).collect();
        Self { normals: normals.map(in_tree_order), tree }
    }

    pub(crate) fn tree(&self) -> &PointTree {
        &self.tree
    }

    /// The points, in an order in which neighbours in the list lie near each other.
    pub(crate) fn points(&self) -> &[DVec3] {
        self.tree.points()
    }

    /// Unit normals, one a point, if the points have any; zero where one is not known.
    pub(crate) fn normals(&self) -> Option<&[DVec3]> {
        self.normals.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_at_one_place_count_once_and_keep_the_first_normal() {
        let cloud = PointCloud {
            positions: vec![DVec3::ZERO, DVec3::ONE, DVec3::new(-0.0, 0.0, 0.0), DVec3::ONE],
            normals: vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::Z],
            viewpoint: None,
            scans: Vec::new(),
            colours: Vec::new(),
        };
        let set = PointSet::of_cloud(&cloud);
        assert_eq!(set.points(), [DVec3::ZERO, DVec3::ONE]);
        assert_eq!(set.normals(), Some(&[DVec3::X, DVec3::Y][..]));
        let bare = PointCloud { normals: Vec::new(), ..cloud };
        assert_eq!(PointSet::of_cloud(&bare).normals(), None);
    }
}
