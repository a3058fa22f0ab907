//! Errors of colours in views from fixed sides.

use super::cameras::Camera;
use super::picture::{Picture, draw};
use super::psnr::psnr_db;
use super::ssim::ssim;
use isv_volume::TriangleMesh;
use rayon::prelude::*;

/// Errors of the colours of two meshes, as their pictures show them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewErrors {
    /// PSNR of Y (dB); `None` if no pixel shows both.
    pub y_psnr_db: Option<f64>,
    /// SSIM of Y; `None` if there is nowhere to measure it.
    pub ssim: Option<f64>,
}

/// Draws both meshes by the cameras around the reference's box, and compares the pictures.
///
/// Each picture that shows something counts the same. [`compare_colours`](crate::compare_colours) does this with meshes. Points can
/// be compared so once they are a mesh of cubes or of discs. A mesh without appearance is white.
///
/// # Panics
/// If a triangle names a vertex that is not there, or an appearance does not fit its mesh.
#[must_use]
pub fn compare_views(reference: &TriangleMesh, test: &TriangleMesh) -> ViewErrors {
    let Some(bounds) = reference.bounds() else { return ViewErrors::default() };
    let errors: Vec<(Option<f64>, Option<f64>)> = Camera::ring(bounds)
        .par_iter()
        .map(|camera| {
            let (reference, test) = rayon::join(|| draw(reference, camera), || draw(test, camera));
            (mean_squared_error(&reference, &test), ssim(&reference, &test))
        })
        .collect();
    ViewErrors {
        y_psnr_db: mean(errors.iter().filter_map(|(mse, _)| *mse)).map(psnr_db),
        ssim: mean(errors.iter().filter_map(|(_, ssim)| *ssim)),
    }
}

/// Mean squared error of Y over the pixels that both pictures cover; none if there are none.
fn mean_squared_error(a: &Picture, b: &Picture) -> Option<f64> {
    mean(a.iter().zip(b).filter_map(|(a, b)| Some(((*a)? - (*b)?).powi(2))))
}

/// The mean; none of nothing.
fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}
