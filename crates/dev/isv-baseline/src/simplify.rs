//! Quadric simplification of meshes (Garland and Heckbert 1997), by the Rust port of meshoptimizer.

use glam::{DVec3, Vec3};
use isv_simplify::{weld, without_unused};
use isv_volume::{Appearance, MeshError, TriangleMesh};
use meshoptimizer_rs::{
    AttributesMut, Positions, PositionsMut, SimplifyOptions, SimplifySettings, Workspace, simplify_into,
    simplify_with_update,
};
use std::collections::HashMap;
use std::sync::Arc;
use thiserror::Error;

/// Largest error allowed, in extents of the mesh: none that stops the simplifier before the share is reached.
const ANY_ERROR: f32 = 1e6;

/// Weight of texture coordinates, of which the texture's side is 1, against positions, of which the mesh's extent is 1.
const COORDINATE_WEIGHT: f32 = 0.5;

/// A mesh that cannot be simplified.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimplifyError {
    /// Not a share.
    #[error("a share of {share} of the faces is outside 0 to 1")]
    Share {
        /// The share asked for.
        share: f64,
    },
    /// The mesh cannot be worked with.
    #[error("the mesh to simplify has {0}")]
    Mesh(#[from] MeshError),
    /// The simplifier gives up: numbers that are not finite in `f32`, or a mesh beyond its limits of memory and work.
    #[error("the mesh cannot be simplified: {0}")]
    Simplifier(meshoptimizer_rs::Error),
}

/// Keeps this share of a mesh's faces, 0 to 1, by collapsing edges at the least quadric error, whatever that error is.
///
/// Vertices at exactly the same position become one before, so that a seam is not a border; normals are dropped. The
/// vertices that are left move to where their quadrics are least. The share is missed where topology stands in the way.
///
/// # Errors
/// See [`SimplifyError`].
pub fn simplify(mesh: &TriangleMesh, share: f64) -> Result<TriangleMesh, SimplifyError> {
    simplify_with(mesh, share, METHOD)
}

/// Keeps a share of a mesh's faces as [`simplify`] does, and the texture coordinates of their corners.
///
/// Corners at one position with different coordinates (seams of the texture) move together. The error of coordinates counts with that
/// of positions. The mesh keeps its materials; faces no longer tell which one is theirs.
///
/// # Errors
/// See [`SimplifyError`].
///
/// # Panics
/// If the mesh has no texture coordinates.
pub fn simplify_textured(mesh: &TriangleMesh, share: f64) -> Result<TriangleMesh, SimplifyError> {
    if !(0.0..=1.0).contains(&share) {
        return Err(SimplifyError::Share { share });
    }
    mesh.validate()?;
    let appearance = mesh.appearance.as_ref().expect("a mesh with a texture");
    let coordinates_of = &appearance.texture_coordinates;
    assert_eq!(coordinates_of.len(), mesh.triangles.len(), "each face has texture coordinates");
    let faces = (mesh.triangles.len() as f64 * share).round() as usize;
    let (low, high) = mesh.bounds().expect("a valid mesh has vertices");
    let centre = (low + high) / 2.0;
    // A vertex for each pair of a position and a coordinate.
    let mut vertices = HashMap::new();
    let (mut positions, mut coordinates): (Vec<[f32; 3]>, Vec<[f32; 2]>) = Default::default();
    let mut corners = Vec::with_capacity(3 * mesh.triangles.len());
    for (triangle, at) in mesh.triangles.iter().zip(coordinates_of) {
        for (vertex, coordinate) in triangle.iter().zip(at) {
            let position = (mesh.vertices[*vertex as usize] - centre).as_vec3().to_array();
            let key = (position.map(f32::to_bits), coordinate.map(f32::to_bits));
            corners.push(*vertices.entry(key).or_insert_with(|| {
                positions.push(position);
                coordinates.push(*coordinate);
                positions.len() as u32 - 1
            }));
        }
    }
    let settings =
        SimplifySettings { target_index_count: 3 * faces, target_error: ANY_ERROR, options: METHOD.options };
    let count = coordinates.len();
    let attributes = AttributesMut::from_interleaved(coordinates.as_flattened_mut(), count, 2, 2, 0);
    let left = simplify_with_update(
        &mut corners,
        &mut PositionsMut::from_packed(&mut positions),
        Some(&mut attributes.map_err(SimplifyError::Simplifier)?),
        &[COORDINATE_WEIGHT; 2],
        None,
        settings,
        &mut Workspace::default(),
    )
    .map_err(SimplifyError::Simplifier)?;
    let triangles = corners[..left.index_count].as_chunks().0;
    let texture_coordinates = triangles.iter().map(|t| t.map(|v| coordinates[v as usize])).collect();
    let all: Vec<DVec3> = positions.iter().map(|p| Vec3::from_array(*p).as_dvec3() + centre).collect();
    let materials = appearance.materials.clone();
    let appearance = Appearance { texture_coordinates, materials, ..Appearance::default() };
    Ok(TriangleMesh { appearance: Some(Arc::new(appearance)), ..without_unused(&all, triangles) })
}

/// How the simplifier is used.
#[derive(Clone, Copy, Debug)]
struct Method {
    options: SimplifyOptions,
    /// Whether the vertices that are left move to where their quadrics are least.
    moves_vertices: bool,
}

/// What gives the least error for the bytes that Draco makes of it (`docs/design/017-baselines.md`).
const METHOD: Method = Method { options: SimplifyOptions::REGULARIZE_LIGHT, moves_vertices: true };

fn simplify_with(mesh: &TriangleMesh, share: f64, method: Method) -> Result<TriangleMesh, SimplifyError> {
    if !(0.0..=1.0).contains(&share) {
        return Err(SimplifyError::Share { share });
    }
    mesh.validate()?;
    let faces = (mesh.triangles.len() as f64 * share).round() as usize;
    let welded = weld(mesh);
    if faces >= welded.triangles.len() {
        return Ok(welded);
    }
    let (low, high) = welded.bounds().expect("a valid mesh has vertices");
    let centre = (low + high) / 2.0;
    let mut positions: Vec<[f32; 3]> =
        welded.vertices.iter().map(|v| (*v - centre).as_vec3().to_array()).collect();
    let mut corners = welded.triangles.as_flattened().to_vec();
    let settings =
        SimplifySettings { target_index_count: 3 * faces, target_error: ANY_ERROR, options: method.options };
    let left = if method.moves_vertices {
        let mut moved = PositionsMut::from_packed(&mut positions);
        let mut workspace = Workspace::default();
        simplify_with_update(&mut corners, &mut moved, None, &[], None, settings, &mut workspace)
    } else {
        let (all, mut workspace) = (corners.clone(), Workspace::default());
        simplify_into(&mut corners, &all, Positions::from_packed(&positions), settings, &mut workspace)
    }
    .map_err(SimplifyError::Simplifier)?;
    let vertices: Vec<DVec3> = positions.iter().map(|p| Vec3::from_array(*p).as_dvec3() + centre).collect();
    let triangles = corners[..left.index_count].as_chunks().0;
    Ok(without_unused(&vertices, triangles))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support;
    use isv_metrics::{CompareOptions, compare, connected_components};
    use isv_testkit::{Need, skip};

    const METHODS: [(&str, Method); 7] = {
        const fn method(options: SimplifyOptions, moves_vertices: bool) -> Method {
            Method { options, moves_vertices }
        }
        [
            ("subset", method(SimplifyOptions::EMPTY, false)),
            ("subset, prune", method(SimplifyOptions::PRUNE, false)),
            ("subset, regularize light", method(SimplifyOptions::REGULARIZE_LIGHT, false)),
            ("moved", method(SimplifyOptions::EMPTY, true)),
            ("moved, prune", method(SimplifyOptions::PRUNE, true)),
            ("moved, permissive", method(SimplifyOptions::PERMISSIVE, true)),
            ("moved, regularize light", METHOD),
        ]
    };

    /// What became of a mesh.
    #[derive(Debug)]
    struct Outcome {
        share_left: f64,
        mean_mm: f64,
        /// Size under 10-bit Draco (bytes).
        bytes: usize,
    }

    /// Outcomes of all methods on a capture, the chosen one last; prints them.
    fn table(share: f64) -> Option<[Outcome; 7]> {
        let mesh = support::load("dancer", 0)?;
        let Some(draco) = crate::Draco::find() else {
            skip(Need::Draco, "draco_encoder is not installed");
            return None;
        };
        Some(METHODS.map(|(name, method)| {
            let test = simplify_with(&mesh, share, method).unwrap();
            let options = CompareOptions { spacing_m: 0.005, ..CompareOptions::default() };
            let outcome = Outcome {
                share_left: test.triangles.len() as f64 / mesh.triangles.len() as f64,
                mean_mm: compare(&mesh, &test, &options).unwrap().p2s_mean_mm.unwrap(),
                bytes: draco.encode(&test, 10).unwrap().output.len(),
            };
            println!("to {share}, {name}: {outcome:.4?}");
            outcome
        }))
    }

    /// Halving the faces about doubles the error, so the product of error and bytes tells which method is ahead.
    #[test]
    fn no_other_method_gives_less_error_for_the_bytes_on_a_capture() {
        for share in [0.5, 0.1] {
            let Some(outcomes) = table(share) else { return };
            let costs: Vec<f64> = outcomes.iter().map(|o| o.mean_mm * o.bytes as f64).collect();
            assert!((outcomes[6].share_left / share - 1.0).abs() < 0.02, "{:?}", outcomes[6]);
            assert!(costs.iter().all(|cost| costs[6] <= 1.02 * cost), "{costs:?}");
        }
    }

    #[test]
    fn a_scene_of_many_parts_is_simplified_to_its_share() {
        let Some(mesh) = support::load("monastery", 0) else { return };
        for share in [0.25, 0.05] {
            let left = simplify(&mesh, share).unwrap().triangles.len() as f64 / mesh.triangles.len() as f64;
            assert!((left / share - 1.0).abs() < 0.05, "{left} for {share}");
        }
    }

    #[test]
    fn a_simplified_sphere_is_still_a_sphere() {
        let sphere = isv_testkit::sphere(1.0, 60);
        for share in [0.5, 0.1] {
            let simplified = simplify(&sphere, share).unwrap();
            simplified.validate().unwrap();
            let left = simplified.triangles.len() as f64 / sphere.triangles.len() as f64;
            assert!((left / share - 1.0).abs() < 0.01, "{left} for {share}");
            assert!((simplified.area() / sphere.area() - 1.0).abs() < 0.01);
            assert!(simplified.vertices.iter().all(|v| (v.length() - 1.0).abs() < 0.02));
            assert_eq!(connected_components(&simplified), 1, "welded at the seam");
        }
    }

    #[test]
    fn texture_coordinates_stay_where_they_are() {
        let square = support::textured_square(40);
        let simplified = simplify_textured(&square, 0.1).unwrap();
        simplified.validate().unwrap();
        assert!(simplified.triangles.len() * 5 < square.triangles.len(), "{}", simplified.triangles.len());
        let farthest = support::farthest_coordinate(&simplified);
        assert!(farthest < 1e-3, "{farthest}");
        // The seam does not open.
        assert_eq!(connected_components(&weld(&simplified)), 1);
        assert!((simplified.area() - 1.0).abs() < 1e-3);
        assert!(matches!(simplify_textured(&square, 2.0), Err(SimplifyError::Share { .. })));
    }

    /// So far from the origin an f32 is good for metres only.
    #[test]
    fn a_mesh_far_away_is_simplified_like_one_at_the_origin() {
        let near = isv_testkit::sphere(1.0, 30);
        let offset = DVec3::splat(8_388_608.0);
        let mut far = near.clone();
        far.vertices.iter_mut().for_each(|v| *v += offset);
        let [near, far] = [near, far].map(|mesh| simplify(&mesh, 0.2).unwrap());
        assert!((far.area() / near.area() - 1.0).abs() < 0.01, "{} for {}", far.area(), near.area());
    }

    #[test]
    fn what_cannot_be_simplified_is_refused() {
        let cube = isv_testkit::cube(1.0);
        for share in [-0.1, 1.1, f64::NAN] {
            assert!(matches!(simplify(&cube, share), Err(SimplifyError::Share { .. })));
        }
        assert_eq!(simplify(&TriangleMesh::default(), 0.5), Err(SimplifyError::Mesh(MeshError::NoFaces)));
        let mut wild = cube;
        wild.vertices[0] = DVec3::splat(1e300);
        assert!(matches!(simplify(&wild, 0.5), Err(SimplifyError::Simplifier(_))));
    }
}
