//! Peak signal-to-noise ratios of colours.

/// Largest PSNR of colours. It stands for errors of 1/400 of an 8-bit level, which are below the rounding of
/// texture coordinates. No error at all has no PSNR, and counts as this many decibels too.
pub const MAX_COLOUR_PSNR_DB: f64 = 100.0;

/// Largest value of a channel.
const PEAK: f64 = 255.0;

/// PSNR of a mean squared error, in decibels.
pub(super) fn psnr_db(mse: f64) -> f64 {
    (10.0 * (PEAK * PEAK / mse).log10()).min(MAX_COLOUR_PSNR_DB)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_error_is_the_most_decibels() {
        assert_eq!(psnr_db(0.0), MAX_COLOUR_PSNR_DB);
        assert_eq!(psnr_db(255.0 * 255.0), 0.0);
        assert!((psnr_db(1.0) - 48.130_803_608_679_1).abs() < 1e-9);
    }
}
