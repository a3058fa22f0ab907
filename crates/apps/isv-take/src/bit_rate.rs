//! Bit rates: `2M`, `800k`.

use std::fmt;
use std::str::FromStr;

/// A bit rate above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BitRate {
    bits_per_second: f64,
}

impl BitRate {
    /// From bits a second.
    #[must_use]
    pub fn from_bits_per_second(bits_per_second: f64) -> Self {
        Self { bits_per_second }
    }

    /// In bits a second.
    #[must_use]
    pub fn bits_per_second(self) -> f64 {
        self.bits_per_second
    }
}

/// Text as a command line takes it.
impl fmt::Display for BitRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.bits_per_second {
            bits if bits < 1e6 => write!(f, "{}k", bits / 1e3),
            bits => write!(f, "{}M", bits / 1e6),
        }
    }
}

impl FromStr for BitRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = match (text.strip_suffix('k'), text.strip_suffix('M')) {
            (Some(number), _) => (number, 1e3),
            (_, Some(number)) => (number, 1e6),
            _ => return Err("a rate is bits a second in k or M, as in 800k or 2M".to_owned()),
        };
        match number.trim_end().parse::<f64>() {
            Ok(value) if value > 0.0 && value <= 1e6 => Ok(Self { bits_per_second: value * unit }),
            _ => Err("a rate is a number above 0 with k or M behind it, as in 800k or 2M".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_need_a_unit() {
        for (text, bits) in [("2M", 2e6), ("800k", 8e5), ("0.5 M", 5e5)] {
            assert_eq!(text.parse::<BitRate>().unwrap().bits_per_second(), bits, "{text}");
        }
        for wrong in ["2", "M", "-2M", "0k", "2m", "2Mbps", "", "infM", "1e9M", "nanM"] {
            assert!(wrong.parse::<BitRate>().is_err(), "{wrong}");
        }
        for text in ["2M", "800k", "1.5M"] {
            assert_eq!(text.parse::<BitRate>().unwrap().to_string(), text);
        }
    }
}
