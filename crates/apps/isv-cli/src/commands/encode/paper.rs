//! The settings that only profile `paper` has.

use crate::cli_enums::MotionName;
use isv::raw::take::Length;
use isv::raw::take::encode::PaperOptions;

/// Nothing has a default here, so that it can be told what was given.
#[derive(Debug, clap::Args)]
pub(super) struct PaperArgs {
    /// Prediction of frames between keyframes [default: 3dof]
    #[arg(help_heading = "Profile paper", long, value_enum)]
    motion: Option<MotionName>,
    /// Transform coefficients coded of each block [default: 64]
    #[arg(help_heading = "Profile paper", long, value_name = "K")]
    coefficients: Option<u16>,
    /// Quantizer step of a block's mean, with a unit [default: 1mm]
    #[arg(help_heading = "Profile paper", long, value_name = "LENGTH")]
    dc_step: Option<Length>,
    /// Quantizer step of all other coefficients, with a unit [default: 10mm]
    #[arg(help_heading = "Profile paper", long, value_name = "LENGTH")]
    ac_step: Option<Length>,
}

impl PaperArgs {
    pub(super) fn options(&self) -> PaperOptions {
        PaperOptions {
            motion: self.motion.map(Into::into),
            coefficients: self.coefficients,
            dc_step: self.dc_step,
            ac_step: self.ac_step,
        }
    }
}
