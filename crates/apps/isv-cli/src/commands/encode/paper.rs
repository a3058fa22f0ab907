//! The settings that only profile `paper` has.

use crate::failure::usage;
use crate::length::Length;
use crate::terms::MotionName;
use anyhow::Result;
use isv::encode::MotionMode;
use isv::format::PaperParameters;
use isv::kernels::quant::{STEP_FRACTION_BITS, StepSize};
use isv::volume::{BlockEdge, CODES_PER_VOXEL, Grid, VoxelSize};

const DEFAULT_MOTION: MotionName = MotionName::ThreeDof;
const DEFAULT_COEFFICIENTS: u16 = 64;
const DEFAULT_DC_STEP_M: f64 = 0.001;
const DEFAULT_AC_STEP_M: f64 = 0.01;

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
    /// What the stream's header states, every field checked.
    pub(super) fn parameters(&self, grid: &Grid) -> Result<PaperParameters> {
        let dc_step = self.dc_step.unwrap_or(Length::from_metres(DEFAULT_DC_STEP_M));
        let ac_step = self.ac_step.unwrap_or(Length::from_metres(DEFAULT_AC_STEP_M));
        Ok(PaperParameters {
            coefficients: self.coefficients(grid.edge)?,
            dc_step: step("--dc-step", dc_step, grid.voxel_size)?,
            ac_step: step("--ac-step", ac_step, grid.voxel_size)?,
        })
    }

    /// How frames between keyframes are predicted.
    pub(super) fn motion(&self) -> MotionMode {
        self.motion.unwrap_or(DEFAULT_MOTION).into()
    }

    /// The first of these flags that was given.
    pub(super) fn first_given(&self) -> Option<&'static str> {
        let flags = [
            (self.motion.is_some(), "--motion"),
            (self.coefficients.is_some(), "--coefficients"),
            (self.dc_step.is_some(), "--dc-step"),
            (self.ac_step.is_some(), "--ac-step"),
        ];
        flags.into_iter().find_map(|(given, flag)| given.then_some(flag))
    }

    fn coefficients(&self, edge: BlockEdge) -> Result<u16> {
        let (asked, most) = (self.coefficients.unwrap_or(DEFAULT_COEFFICIENTS), edge.block_voxels());
        if !(1..=most).contains(&usize::from(asked)) {
            let edge = edge.voxels();
            return Err(usage(format!(
                "--coefficients {asked}: a block of {edge}^3 voxels has 1 to {most} of them"
            )));
        }
        Ok(asked)
    }
}

/// A quantizer step as a stream states it: in sixteenths of a code. `flag` is its name in messages.
fn step(flag: &str, length: Length, voxel: VoxelSize) -> Result<u32> {
    let per_metre = f64::from(CODES_PER_VOXEL << STEP_FRACTION_BITS) / voxel.metres();
    let step = (length.metres() * per_metre).round();
    let ends = [*StepSize::RANGE.start(), *StepSize::RANGE.end()].map(f64::from);
    if (ends[0]..=ends[1]).contains(&step) {
        return Ok(step as u32);
    }
    let [least, most] = ends.map(|step| Length::from_metres(step / per_metre));
    let voxel = Length::from_metres(voxel.metres());
    Err(usage(format!("{flag} {length}: at voxels of {voxel} a step is between {least} and {most}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_sixteenths_of_a_code() {
        let voxel = VoxelSize::from_metres(0.005).unwrap();
        let step = |text: &str| step("--ac-step", text.parse().unwrap(), voxel);
        assert_eq!(step("10mm").unwrap(), 8192);
        assert_eq!(step("1mm").unwrap(), 819);
        let sentence = step("2m").unwrap_err().to_string();
        assert_eq!(sentence, "--ac-step 2000mm: at voxels of 5mm a step is between 0.001221mm and 1280mm");
    }
}
