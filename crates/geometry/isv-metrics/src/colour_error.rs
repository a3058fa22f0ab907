//! The figures of a comparison of colours, and their means over frames.

use serde::{Deserialize, Serialize};

/// Difference of a test shape's colours from those of its reference. The names are the keys of `isv eval --json`.
///
/// Nothing is there unless both sides have colours. PSNR is that of sRGB values as BT.709 turns them into Y,
/// Cb and Cr of full range, with a peak of 255. It is at most
/// [`MAX_COLOUR_PSNR_DB`](crate::MAX_COLOUR_PSNR_DB).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColourError {
    /// PSNR of Y at points of the test shape.
    pub colour_y_psnr_db: Option<f64>,
    /// PSNR of Y, Cb and Cr at points of the test shape: squared errors are weighted 6:1:1.
    pub colour_ycc_psnr_db: Option<f64>,
    /// PSNR of Y at points of either shape: the lower of both directions.
    pub colour_y_symmetric_psnr_db: Option<f64>,
    /// PSNR of Y, Cb and Cr, weighted 6:1:1, at points of either shape: the lower of both directions.
    pub colour_ycc_symmetric_psnr_db: Option<f64>,
    /// PSNR of Y in pictures of both meshes from six sides, over the pixels that both cover.
    pub render_y_psnr_db: Option<f64>,
    /// Structural similarity (SSIM) of Y in these pictures, at most 1; mean over the pixels whose surroundings both cover.
    pub render_ssim: Option<f64>,
}

/// Mean of each figure over the frames that have it.
#[must_use]
pub fn colour_summary(frames: &[ColourError]) -> ColourError {
    let mean = |figure: fn(&ColourError) -> Option<f64>| {
        let having = frames.iter().filter_map(figure).count();
        (having > 0).then(|| frames.iter().filter_map(figure).sum::<f64>() / having as f64)
    };
    ColourError {
        colour_y_psnr_db: mean(|f| f.colour_y_psnr_db),
        colour_ycc_psnr_db: mean(|f| f.colour_ycc_psnr_db),
        colour_y_symmetric_psnr_db: mean(|f| f.colour_y_symmetric_psnr_db),
        colour_ycc_symmetric_psnr_db: mean(|f| f.colour_ycc_symmetric_psnr_db),
        render_y_psnr_db: mean(|f| f.render_y_psnr_db),
        render_ssim: mean(|f| f.render_ssim),
    }
}
