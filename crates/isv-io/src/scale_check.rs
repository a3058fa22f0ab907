//! Frames of one sequence must share a unit.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Ratio of frame sizes from which on two frames cannot share a unit: just below the 10 between metres and
/// decimetres, the smallest step between two common units. Moving figures stay far below it.
pub const SCALE_JUMP: f64 = 9.5;

/// A frame so much larger or smaller than the one before that it must be in another unit.
#[derive(Clone, Debug, PartialEq, Error)]
#[error(
    "{}: this frame is {diagonal_m:.4} m across but the one before, {}, is {before_diagonal_m:.4} m: all frames need \
     one common unit; convert them to one and name it with --units",
    path.display(), before_path.display()
)]
pub struct ScaleError {
    /// The frame.
    pub path: PathBuf,
    /// Diagonal of its bounding box, in metres.
    pub diagonal_m: f64,
    /// The frame before it.
    pub before_path: PathBuf,
    /// Diagonal of its bounding box, in metres.
    pub before_diagonal_m: f64,
}

/// Compares the size of each frame with that of the one before: over a take, what spreads or collapses may become any size.
#[derive(Clone, Debug, Default)]
pub struct ScaleCheck {
    before: Option<(PathBuf, f64)>,
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
    /// [`ScaleError`] if the frame is [`SCALE_JUMP`] times larger or smaller than the last one that passed.
    pub fn check(&mut self, path: &Path, diagonal_m: f64) -> Result<(), ScaleError> {
        if diagonal_m <= 0.0 {
            return Ok(());
        }
        if let Some((before_path, before_diagonal_m)) = &self.before {
            let ratio = diagonal_m / before_diagonal_m;
            if ratio.max(1.0 / ratio) >= SCALE_JUMP {
                return Err(ScaleError {
                    path: path.to_owned(),
                    diagonal_m,
                    before_path: before_path.clone(),
                    before_diagonal_m: *before_diagonal_m,
                });
            }
        }
        self.before = Some((path.to_owned(), diagonal_m));
        Ok(())
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
        feed("c.ply", 1.8).unwrap();
        feed("c.ply", 1.8 / 9.0).unwrap();
        feed("a.ply", 1.8).unwrap();
        for factor in [10.0, 25.4, 100.0, 1000.0] {
            assert!(feed("d.ply", 1.8 * factor).is_err());
            assert!(feed("d.ply", 1.8 / factor).is_err());
        }
        assert_eq!(
            feed("e.ply", 180.0).unwrap_err().to_string(),
            "e.ply: this frame is 180.0000 m across but the one before, a.ply, is 1.8000 m: all frames need one \
             common unit; convert them to one and name it with --units"
        );
    }
}
