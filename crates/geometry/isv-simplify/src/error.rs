//! How far two surfaces are apart, and where.

use glam::DVec3;
use isv_spatial::Bvh;
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// How far a simplified mesh is from its source.
pub(crate) struct Errors {
    /// Distance of each vertex of the source to the simplified mesh, in metres.
    of_vertices: Vec<f64>,
    /// Places on the simplified mesh: their face, the closest triangle of the source, and the distance to it in metres.
    of_places: Vec<(u32, u32, f64)>,
}

impl Errors {
    /// Measures; nothing if one of the meshes has no faces.
    pub(crate) fn measure(source: &TriangleMesh, simplified: &TriangleMesh) -> Option<Self> {
        if source.triangles.is_empty() || simplified.triangles.is_empty() {
            return None;
        }
        let to_simplified = Bvh::new(simplified);
        let of_vertices =
            source.vertices.par_iter().map(|vertex| to_simplified.closest_point(*vertex).distance_sq.sqrt());
        let of_vertices = of_vertices.collect();
        let to_source = Bvh::new(source);
        let spacing_m = mean_edge_m(source);
        let faces = (0..simplified.triangles.len()).into_par_iter();
        let of_places = faces.flat_map_iter(|face| {
            let to_source = &to_source;
            places(simplified.corners(face), spacing_m).map(move |place| {
                let closest = to_source.closest_point(place);
                (face as u32, closest.triangle, closest.distance_sq.sqrt())
            })
        });
        Some(Self { of_vertices, of_places: of_places.collect() })
    }

    /// The largest of all, in metres.
    pub(crate) fn largest_m(&self) -> f64 {
        let of_places = self.of_places.iter().map(|(.., error_m)| *error_m);
        self.of_vertices.iter().copied().chain(of_places).fold(0.0, f64::max)
    }

    /// Marks the vertices of the source around which the error is larger than allowed.
    ///
    /// `names`: the triangles of the simplified mesh by the numbers that their vertices have in the source.
    pub(crate) fn mark(
        &self,
        source: &TriangleMesh,
        names: &[[u32; 3]],
        max_error_m: f64,
        marked: &mut [bool],
    ) {
        for (mark, error_m) in marked.iter_mut().zip(&self.of_vertices) {
            *mark |= *error_m > max_error_m;
        }
        for (face, triangle, error_m) in &self.of_places {
            if *error_m > max_error_m {
                // What is under the place, and the face itself, whose vertices may have moved too far.
                let kept = names[*face as usize].iter().chain(&source.triangles[*triangle as usize]);
                kept.for_each(|vertex| marked[*vertex as usize] = true);
            }
        }
    }
}

/// Mean length of the triangles' edges, in metres.
fn mean_edge_m(mesh: &TriangleMesh) -> f64 {
    let edges = (0..mesh.triangles.len()).map(|face| {
        let [a, b, c] = mesh.corners(face);
        a.distance(b) + b.distance(c) + c.distance(a)
    });
    edges.sum::<f64>() / (3 * mesh.triangles.len()) as f64
}

/// Most parts of an edge between places.
const MOST_PARTS: f64 = 8.0;

/// Places all over a face, its corners among them, no farther apart than `spacing_m` unless the face is very large.
fn places([a, b, c]: [DVec3; 3], spacing_m: f64) -> impl Iterator<Item = DVec3> {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let parts = (longest / spacing_m).ceil().clamp(2.0, MOST_PARTS) as u32;
    let at = move |i: u32, j: u32| a + ((b - a) * f64::from(i) + (c - a) * f64::from(j)) / f64::from(parts);
    (0..=parts).flat_map(move |i| (0..=parts - i).map(move |j| at(i, j)))
}
