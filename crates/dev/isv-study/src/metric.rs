//! The measures of error that a study draws.

use isv::raw::metrics::{ColourError, GeometryError};

/// A measure of the error of decoded frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Metric {
    /// Exact point-to-surface distance, mean of both directions.
    PointToSurface,
    /// Exact distance of decoded points to the source's surface, mean: one direction, which codecs of points have too.
    DecodedToSource,
    /// Chamfer distance, Eq. 15 of the paper.
    Chamfer,
    /// Angle between normals.
    NormalError,
    /// MPEG's point-to-point PSNR.
    D1,
    /// MPEG's point-to-plane PSNR.
    D2,
    /// PSNR of luma at points of the decoded surface.
    ColourY,
    /// PSNR of luma in pictures from six sides, which stands against the rate of geometry and colour together.
    RenderY,
}

impl Metric {
    /// Measures of geometry, the one that says most first.
    pub const ALL: [Self; 6] =
        [Self::PointToSurface, Self::DecodedToSource, Self::Chamfer, Self::NormalError, Self::D1, Self::D2];

    /// Measures of colour, for codecs and captures that have any.
    pub const COLOUR: [Self; 2] = [Self::ColourY, Self::RenderY];

    /// Whether it measures colour.
    #[must_use]
    pub fn is_of_colour(self) -> bool {
        Self::COLOUR.contains(&self)
    }

    /// Key of the measure in `isv eval --json`.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::PointToSurface => "p2s_mean_mm",
            Self::DecodedToSource => "test_to_ref_mean_mm",
            Self::Chamfer => "chamfer_mm",
            Self::NormalError => "normal_error_deg",
            Self::D1 => "d1_psnr_db",
            Self::D2 => "d2_psnr_db",
            Self::ColourY => "colour_y_psnr_db",
            Self::RenderY => "render_y_psnr_db",
        }
    }

    /// Name of the measure in titles.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::PointToSurface => "Point to surface",
            Self::DecodedToSource => "Decoded points to source",
            Self::Chamfer => "Chamfer distance",
            Self::NormalError => "Normal error",
            Self::D1 => "D1 PSNR",
            Self::D2 => "D2 PSNR",
            Self::ColourY => "Colour at the surface",
            Self::RenderY => "Pictures, for the rate of all",
        }
    }

    /// What is on its axis, with the unit.
    #[must_use]
    pub fn axis(self) -> &'static str {
        match self {
            Self::PointToSurface => "mean distance, mm",
            Self::DecodedToSource => "mean distance of decoded points to the source, mm",
            Self::Chamfer => "mean distance between samples, mm",
            Self::NormalError => "mean angle, degrees",
            Self::D1 => "point to point, dB",
            Self::D2 => "point to plane, dB",
            Self::ColourY => "PSNR of Y at the surface, dB",
            Self::RenderY => "PSNR of Y in pictures, dB",
        }
    }

    /// Whether it measures quality rather than error.
    #[must_use]
    pub fn higher_is_better(self) -> bool {
        matches!(self, Self::D1 | Self::D2 | Self::ColourY | Self::RenderY)
    }

    /// The value of a measure of geometry, where it exists; none of colour.
    #[must_use]
    pub fn of(self, error: &GeometryError) -> Option<f64> {
        match self {
            Self::PointToSurface => error.p2s_mean_mm,
            Self::DecodedToSource => error.test_to_ref_mean_mm,
            Self::Chamfer => Some(error.chamfer_mm),
            Self::NormalError => error.normal_error_deg,
            Self::D1 => error.d1_psnr_db,
            Self::D2 => error.d2_psnr_db,
            Self::ColourY | Self::RenderY => None,
        }
    }

    /// The value of a measure of colour, where it exists; none of geometry.
    #[must_use]
    pub fn of_colour(self, error: &ColourError) -> Option<f64> {
        match self {
            Self::ColourY => error.colour_y_psnr_db,
            Self::RenderY => error.render_y_psnr_db,
            _ => None,
        }
    }

    /// A value as quality in decibels, higher better: a tenth of an error is 20 dB more.
    #[must_use]
    pub fn quality_db(self, value: f64) -> f64 {
        if self.higher_is_better() { value } else { -20.0 * value.log10() }
    }
}
