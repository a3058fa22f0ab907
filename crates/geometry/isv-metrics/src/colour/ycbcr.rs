//! Luma and chroma, and the errors of both.

/// Largest PSNR of colours. Errors of 1/400 of an 8-bit level, which it stands for, are below the rounding of texture coordinates; no error
/// at all, which has no PSNR, is this many decibels too.
pub const MAX_COLOUR_PSNR_DB: f64 = 100.0;

/// Largest value of a channel.
const PEAK: f64 = 255.0;

/// Shares of red, green and blue in Y (ITU-R BT.709-6, item 3.2).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Y of sRGB values of 0 to 255 a channel, in the same range.
pub(super) fn luma(rgb: [f32; 3]) -> f64 {
    (0..3).map(|channel| LUMA[channel] * f64::from(rgb[channel])).sum()
}

/// Y (0 to 255), Cb and Cr (-127.5 to 127.5) of sRGB values of 0 to 255 a channel (ITU-R BT.709-6, items 3.2 and 3.3, full range).
pub(super) fn ycbcr(rgb: [f32; 3]) -> [f64; 3] {
    let y = luma(rgb);
    let [red, _, blue] = rgb.map(f64::from);
    [y, (blue - y) / (2.0 * (1.0 - LUMA[2])), (red - y) / (2.0 * (1.0 - LUMA[0]))]
}

/// PSNR of a mean squared error, in decibels.
pub(super) fn psnr_db(mse: f64) -> f64 {
    (10.0 * (PEAK * PEAK / mse).log10()).min(MAX_COLOUR_PSNR_DB)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_have_no_chroma_and_primaries_have_all_of_it() {
        let near = |rgb: [f32; 3], expected: [f64; 3]| {
            let found = ycbcr(rgb);
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-9), "{rgb:?}: {found:?}");
        };
        near([0.0; 3], [0.0; 3]);
        near([255.0; 3], [255.0, 0.0, 0.0]);
        near([0.0, 0.0, 255.0], [0.0722 * 255.0, 127.5, -0.0722 * 255.0 / 1.5748]);
        near([255.0, 0.0, 0.0], [0.2126 * 255.0, -0.2126 * 255.0 / 1.8556, 127.5]);
    }

    #[test]
    fn no_error_is_the_most_decibels() {
        assert_eq!(psnr_db(0.0), MAX_COLOUR_PSNR_DB);
        assert_eq!(psnr_db(255.0 * 255.0), 0.0);
        assert!((psnr_db(1.0) - 48.130_803_608_679_1).abs() < 1e-9);
    }
}
