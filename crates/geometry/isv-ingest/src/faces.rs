//! Faces that say nothing of a surface: those without area, and those that are there already.

use isv_spatial::{PositionKey, PositionSet, position_key};
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// The mesh without faces that have no area at all. Such a face is an edge or a point, and an offset shell
/// would make a spike or a ball of it. Slivers stay.
pub(crate) fn with_area(mesh: &TriangleMesh) -> Cow<'_, TriangleMesh> {
    let has_area = |face: usize| {
        let [a, b, c] = mesh.corners(face);
        a != b && b != c && c != a && mesh.area_vector(face) != glam::DVec3::ZERO
    };
    keep(mesh, (0..mesh.triangles.len()).into_par_iter().map(has_area).collect())
}

/// The mesh without faces that have the corners of an earlier one, in the same order. One that faces the other way stays.
pub(crate) fn distinct(mesh: &TriangleMesh) -> Cow<'_, TriangleMesh> {
    let mut seen: PositionSet<[PositionKey; 3]> = PositionSet::default();
    let is_new = |face: usize| {
        let mut corners = mesh.corners(face).map(position_key);
        let first = (0..3).min_by_key(|corner| corners[*corner]).unwrap_or(0);
        corners.rotate_left(first);
        seen.insert(corners)
    };
    keep(mesh, (0..mesh.triangles.len()).map(is_new).collect())
}

fn keep(mesh: &TriangleMesh, kept: Vec<bool>) -> Cow<'_, TriangleMesh> {
    if !kept.contains(&false) {
        return Cow::Borrowed(mesh);
    }
    let mut thinned = mesh.clone();
    let faces = (0..kept.len()).filter(|face| kept[*face]).map(|face| (face, false));
    thinned.appearance = mesh.appearance.as_ref().map(|look| Arc::new(look.of_faces(faces)));
    let mut kept = kept.into_iter();
    thinned.triangles.retain(|_| kept.next() == Some(true));
    Cow::Owned(thinned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::sphere;

    #[test]
    fn what_says_something_stays() {
        // Those at the poles have no area.
        let mesh = with_area(&sphere(0.4, 20)).into_owned();
        assert!(matches!(with_area(&mesh), Cow::Borrowed(_)) && matches!(distinct(&mesh), Cow::Borrowed(_)));
        let mut more = mesh.clone();
        let [a, b, c] = mesh.triangles[7];
        more.triangles.extend([[a, b, a], [c, c, c]]);
        assert_eq!(*with_area(&more), mesh);
        more.triangles.truncate(mesh.triangles.len());
        more.triangles.extend([[b, c, a], [a, b, c]]);
        assert_eq!(*distinct(&more), mesh);
        more.triangles.push([a, c, b]);
        assert_eq!(distinct(&more).triangles.len(), mesh.triangles.len() + 1);
    }
}
