//! How finely a stream samples colour.

/// Layers of colour samples that the frames of a stream may have. Each layer halves the distance between samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ColourLayers {
    /// No colour.
    #[default]
    None,
    /// Samples at voxels.
    Voxels,
    /// Samples at voxels and half voxels.
    HalfVoxels,
    /// Samples at voxels, half and quarter voxels.
    QuarterVoxels,
}

impl ColourLayers {
    /// All values, by number of layers.
    pub const ALL: [Self; 4] = [Self::None, Self::Voxels, Self::HalfVoxels, Self::QuarterVoxels];

    /// Number of layers, 0 to 3: what the stream header states.
    #[must_use]
    pub fn count(self) -> u8 {
        self as u8
    }

    /// The value with this number of layers; `None` above 3.
    #[must_use]
    pub fn from_count(count: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|layers| layers.count() == count)
    }

    /// Whether there is any layer.
    #[must_use]
    pub fn is_some(self) -> bool {
        self != Self::None
    }
}
