//! Time stamps as text: exact to the nanosecond, in the unit that they must be in.

use super::error::DepthFileError;
use crate::text::parse_billionths;
use serde::de::{Deserialize, Deserializer};
use serde_json::Value;
use std::path::Path;

/// Billionths to a unit: a number `x` is kept as `x * 1e9`.
const NANO: i128 = 1_000_000_000;

/// How far, in seconds, the colour image nearest in time may be from a depth image; depth images without such an image have no colour.
pub(crate) const COLOUR_LIMIT_S: f64 = 0.02;

/// The years 2000 to 2040 in billionths of seconds since 1970.
const YEARS: std::ops::Range<i128> = 946_684_800 * NANO..2_208_988_800 * NANO;

/// Frames a second of a take whose times look like times since 1970.
const RATES_BY_THE_CLOCK: std::ops::Range<f64> = 0.1..500.0;

/// What time stamps count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
pub(crate) enum TimeUnit {
    /// Seconds.
    #[serde(rename = "s")]
    Second,
    /// Thousandths of a second.
    #[serde(rename = "ms")]
    Millisecond,
    /// Millionths of a second.
    #[serde(rename = "us", alias = "µs", alias = "μs")]
    Microsecond,
    /// Billionths of a second.
    #[serde(rename = "ns")]
    Nanosecond,
}

impl TimeUnit {
    const ALL: [Self; 4] = [Self::Second, Self::Millisecond, Self::Microsecond, Self::Nanosecond];

    /// Units to a second.
    fn per_second(self) -> f64 {
        self.per_second_exact() as f64
    }

    fn per_second_exact(self) -> i128 {
        match self {
            Self::Second => 1,
            Self::Millisecond => 1_000,
            Self::Microsecond => 1_000_000,
            Self::Nanosecond => 1_000_000_000,
        }
    }

    /// The unit of time stamps in rising order, in billionths of it.
    ///
    /// Times since 1970 are told by their size, unless the rate by their median distance is no camera's. Otherwise whole numbers are in
    /// the unit of which the rate is from 0.5 up to 500 frames a second. With decimals it is from 0.125 up to 125, as fractions of
    /// milliseconds are less common than slow takes. What fits no unit is in seconds.
    pub(crate) fn from_stamps(stamps: &[i128]) -> Self {
        if let Some(unit) = Self::of_clock(stamps) {
            return unit;
        }
        let has_decimals = has_decimals(stamps);
        let step = median_step(stamps);
        let least = if has_decimals { 0.125 } else { 0.5 };
        let Some(step) = step else { return Self::Second };
        let fits = |unit: &Self| (least..1000.0 * least).contains(&(unit.per_second() / step));
        Self::ALL.into_iter().find(fits).unwrap_or(Self::Second)
    }

    /// The unit of time stamps that are times since 1970, if all of them are.
    pub(crate) fn of_clock(stamps: &[i128]) -> Option<Self> {
        let (has_decimals, step) = (has_decimals(stamps), median_step(stamps));
        Self::ALL.into_iter().find(|unit| {
            let scale = unit.per_second_exact();
            stamps.iter().all(|stamp| (YEARS.start * scale..YEARS.end * scale).contains(stamp))
                && (*unit == Self::Second && has_decimals
                    || step.is_none_or(|step| RATES_BY_THE_CLOCK.contains(&(unit.per_second() / step))))
        })
    }

    /// The unit's name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Second => "seconds",
            Self::Millisecond => "milliseconds",
            Self::Microsecond => "microseconds",
            Self::Nanosecond => "nanoseconds",
        }
    }

    /// The unit as it is said to the user, unless it is clear: seconds are, where they make a frame a second or more.
    pub(crate) fn doubtful_name(self, stamps: &[i128]) -> Option<&'static str> {
        let is_clear = self == Self::Second && median_step(stamps).is_none_or(|step| step <= 1.0);
        (!is_clear).then(|| self.name())
    }

    /// A time stamp in nanoseconds, rounded to the nearest.
    pub(crate) fn nanoseconds(self, stamp: i128) -> i128 {
        let scale = self.per_second_exact();
        (stamp + scale / 2).div_euclid(scale)
    }
}

/// The image nearest to a time, of images in order of time, if it is near enough.
pub(crate) fn nearest<T>(images: &[(i128, T)], time: i128, limit: i128) -> Option<&(i128, T)> {
    let next = images.partition_point(|(other, _)| *other < time);
    let around = images[next.saturating_sub(1)..].iter().take(2);
    around.min_by_key(|(other, _)| (other - time).abs()).filter(|(other, _)| (other - time).abs() <= limit)
}

fn has_decimals(stamps: &[i128]) -> bool {
    stamps.iter().any(|stamp| stamp % NANO != 0)
}

/// The median of the distances above 0 between neighbours, in units.
pub(crate) fn median_step(stamps: &[i128]) -> Option<f64> {
    let mut steps: Vec<i128> =
        stamps.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|step| *step as f64 / NANO as f64)
}

/// One over the median distance of times in nanoseconds, in frames a second.
pub(crate) fn median_rate(times_ns: &[u64]) -> Option<f64> {
    let mut steps: Vec<u64> = times_ns.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    steps.retain(|step| *step > 0);
    steps.sort_unstable();
    steps.get(steps.len() / 2).map(|step| 1e9 / *step as f64)
}

/// Times in nanoseconds, which do not fall, as times after the first.
pub(crate) fn since_first(times_ns: &[i128], file: &Path) -> Result<Vec<u64>, DepthFileError> {
    let first = times_ns.first().copied().unwrap_or_default();
    let since_first = |(frame, time): (usize, &i128)| {
        u64::try_from(time - first)
            .map_err(|_| time_error(file, frame, "the time stamp is more than 584 years after the first"))
    };
    times_ns.iter().enumerate().map(since_first).collect()
}

/// Names the frame whose time stamp cannot be.
pub(crate) fn time_error(file: &Path, frame: usize, why: &'static str) -> DepthFileError {
    DepthFileError::Time { path: file.to_owned(), frame, why }
}

/// A time stamp in JSON, in billionths: a number, or text to keep all of its digits. `None` for everything else.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WrittenStamp(pub(crate) Option<i128>);

impl<'de> Deserialize<'de> for WrittenStamp {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self(match Value::deserialize(deserializer)? {
            // The shortest decimals that make a number are those that were written.
            Value::Number(number) => parse_billionths(&number.to_string()),
            Value::String(text) => parse_billionths(text.trim()),
            _ => None,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(stamps: &[&str]) -> TimeUnit {
        TimeUnit::from_stamps(
            &stamps.iter().map(|stamp| parse_billionths(stamp).unwrap()).collect::<Vec<_>>(),
        )
    }

    #[test]
    fn the_unit_is_that_of_a_cameras_rate() {
        use TimeUnit::{Microsecond, Millisecond, Nanosecond, Second};
        for (stamps, expected) in [
            (&["1305031102.175304", "1305031102.211214", "1305031102.243211"][..], Second),
            (&["0.0", "0.033333", "0.066667"], Second),
            (&["0", "1", "2"], Second),
            (&["0", "2", "4"], Second),
            (&["0.0", "2.5", "5.0"], Second),
            (&["1305031102.5", "1305031112.5", "1305031122.5"], Second),
            (&["0.001", "0.002", "0.003"], Second),
            (&["1305031102175", "1305031102211", "1305031102243"], Millisecond),
            (&["0", "33", "67", "100"], Millisecond),
            (&["0", "5", "10", "15"], Millisecond),
            (&["33.366", "66.733", "100.100"], Millisecond),
            (&["0", "33", "2067", "2100", "2133"], Millisecond),
            (&["1305031102175304", "1305031102211214"], Microsecond),
            (&["0", "33333", "66667"], Microsecond),
            (&["1305031102175304000", "1305031102211214000"], Nanosecond),
            (&["300000000000", "300033333333"], Nanosecond),
            (&["1000000000000", "1000033333333"], Nanosecond),
            (&["1305031102175", "1305031112175"], Millisecond),
            (&["1305031102175"], Millisecond),
            (&["1305031102", "1305031112"], Second),
            (&["7"], Second),
            (&["7", "7"], Second),
            (&["0", "99000000000000000000"], Second),
        ] {
            assert_eq!(unit(stamps), expected, "{stamps:?}");
        }
    }
}
