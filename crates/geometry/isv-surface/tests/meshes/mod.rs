//! What a good mesh is.

use isv_volume::TriangleMesh;
use std::collections::HashMap;

/// How often each directed edge occurs.
pub(crate) fn directed_edges(mesh: &TriangleMesh) -> HashMap<(u32, u32), usize> {
    let mut edges = HashMap::new();
    for [a, b, c] in &mesh.triangles {
        for edge in [(*a, *b), (*b, *c), (*c, *a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    edges
}

/// Directed edges whose opposite is missing: the border of the mesh. Panics if any directed edge occurs twice.
pub(crate) fn border(mesh: &TriangleMesh) -> Vec<(u32, u32)> {
    let edges = directed_edges(mesh);
    assert!(edges.values().all(|n| *n == 1), "an edge is used twice in the same direction");
    edges.keys().filter(|(a, b)| !edges.contains_key(&(*b, *a))).copied().collect()
}

/// Checks what holds for every mesh: manifold edges, all vertices used, no two in one place.
pub(crate) fn check_mesh(mesh: &TriangleMesh) {
    border(mesh);
    let mut used = vec![false; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|v| used[*v as usize] = true);
    assert!(used.iter().all(|u| *u), "a vertex has no triangle");
    let mut places: Vec<[u64; 3]> = mesh.vertices.iter().map(|v| v.to_array().map(f64::to_bits)).collect();
    places.sort_unstable();
    assert!(places.windows(2).all(|w| w[0] != w[1]), "two vertices have the same position");
}

/// Vertices - edges + faces of a closed mesh.
pub(crate) fn euler_number(mesh: &TriangleMesh) -> i64 {
    assert!(border(mesh).is_empty(), "the mesh is open");
    mesh.vertices.len() as i64 - directed_edges(mesh).len() as i64 / 2 + mesh.triangles.len() as i64
}

/// Area and enclosed volume.
pub(crate) fn measures(mesh: &TriangleMesh) -> (f64, f64) {
    (0..mesh.triangles.len()).fold((0.0, 0.0), |(area, volume), face| {
        let [a, b, c] = mesh.corners(face);
        (area + (b - a).cross(c - a).length() / 2.0, volume + a.dot(b.cross(c)) / 6.0)
    })
}
