//! Colours as files hold them: the numbers of all tell their scale.

use isv_volume::Rgb;

/// Scale of the numbers of a file's colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// 0 to 255.
    Byte,
    /// 0 to 65535; 0 to 255 if no number is larger, as some programs write it.
    Short,
    /// 0 to 1; 0 to 255 if a number is larger than that, and more than a little where some are no whole numbers.
    Unit,
    /// 0 to 255; 0 to 1 if no number is much larger than 1 and some are no whole numbers.
    ByteOrUnit,
}

/// Colours of 0 to 1 may be this large: by rounding, or as light that is brighter than white.
const BRIGHTEST: f32 = 4.0;

/// The colours of vertices or points, until all are there.
#[derive(Debug)]
pub(crate) struct RawColours {
    scale: Scale,
    values: Vec<[f32; 3]>,
    largest: f32,
    any_fraction: bool,
}

impl RawColours {
    /// No colours yet; `room` is a number of colours whose bytes are there.
    pub(crate) fn new(scale: Scale, room: usize) -> Self {
        Self { scale, values: Vec::with_capacity(room), largest: 0.0, any_fraction: false }
    }

    /// Appends a colour. NaN stands for one that is not known, which becomes white.
    pub(crate) fn push(&mut self, colour: [f64; 3]) {
        let colour = colour.map(|value| value as f32);
        self.largest = colour.iter().fold(self.largest, |largest, value| largest.max(*value));
        self.any_fraction |= colour.iter().any(|value| value.is_finite() && value.fract() != 0.0);
        self.values.push(colour);
    }

    /// Appends unknown colours until there are `count`.
    pub(crate) fn fill(&mut self, count: usize) {
        if self.values.len() < count {
            self.values.resize(count, [f32::NAN; 3]);
        }
    }

    /// How many colours there are.
    pub(crate) fn len(&self) -> usize {
        self.values.len()
    }

    /// Colours as bytes.
    pub(crate) fn finish(self) -> Vec<Rgb> {
        let is_unit = self.largest <= 1.0 || self.any_fraction && self.largest <= BRIGHTEST;
        let full = match self.scale {
            Scale::Byte => 255.0,
            Scale::Short if self.largest > 255.0 => 65535.0,
            Scale::Unit if is_unit => 1.0,
            Scale::ByteOrUnit if is_unit && self.any_fraction => 1.0,
            Scale::Short | Scale::Unit | Scale::ByteOrUnit => 255.0,
        };
        let byte = |value: f32| if value.is_nan() { 255 } else { (value / full * 255.0).round() as u8 };
        self.values.into_iter().map(|colour| colour.map(byte)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(scale: Scale, values: &[f64]) -> Vec<u8> {
        let mut colours = RawColours::new(scale, 0);
        values.iter().for_each(|value| colours.push([*value; 3]));
        colours.finish().iter().map(|colour| colour[0]).collect()
    }

    #[test]
    fn the_largest_number_tells_the_scale() {
        assert_eq!(bytes(Scale::Byte, &[0.0, 1.0, 255.0, 300.0, -4.0]), [0, 1, 255, 255, 0]);
        assert_eq!(bytes(Scale::Short, &[0.0, 128.0, 255.0]), [0, 128, 255]);
        assert_eq!(bytes(Scale::Short, &[0.0, 257.0, 65535.0]), [0, 1, 255]);
        assert_eq!(bytes(Scale::Unit, &[0.0, 0.5, 1.0]), [0, 128, 255]);
        assert_eq!(bytes(Scale::Unit, &[0.0, 0.5, 1.000_000_1, 2.0]), [0, 128, 255, 255]);
        assert_eq!(bytes(Scale::Unit, &[0.0, 1.0, 2.0]), [0, 1, 2]);
        assert_eq!(bytes(Scale::Unit, &[0.0, 0.5, 4.5]), [0, 1, 5]);
        assert_eq!(bytes(Scale::ByteOrUnit, &[0.0, 1.0]), [0, 1]);
        assert_eq!(bytes(Scale::ByteOrUnit, &[0.0, 0.5, 1.0]), [0, 128, 255]);
    }

    #[test]
    fn what_is_not_known_is_white_and_what_is_infinite_is_cut() {
        assert_eq!(bytes(Scale::Unit, &[f64::NAN, 0.5]), [255, 128]);
        assert_eq!(bytes(Scale::Byte, &[f64::INFINITY, f64::NEG_INFINITY]), [255, 0]);
        let mut colours = RawColours::new(Scale::Unit, 0);
        colours.fill(2);
        assert_eq!(colours.finish(), [[255; 3]; 2]);
    }

    #[test]
    fn every_byte_comes_back() {
        let all: Vec<u8> = (0..=255).collect();
        let numbers: Vec<f64> = all.iter().map(|byte| f64::from(f32::from(*byte) / 255.0)).collect();
        assert_eq!(bytes(Scale::Unit, &numbers), all);
        let shorts: Vec<f64> = all.iter().map(|byte| 257.0 * f64::from(*byte)).collect();
        assert_eq!(bytes(Scale::Short, &shorts), all);
    }
}
