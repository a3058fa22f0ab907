//! When frames were taken, as the names of their files say it.

use crate::NameOrder;
use crate::depth::TimeUnit;
use crate::text::parse_billionths;

/// The longest gap in a numbering that is one, in frames. Beyond it numbers count something else.
const LONGEST_GAP: u64 = 10_000;

/// Rates that names may have as times, in frames a second.
const RATES: std::ops::RangeInclusive<f64> = 0.5..=1000.0;

/// When the frames of a sequence were taken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FrameTimes {
    /// Nothing is said: one after the other.
    #[default]
    Even,
    /// Frames are numbered, and some are missing: the place of each, counted in frames from the first.
    Numbered(Vec<u64>),
    /// Names are times: nanoseconds since the first frame.
    Nanoseconds(Vec<u64>),
}

impl FrameTimes {
    /// Reads the names of files, without their extensions, in frame order; `order`: what their numbers are. With a sentence on what was
    /// decided, unless frames simply follow each other.
    pub(crate) fn from_names(names: &[&str], order: NameOrder) -> (Self, Option<String>) {
        let Some(numbers) = varying_numbers(names, order) else { return (Self::Even, None) };
        let words: Option<Vec<i128>> = numbers.iter().map(|number| parse_billionths(number)).collect();
        let Some(words) = words.filter(|words| words.windows(2).all(|pair| pair[0] < pair[1])) else {
            return (Self::Even, None);
        };
        let has_decimals = order.decimals && numbers.iter().any(|number| number.contains('.'));
        let seconds = has_decimals.then_some(TimeUnit::Second);
        if let Some(unit) = TimeUnit::of_clock(&words).or(seconds) {
            return times(&words, unit);
        }
        const ONE: i128 = 1_000_000_000;
        if words.iter().any(|word| word % ONE != 0) {
            return (Self::Even, None);
        }
        let whole: Vec<i128> = words.iter().map(|word| word / ONE).collect();
        numbered(&whole)
    }

    /// Frames a second, where names are times: one over the median distance.
    #[must_use]
    pub fn rate(&self) -> Option<f64> {
        match self {
            Self::Nanoseconds(times) => crate::depth::median_rate(times),
            Self::Even | Self::Numbered(_) => None,
        }
    }

    /// The times of a part of the frames, in range.
    pub(crate) fn part(&self, range: std::ops::Range<usize>) -> Self {
        let since_first = |times: &[u64]| times.iter().map(|time| time - times[0]).collect();
        match self {
            Self::Even => Self::Even,
            Self::Numbered(places) => Self::Numbered(since_first(&places[range])),
            Self::Nanoseconds(times) => Self::Nanoseconds(since_first(&times[range])),
        }
    }
}

fn times(stamps: &[i128], unit: TimeUnit) -> (FrameTimes, Option<String>) {
    let times_ns: Vec<i128> = stamps.iter().map(|stamp| unit.nanoseconds(*stamp)).collect();
    let since_first: Option<Vec<u64>> =
        times_ns.iter().map(|time| u64::try_from(time - times_ns[0]).ok()).collect();
    let Some(since_first) = since_first else { return (FrameTimes::Even, None) };
    match crate::depth::median_rate(&since_first).filter(|rate| RATES.contains(rate)) {
        Some(rate) => {
            let note = format!(
                "names are times in {}, about {rate:.4} frames a second; --timestamps rate ignores them",
                unit.name()
            );
            (FrameTimes::Nanoseconds(since_first), Some(note))
        }
        None => (FrameTimes::Even, None),
    }
}

/// Places of frames from their numbers, which count by a step of one or more.
fn numbered(numbers: &[i128]) -> (FrameTimes, Option<String>) {
    let steps: Vec<u64> =
        numbers.windows(2).map(|pair| u64::try_from(pair[1] - pair[0]).unwrap_or(u64::MAX)).collect();
    let Some(&step) = steps.iter().min() else { return (FrameTimes::Even, None) };
    if steps.iter().all(|other| *other == step) {
        return (FrameTimes::Even, None);
    }
    let counts = steps.iter().all(|other| other % step == 0 && other / step <= LONGEST_GAP);
    let usual = steps.iter().filter(|other| **other == step).count();
    if !counts || 2 * usual < steps.len() {
        let note = "numbers in names have no common step, so frames follow each other evenly";
        return (FrameTimes::Even, Some(note.to_owned()));
    }
    let places: Vec<u64> = numbers.iter().map(|number| (number - numbers[0]) as u64 / step).collect();
    let missing = places[places.len() - 1] + 1 - places.len() as u64;
    let note = format!(
        "{missing} frame{} missing in the numbering: the others keep their times; --timestamps rate closes the gaps",
        if missing == 1 { " is" } else { "s are" }
    );
    (FrameTimes::Numbered(places), Some(note))
}

/// The number that varies from name to name, where nothing else does.
fn varying_numbers<'a>(names: &[&'a str], order: NameOrder) -> Option<Vec<&'a str>> {
    let (first, others) = names.split_first()?;
    if others.is_empty() {
        return None;
    }
    let first = first.as_bytes();
    let shared = |from_end: bool| {
        let length = |other: &&str| {
            let other = other.as_bytes();
            let pairs: Box<dyn Iterator<Item = bool>> = match from_end {
                false => Box::new(first.iter().zip(other).map(|(a, b)| a == b)),
                true => Box::new(first.iter().rev().zip(other.iter().rev()).map(|(a, b)| a == b)),
            };
            pairs.take_while(|same| *same).count()
        };
        others.iter().map(length).min().unwrap_or_default()
    };
    let is_part = |b: u8| b.is_ascii_digit() || (order.decimals && b == b'.');
    let mut start = shared(false);
    // A number that starts alike is one all the same.
    while start > 0 && is_part(first[start - 1]) {
        start -= 1;
    }
    if order.signs && start > 0 && first[start - 1] == b'-' {
        start -= 1;
    }
    let mut end = shared(true);
    while end > 0 && is_part(first[first.len() - end]) {
        end -= 1;
    }
    names.iter().map(|name| name.get(start..name.len().checked_sub(end)?)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> FrameTimes {
        let bytes: Vec<&[u8]> = names.iter().map(|name| name.as_bytes()).collect();
        FrameTimes::from_names(names, NameOrder::new(&bytes)).0
    }

    #[test]
    fn numbers_with_gaps_keep_their_places() {
        for (names, places) in [
            (&["f_0", "f_1", "f_4"][..], vec![0, 1, 4]),
            (&["frame_0008", "frame_0009", "frame_0011"], vec![0, 1, 3]),
            (&["a10b", "a20b", "a50b", "a60b"], vec![0, 1, 4, 5]),
            (&["sim-0002", "sim-0001", "sim00001"], vec![0, 1, 3]),
        ] {
            assert_eq!(of(names), FrameTimes::Numbered(places), "{names:?}");
        }
        for names in [
            &["f_0", "f_1", "f_2"][..],
            &["f_0", "f_10", "f_20"],
            &["f_7"],
            &["a", "b", "d"],
            &["a_1_x", "a_2_y", "a_4_z"],
            &["1", "20", "333"],
            &["1", "2", "1000000"],
            &["f_1", "f_01"],
        ] {
            assert_eq!(of(names), FrameTimes::Even, "{names:?}");
        }
    }

    #[test]
    fn names_may_be_times() {
        let ms = |times: &[u64]| FrameTimes::Nanoseconds(times.iter().map(|ms| ms * 1_000_000).collect());
        assert_eq!(of(&["0.95", "0.975", "1.0", "1.025", "1.05"]), ms(&[0, 25, 50, 75, 100]));
        assert_eq!(
            of(&["t_1305031102.175304", "t_1305031102.275304", "t_1305031104.175304"]),
            ms(&[0, 100, 2000])
        );
        assert_eq!(of(&["1305031102175", "1305031102275", "1305031104175"]), ms(&[0, 100, 2000]));
        assert_eq!(of(&["1305031102175000000", "1305031102275000000"]), ms(&[0, 100]));
        // Some numbers in a name, but no times.
        assert_eq!(of(&["scale_100.5", "scale_200.5"]), FrameTimes::Even);
    }
}
