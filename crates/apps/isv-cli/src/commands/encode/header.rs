//! The part of the command line that goes into the stream's header.

use super::paper::PaperArgs;
use super::target::TargetArgs;
use crate::cli_enums::{BandName, ProfileName};
use isv::raw::format::FrameRate;
use isv::raw::take::Length;
use isv::raw::take::encode::{EncodeOptions, VoxelChoice};
use std::str::FromStr;

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
    /// Set of the codec's tools [default: main]
    #[arg(help_heading = "Stream", long, value_enum)]
    profile: Option<ProfileName>,
    /// Frames a second: 30, 29.97 or 30000/1001 [default: the input's, else 30]
    #[arg(help_heading = "Stream", long)]
    fps: Option<FrameRate>,
    /// Edge of a voxel, with a unit, or auto [default: what fits the input]
    ///
    /// Without it, volumes keep their own and meshes get 5mm. Points and depth images get one that fits the distance of
    /// points, the size of a pixel and the noise of depths. Their voxel is never less than 5mm. With auto, meshes in
    /// profile main get whichever of a few sizes serves the quality, rate or error best.
    #[arg(help_heading = "Stream", long, value_name = "LENGTH|auto")]
    voxel: Option<VoxelArg>,
    /// Edge of a block in voxels: 4, 8 or 16 [default: the input's, else 8]
    ///
    /// Profile main has blocks of 8.
    #[arg(help_heading = "Stream", long, value_name = "VOXELS")]
    block: Option<u32>,
    /// Distance up to which distances are kept, 2 to 16 voxels [default: 8]
    ///
    /// Volumes keep their own unless it is given.
    #[arg(help_heading = "Stream", long, value_name = "VOXELS")]
    truncation: Option<u32>,
    /// Part of the volume to code [default: surface]
    ///
    /// In profile paper the default is full. Value full takes profile paper, unless main or a setting of it is asked for.
    /// Profile main tells observed from unobserved voxels near the surface alone.
    #[arg(help_heading = "Stream", long, value_enum)]
    band: Option<BandName>,
    #[command(flatten)]
    paper: PaperArgs,
    #[command(flatten)]
    target: TargetArgs,
}

impl HeaderArgs {
    /// These choices, beside others.
    pub(super) fn options(&self, others: EncodeOptions) -> EncodeOptions {
        EncodeOptions {
            profile: self.profile.map(Into::into),
            frame_rate: self.fps,
            voxel: match self.voxel {
                None => VoxelChoice::Fit,
                Some(VoxelArg::Edge(edge)) => VoxelChoice::Edge(edge),
                Some(VoxelArg::Auto) => VoxelChoice::Auto,
            },
            block: self.block,
            truncation: self.truncation,
            band: self.band.map(Into::into),
            paper: self.paper.options(),
            main: self.target.options(),
            ..others
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::words;
    use clap::Parser;
    use isv::raw::format::{PaperParameters, Profile};
    use isv::raw::take::encode::default_grid;
    use isv::raw::volume::{BlockEdge, Grid};

    #[derive(Debug, Parser)]
    struct CommandLine {
        #[command(flatten)]
        header: HeaderArgs,
    }

    /// The grid and the profile of a command line, or its sentence.
    fn parse(flags: &[&str], captured: Option<Grid>) -> Result<(Grid, Profile), String> {
        let CommandLine { header } = CommandLine::parse_from([&["encode"], flags].concat());
        let options = header.options(EncodeOptions::default());
        let header = options.header(captured, None).map_err(|error| words::options(&error))?;
        Ok((header.grid, header.profile))
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
