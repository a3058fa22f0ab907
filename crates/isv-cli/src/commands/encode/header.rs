//! The part of the command line that goes into the stream's header.

use crate::capture::{Capture, default_voxel_size};
use crate::failure::usage;
use crate::frame_rate;
use crate::length::Length;
use crate::terms::ProfileName;
use anyhow::Result;
use isv::format::{FrameRate, StreamHeader};
use isv::kernels::quant::{STEP_FRACTION_BITS, StepSize};
use isv::volume::{BlockEdge, CODES_PER_VOXEL, Grid, Truncation, VoxelSize};

const DEFAULT_FRAME_RATE: FrameRate = FrameRate { numerator: 30, denominator: 1 };
/// Voxels of 5 mm in blocks of 8, truncated at 8 voxels.
fn default_grid() -> Grid {
    Grid {
        voxel_size: default_voxel_size(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8).expect("8 is in range"),
    }
}

#[derive(Debug, clap::Args)]
pub(super) struct HeaderArgs {
    /// The codec's set of tools
    #[arg(long, value_enum, default_value = "paper")]
    profile: ProfileName,
    /// Frames a second, such as 30, 29.97 or 30000/1001; without it, as the input says, or else 30
    #[arg(long, value_parser = frame_rate::parse)]
    fps: Option<FrameRate>,
    /// Edge of a voxel, with a unit; without it, that of the input if it is volumes, or else 5mm
    #[arg(long, value_name = "LENGTH")]
    voxel: Option<Length>,
    /// Edge of a block in voxels, 4, 8 or 16; without it, that of the input if it is volumes, or else 8
    #[arg(long, value_name = "VOXELS")]
    block: Option<u32>,
    /// How far from the surface distances are kept, in voxels, 2 to 16; without it, as the input if it is volumes, or
    /// else 8
    #[arg(long, value_name = "VOXELS")]
    truncation: Option<u32>,
    /// Transform coefficients coded of each block
    #[arg(long, value_name = "K", default_value = "64")]
    coefficients: u16,
    /// Quantizer step of a block's mean, with a unit
    #[arg(long, value_name = "LENGTH", default_value = "1mm")]
    dc_step: Length,
    /// Quantizer step of all other coefficients, with a unit
    #[arg(long, value_name = "LENGTH", default_value = "10mm")]
    ac_step: Length,
}

impl HeaderArgs {
    /// The header, every field checked; the capture has a say in what was not asked for.
    pub(super) fn header(&self, capture: &Capture) -> Result<StreamHeader> {
        let grid = self.grid(capture.grid())?;
        Ok(StreamHeader {
            profile: self.profile.into(),
            grid,
            frame_rate: self.fps.or(capture.frame_rate()).unwrap_or(DEFAULT_FRAME_RATE),
            coefficients: self.coefficients(grid.edge)?,
            dc_step: step("--dc-step", self.dc_step, grid.voxel_size)?,
            ac_step: step("--ac-step", self.ac_step, grid.voxel_size)?,
        })
    }

    /// The frame rate asked for, if any.
    pub(super) fn frame_rate(&self) -> Option<FrameRate> {
        self.fps
    }

    /// The voxel size asked for, if any.
    pub(super) fn voxel_size(&self) -> Result<Option<VoxelSize>> {
        let checked = |voxel: Length| {
            VoxelSize::from_metres(voxel.metres()).map_err(|error| usage(format!("--voxel {voxel}: {error}")))
        };
        self.voxel.map(checked).transpose()
    }

    /// The truncation asked for, if any.
    pub(super) fn truncation(&self) -> Result<Option<Truncation>> {
        let checked = self.truncation.map(Truncation::from_voxels).transpose();
        checked.map_err(|error| usage(format!("--truncation: {error}")))
    }

    /// The grid: what was asked for, else what the capture has, else the defaults.
    fn grid(&self, captured: Option<Grid>) -> Result<Grid> {
        let default = captured.unwrap_or(default_grid());
        let edge = self.block.map_or(Ok(default.edge), BlockEdge::from_voxels);
        Ok(Grid {
            voxel_size: self.voxel_size()?.unwrap_or(default.voxel_size),
            edge: edge.map_err(|error| usage(format!("--block: {error}")))?,
            truncation: self.truncation()?.unwrap_or(default.truncation),
        })
    }

    fn coefficients(&self, edge: BlockEdge) -> Result<u16> {
        let (asked, most) = (self.coefficients, edge.block_voxels());
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
