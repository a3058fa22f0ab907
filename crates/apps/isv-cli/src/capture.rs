//! Inputs as the command line opens them.

use crate::{memory, words};
use isv::raw::io::{Colours, InvalidPoints, Unit};
use isv::raw::take::Input;
use isv::raw::take::capture::{Capture, Hints};
use isv::raw::take::encode::CaptureError;
use std::path::Path;

/// Opens a folder, a pattern, a file or (`-`) standard input.
pub(crate) fn open(input: &Path, hints: &Hints) -> Result<Capture, CaptureError> {
    Capture::open(&Input::from_argument(input), hints)
}

/// What is said of a capture in a unit, with nothing else said.
pub(crate) fn hints(unit: Unit) -> Hints {
    Hints::in_unit(unit, memory::limit(), words::observer())
}

/// Hints of a unit for a capture whose colours are kept.
pub(crate) fn colour_hints(unit: Unit) -> Hints {
    Hints { colours: Colours::Keep, ..hints(unit) }
}

/// Treatment of points that are nowhere, as `--drop-invalid-points` asks for it.
pub(crate) fn invalid_points(drop: bool) -> InvalidPoints {
    if drop { InvalidPoints::Drop } else { InvalidPoints::Refuse }
}
