//! Samples to sRGB.

use super::frame::{SAMPLE_BITS, Sample};
use isv_volume::Rgb;

/// The sRGB colour of a sample: exact integers, so that all decoders give the same bytes.
///
/// The factors are BT.709's 1.5748, 0.1873, 0.4681 and 1.8556 in 1/65536.
#[must_use]
pub fn to_rgb([y, cb, cr, _]: Sample) -> Rgb {
    const HALF: i32 = 1 << (15 + SAMPLE_BITS);
    let [y, cb, cr] = [y, cb, cr].map(i32::from);
    let channels =
        [65536 * y + 103_206 * cr, 65536 * y - 12_276 * cb - 30_679 * cr, 65536 * y + 121_609 * cb];
    channels.map(|c| ((c + HALF) >> (16 + SAMPLE_BITS)).clamp(0, 255) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_volume::ycbcr_from_rgb;

    #[test]
    fn there_and_back() {
        for r in (0..=255u8).step_by(15) {
            for g in (0..=255u8).step_by(15) {
                for b in (0..=255u8).step_by(15) {
                    let ycbcr = ycbcr_from_rgb([r, g, b].map(f32::from));
                    let [y, cb, cr] = ycbcr.map(|c| (c * 64.0).round() as i16);
                    assert_eq!(to_rgb([y, cb, cr, 0]), [r, g, b]);
                }
            }
        }
    }

    #[test]
    fn nothing_overflows() {
        for y in [0, 255 * 64] {
            for c in [-128 * 64, 127 * 64] {
                let [_, green, _] = to_rgb([y, c, c, 0]);
                assert!(green == 0 || y > 0 || c < 0);
            }
        }
    }
}
