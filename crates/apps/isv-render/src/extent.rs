//! How far the surfaces of all frames reach, and which side they show.

use glam::DVec3;
use isv_volume::TriangleMesh;

/// Share of a surface that must face one way before that side is the one to look from. It is 0 for a closed
/// surface, 1 for a plane.
///
/// What one depth camera saw of a room has 0.58, a building of open parts on its ground 0.35, a person with open soles 0.02.
const ONE_SIDED: f64 = 0.45;

/// Most degrees above or below the horizon of a view that nobody asked for.
const STEEPEST_DEGREES: f64 = 60.0;

/// A mean normal with a smaller horizontal part than this has no side to look from.
const LEAST_HORIZONTAL: f64 = 0.1;

/// A direction to look from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Turn about the up axis (degrees): 0 looks from +z, 90 from +x.
    pub yaw_degrees: f64,
    /// Height above the horizon (degrees).
    pub pitch_degrees: f64,
}

/// What all frames together take up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Smallest and largest corner, in metres.
    pub bounds: (DVec3, DVec3),
    /// Sum of the faces' normals, each as long as its area (square metres).
    facing: DVec3,
    /// Area of all faces (square metres).
    area: f64,
}

impl Extent {
    /// The extent of a mesh; none without triangles.
    #[must_use]
    pub fn new(mesh: &TriangleMesh) -> Option<Self> {
        let bounds = mesh.bounds()?;
        let (mut facing, mut area) = (DVec3::ZERO, 0.0);
        for face in 0..mesh.triangles.len() {
            let vector = mesh.area_vector(face);
            facing += vector;
            area += vector.length();
        }
        Some(Self { bounds, facing, area })
    }

    /// The extent of both.
    #[must_use]
    pub fn join(one: Option<Self>, other: Option<Self>) -> Option<Self> {
        match (one, other) {
            (Some(one), Some(other)) => Some(Self {
                bounds: (one.bounds.0.min(other.bounds.0), one.bounds.1.max(other.bounds.1)),
                facing: one.facing + other.facing,
                area: one.area + other.area,
            }),
            _ => one.or(other),
        }
    }

    /// The side that a surface faces if it is open and one-sided, else the front, +z.
    #[must_use]
    pub fn opening_view(&self) -> View {
        let mean = self.facing / self.area;
        if mean.is_nan() || mean.length() < ONE_SIDED {
            return View { yaw_degrees: 0.0, pitch_degrees: 0.0 };
        }
        let towards = mean.normalize();
        let pitch = towards.y.asin().to_degrees().clamp(-STEEPEST_DEGREES, STEEPEST_DEGREES);
        let has_side = towards.x.hypot(towards.z) >= LEAST_HORIZONTAL;
        let yaw = if has_side { towards.x.atan2(towards.z).to_degrees() } else { 0.0 };
        View { yaw_degrees: yaw.round(), pitch_degrees: pitch.round() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRONT: View = View { yaw_degrees: 0.0, pitch_degrees: 0.0 };

    /// A square of 2 m with a normal.
    fn square(normal: DVec3) -> TriangleMesh {
        let right = normal.any_orthonormal_vector();
        let up = normal.cross(right);
        let vertices = vec![-right - up, right - up, right + up, -right + up];
        TriangleMesh {
            vertices,
            normals: Vec::new(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            appearance: None,
        }
    }

    fn view(mesh: &TriangleMesh) -> View {
        Extent::new(mesh).unwrap().opening_view()
    }

    #[test]
    fn an_open_surface_is_seen_from_the_side_it_faces() {
        assert_eq!(view(&square(DVec3::Z)), FRONT);
        assert_eq!(view(&square(DVec3::NEG_Z)).yaw_degrees.abs(), 180.0);
        assert_eq!(view(&square(DVec3::X)), View { yaw_degrees: 90.0, pitch_degrees: 0.0 });
        assert_eq!(view(&square(DVec3::Y)), View { yaw_degrees: 0.0, pitch_degrees: 60.0 });
        let slanted = view(&square(DVec3::new(0.0, 1.0, -1.0).normalize()));
        assert_eq!((slanted.yaw_degrees.abs(), slanted.pitch_degrees), (180.0, 45.0));
    }

    #[test]
    fn a_closed_surface_is_seen_from_the_front() {
        let mut cube = isv_testkit::cube(1.0);
        assert_eq!(view(&cube), FRONT);
        // A hole in its floor leaves it closed enough.
        cube.triangles.pop();
        assert_eq!(view(&cube), FRONT);
    }

    #[test]
    fn all_frames_count() {
        let [back, left] = [DVec3::NEG_Z, DVec3::NEG_X].map(|normal| Extent::new(&square(normal)));
        let both = Extent::join(Extent::join(back, None), Extent::join(back, left)).unwrap();
        assert_eq!(both.opening_view().yaw_degrees, -153.0);
        assert_eq!(Extent::new(&TriangleMesh::default()), None);
    }
}
