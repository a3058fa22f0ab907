//! The settings that only profile `main` has: how good, how small, how slow.

use crate::terms::{PresetName, RefreshName};
use isv::raw::encode::Tools;
use isv::raw::take::encode::MainOptions;
use isv::raw::take::{BitRate, Length};

/// Nothing has a default here, so that it can be told what was given.
#[derive(Debug, clap::Args)]
pub(super) struct TargetArgs {
    /// How good the surface is to be, 0 to 100: the same in all frames, and equal steps look equally different. Without
    /// this and the next two, 50
    #[arg(long, value_name = "0..100", value_parser = quality)]
    quality: Option<f32>,
    /// Bits a second, such as 800k or 2M, every byte counted: what a channel of that rate carries with a buffer of one second
    #[arg(long, value_name = "RATE")]
    bitrate: Option<BitRate>,
    /// Root mean square that the surface of no frame may be away from what was captured as a volume, with a unit
    #[arg(long, value_name = "LENGTH")]
    max_error: Option<Length>,
    /// With --bitrate: 1 to keep to the rate as frames come, 2 to read everything more than once and find the one step that
    /// meets it
    #[arg(long, value_name = "1|2", value_parser = clap::value_parser!(u8).range(1..=2))]
    passes: Option<u8>,
    /// How much work to take on; without it, balanced
    #[arg(long, value_enum)]
    preset: Option<PresetName>,
    /// How who lost a packet comes to have all again; without it, at keyframes
    #[arg(long, value_enum)]
    refresh: Option<RefreshName>,
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
            tools: self.without,
        }
    }
}

fn quality(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number| (0.0..=100.0).contains(number));
    number.ok_or_else(|| "a quality is a number from 0 to 100".to_owned())
}
