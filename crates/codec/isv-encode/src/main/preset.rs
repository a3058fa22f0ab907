//! How much work the encoder takes on.

use super::motion_search::SearchEffort;
use super::settings::MainSettings;
use std::fmt;

/// Sets of choices between speed and size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// For live encoding: a shorter search for motion, of which one vector of each block is coded, and two slices at a time.
    Realtime,
    /// What serves most.
    Balanced,
    /// Smallest size: levels are searched far and wide, and more vectors and filters are tried. It takes ten times the work of
    /// [`Self::Balanced`] for 6 to 11 % fewer bits at the same error. At the same quality, the error is less.
    Archive,
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Realtime => "realtime",
            Self::Balanced => "balanced",
            Self::Archive => "archive",
        })
    }
}

impl Preset {
    /// From the fastest to the smallest.
    pub const ALL: [Self; 3] = [Self::Realtime, Self::Balanced, Self::Archive];

    /// The settings of a preset; what it does not say is as in [`MainSettings::default`].
    #[must_use]
    pub fn settings(self) -> MainSettings {
        let balanced = MainSettings::default();
        match self {
            Self::Realtime => MainSettings { trials: 1, slices: 2, effort: SearchEffort::QUICK, ..balanced },
            Self::Balanced => balanced,
            Self::Archive => MainSettings { trials: 3, filter_search: true, refinement: true, ..balanced },
        }
    }
}
