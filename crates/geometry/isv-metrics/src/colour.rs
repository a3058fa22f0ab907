//! Colours of one shape against those of another.

mod at_surface;
mod cameras;
mod coloured;
mod picture;
mod psnr;
mod ssim;
mod views;

pub use psnr::MAX_COLOUR_PSNR_DB;
pub use views::{ViewErrors, compare_views};

use crate::chamfer::second_seed;
use crate::compare::checked_areas;
use crate::{ColourError, CompareError, CompareOptions, Shape};
use at_surface::ErrorsAtPoints;
use coloured::Coloured;

/// Measures the colours of a test shape against those of a reference: meshes with an appearance or points with colours, on either
/// side. Pictures are compared where both are meshes. Without colours on both sides there are no figures.
///
/// Colours are compared where the geometry is, at the points that [`compare`](crate::compare) measures from, or in pictures from fixed
/// sides. The seeds are those of [`compare`](crate::compare).
///
/// # Errors
/// See [`CompareError`]: what has no geometry to measure has no colours to measure.
pub fn compare_colours<'a>(
    reference: impl Into<Shape<'a>>,
    test: impl Into<Shape<'a>>,
    options: &CompareOptions,
) -> Result<ColourError, CompareError> {
    let (reference, test) = (reference.into(), test.into());
    checked_areas(&reference, &test, options)?;
    if !(reference.has_colours() && test.has_colours()) {
        return Ok(ColourError::default());
    }
    let &CompareOptions { spacing_m, seed } = options;
    let (on_reference, on_test) = rayon::join(
        || Coloured::new(reference, spacing_m, seed),
        || Coloured::new(test, spacing_m, second_seed(seed)),
    );
    let back = ErrorsAtPoints::new(&on_test, &on_reference);
    let there = ErrorsAtPoints::new(&on_reference, &on_test);
    let views = match (reference, test) {
        (Shape::Mesh(reference), Shape::Mesh(test)) => compare_views(reference, test),
        _ => ViewErrors::default(),
    };
    Ok(ColourError {
        colour_y_psnr_db: Some(back.y_psnr_db()),
        colour_ycc_psnr_db: Some(back.ycc_psnr_db()),
        colour_y_symmetric_psnr_db: Some(back.y_psnr_db().min(there.y_psnr_db())),
        colour_ycc_symmetric_psnr_db: Some(back.ycc_psnr_db().min(there.ycc_psnr_db())),
        render_y_psnr_db: views.y_psnr_db,
        render_ssim: views.ssim,
    })
}
