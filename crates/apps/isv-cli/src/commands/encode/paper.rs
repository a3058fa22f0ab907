//! The settings that only profile `paper` has.

use crate::terms::MotionName;
use isv::raw::take::Length;
use isv::raw::take::encode::PaperOptions;

/// Nothing has a default here, so that it can be told what was given.
#[derive(Debug, clap::Args)]
pub(super) struct PaperArgs {
    /// Profile paper: how frames between keyframes are predicted; without it, 3dof
    #[arg(long, value_enum)]
    motion: Option<MotionName>,
    /// Profile paper: transform coefficients coded of each block; without it, 64
    #[arg(long, value_name = "K")]
    coefficients: Option<u16>,
    /// Profile paper: quantizer step of a block's mean, with a unit; without it, 1mm
    #[arg(long, value_name = "LENGTH")]
    dc_step: Option<Length>,
    /// Profile paper: quantizer step of all other coefficients, with a unit; without it, 10mm
    #[arg(long, value_name = "LENGTH")]
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
