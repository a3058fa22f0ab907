//! The settings that only profile `main` has: how good, how small, how slow.

use crate::cli_enums::{MasksName, PresetName, RefreshName};
use isv::raw::encode::Tools;
use isv::raw::take::encode::MainOptions;
use isv::raw::take::{BitRate, Length};

/// Nothing has a default here, so that it can be told what was given.
#[derive(Debug, clap::Args)]
pub(super) struct TargetArgs {
    /// Quality, 0 to 100, the same in all frames [default: 50]
    ///
    /// Equal steps look equally different. Only one of --quality, --bitrate and --max-error can be met.
    #[arg(help_heading = "Quality and rate (profile main)", long, value_name = "0..100", value_parser = quality)]
    quality: Option<f32>,
    /// Bits a second, such as 800k or 2M, every byte counted
    ///
    /// A channel of that rate carries the stream with a buffer of one second. The rate pays for geometry and colour.
    /// Colour gets the share that makes pictures best, or what --colour-quality asks for.
    #[arg(help_heading = "Quality and rate (profile main)", long, value_name = "RATE")]
    bitrate: Option<BitRate>,
    /// RMS surface error that every frame stays below, with a unit
    ///
    /// The error is measured against the volume that was made of the capture.
    #[arg(help_heading = "Quality and rate (profile main)", long, value_name = "LENGTH")]
    max_error: Option<Length>,
    /// Passes over the input to meet a --bitrate [default: 1]
    ///
    /// 1 keeps to the rate as frames come. 2 reads everything more than once and finds the one step that meets it.
    #[arg(help_heading = "Quality and rate (profile main)", long, value_name = "1|2", value_parser = clap::value_parser!(u8).range(1..=2))]
    passes: Option<u8>,
    /// Work to take on [default: balanced]
    #[arg(help_heading = "Quality and rate (profile main)", long, value_enum)]
    preset: Option<PresetName>,
    /// How decoders recover from lost packets [default: keyframes]
    #[arg(help_heading = "Quality and rate (profile main)", long, value_enum)]
    refresh: Option<RefreshName>,
    /// How unobserved voxels are coded [default: cells, with --band full voxels]
    #[arg(help_heading = "Quality and rate (profile main)", long, value_enum)]
    masks: Option<MasksName>,
    /// For studies: tools to leave out, separated by commas
    #[arg(long, value_name = "TOOL,..", hide = true)]
    without: Option<Tools>,
}

impl TargetArgs {
    pub(super) fn options(&self) -> MainOptions {
        MainOptions {
            quality: self.quality,
            bitrate: self.bitrate,
            max_error: self.max_error,
            passes: self.passes,
            preset: self.preset.map(Into::into),
            refresh: self.refresh.map(Into::into),
            masks: self.masks.map(Into::into),
            tools: self.without,
        }
    }
}

pub(super) fn quality(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number| (0.0..=100.0).contains(number));
    number.ok_or_else(|| "a quality is a number from 0 to 100".to_owned())
}
