//! Whether a mesh has an inside.

use crate::faces::{distinct, with_area};
use crate::orientation::agreeing;
use crate::parts::open_faces;
use isv_spatial::WindingNumber;
use isv_volume::TriangleMesh;
use rayon::prelude::*;
use std::fmt;

/// Points on the surface that are looked at, spread evenly by area.
pub(crate) const SAMPLES: usize = 1024;

/// How far samples are moved off the surface, as a share of the mesh's diagonal.
const NUDGE: f64 = 1e-5;

/// How far a winding number may be from a whole one and still count as such.
const NEAR: f64 = 0.15;

/// Share of the area that must look closed; real sequences lie below 0.33 or above 0.96 (see [`decide_sign`]).
pub(crate) const CLOSED_SHARE: f64 = 0.9;

/// How the sign of the distance is asked to be found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SignMode {
    /// Look at the mesh, part by part: [`Self::Closed`] if all parts are closed, else [`Self::Sheet`].
    #[default]
    Auto,
    /// Look at the mesh as a whole, as the paper does: [`Self::Closed`] if nine tenths of its area look closed, else [`Self::Offset`].
    Paper,
    /// Sign of a closed surface (Eq. 8): negative inside.
    Closed,
    /// Sign of a surface without inside (Eq. 9): unsigned distance less a constant.
    Offset,
    /// Part by part: closed parts have an inside, open parts are single sheets, negative behind their faces.
    Sheet,
}

/// How the sign of the distance is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignDecision {
    /// Negative where the winding number exceeds one half in magnitude.
    Closed {
        /// Whether most of the surface is oriented inside out, with -1 inside. Either way the inside becomes negative.
        flipped: bool,
    },
    /// Unsigned distance less a constant offset: a thin closed shell around the surface.
    Offset,
    /// Closed parts by winding number, open parts negative behind the closest point.
    Sheet,
}

impl fmt::Display for SignDecision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Closed { flipped: false } => "closed surface: sign by winding number",
            Self::Closed { flipped: true } => "closed surface, inside out: sign by winding number, reversed",
            Self::Offset => "open surface: offset shell",
            Self::Sheet => "open surface: single sheets, sign by side",
        })
    }
}

/// What a [`SignDecision`] rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SignEvidence {
    /// Share of the area, 0 to 1, with near-integer winding numbers on both sides and an inside on one of them.
    pub closed_share: f64,
    /// Share of the area, 0 to 1, that is such and has a negative winding number inside.
    pub inverted_share: f64,
    /// Share of the area, 0 to 1, in parts without inside; 0 if nobody asked.
    pub open_share: f64,
}

/// Decides how to sign distances to a mesh: as `mode` says, or from the winding number on both sides of the surface.
///
/// Just off a closed surface the winding number is close to a whole number on both sides, and not zero on one
/// of them. Just off an open sheet it is far from whole. A part is taken for closed when that holds for nine
/// tenths of its area; so is the whole mesh by [`SignMode::Paper`]. Measured on the first frames of eight
/// sequences:
///
/// | sequence | closed share | inverted share | share of open parts |
/// |---|---|---|---|
/// | dancer (open soles, seams) | 0.961 | 0.000 | 0.000 |
/// | thomas, liam | 1.000 | 0.000 | 0.000 |
/// | xbot (95 overlapping parts) | 1.000 | 0.000 | 0.000 |
/// | cesium_man, collision | 1.000 | 0.000 | 0.000 |
/// | flag (thin sheet) | 0.013 | 0.013 | 1.000 |
/// | monastery (591 parts) | 0.326 | 0.176 | 0.899 |
///
/// The same mesh always gives the same answer. A mesh that [`TriangleMesh::validate`] refuses looks open here.
#[must_use]
pub fn decide_sign(mesh: &TriangleMesh, mode: SignMode) -> (SignDecision, SignEvidence) {
    if mesh.validate().is_err() {
        let decision = match mode {
            SignMode::Closed => SignDecision::Closed { flipped: false },
            SignMode::Auto | SignMode::Sheet => SignDecision::Sheet,
            SignMode::Paper | SignMode::Offset => SignDecision::Offset,
        };
        return (decision, SignEvidence::default());
    }
    let mut evidence = gather_evidence(mesh, mesh.triangles.len(), SAMPLES);
    if matches!(mode, SignMode::Auto | SignMode::Sheet) {
        evidence.open_share = open_share(mesh);
    }
    let closed = SignDecision::Closed { flipped: 2.0 * evidence.inverted_share > evidence.closed_share };
    let decision = match mode {
        SignMode::Closed => closed,
        // What looks closed only once faces agree is for sheets, which make them agree.
        SignMode::Auto if evidence.open_share == 0.0 && evidence.closed_share >= CLOSED_SHARE => closed,
        SignMode::Paper if evidence.closed_share >= CLOSED_SHARE => closed,
        SignMode::Paper | SignMode::Offset => SignDecision::Offset,
        SignMode::Auto | SignMode::Sheet => SignDecision::Sheet,
    };
    (decision, evidence)
}

/// Share of a mesh's area, 0 to 1, in open parts.
fn open_share(mesh: &TriangleMesh) -> f64 {
    let (mesh, edges) = agreeing(with_area(mesh));
    let (open, _) = open_faces(&mesh, &edges, None);
    let areas = (0..mesh.triangles.len()).map(|face| mesh.area_vector(face).length());
    let (mut whole, mut of_open) = (0.0, 0.0);
    for (area, is_open) in areas.zip(open) {
        whole += area;
        of_open += if is_open { area } else { 0.0 };
    }
    if whole > 0.0 { of_open / whole } else { 0.0 }
}

/// Share of a mesh's area, 0 to 1, that looks closed, looked at in so many places.
pub(crate) fn closed_share(mesh: &TriangleMesh, samples: usize) -> f64 {
    gather_evidence(mesh, mesh.triangles.len(), samples).closed_share
}

/// Share of the area of the first faces of a mesh, 0 to 1, that looks closed in the whole mesh. No face is there twice.
pub(crate) fn closed_share_of_first(mesh: &TriangleMesh, faces: usize, samples: usize) -> f64 {
    gather_evidence(mesh, faces, samples).closed_share
}

/// Looks at the first faces of a mesh.
fn gather_evidence(mesh: &TriangleMesh, faces: usize, samples: usize) -> SignEvidence {
    // Winding numbers count what is there twice.
    let mesh = &*distinct(mesh);
    let winding = WindingNumber::new(mesh);
    let nudge = mesh.bounds().map_or(0.0, |(lo, hi)| NUDGE * lo.distance(hi));
    let (closed, inverted) = sample_first_faces(mesh, faces, samples)
        .into_par_iter()
        .map(|(face, weight)| {
            let [a, b, c] = mesh.corners(face);
            let (middle, normal) = ((a + b + c) / 3.0, mesh.area_vector(face).normalize_or_zero());
            let (front, back) = (winding.at(middle + nudge * normal), winding.at(middle - nudge * normal));
            let whole = (front - front.round()).abs() < NEAR && (back - back.round()).abs() < NEAR;
            let closed = whole && (front.round() != 0.0 || back.round() != 0.0);
            (if closed { weight } else { 0 }, if closed && front + back < 0.0 { weight } else { 0 })
        })
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    let share = |count: usize| count as f64 / samples as f64;
    SignEvidence { closed_share: share(closed), inverted_share: share(inverted), open_share: 0.0 }
}

/// Faces at so many evenly spaced steps of the running area, each with the number of steps it took.
pub(crate) fn sample_faces(mesh: &TriangleMesh, steps: usize) -> Vec<(usize, usize)> {
    sample_first_faces(mesh, mesh.triangles.len(), steps)
}

/// Samples only the first faces of a mesh, in the same way.
fn sample_first_faces(mesh: &TriangleMesh, faces: usize, steps: usize) -> Vec<(usize, usize)> {
    let faces = faces.min(mesh.triangles.len());
    let areas: Vec<f64> = (0..faces).map(|face| mesh.area_vector(face).length()).collect();
    let step = areas.iter().sum::<f64>() / steps as f64;
    let (mut samples, mut taken, mut covered) = (Vec::new(), 0, 0.0);
    for (face, area) in areas.into_iter().enumerate() {
        covered += area;
        let mut weight = 0;
        while taken < steps && covered > (taken as f64 + 0.5) * step {
            taken += 1;
            weight += 1;
        }
        if weight > 0 {
            samples.push((face, weight));
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{sheet, sphere};

    #[test]
    fn closed_inside_out_and_open_surfaces_are_told_apart() {
        let mut mesh = sphere(0.4, 20);
        assert_eq!(decide_sign(&mesh, SignMode::Auto).0, SignDecision::Closed { flipped: false });
        assert_eq!(decide_sign(&mesh, SignMode::Offset).0, SignDecision::Offset);
        for triangle in &mut mesh.triangles {
            triangle.swap(0, 1);
        }
        assert_eq!(decide_sign(&mesh, SignMode::Auto).0, SignDecision::Closed { flipped: true });
        assert_eq!(decide_sign(&sheet(1.0), SignMode::Auto).0, SignDecision::Sheet);
        assert_eq!(decide_sign(&sheet(1.0), SignMode::Paper).0, SignDecision::Offset);
    }

    #[test]
    fn a_two_sided_sheet_has_no_inside() {
        let mut mesh = sheet(1.0);
        let back: Vec<_> = mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        mesh.triangles.extend(back);
        assert_eq!(decide_sign(&mesh, SignMode::Auto).0, SignDecision::Sheet);
        assert_eq!(decide_sign(&mesh, SignMode::Paper).0, SignDecision::Offset);
    }

    #[test]
    fn a_mesh_without_area_or_faces_is_open() {
        let mut mesh = sheet(1.0);
        mesh.triangles = vec![[0, 0, 1]];
        assert_eq!(decide_sign(&mesh, SignMode::Auto), (SignDecision::Sheet, SignEvidence::default()));
        mesh.triangles.clear();
        assert_eq!(decide_sign(&mesh, SignMode::Auto), (SignDecision::Sheet, SignEvidence::default()));
    }
}
