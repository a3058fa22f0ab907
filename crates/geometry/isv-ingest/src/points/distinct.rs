//! The positions of a cloud, each once: points that several scans or programs have written again tell nothing more.

use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;

/// Positions of points without repetitions, in the order in which they come first.
#[derive(Debug)]
pub(crate) struct Distinct<'a> {
    /// The positions.
    pub(crate) positions: Cow<'a, [DVec3]>,
    /// For each of them the first point that lies there, and for each point its position; `None` where no two are the same.
    places: Option<(Vec<u32>, Vec<u32>)>,
}

impl<'a> Distinct<'a> {
    /// Finds the positions that repeat others to the last bit.
    pub(crate) fn new(positions: &'a [DVec3]) -> Self {
        // Both zeros are one place.
        let bits = |p: &DVec3| (*p + DVec3::ZERO).to_array().map(f64::to_bits);
        let mut keys: Vec<([u64; 3], u32)> =
            positions.par_iter().map(bits).zip(0..positions.len() as u32).collect();
        keys.par_sort_unstable();
        let same = |a: &([u64; 3], u32), b: &([u64; 3], u32)| a.0 == b.0;
        if keys.windows(2).all(|pair| !same(&pair[0], &pair[1])) {
            return Self { positions: Cow::Borrowed(positions), places: None };
        }
        let mut first_of = vec![0; positions.len()];
        for run in keys.chunk_by(same) {
            run.iter().for_each(|(_, point)| first_of[*point as usize] = run[0].1);
        }
        let firsts: Vec<u32> =
            (0..positions.len() as u32).filter(|point| first_of[*point as usize] == *point).collect();
        let mut place_of = vec![0; positions.len()];
        for (place, first) in (0..).zip(&firsts) {
            place_of[*first as usize] = place;
        }
        for point in 0..positions.len() {
            place_of[point] = place_of[first_of[point] as usize];
        }
        let kept = firsts.iter().map(|first| positions[*first as usize]).collect();
        Self { positions: Cow::Owned(kept), places: Some((firsts, place_of)) }
    }

    /// The first point at a position.
    pub(crate) fn first(&self, position: usize) -> usize {
        self.places.as_ref().map_or(position, |(firsts, _)| firsts[position] as usize)
    }

    /// The position of a point.
    pub(crate) fn of_point(&self, point: usize) -> usize {
        self.places.as_ref().map_or(point, |(_, place_of)| place_of[point] as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_are_there_again_have_one_position() {
        let [a, b] = [DVec3::new(1.0, -2.0, 0.0), DVec3::new(1.0, -2.0, 0.5)];
        let points = [b, a, b, DVec3::new(1.0, -2.0, -0.0), a];
        let distinct = Distinct::new(&points);
        assert_eq!(*distinct.positions, [b, a]);
        assert_eq!([0, 1].map(|position| distinct.first(position)), [0, 1]);
        assert_eq!([0, 1, 2, 3, 4].map(|point| distinct.of_point(point)), [0, 1, 0, 1, 1]);
        let distinct = Distinct::new(&points[1..3]);
        assert_eq!(*distinct.positions, [a, b]);
        assert_eq!([0, 1].map(|point| distinct.first(distinct.of_point(point))), [0, 1]);
    }
}
