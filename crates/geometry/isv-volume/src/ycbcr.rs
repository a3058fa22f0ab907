//! YCbCr of BT.709.

/// Shares of red, green and blue in Y (ITU-R BT.709-6, item 3.2).
const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Y (0 to 255), Cb and Cr (-127.5 to 127.5) of sRGB values of 0 to 255 a channel. ITU-R BT.709-6, items 3.2
/// and 3.3, full range.
#[must_use]
#[inline]
pub fn ycbcr_from_rgb(rgb: [f32; 3]) -> [f64; 3] {
    let [red, green, blue] = rgb.map(f64::from);
    let y = LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue;
    [y, (blue - y) / (2.0 * (1.0 - LUMA[2])), (red - y) / (2.0 * (1.0 - LUMA[0]))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greys_have_no_chroma_and_primaries_have_all_of_it() {
        let near = |rgb: [f32; 3], expected: [f64; 3]| {
            let found = ycbcr_from_rgb(rgb);
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-9), "{rgb:?}: {found:?}");
        };
        near([0.0; 3], [0.0; 3]);
        near([255.0; 3], [255.0, 0.0, 0.0]);
        near([0.0, 0.0, 255.0], [0.0722 * 255.0, 127.5, -0.0722 * 255.0 / 1.5748]);
        near([255.0, 0.0, 0.0], [0.2126 * 255.0, -0.2126 * 255.0 / 1.8556, 127.5]);
    }
}
