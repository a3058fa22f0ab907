//! Colours of errors.

/// Colours from error 0 to the range, evenly spaced: the nine-class scheme `YlOrRd` of ColorBrewer 2.0,
/// sequential and safe for the colour-blind. It is that of Harrower and Brewer 2003, "ColorBrewer.org: An
/// Online Tool for Selecting Colour Schemes for Maps", The Cartographic Journal 40. Its light end leaves the
/// form to be seen where errors are small.
const YELLOW_TO_RED: [[u8; 3]; 9] = [
    [255, 255, 204],
    [255, 237, 160],
    [254, 217, 118],
    [254, 178, 76],
    [253, 141, 60],
    [252, 78, 42],
    [227, 26, 28],
    [189, 0, 38],
    [128, 0, 38],
];

/// Colour of errors beyond the range: a blue that is far from all colours of the scale for every kind of
/// colour vision. It is `blue` of Okabe and Ito's palette, "Color Universal Design", 2008.
pub const BEYOND_RANGE: [u8; 3] = [0, 114, 178];

/// The map from errors to colours: linear from 0 to a range, one colour beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    range_m: f64,
}

impl ErrorScale {
    /// A scale from 0 to `range_m` metres; none unless that is a positive, finite number.
    #[must_use]
    pub fn new(range_m: f64) -> Option<Self> {
        (range_m > 0.0 && range_m.is_finite()).then_some(Self { range_m })
    }

    /// Largest error that has a colour of its own, in metres.
    #[must_use]
    pub fn range_m(&self) -> f64 {
        self.range_m
    }

    /// RGB of an error in metres. Negative errors count as 0; what is not a number is beyond the range.
    #[must_use]
    pub fn colour(&self, error_m: f64) -> [u8; 3] {
        let place = error_m.max(0.0) / self.range_m * (YELLOW_TO_RED.len() - 1) as f64;
        if error_m.is_nan() || error_m > self.range_m {
            return BEYOND_RANGE;
        }
        let below = (place.floor() as usize).min(YELLOW_TO_RED.len() - 2);
        let part = place - below as f64;
        [0, 1, 2].map(|channel| {
            let [low, high] = [below, below + 1].map(|i| f64::from(YELLOW_TO_RED[i][channel]));
            (low + (high - low) * part).round() as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness L*, of sRGB.
    fn lightness(rgb: [u8; 3]) -> f64 {
        let linear = rgb.map(|c| {
            let c = f64::from(c) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        });
        let luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        116.0 * luminance.cbrt() - 16.0
    }

    #[test]
    fn larger_errors_are_darker() {
        let scale = ErrorScale::new(0.002).unwrap();
        let lights: Vec<f64> =
            (0..=64).map(|i| lightness(scale.colour(0.002 * f64::from(i) / 64.0))).collect();
        assert!(lights.windows(2).all(|pair| pair[1] < pair[0]), "{lights:?}");
    }

    #[test]
    fn the_ends_and_the_middle_are_the_published_colours() {
        let scale = ErrorScale::new(0.002).unwrap();
        assert_eq!(scale.colour(0.0), [255, 255, 204]);
        assert_eq!(scale.colour(0.001), [253, 141, 60]);
        assert_eq!(scale.colour(0.002), [128, 0, 38]);
        assert_eq!(scale.colour(0.000125), [255, 246, 182]);
    }

    #[test]
    fn what_is_beyond_or_unknown_has_its_own_colour() {
        let scale = ErrorScale::new(0.002).unwrap();
        for error in [0.0020001, 1e9, f64::INFINITY, f64::NAN] {
            assert_eq!(scale.colour(error), BEYOND_RANGE, "{error}");
        }
        assert_eq!(scale.colour(-1.0), scale.colour(0.0));
        for range in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(ErrorScale::new(range), None, "{range}");
        }
    }
}
