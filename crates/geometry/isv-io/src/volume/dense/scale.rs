//! What the values of a dense field count.

use super::{Dense, DenseOptions};
use crate::volume::VolumeError;
use std::fmt;
use std::path::Path;

/// Gradients that are looked at.
const GRADIENTS: usize = 1 << 14;
/// Values this near to the largest one are at the truncation.
const SATURATED: f64 = 0.999;
/// A field that grows by this many voxels a voxel is one of distances.
const LIKELY: std::ops::Range<f64> = 0.55..1.6;

/// What values of a field are in metres, and how that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::volume) struct Scale {
    /// Metres of a value of 1, of integers of the largest one.
    pub(super) metres: f64,
    /// Values of this much and more are at the truncation.
    pub(super) saturated: f64,
    /// The distance at which values are cut off.
    pub(super) truncation_m: Option<f64>,
    why: Why,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Why {
    Told,
    /// The file has a truncation and values in -1..1.
    File,
    Metres,
    Voxels,
    /// Values in -1..1, which grow as with this truncation.
    Slope,
    /// There is no surface to tell by.
    Default,
}

impl Scale {
    pub(super) fn new(
        dense: &Dense,
        path: &Path,
        options: &DenseOptions,
        voxel_m: f64,
    ) -> Result<Self, VolumeError> {
        let facts = Facts::new(dense);
        // Rounded halves of 1 are a little off it.
        let is_normalised = facts.largest <= 1.0 + 1e-3;
        let is_integer = dense.tsdf.array.is_integer();
        let scale = |metres: f64, why| Self {
            metres,
            saturated: SATURATED * facts.largest,
            truncation_m: dense
                .truncation_m
                .or((facts.largest.is_finite() && facts.largest > 0.0).then_some(facts.largest * metres)),
            why,
        };
        if let Some(metres) = options.scale_m {
            return Ok(scale(metres, Why::Told));
        }
        // Voxels that the surface is passed by in a step of one voxel, were the values metres.
        let slope = facts.slope.map(|slope| slope / voxel_m);
        let fits = |metres: f64| slope.is_some_and(|slope| LIKELY.contains(&(slope * metres)));
        let known = dense.truncation_m.filter(|_| is_normalised);
        Ok(match (known, slope) {
            (Some(truncation), _) if is_integer || fits(truncation) || (slope.is_none() && !fits(1.0)) => {
                scale(truncation, Why::File)
            }
            (_, Some(_)) if !is_integer && fits(1.0) => scale(1.0, Why::Metres),
            (_, Some(_)) if !is_integer && fits(voxel_m) => scale(voxel_m, Why::Voxels),
            (_, Some(slope)) if is_normalised && slope > 0.0 => {
                let voxels = (1.0 / (slope * voxel_m)).round();
                if !(1.0..=1000.0).contains(&voxels) {
                    return Err(VolumeError::NoScale { path: path.to_owned() });
                }
                scale(voxels * voxel_m, Why::Slope)
            }
            (_, None) if is_normalised => scale(8.0 * voxel_m, Why::Default),
            (_, None) => scale(1.0, Why::Default),
            _ => return Err(VolumeError::NoScale { path: path.to_owned() }),
        })
    }

    /// Whether a user should know how it was found.
    pub(in crate::volume) fn is_guess(&self) -> bool {
        !matches!(self.why, Why::Told | Why::File)
    }
}

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.why {
            Why::Told => write!(f, "a value of 1 is {} m", self.metres),
            Why::File => write!(f, "values are in truncation distances of {} m", self.metres),
            Why::Metres => f.write_str("values are taken as metres"),
            Why::Voxels => f.write_str("values are taken as voxels"),
            Why::Slope | Why::Default => write!(f, "a value of 1 is taken as {:.4} m", self.metres),
        }
    }
}

/// What is seen in the values.
struct Facts {
    /// The largest finite magnitude of an observed value.
    largest: f64,
    /// How much values change from a voxel to the next across the surface: the median. `None` without a surface.
    slope: Option<f64>,
}

impl Facts {
    fn new(dense: &Dense) -> Self {
        let [nx, ny, nz] = dense.extents;
        let mut largest: f64 = 0.0;
        for_all([nx, ny, nz], |at| {
            let value = dense.value(at).abs();
            if value.is_finite() {
                largest = largest.max(value);
            }
        });
        let cut = SATURATED * largest;
        let within = |value: f64| value.is_finite() && value.abs() < cut;
        let (mut slopes, mut every, mut met) = (Vec::new(), 1_u64, 0_u64);
        for_all([nx - 1, ny - 1, nz - 1], |at| {
            let here = dense.value(at);
            if !within(here) {
                return;
            }
            let steps: [f64; 3] = std::array::from_fn(|axis| {
                let mut next = at;
                next[axis] += 1;
                dense.value(next)
            });
            let is_crossed = |next: &f64| within(*next) && (*next < 0.0) != (here < 0.0);
            if !steps.iter().any(is_crossed) || !steps.iter().all(|next| within(*next)) {
                return;
            }
            if met % every == 0 {
                slopes.push(steps.iter().map(|next| (next - here).powi(2)).sum::<f64>().sqrt());
            }
            met += 1;
            if slopes.len() == GRADIENTS {
                // Every other one stays, so that they are from all over the box.
                let mut keep = false;
                slopes.retain(|_| {
                    keep = !keep;
                    keep
                });
                every *= 2;
            }
        });
        slopes.sort_unstable_by(f64::total_cmp);
        let slope = slopes.get(slopes.len() / 2).copied().filter(|slope| *slope > 0.0);
        Self { largest, slope }
    }
}

/// All places of a box.
fn for_all([nx, ny, nz]: [usize; 3], mut look: impl FnMut([usize; 3])) {
    for z in 0..nz {
        for y in 0..ny {
            (0..nx).for_each(|x| look([x, y, z]));
        }
    }
}
