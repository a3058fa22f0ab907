//! How often something may happen.

use std::time::{Duration, Instant};

/// A bucket of tokens that fills at a steady rate.
#[derive(Debug)]
pub(crate) struct TokenBucket {
    most: u32,
    every: Duration,
    left: f64,
    counted: Instant,
}

impl TokenBucket {
    /// `most` at once, and one more each `every`.
    pub(crate) fn new(most: u32, every: Duration, now: Instant) -> Self {
        Self { most, every, left: f64::from(most), counted: now }
    }

    /// Uses one token, if there is one.
    pub(crate) fn take(&mut self, now: Instant) -> bool {
        let gained = now.duration_since(self.counted).as_secs_f64() / self.every.as_secs_f64();
        self.counted = now;
        self.left = (self.left + gained).min(f64::from(self.most));
        let is_allowed = self.left >= 1.0;
        if is_allowed {
            self.left -= 1.0;
        }
        is_allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permissions_come_back_with_time_up_to_a_bound() {
        let start = Instant::now();
        let mut bucket = TokenBucket::new(3, Duration::from_secs(1), start);
        let mut taken =
            |seconds| (0..10).filter(|_| bucket.take(start + Duration::from_secs(seconds))).count();
        assert_eq!([taken(0), taken(0), taken(2), taken(100)], [3, 0, 2, 3]);
    }
}
