//! Means that do not depend on the number of threads.

use rayon::prelude::*;

/// Terms that are added up by one thread; fixed, so that sums round the same on any number of threads.
const CHUNK: usize = 1024;

/// The sum of a term for each index below `count`.
pub(crate) fn sum(count: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let chunks = count.div_ceil(CHUNK);
    let sum_of = |chunk: usize| -> f64 { (chunk * CHUNK..count.min((chunk + 1) * CHUNK)).map(&term).sum() };
    let sums: Vec<f64> = (0..chunks).into_par_iter().map(sum_of).collect();
    sums.iter().sum()
}

/// The mean of a term for each index below `count`.
pub(crate) fn mean(count: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    sum(count, term) / count as f64
}
