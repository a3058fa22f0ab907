//! The part of the command line that goes into the stream's header.

use super::paper::PaperArgs;
use super::target::TargetArgs;
use crate::capture::{Capture, default_voxel_size};
use crate::failure::usage;
use crate::frame_rate;
use crate::length::Length;
use crate::terms::{BandName, ProfileName};
use anyhow::Result;
use isv::encode::MotionMode;
use isv::format::{FrameRate, Profile, StreamHeader};
use isv::volume::{BlockEdge, Grid, Truncation, VoxelSize};
use std::str::FromStr;

const DEFAULT_FRAME_RATE: FrameRate = FrameRate { numerator: 30, denominator: 1 };
/// Voxels of 5 mm in blocks of 8, truncated at 8 voxels.
fn default_grid() -> Grid {
    Grid {
        voxel_size: default_voxel_size(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8).expect("8 is in range"),
    }
}

/// `--voxel`
#[derive(Clone, Copy, Debug, PartialEq)]
enum VoxelArg {
    Edge(Length),
    Auto,
}

impl FromStr for VoxelArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Edge) }
    }
}

#[derive(Debug, clap::Args)]
pub(super) struct HeaderArgs {
    /// The codec's set of tools; without it, main
    #[arg(long, value_enum)]
    profile: Option<ProfileName>,
    /// Frames a second, such as 30, 29.97 or 30000/1001; without it, as the input says, or else 30
    #[arg(long, value_parser = frame_rate::parse)]
    fps: Option<FrameRate>,
    /// Edge of a voxel, with a unit [default: what fits the input]
    ///
    /// Without it, volumes keep their own and meshes get 5mm. Points and depth images get one that fits how far points are apart, how
    /// large a pixel is and how noisy depths are, but never less than 5mm. With auto, meshes in profile main get whichever of a few
    /// sizes serves the quality, rate or error best, and points and depth images the one that fits.
    #[arg(long, value_name = "LENGTH|auto")]
    voxel: Option<VoxelArg>,
    /// Edge of a block in voxels, 4, 8 or 16; without it, that of the input if it is volumes, or else 8. Profile
    /// main has blocks of 8
    #[arg(long, value_name = "VOXELS")]
    block: Option<u32>,
    /// How far from the surface distances are kept, in voxels, 2 to 16; without it, as the input if it is volumes, or
    /// else 8
    #[arg(long, value_name = "VOXELS")]
    truncation: Option<u32>,
    /// How much of the volume to code; without it, surface in profile main and full in profile paper. full takes profile paper, unless
    /// main or a setting of it is asked for: main tells observed from unobserved near the surface alone
    #[arg(long, value_enum)]
    band: Option<BandName>,
    #[command(flatten)]
    paper: PaperArgs,
    #[command(flatten)]
    target: TargetArgs,
}

impl HeaderArgs {
    /// The header, every field checked; the capture has a say in what was not asked for.
    pub(super) fn header(&self, capture: &Capture) -> Result<StreamHeader> {
        let grid = self.grid(capture.grid())?;
        Ok(StreamHeader {
            profile: self.profile(&grid)?,
            grid,
            frame_rate: self.fps.or(capture.frame_rate()).unwrap_or(DEFAULT_FRAME_RATE),
        })
    }

    /// The flags of profile `main`.
    pub(super) fn target(&self) -> &TargetArgs {
        &self.target
    }

    /// The profile asked for, or the default: main, but for the whole band, of which it has no place for the unobserved voxels.
    pub(super) fn profile_name(&self) -> ProfileName {
        let wants_main = self.target.first_given().is_some() || self.voxel_is_auto();
        self.profile.unwrap_or(match self.band {
            Some(BandName::Full) if !wants_main => ProfileName::Paper,
            _ => ProfileName::Main,
        })
    }

    /// How much of the volume to code, if that was asked for.
    pub(super) fn band(&self) -> Option<BandName> {
        self.band
    }

    /// How frames between keyframes are predicted in profile `paper`.
    pub(super) fn motion(&self) -> MotionMode {
        self.paper.motion()
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
        match self.voxel {
            Some(VoxelArg::Edge(edge)) => checked(edge).map(Some),
            Some(VoxelArg::Auto) | None => Ok(None),
        }
    }

    /// Whether the voxel size is to be found out.
    pub(super) fn voxel_is_auto(&self) -> bool {
        self.voxel == Some(VoxelArg::Auto)
    }

    /// Whether the capture may choose the voxel size: nobody has, or asked for that.
    pub(super) fn voxel_is_open(&self, capture: &Capture) -> bool {
        capture.grid().is_none() && !matches!(self.voxel, Some(VoxelArg::Edge(_)))
    }

    /// The truncation asked for, if any.
    pub(super) fn truncation(&self) -> Result<Option<Truncation>> {
        let checked = self.truncation.map(Truncation::from_voxels).transpose();
        checked.map_err(|error| usage(format!("--truncation: {error}")))
    }

    /// The grid: what was asked for, else what the capture has, else the defaults.
    fn grid(&self, captured: Option<Grid>) -> Result<Grid> {
        let default = captured.unwrap_or(default_grid());
        Ok(Grid {
            voxel_size: self.voxel_size()?.unwrap_or(default.voxel_size),
            edge: self.edge(default.edge)?,
            truncation: self.truncation()?.unwrap_or(default.truncation),
        })
    }

    /// The edge of a block: what was asked for, else `default`; in profile `main` always 8.
    fn edge(&self, default: BlockEdge) -> Result<BlockEdge> {
        match (self.profile_name(), self.block) {
            (ProfileName::Main, None | Some(8)) => Ok(BlockEdge::E8),
            (ProfileName::Main, Some(other)) => {
                Err(usage(format!("--block {other}: profile main has blocks of 8^3 voxels{}", self.advice())))
            }
            (ProfileName::Paper, None) => Ok(default),
            (ProfileName::Paper, Some(edge)) => {
                BlockEdge::from_voxels(edge).map_err(|error| usage(format!("--block: {error}")))
            }
        }
    }

    /// The profile; a setting of another one is refused.
    pub(super) fn profile(&self, grid: &Grid) -> Result<Profile> {
        self.target.check()?;
        if self.voxel_is_auto() && self.profile_name() == ProfileName::Paper {
            return Err(usage("--voxel auto: this is for profile main, not for profile paper"));
        }
        match self.profile_name() {
            ProfileName::Paper => match self.target.first_given() {
                None => Ok(Profile::Paper(self.paper.parameters(grid)?)),
                Some(flag) => {
                    Err(usage(format!("{flag}: this is a setting of profile main, not of profile paper")))
                }
            },
            ProfileName::Main => match self.paper.first_given() {
                None => Ok(Profile::Main),
                Some(flag) => Err(usage(format!(
                    "{flag}: this is a setting of profile paper, not of profile main{}",
                    self.advice()
                ))),
            },
        }
    }

    /// What to do about a setting of profile `paper`, for those who never asked for `main`.
    fn advice(&self) -> &'static str {
        if self.profile.is_none() { ": add --profile paper" } else { "" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use isv::format::PaperParameters;

    #[derive(Debug, Parser)]
    struct CommandLine {
        #[command(flatten)]
        header: HeaderArgs,
    }

    /// The grid and the profile of a command line, or its sentence.
    fn parse(flags: &[&str], captured: Option<Grid>) -> Result<(Grid, Profile), String> {
        let CommandLine { header } = CommandLine::parse_from([&["encode"], flags].concat());
        let grid = header.grid(captured).map_err(|error| error.to_string())?;
        let profile = header.profile(&grid).map_err(|error| error.to_string())?;
        Ok((grid, profile))
    }

    #[test]
    fn paper_has_the_settings_of_its_fig_12_unless_told() {
        let paper = PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 };
        assert_eq!(parse(&["--profile=paper"], None).unwrap(), (default_grid(), Profile::Paper(paper)));
        let knobs = ["--profile=paper", "--block=4", "--coefficients=20", "--ac-step=5mm"];
        let (grid, profile) = parse(&knobs, None).unwrap();
        assert_eq!(grid.edge, BlockEdge::E4);
        let told = PaperParameters { coefficients: 20, ac_step: 4096, ..paper };
        assert_eq!(profile, Profile::Paper(told));
    }

    #[test]
    fn main_has_blocks_of_8_whatever_the_capture_has() {
        let captured = Grid { edge: BlockEdge::E4, ..default_grid() };
        assert_eq!(parse(&["--profile=paper"], Some(captured)).unwrap().0.edge, BlockEdge::E4);
        for flags in [&[][..], &["--profile=main"], &["--profile=main", "--block=8"]] {
            assert_eq!(parse(flags, Some(captured)).unwrap(), (default_grid(), Profile::Main));
        }
        let sentence = parse(&["--profile=main", "--block=16"], None).unwrap_err();
        assert_eq!(sentence, "--block 16: profile main has blocks of 8^3 voxels");
        let sentence = parse(&["--block=16"], None).unwrap_err();
        assert_eq!(sentence, "--block 16: profile main has blocks of 8^3 voxels: add --profile paper");
    }

    #[test]
    fn main_refuses_the_settings_of_paper_even_at_their_defaults() {
        for flag in ["--motion=3dof", "--coefficients=64", "--dc-step=1mm", "--ac-step=10mm"] {
            let sentence = parse(&["--profile=main", flag], None).unwrap_err();
            let name = flag.split('=').next().unwrap();
            assert_eq!(sentence, format!("{name}: this is a setting of profile paper, not of profile main"));
            let kinder = parse(&[flag], None).unwrap_err();
            assert_eq!(kinder, format!("{sentence}: add --profile paper"));
        }
    }

    #[test]
    fn paper_refuses_the_settings_of_main() {
        for flag in ["--quality=50", "--bitrate=2M", "--max-error=1mm", "--preset=archive"] {
            let sentence = parse(&["--profile=paper", flag], None).unwrap_err();
            assert!(
                sentence.ends_with("this is a setting of profile main, not of profile paper"),
                "{sentence}"
            );
        }
    }

    #[test]
    fn one_target_at_a_time() {
        let targets = ["--quality=50", "--bitrate=2M", "--max-error=1mm"];
        for (one, other) in [(0, 1), (0, 2), (1, 2)] {
            let sentence = parse(&[targets[one], targets[other]], None).unwrap_err();
            assert!(sentence.ends_with(": only one of them can be met"), "{sentence}");
        }
        assert!(
            parse(&["--passes=2"], None).is_err() && parse(&["--passes=2", "--bitrate=1M"], None).is_ok()
        );
    }
}
