//! Groups of pictures that are coded by themselves.

use std::num::NonZero;

/// Follows frames from one group of pictures to the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Groups {
    /// Frames of a group; `None` if nothing begins anew.
    length: Option<NonZero<u32>>,
    /// Number in the capture of the first frame of the stream.
    first: usize,
    /// Group of the frame before.
    current: usize,
}

impl Groups {
    pub(super) fn new(length: Option<NonZero<u32>>, first: usize) -> Self {
        Self { length, first, current: 0 }
    }

    /// Whether a frame, by its number in the capture, is the first that came of another group than the frame before.
    pub(super) fn enter(&mut self, number: usize) -> bool {
        let group = self.length.map_or(0, |length| (number - self.first) / length.get() as usize);
        std::mem::replace(&mut self.current, group) != group
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_begin_at_multiples_whether_their_first_frame_came_or_not() {
        let mut groups = Groups::new(NonZero::new(3), 10);
        let entered: Vec<_> =
            [10, 11, 12, 13, 14, 17, 18, 22].into_iter().filter(|n| groups.enter(*n)).collect();
        assert_eq!(entered, [13, 17, 22]);
        let mut one = Groups::new(None, 10);
        assert!(![10, 40, 400].into_iter().any(|number| one.enter(number)));
    }
}
