//! `--timestamps`: what packets are stamped with.

use crate::terms::TimestampsName;
use crate::timeline::Timeline;
use isv::format::FrameRate;
use std::time::{SystemTime, UNIX_EPOCH};

/// Gives each frame its timestamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timestamps {
    name: TimestampsName,
    rate: FrameRate,
    /// Of frames that have a time already.
    stated: Timeline,
    /// Least timestamp of the next frame, in nanoseconds: a clock may be set back, and timestamps ascend all the same.
    least: u64,
}

impl Timestamps {
    pub(super) fn new(name: TimestampsName, rate: FrameRate) -> Self {
        Self { name, rate, stated: Timeline::new(rate), least: 0 }
    }

    /// In nanoseconds, of a frame counted from the stream's first that had been read at a time. `stated`: its time if it comes of a
    /// stream of this rate, which it keeps, counted from the first.
    pub(super) fn of(&mut self, frame: u64, read: SystemTime, stated: Option<u64>) -> u64 {
        match self.name {
            TimestampsName::Rate => match stated {
                Some(stated_ns) => (self.stated.place(stated_ns) * 1e9).round() as u64,
                None => self.rate.timestamp_ns(frame),
            },
            TimestampsName::Clock => {
                let since_1970 = read.duration_since(UNIX_EPOCH).unwrap_or_default();
                // Nanoseconds fit until the year 2554.
                let now = u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX - 1).max(self.least);
                self.least = now + 1;
                now
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const RATE: FrameRate = FrameRate { numerator: 30, denominator: 1 };

    #[test]
    fn a_rate_counts_and_a_clock_tells_and_both_ascend() {
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        let times = [at(1_800_000_000), at(1_800_000_001), at(1_700_000_000), at(1_800_000_002)];
        let stamps = |name| {
            let mut timestamps = Timestamps::new(name, RATE);
            times.iter().zip(0..).map(|(read, frame)| timestamps.of(frame, *read, None)).collect::<Vec<_>>()
        };
        assert_eq!(stamps(TimestampsName::Rate), [0, 33_333_333, 66_666_666, 100_000_000]);
        let second = 1_000_000_000;
        let first = 1_800_000_000 * second;
        assert_eq!(
            stamps(TimestampsName::Clock),
            [first, first + second, first + second + 1, first + 2 * second]
        );
    }

    #[test]
    fn a_stream_keeps_its_times_from_its_first_frame_on() {
        let mut timestamps = Timestamps::new(TimestampsName::Rate, RATE);
        let times: Vec<_> =
            (3..200_000).filter(|frame| frame % 7 != 4).map(|f| RATE.timestamp_ns(f)).collect();
        for (time, frame) in times.iter().zip(0..) {
            assert_eq!(timestamps.of(frame, UNIX_EPOCH, Some(*time)), time - times[0]);
        }
    }
}
