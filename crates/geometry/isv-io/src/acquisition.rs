//! When a scanner took a file of points.

use crate::{Format, e57, las, regular_file};
use std::io::Read;
use std::path::Path;

/// Time at which a file was scanned, in seconds of its own clock. LAS and LAZ have the GPS time of the first
/// point, E57 the start of the first scan. `None` for other formats, and where the file does not say.
#[must_use]
pub fn acquisition_time_s(path: &Path) -> Option<f64> {
    let time = match Format::of_path(path)? {
        Format::Las | Format::Laz => las::first_time_s(&start_of(path)?),
        Format::E57 => e57::start_s(&regular_file::read(path).ok()?),
        _ => None,
    };
    time.filter(|seconds| seconds.is_finite() && *seconds > 0.0)
}

/// The start of a file, in which LAS has its header and its first point.
fn start_of(path: &Path) -> Option<Vec<u8>> {
    const BYTES: u64 = 1 << 20;
    let (file, _) = regular_file::open(path).ok()?;
    let mut start = Vec::new();
    file.take(BYTES).read_to_end(&mut start).ok()?;
    Some(start)
}
