//! Whether the normals of a point cloud can tell inside from outside.

use super::distinct::Distinct;
use super::orient::CREASE;
use crate::SignMode;
use glam::DVec3;
use isv_spatial::{Neighbour, PointTree};
use isv_volume::PointCloud;
use rayon::prelude::*;
use std::fmt;

/// Points that are looked at, spread evenly over the cloud.
const SAMPLES: usize = 2048;

/// Neighbours of each that its normal is compared with.
const COMPARED: usize = 6;

/// Neighbours that the spacing is found from.
pub(crate) const SPACING_NEIGHBOURS: usize = 12;

/// Share of the points that must have a normal.
const WITH_NORMAL: f64 = 0.9;

/// Share of neighbours whose normals must point to the same side. Captures lie above 0.98; with one normal in
/// ten reversed it is 0.82, with random signs 0.5.
const AGREEMENT: f64 = 0.9;

/// How the sign of the distance to points is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointSign {
    /// By the side of the closest points' planes.
    Oriented,
    /// Unsigned distance less a constant offset (Eq. 9): a thin closed shell around the points.
    Offset,
}

impl fmt::Display for PointSign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Oriented => "oriented points: sign by the planes of the closest points",
            Self::Offset => "points without usable normals: offset shell",
        })
    }
}

/// What a [`PointSign`] rests on. Its text says it in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointEvidence {
    /// Share of the points, 0 to 1, that have a normal.
    pub with_normal: f64,
    /// Share of neighbouring normals, 0 to 1, that point to the same side; 0 where there are none to compare.
    pub agreement: f64,
    /// Typical distance between neighbouring points in metres: the median of the edge of the square that a point has for
    /// itself.
    pub spacing_m: f64,
    /// What nine of ten points stay below, in metres.
    pub wide_spacing_m: f64,
}

impl fmt::Display for PointEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { with_normal, agreement, spacing_m, wide_spacing_m } = self;
        if *with_normal > 0.0 {
            let (normals, agreement) = (100.0 * with_normal, 100.0 * agreement);
            write!(
                f,
                "{normals:.0} % of the points have a normal, {agreement:.0} % of neighbours agree on the side"
            )?;
        } else {
            f.write_str("no point has a normal")?;
        }
        let (spacing, wide) = (1e3 * spacing_m, 1e3 * wide_spacing_m);
        write!(f, ", points are {spacing:.1} mm apart, one in ten more than {wide:.1} mm")
    }
}

/// Decides how to find the sign: as asked, or with [`SignMode::Auto`] by what the normals are, as
/// [`SignMode::Paper`] does. Nearly all points must have a normal, and neighbouring normals must agree.
/// [`SignMode::Closed`] asks for [`PointSign::Oriented`]. [`SignMode::Sheet`] is of meshes alone, and counts
/// as [`SignMode::Offset`].
///
/// The cloud need not be valid; points that are not finite have no say.
#[must_use]
pub fn decide_point_sign(cloud: &PointCloud, mode: SignMode) -> (PointSign, PointEvidence) {
    let evidence = gather_evidence(cloud);
    let usable = evidence.with_normal >= WITH_NORMAL && evidence.agreement >= AGREEMENT;
    let sign = match mode {
        SignMode::Closed => PointSign::Oriented,
        SignMode::Auto | SignMode::Paper if usable => PointSign::Oriented,
        SignMode::Auto | SignMode::Paper | SignMode::Offset | SignMode::Sheet => PointSign::Offset,
    };
    (sign, evidence)
}

fn gather_evidence(cloud: &PointCloud) -> PointEvidence {
    let known = |i: usize| cloud.normals.get(i).copied().filter(|n| n.is_finite() && *n != DVec3::ZERO);
    let finite: Vec<usize> = (0..cloud.positions.len()).filter(|i| cloud.positions[*i].is_finite()).collect();
    if finite.is_empty() {
        return PointEvidence::default();
    }
    let positions: Vec<DVec3> = finite.iter().map(|i| cloud.positions[*i]).collect();
    let distinct = Distinct::new(&positions);
    let tree = PointTree::new(distinct.positions.to_vec());
    let count = finite.len().min(SAMPLES);
    let looks: Vec<(usize, usize, f64)> = (0..count)
        .into_par_iter()
        .map_init(Vec::new, |found, sample| {
            let own = sample * finite.len() / count;
            tree.k_nearest(cloud.positions[finite[own]], SPACING_NEIGHBOURS + 1, found);
            let spacing = spacing(found);
            found.retain(|n| n.index as usize != distinct.of_point(own));
            let normal_at = |n: &Neighbour| known(finite[distinct.first(n.index as usize)]);
            let others = found.iter().take(COMPARED).filter_map(normal_at);
            let (mut compared, mut agreeing) = (0, 0);
            if let Some(normal) = known(finite[own]) {
                // Neighbours across a crease tell nothing.
                let cosines = others.map(|other| normal.normalize().dot(other.normalize()));
                for cosine in cosines.filter(|cosine| cosine.abs() >= CREASE) {
                    compared += 1;
                    agreeing += usize::from(cosine > 0.0);
                }
            }
            (compared, agreeing, spacing)
        })
        .collect();
    let (compared, agreeing) = looks.iter().fold((0, 0), |sum, look| (sum.0 + look.0, sum.1 + look.1));
    let mut spacings: Vec<f64> = looks.iter().map(|look| look.2).collect();
    spacings.sort_unstable_by(f64::total_cmp);
    PointEvidence {
        with_normal: finite.iter().filter(|i| known(**i).is_some()).count() as f64 / finite.len() as f64,
        agreement: if compared == 0 { 0.0 } else { f64::from(agreeing as u32) / f64::from(compared as u32) },
        spacing_m: spacings[spacings.len() / 2],
        wide_spacing_m: spacings[spacings.len() * 9 / 10],
    }
}

/// Edge of the square that a point has for itself, from its neighbours, the first of which is itself. That
/// many points lie on the disc up to the last one.
pub(crate) fn spacing(found: &[Neighbour]) -> f64 {
    let others = found.len().saturating_sub(1).max(1);
    found.last().map_or(0.0, |last| (std::f64::consts::PI * last.distance_sq / others as f64).sqrt())
}
