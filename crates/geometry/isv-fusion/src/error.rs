//! Why depth images cannot become a volume.

use isv_volume::FitError;
use thiserror::Error;

/// Images or settings that fusion refuses, always before memory for samples is taken; or a backend that failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FusionError {
    /// Not one pixel of any image can be used.
    #[error(
        "no reading in any image: {pixels} pixels, none of them with a depth above 0 and up to {max_depth_m} m"
    )]
    NoReading {
        /// Pixels of all images.
        pixels: usize,
        /// [`FusionSettings::max_depth_m`](crate::FusionSettings::max_depth_m).
        max_depth_m: f64,
    },
    /// A setting that makes no sense.
    #[error("{name} of {value} is outside {range}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// Whoever did the arithmetic failed: its device is gone, or has too little memory. The sentence is the backend's.
    #[error("{0}")]
    Backend(String),
    /// The surface does not fit on the grid.
    #[error(transparent)]
    Fit(#[from] FitError),
}
