//! Frames of one sequence must share a unit.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Ratio of frame sizes from which on two frames cannot share a unit: just below the 10 between metres and
/// decimetres, the smallest step between two common units. Moving figures stay far below it.
pub const SCALE_JUMP: f64 = 9.5;

/// A frame so much larger or smaller than the first that it must be in another unit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "{}: this frame is {diagonal_m:.4} m across but the first one, {}, is {first_diagonal_m:.4} m: all frames need \
     one common unit; convert them to one and name it with --units",
    path.display(), first_path.display()
)]
pub struct ScaleError {
    /// The frame.
    pub path: PathBuf,
    /// Diagonal of its bounding box, in metres.
    pub diagonal_m: f64,
    /// The first frame.
    pub first_path: PathBuf,
    /// Diagonal of its bounding box, in metres.
    pub first_diagonal_m: f64,
}

/// Compares the size of each frame with that of the first.
#[derive(Clone, Debug, Default)]
pub struct ScaleCheck {
    first: Option<(PathBuf, f64)>,
}

impl ScaleCheck {
    /// A check that has seen no frame.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes the next frame: the file it came from and the diagonal of its bounding box in metres. Frames without
    /// extent say nothing about units and pass.
    ///
    /// # Errors
    /// [`ScaleError`] if the frame is [`SCALE_JUMP`] times larger or smaller than the first.
    pub fn check(&mut self, path: &Path, diagonal_m: f64) -> Result<(), ScaleError> {
        if diagonal_m <= 0.0 {
            return Ok(());
        }
        let (first_path, first_diagonal_m) = self.first.get_or_insert_with(|| (path.to_owned(), diagonal_m));
        let ratio = diagonal_m / *first_diagonal_m;
        if ratio.max(1.0 / ratio) < SCALE_JUMP {
            return Ok(());
        }
        Err(ScaleError {
            path: path.to_owned(),
            diagonal_m,
            first_path: first_path.clone(),
            first_diagonal_m: *first_diagonal_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_unit_is_noticed_in_both_directions() {
        let mut check = ScaleCheck::new();
        let mut feed = |name: &str, diagonal| check.check(Path::new(name), diagonal);
        feed("empty.ply", 0.0).unwrap();
        feed("a.ply", 1.8).unwrap();
        feed("b.ply", 1.8 * 9.0).unwrap();
        feed("c.ply", 1.8 / 9.0).unwrap();
        for factor in [10.0, 25.4, 100.0, 1000.0] {
            assert!(feed("d.ply", 1.8 * factor).is_err());
            assert!(feed("d.ply", 1.8 / factor).is_err());
        }
        assert_eq!(
            feed("e.ply", 180.0).unwrap_err().to_string(),
            "e.ply: this frame is 180.0000 m across but the first one, a.ply, is 1.8000 m: all frames need one \
             common unit; convert them to one and name it with --units"
        );
    }
}
