//! Quadric simplification of meshes (Garland and Heckbert 1997), by the Rust port of meshoptimizer.

use glam::DVec3;
use isv_volume::{MeshError, TriangleMesh};
use meshoptimizer_rs::{Positions, SimplifyOptions, SimplifySettings, Workspace};
use rustc_hash::FxHashMap;
use thiserror::Error;

/// Largest error allowed, in extents of the mesh: none that stops the simplifier before the share is reached.
const ANY_ERROR: f32 = 1e6;

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
/// Vertices at exactly the same position become one before, so that a seam is not a border; normals are dropped. What is
/// left are some of the mesh's own vertices. The share is missed where topology stands in the way.
///
/// # Errors
/// See [`SimplifyError`].
pub fn simplify(mesh: &TriangleMesh, share: f64) -> Result<TriangleMesh, SimplifyError> {
    simplify_with(mesh, share, SimplifyOptions::PRUNE)
}

fn simplify_with(
    mesh: &TriangleMesh,
    share: f64,
    options: SimplifyOptions,
) -> Result<TriangleMesh, SimplifyError> {
    if !(0.0..=1.0).contains(&share) {
        return Err(SimplifyError::Share { share });
    }
    mesh.validate()?;
    let faces = (mesh.triangles.len() as f64 * share).round() as usize;
    let welded = weld(mesh);
    let (low, high) = welded.bounds().expect("a valid mesh has vertices");
    let centre = (low + high) / 2.0;
    let positions: Vec<[f32; 3]> =
        welded.vertices.iter().map(|v| (*v - centre).as_vec3().to_array()).collect();
    let settings = SimplifySettings {
        target_index_count: 3 * faces.min(welded.triangles.len()),
        target_error: ANY_ERROR,
        options,
    };
    let simplified = meshoptimizer_rs::simplify(
        welded.triangles.as_flattened(),
        Positions::from_packed(&positions),
        settings,
        &mut Workspace::default(),
    )
    .map_err(SimplifyError::Simplifier)?;
    let triangles = simplified.indices.as_chunks().0;
    Ok(without_unused(&welded.vertices, triangles))
}

/// The mesh with one vertex a position, without the faces that have no area for it.
fn weld(mesh: &TriangleMesh) -> TriangleMesh {
    let mut places = FxHashMap::default();
    let mut vertices = Vec::new();
    let merged: Vec<u32> = mesh
        .vertices
        .iter()
        .map(|vertex| {
            // Zero has two signs and one place.
            let place = (*vertex + DVec3::ZERO).to_array().map(f64::to_bits);
            *places.entry(place).or_insert_with(|| {
                vertices.push(*vertex);
                vertices.len() as u32 - 1
            })
        })
        .collect();
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| merged[v as usize]));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    TriangleMesh { vertices, normals: Vec::new(), triangles }
}

/// The mesh of these triangles, with only the vertices that they name, in the order in which they are named.
fn without_unused(vertices: &[DVec3], triangles: &[[u32; 3]]) -> TriangleMesh {
    let mut renamed = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    let triangles = triangles
        .iter()
        .map(|triangle| {
            triangle.map(|v| {
                let name = &mut renamed[v as usize];
                if *name == u32::MAX {
                    *name = kept.len() as u32;
                    kept.push(vertices[v as usize]);
                }
                *name
            })
        })
        .collect();
    TriangleMesh { vertices: kept, normals: Vec::new(), triangles }
}
