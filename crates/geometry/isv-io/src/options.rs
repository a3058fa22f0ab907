//! Options of reading frames.

use crate::{InvalidPoints, Unit};

/// Treatment of the colours of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Colours {
    /// Colours are passed over. No image is opened, so none can be missing.
    #[default]
    Drop,
    /// Vertex colours, materials and images are read; see [`Appearance`](isv_volume::Appearance). A missing or damaged image is an error.
    Keep,
}

/// Options of reading a file of meshes or points.
///
/// ```no_run
/// use isv_io::{Colours, ReadOptions, Unit, read_geometry_as};
/// let options = ReadOptions::new(Unit::Metre).with_colours(Colours::Keep);
/// let geometry = read_geometry_as("walk_0000.obj".as_ref(), &options)?;
/// # Ok::<(), isv_io::ReadError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Unit of the file's coordinates.
    pub unit: Unit,
    /// Treatment of points that are nowhere.
    pub invalid_points: InvalidPoints,
    /// Treatment of colours.
    pub colours: Colours,
}

impl ReadOptions {
    /// Options for coordinates in `unit`: invalid points refuse their file, and colours are dropped.
    #[must_use]
    pub fn new(unit: Unit) -> Self {
        Self { unit, invalid_points: InvalidPoints::Refuse, colours: Colours::Drop }
    }

    /// Sets the treatment of points that are nowhere.
    #[must_use]
    pub fn with_invalid_points(self, invalid_points: InvalidPoints) -> Self {
        Self { invalid_points, ..self }
    }

    /// Sets the treatment of colours.
    #[must_use]
    pub fn with_colours(self, colours: Colours) -> Self {
        Self { colours, ..self }
    }
}
