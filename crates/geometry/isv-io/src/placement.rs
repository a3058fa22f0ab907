//! Place and precision of written coordinates.

use glam::DVec3;
use std::io::{self, Write};

/// Place of a mesh or points when they are written, and how exact their coordinates stay.
///
/// Most formats hold coordinates as `f32`, which is good for half a metre where a country's survey counts them. PLY, OBJ and
/// PCD then get `f64`, and a GLB file moves its nodes in place of their vertices. STL has nothing but `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Added to all positions.
    pub translation: DVec3,
    /// Largest rounding that coordinates may take, in the unit that is written.
    pub tolerance: f64,
}

/// Coordinates as they are, rounded to `f32`.
impl Default for Placement {
    fn default() -> Self {
        Self { translation: DVec3::ZERO, tolerance: f64::INFINITY }
    }
}

impl Placement {
    /// Whether `f32` is too coarse for these positions, once they are moved.
    #[must_use]
    pub fn needs_double(&self, positions: &[DVec3]) -> bool {
        if self.tolerance == f64::INFINITY {
            return false;
        }
        let largest = positions
            .iter()
            .fold(0f64, |largest, position| largest.max((*position + self.translation).abs().max_element()));
        f64::from(spacing(largest as f32)) > self.tolerance
    }

    /// Positions where they go.
    pub(crate) fn place(&self, position: DVec3) -> DVec3 {
        position + self.translation
    }
}

/// Distance from an `f32` to the next larger one.
fn spacing(value: f32) -> f32 {
    value.next_up() - value
}

/// The components of a vector as bytes of `f32`, or of `f64` where asked.
pub(crate) fn write_components(out: &mut impl Write, vector: DVec3, double: bool) -> io::Result<()> {
    for component in vector.to_array() {
        match double {
            true => out.write_all(&component.to_le_bytes())?,
            false => out.write_all(&(component as f32).to_le_bytes())?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn double_precision_begins_where_a_tenth_of_a_millimetre_is_lost() {
        let placed = |x: f64| Placement { translation: DVec3::new(x, 0.0, 0.0), tolerance: 1e-4 };
        let positions = [DVec3::ZERO, DVec3::splat(0.5)];
        assert!(!placed(0.0).needs_double(&positions));
        // The spacing of f32 is 0.06 mm from 512 m on and 0.12 mm from 1024 m on.
        assert!(!placed(1000.0).needs_double(&positions));
        assert!(placed(1023.6).needs_double(&positions));
        assert!(placed(-5_403_000.0).needs_double(&positions));
        assert!(!Placement::default().needs_double(&[DVec3::splat(5e6)]));
        assert!(!placed(5e6).needs_double(&[]), "no position, nothing to lose");
    }
}
