//! One side of a comparison of colours, made ready.

use crate::Shape;
use crate::normals::{SmoothNormals, weights_of};
use crate::sampling::draw_in_order;
use glam::DVec3;
use isv_spatial::{Bvh, Closest, PointTree, PositionSet, Ray, Weld, position_key};
use isv_volume::{Appearance, PointCloud, TriangleMesh};
use rayon::prelude::*;

/// Distance outside of a surface, in metres, from which its outermost layer is looked for.
const REACH_M: f64 = 0.012;

/// Distance, in metres, by which the outermost layer may lie farther than the closest one.
const SLACK_M: f64 = 0.004;

/// Least cosine between the normals of a point and of the layer that gives its colour.
const AGREEMENT: f64 = 0.2;

/// A point this near to a surface, in metres, lies on it, and on no other layer.
const ON_SURFACE_M: f64 = 1e-6;

/// Points that are worth a thread's while.
const MIN_POINTS: usize = 256;

/// A point of a shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct ColouredPoint {
    /// Position in metres.
    pub(super) position: DVec3,
    /// Unit normal; zero where not known.
    normal: DVec3,
    /// sRGB, 0 to 255 a channel.
    pub(super) colour: [f32; 3],
}

/// A shape with its colours: points of it, and the colour that it has near any point.
pub(super) struct Coloured<'a> {
    pub(super) points: Vec<ColouredPoint>,
    lookup: Lookup<'a>,
}

/// Lookup of the colour near a point.
enum Lookup<'a> {
    Surface {
        mesh: &'a TriangleMesh,
        appearance: Option<&'a Appearance>,
        bvh: Bvh,
    },
    /// Points, and their colours in the order of the tree.
    Points {
        tree: PointTree,
        colours: Vec<[f32; 3]>,
    },
}

impl<'a> Coloured<'a> {
    /// Prepares a shape with colours; a mesh must have area.
    pub(super) fn new(shape: Shape<'a>, spacing_m: f64, seed: u64) -> Self {
        match shape {
            Shape::Mesh(mesh) => Self::sampled(mesh, spacing_m, seed),
            Shape::Points(cloud) => Self::of_cloud(cloud),
        }
    }

    /// The samples that [`compare`](crate::compare) draws of a mesh, with their colours.
    fn sampled(mesh: &'a TriangleMesh, spacing_m: f64, seed: u64) -> Self {
        let normals = SmoothNormals::new(mesh, Weld::new(&mesh.vertices));
        let appearance = mesh.appearance.as_deref();
        let samples = draw_in_order(mesh, spacing_m, seed);
        let points = samples.par_iter().with_min_len(MIN_POINTS).map(|drawn| ColouredPoint {
            position: drawn.point,
            normal: normals.at(drawn.face, drawn.weights),
            colour: colour_at(mesh, appearance, drawn.face, drawn.weights),
        });
        Self { points: points.collect(), lookup: Lookup::Surface { mesh, appearance, bvh: Bvh::new(mesh) } }
    }

    /// The points of a cloud; of those at exactly the same position the first.
    fn of_cloud(cloud: &PointCloud) -> Self {
        let mut seen = PositionSet::default();
        let first = (0..cloud.positions.len()).filter(|i| seen.insert(position_key(cloud.positions[*i])));
        let described = first.map(|i| ColouredPoint {
            position: cloud.positions[i],
            normal: cloud.normals.get(i).copied().unwrap_or(DVec3::ZERO),
            colour: cloud.colours[i].map(f32::from),
        });
        let points: Vec<_> = described.collect();
        let tree = PointTree::new(points.iter().map(|point| point.position).collect());
        let in_tree_order: Vec<_> = tree.origins().iter().map(|i| points[*i as usize]).collect();
        let colours = in_tree_order.iter().map(|point| point.colour).collect();
        Self { points: in_tree_order, lookup: Lookup::Points { tree, colours } }
    }

    /// The colour of this shape at each of some points of another one.
    pub(super) fn colours_at(&self, points: &[ColouredPoint]) -> Vec<[f32; 3]> {
        let positions: Vec<DVec3> = points.iter().map(|point| point.position).collect();
        match &self.lookup {
            Lookup::Surface { mesh, appearance, bvh } => {
                let closest = bvh.closest_to_each(&positions);
                let pairs = points.par_iter().with_min_len(MIN_POINTS).zip(&closest);
                let colour = |(point, closest): (&ColouredPoint, &Closest)| {
                    let (face, weights) = outermost(mesh, bvh, point, closest);
                    colour_at(mesh, *appearance, face, weights)
                };
                pairs.map(colour).collect()
            }
            Lookup::Points { tree, colours } => {
                let nearest = tree.nearest_to_each(&positions);
                (0..points.len()).map(|i| mean_colour(nearest.of(i), colours)).collect()
            }
        }
    }
}

/// The colour of a mesh at a point of a face.
fn colour_at(
    mesh: &TriangleMesh,
    appearance: Option<&Appearance>,
    face: usize,
    weights: [f64; 3],
) -> [f32; 3] {
    let white = Appearance::default();
    appearance.unwrap_or(&white).colour(face, mesh.triangles[face], weights.map(|weight| weight as f32))
}

/// The mean colour of equally near points.
fn mean_colour(points: &[u32], colours: &[[f32; 3]]) -> [f32; 3] {
    [0, 1, 2].map(|channel| {
        let sum: f32 = points.iter().map(|point| colours[*point as usize][channel]).sum();
        sum / points.len() as f32
    })
}

/// The face of a mesh that a point of another surface has its colour from, and the weights of its corners there.
///
/// The point is the first surface met from outside along its normal. That surface must be nearly as near as
/// the closest point and face the same way; else it is the closest point. The closest point alone would often
/// lie on a layer that nobody sees: a lining, or skin under a collar. A point that lies on the mesh itself
/// has the colour there.
fn outermost(mesh: &TriangleMesh, bvh: &Bvh, point: &ColouredPoint, closest: &Closest) -> (usize, [f64; 3]) {
    let distance = closest.distance_sq.sqrt();
    let &ColouredPoint { position, normal, .. } = point;
    if normal != DVec3::ZERO && distance > ON_SURFACE_M {
        let inwards = Ray { origin: position + REACH_M * normal, direction: -normal };
        let met = bvh.first_hit(&inwards, REACH_M + distance + SLACK_M).filter(|hit| {
            let faces = mesh.area_vector(hit.triangle as usize).normalize_or_zero();
            (hit.distance - REACH_M).abs() < distance + SLACK_M && faces.dot(normal) > AGREEMENT
        });
        if let Some(hit) = met {
            return (hit.triangle as usize, hit.weights);
        }
    }
    let face = closest.triangle as usize;
    (face, weights_of(closest, mesh.corners(face)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;

    /// Squares of 1 m facing up at heights, in millimetres.
    fn layers(heights_mm: &[f64]) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for z in heights_mm.iter().map(|mm| mm / 1e3) {
            let first = mesh.vertices.len() as u32;
            mesh.vertices
                .extend([[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]].map(DVec3::from));
            mesh.triangles.extend([[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|v| v + first)));
        }
        mesh
    }

    /// Height, in millimetres, of the layer that gives a point above the middle its colour.
    fn layer_of(heights_mm: &[f64], point_mm: f64, normal: DVec3) -> f64 {
        let mesh = layers(heights_mm);
        let bvh = Bvh::new(&mesh);
        let position = DVec3::new(0.3, 0.4, point_mm / 1e3);
        let point = ColouredPoint { position, normal, colour: [0.0; 3] };
        let (face, weights) = outermost(&mesh, &bvh, &point, &bvh.closest_point(position));
        let corners = mesh.corners(face);
        let found: DVec3 = (0..3).map(|i| corners[i] * weights[i]).sum();
        assert!(found.distance(position.with_z(found.z)) < 1e-12);
        (found.z * 1e6).round() / 1e3
    }

    #[test]
    fn the_outermost_of_near_layers_gives_the_colour() {
        let up = DVec3::Z;
        assert_eq!(layer_of(&[0.0, 5.0], 1.5, up), 5.0, "3.5 mm away is less than 1.5 + 4 mm");
        assert_eq!(layer_of(&[0.0, 5.0], 0.4, up), 0.0, "4.6 mm away is more than 0.4 + 4 mm");
        assert_eq!(layer_of(&[0.0, 5.0], 4.0, up), 5.0);
        assert_eq!(layer_of(&[0.0, 15.0], 1.0, up), 0.0, "beyond the reach");
        assert_eq!(layer_of(&[0.0, 3.0, 3.5], 0.1, up), 3.5);
    }

    #[test]
    fn layers_that_face_elsewhere_give_no_colour() {
        // From below, the squares show their backs.
        assert_eq!(layer_of(&[0.0, 2.0], 1.4, DVec3::NEG_Z), 2.0);
        assert_eq!(layer_of(&[0.0, 2.0], 1.4, DVec3::ZERO), 2.0, "no normal is known");
        assert_eq!(layer_of(&[0.0, 2.0], 0.6, DVec3::ZERO), 0.0);
    }

    #[test]
    fn a_point_on_a_layer_has_its_colour() {
        assert_eq!(layer_of(&[0.0, 2.0], 0.0, DVec3::Z), 0.0);
        assert_eq!(layer_of(&[0.0, 2.0], 0.01, DVec3::Z), 2.0);
    }

    /// The rule from its definition, by trying all triangles.
    fn outermost_slowly(mesh: &TriangleMesh, point: &ColouredPoint) -> DVec3 {
        let start = point.position + point.normal * 0.012;
        let (mut first, mut closest) = ((f64::INFINITY, 0), (f64::INFINITY, DVec3::ZERO));
        for face in 0..mesh.triangles.len() {
            let corners @ [a, b, c] = mesh.corners(face);
            let (foot, _) = isv_spatial::closest_on_triangle(point.position, &corners);
            if foot.distance(point.position) < closest.0 {
                closest = (foot.distance(point.position), foot);
            }
            let normal = (b - a).cross(c - a);
            let t = normal.dot(a - start) / -normal.dot(point.normal);
            let at = start - t * point.normal;
            let inside =
                [(a, b), (b, c), (c, a)].iter().all(|(p, q)| normal.dot((*q - *p).cross(at - *p)) >= 0.0);
            if t >= 0.0 && inside && t < first.0 {
                first = (t, face);
            }
        }
        let agrees = mesh.area_vector(first.1).normalize().dot(point.normal) > 0.2;
        if (first.0 - 0.012).abs() < closest.0 + 0.004 && agrees {
            return start - first.0 * point.normal;
        }
        closest.1
    }

    #[test]
    fn the_rule_is_what_brute_force_makes_of_its_definition() {
        let mut random = SplitMix64::new(4);
        let mut signed = || 2.0 * random.next_f64() - 1.0;
        let mesh = TriangleMesh {
            vertices: (0..180).map(|_| 0.02 * DVec3::new(signed(), signed(), signed())).collect(),
            triangles: (0..60).map(|face| [0, 1, 2].map(|i| 3 * face + i)).collect(),
            ..TriangleMesh::default()
        };
        let bvh = Bvh::new(&mesh);
        let mut from_outside = 0;
        for _ in 0..1000 {
            let [position, normal] =
                [0.02, 1.0].map(|scale| scale * DVec3::new(signed(), signed(), signed()));
            let point = ColouredPoint { position, normal: normal.normalize(), colour: [0.0; 3] };
            let closest = bvh.closest_point(position);
            let (face, weights) = outermost(&mesh, &bvh, &point, &closest);
            let corners = mesh.corners(face);
            let found: DVec3 = (0..3).map(|i| corners[i] * weights[i]).sum();
            assert!(found.distance(outermost_slowly(&mesh, &point)) < 1e-9, "{point:?}");
            from_outside += usize::from(found.distance(closest.point) > 1e-9);
        }
        assert!((50..950).contains(&from_outside), "{from_outside}");
    }
}
