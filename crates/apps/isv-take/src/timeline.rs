//! When frames are shown: by their timestamps, which nobody promises to make sense.

use isv_format::FrameRate;

/// A frame is shown for so many seconds at most, or as long as so many frames where that is longer.
/// Timestamps that jump further are those of another clock. A capture may pause for minutes.
const LONGEST_S: f64 = 600.0;
const LONGEST_FRAMES: f64 = 10.0;

/// Seconds between two timestamps; nothing if time goes back or jumps.
#[must_use]
pub fn seconds_between(rate: FrameRate, last_ns: u64, now_ns: u64) -> Option<f64> {
    let seconds = now_ns.checked_sub(last_ns)? as f64 / 1e9;
    let jumps = seconds > LONGEST_S && (seconds * rate.per_second()).round() > LONGEST_FRAMES;
    (!jumps).then_some(seconds)
}

/// The number of the frame that is shown at a time, if frames come at the rate. Times are rounded to nanoseconds, and what is rounded twice
/// may be one away: a nanosecond a piece is enough to be another time.
#[must_use]
pub fn frame_at(rate: FrameRate, time_ns: u64) -> Option<u64> {
    let [numerator, denominator] = [rate.numerator, rate.denominator].map(u128::from);
    let nearest =
        (u128::from(time_ns) * numerator + denominator * 500_000_000) / (denominator * 1_000_000_000);
    let frame = u64::try_from(nearest).ok().filter(|frame| *frame < u64::from(u32::MAX))?;
    (rate.timestamp_ns(frame).abs_diff(time_ns) <= 1).then_some(frame)
}

/// Whether a frame is shown at a time if frames come at the rate.
#[must_use]
pub fn is_on_time(rate: FrameRate, time_ns: u64) -> bool {
    frame_at(rate, time_ns).is_some()
}

/// The times of frames in order, from 0 on. Each follows the last by what their timestamps are apart, or by one frame where that is no
/// time to show a frame for.
#[derive(Clone, Copy, Debug)]
pub struct Timeline {
    rate: FrameRate,
    /// The last frame.
    last: Option<Place>,
    /// The last one that did not follow by timestamps: sums over many frames would drift.
    origin: Place,
}

/// A frame's timestamp, and when it is shown, in seconds.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    timestamp_ns: u64,
    start_s: f64,
}

impl Timeline {
    /// Without a frame yet, of a stream with a nominal rate.
    #[must_use]
    pub fn new(rate: FrameRate) -> Self {
        Self { rate, last: None, origin: Place::default() }
    }

    /// When the next frame is shown, in seconds after the first.
    pub fn place(&mut self, timestamp_ns: u64) -> f64 {
        let follows = |last: Place| {
            seconds_between(self.rate, last.timestamp_ns, timestamp_ns).is_some_and(|seconds| seconds > 0.0)
        };
        if !self.last.is_some_and(follows) {
            self.origin = Place { timestamp_ns, start_s: self.end_s() };
        }
        let Place { timestamp_ns: origin_ns, start_s: origin_s } = self.origin;
        let start_s = origin_s + (timestamp_ns - origin_ns) as f64 / 1e9;
        self.last = Some(Place { timestamp_ns, start_s });
        start_s
    }

    /// When the last frame has been shown for as long as the rate says; 0 without a frame.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.last.map_or(0.0, |last| last.start_s + self.frame_s())
    }

    fn frame_s(&self) -> f64 {
        1.0 / self.rate.per_second()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_shown_when_their_timestamps_say_as_long_as_these_make_sense() {
        let rate = FrameRate { numerator: 10, denominator: 1 };
        let times = |timestamps: &[f64]| {
            let mut timeline = Timeline::new(rate);
            let starts: Vec<f64> = timestamps.iter().map(|s| timeline.place((s * 1e9) as u64)).collect();
            let round = |seconds: f64| (seconds * 1e6).round() / 1e6;
            (starts.into_iter().map(round).collect::<Vec<_>>(), round(timeline.end_s()))
        };
        assert_eq!(times(&[]), (vec![], 0.0));
        assert_eq!(times(&[0.0, 0.1, 0.2]), (vec![0.0, 0.1, 0.2], 0.3));
        // A frame was skipped, another came late; a clock does not begin at 0.
        assert_eq!(times(&[7.0, 7.2, 7.35]), (vec![0.0, 0.2, 0.35], 0.45));
        // Nobody set any.
        assert_eq!(times(&[0.0, 0.0, 0.0]), (vec![0.0, 0.1, 0.2], 0.3));
        // A clock was set back, and forward by an hour.
        assert_eq!(times(&[5.0, 5.1, 4.0, 4.1, 3604.0]), (vec![0.0, 0.1, 0.2, 0.3, 0.4], 0.5));
    }

    #[test]
    fn of_a_slow_capture_ten_frames_are_no_jump() {
        let minutes = FrameRate { numerator: 1, denominator: 60 };
        assert_eq!(seconds_between(minutes, 0, 600_000_000_000), Some(600.0));
        assert_eq!(seconds_between(minutes, 0, 700_000_000_000), None);
    }
}
