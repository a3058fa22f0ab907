//! Lengths: a number and its unit.

use isv_io::Unit;
use std::fmt;
use std::str::FromStr;

/// A length above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Length {
    metres: f64,
}

impl Length {
    /// From metres.
    #[must_use]
    pub fn from_metres(metres: f64) -> Self {
        Self { metres }
    }

    /// In metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        self.metres
    }
}

/// Text as a command line takes it, in millimetres.
impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Nanometres are as fine as a stream can say; further digits come from the conversion.
        write!(f, "{}mm", (self.metres * 1e9).round() / 1e6)
    }
}

impl FromStr for Length {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let unit = match &text[number.len()..] {
            "" => return Err("a length needs a unit, as in 5mm".to_owned()),
            unit => unit.parse::<Unit>().map_err(|error| error.to_string())?,
        };
        match number.trim_end().parse::<f64>() {
            Ok(value) if value > 0.0 && value.is_finite() => Ok(Self { metres: value * unit.metres() }),
            _ => Err("a length is a number above 0 and a unit, as in 5mm".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_need_a_unit() {
        for (text, metres) in
            [("5mm", 0.005), ("0.02m", 0.02), ("1cm", 0.01), ("1 in", 0.0254), ("1e-3m", 0.001)]
        {
            assert!((text.parse::<Length>().unwrap().metres() - metres).abs() < 1e-12, "{text}");
        }
        for wrong in ["5", "mm", "-5mm", "0mm", "5yd", "", "infm", "5mm2"] {
            assert!(wrong.parse::<Length>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn lengths_print_as_they_may_be_given() {
        for text in ["5mm", "0.25mm", "1200mm", "12.5mm"] {
            assert_eq!(text.parse::<Length>().unwrap().to_string(), text);
        }
    }
}
