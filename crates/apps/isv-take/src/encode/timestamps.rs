//! What packets are stamped with.

use isv_format::FrameRate;
use std::time::{SystemTime, UNIX_EPOCH};

/// What packets are stamped with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum TimestampSource {
    /// When the frame was taken, where the capture says: time stamps, times of scans, numbers and times in names, an `.isv` file.
    #[default]
    Source,
    /// One frame after the other at the frame rate.
    Rate,
    /// When the frame was read, in nanoseconds since 1970: live viewers see how late they are.
    Clock,
}

/// Gives each frame its timestamp.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timestamps {
    source: TimestampSource,
    rate: FrameRate,
    /// The source's time of the first frame that has one, and the timestamp of that frame.
    base: Option<(u64, u64)>,
    /// Timestamp of the frame before, in nanoseconds.
    last: Option<u64>,
}

impl Timestamps {
    pub(crate) fn new(source: TimestampSource, rate: FrameRate) -> Self {
        Self { source, rate, base: None, last: None }
    }

    /// Timestamps that count from a time that the source states (ns).
    pub(crate) fn since(self, stated_ns: u64) -> Self {
        Self { base: Some((stated_ns, 0)), ..self }
    }

    /// The timestamp in nanoseconds of a frame counted from the stream's first that had been read at a time. `stated`: when the source
    /// took it, in nanoseconds from any start. Timestamps ascend, whatever clocks do.
    pub(crate) fn of(&mut self, frame: u64, read: SystemTime, stated: Option<u64>) -> u64 {
        let (wanted, least) = match (self.source, stated) {
            (TimestampSource::Clock, _) => {
                let since_1970 = read.duration_since(UNIX_EPOCH).unwrap_or_default();
                // Nanoseconds fit until the year 2554.
                let now = u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX - 1);
                (now, self.last.map(|last| last.saturating_add(1)))
            }
            (TimestampSource::Rate, _) => (self.rate.timestamp_ns(frame), None),
            (TimestampSource::Source, Some(stated)) => {
                let after_last = self.after_last();
                let (start, at) = *self.base.get_or_insert((stated, after_last));
                let time = stated.checked_sub(start).map_or(0, |since| at.saturating_add(since));
                // A time that does not ascend is none.
                let follows = self.last.is_none_or(|last| time > last);
                (if follows { time } else { after_last }, None)
            }
            (TimestampSource::Source, None) => match self.base {
                Some(_) => (self.after_last(), None),
                None => (self.rate.timestamp_ns(frame), None),
            },
        };
        let timestamp = wanted.max(least.unwrap_or_default());
        self.last = Some(timestamp);
        timestamp
    }

    /// The time of a frame that follows the last one at the rate; 0 of the first.
    fn after_last(&self) -> u64 {
        self.last.map_or(0, |last| last.saturating_add(self.rate.timestamp_ns(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const RATE: FrameRate = FrameRate::DEFAULT;

    #[test]
    fn a_rate_counts_and_a_clock_tells_and_both_ascend() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        let times = [at(1_800_000_000), at(1_800_000_001), at(1_700_000_000), at(1_800_000_002)];
        let stamps = |name| {
            let mut timestamps = Timestamps::new(name, RATE);
            times.iter().zip(0..).map(|(read, frame)| timestamps.of(frame, *read, None)).collect::<Vec<_>>()
        };
        for name in [TimestampSource::Rate, TimestampSource::Source] {
            assert_eq!(stamps(name), [0, 33_333_333, 66_666_666, 100_000_000]);
        }
        let second = 1_000_000_000;
        let first = 1_800_000_000 * second;
        assert_eq!(
            stamps(TimestampSource::Clock),
            [first, first + second, first + second + 1, first + 2 * second]
        );
    }

    #[test]
    fn a_stream_keeps_its_times_from_its_first_frame_on() {
        let mut timestamps = Timestamps::new(TimestampSource::Source, RATE);
        let times: Vec<_> =
            (3..200_000).filter(|frame| frame % 7 != 4).map(|f| RATE.timestamp_ns(f)).collect();
        for (time, frame) in times.iter().zip(0..) {
            assert_eq!(timestamps.of(frame, UNIX_EPOCH, Some(*time)), time - times[0]);
        }
    }

    #[test]
    fn a_pause_stays_and_what_does_not_ascend_follows_at_the_rate() {
        let second = 1_000_000_000;
        let stamps = |name, times: &[Option<u64>]| {
            let mut timestamps = Timestamps::new(name, RATE);
            times
                .iter()
                .zip(0..)
                .map(|(stated, frame)| timestamps.of(frame, UNIX_EPOCH, *stated))
                .collect::<Vec<_>>()
        };
        let frame = RATE.timestamp_ns(1);
        let times = [7, 8, 70, 70, 3, 71].map(|seconds| Some(seconds * second));
        let expected = [0, second, 63 * second, 63 * second + frame, 63 * second + 2 * frame, 64 * second];
        assert_eq!(stamps(TimestampSource::Source, &times), expected);
        assert_eq!(stamps(TimestampSource::Rate, &times)[5], RATE.timestamp_ns(5));
        // The first frames have no time, and one between.
        let times = [None, None, Some(5 * second), None, Some(6 * second)];
        let start = 2 * frame;
        assert_eq!(stamps(TimestampSource::Source, &times), [0, frame, start, start + frame, start + second]);
    }
}
