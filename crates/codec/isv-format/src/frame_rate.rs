//! Frames a second.

use std::str::FromStr;
use thiserror::Error;

/// Frames a second as a fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRate {
    /// Frames in `denominator` seconds; not 0.
    pub numerator: u32,
    /// Seconds; not 0.
    pub denominator: u32,
}

impl FrameRate {
    /// The default: 30 frames a second.
    pub const DEFAULT: Self = Self { numerator: 30, denominator: 1 };

    /// Frames a second.
    #[must_use]
    pub fn per_second(self) -> f64 {
        f64::from(self.numerator) / f64::from(self.denominator)
    }

    /// Start of a frame in nanoseconds, rounded down; at most what 64 bits hold, which is 584 years.
    #[must_use]
    pub fn timestamp_ns(self, frame: u64) -> u64 {
        let seconds = u128::from(frame) * u128::from(self.denominator);
        u64::try_from(seconds * 1_000_000_000 / u128::from(self.numerator)).unwrap_or(u64::MAX)
    }

    /// The rate closest to a number of frames a second, in thousandths; `None` if that is none.
    #[must_use]
    pub fn nearest(per_second: f64) -> Option<Self> {
        format!("{per_second:.3}").parse().ok()
    }
}

/// A text that is no frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ParseFrameRateError {
    /// No number above 0.
    #[error("a frame rate is a number above 0, such as 30, 29.97 or 30000/1001")]
    NoRate,
    /// A fraction of larger numbers than a stream can state.
    #[error("numerator and denominator of a frame rate must be below 2^32")]
    TooLarge,
}

/// A whole number, a decimal number or a fraction, exactly as written and in lowest terms: `30`, `29.97`, `30000/1001`.
impl FromStr for FrameRate {
    type Err = ParseFrameRateError;

    fn from_str(text: &str) -> Result<Self, ParseFrameRateError> {
        let (numerator, denominator) = match text.split_once('/') {
            Some((numerator, denominator)) => (digits(numerator), digits(denominator)),
            None => {
                let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
                (digits(&format!("{whole}{decimals}")), 10u64.checked_pow(decimals.len() as u32))
            }
        };
        let (Some(numerator @ 1..), Some(denominator @ 1..)) = (numerator, denominator) else {
            return Err(ParseFrameRateError::NoRate);
        };
        let divisor = greatest_common_divisor(numerator, denominator);
        match (u32::try_from(numerator / divisor), u32::try_from(denominator / divisor)) {
            (Ok(numerator), Ok(denominator)) => Ok(Self { numerator, denominator }),
            _ => Err(ParseFrameRateError::TooLarge),
        }
    }
}

fn digits(text: &str) -> Option<u64> {
    // `u64::from_str` would also take a plus sign.
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_exact() {
        for (text, numerator, denominator) in [
            ("30", 30, 1),
            ("29.97", 2997, 100),
            ("30000/1001", 30000, 1001),
            ("12.50", 25, 2),
            ("50/2", 25, 1),
        ] {
            assert_eq!(text.parse(), Ok(FrameRate { numerator, denominator }), "{text}");
        }
        assert_eq!(FrameRate::nearest(29.99996), Some(FrameRate { numerator: 30, denominator: 1 }));
        assert_eq!(FrameRate::nearest(29.97003), Some(FrameRate { numerator: 2997, denominator: 100 }));
        assert_eq!(
            (FrameRate::nearest(0.0001), FrameRate::nearest(f64::NAN), FrameRate::nearest(-1.0)),
            (None, None, None)
        );
        for wrong in ["", "0", "-30", "+30", "30fps", "1/0", "0/1", ".", "1e3", "30/1.001", "9999999999"] {
            assert!(wrong.parse::<FrameRate>().is_err(), "{wrong}");
        }
    }
}
