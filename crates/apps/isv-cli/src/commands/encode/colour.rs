//! Colour of its own.

use super::target::quality;
use isv::raw::take::encode::ColourOptions;

/// Options of colour, which captures with textures, vertex colours or coloured points have.
#[derive(Debug, clap::Args)]
pub(super) struct ColourArgs {
    /// Quality of colour, 0 to 100 [default: 50]
    ///
    /// Each 20 more halve the quantizer steps. Colour of 0.4 Mbps a person is good at 50. With --bitrate the rate decides.
    #[arg(help_heading = "Colour (profile main)", long, value_name = "0..100", value_parser = quality)]
    colour_quality: Option<f32>,
    /// Leave colour out
    ///
    /// Images are then not opened, so that a missing one is no error.
    #[arg(help_heading = "Colour (profile main)", long, conflicts_with = "colour_quality")]
    no_colour: bool,
    /// Make room for colour though the first frame has none
    ///
    /// For parts of a take that are joined: streams with and without colour do not go together.
    #[arg(help_heading = "Colour (profile main)", long, conflicts_with = "no_colour")]
    expect_colour: bool,
}

impl ColourArgs {
    pub(super) fn options(&self) -> ColourOptions {
        ColourOptions {
            is_dropped: self.no_colour,
            is_expected: self.expect_colour,
            quality: self.colour_quality,
        }
    }
}
