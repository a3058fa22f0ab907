//! The settings that only profile `main` has: how good, how small, how slow.

use crate::bit_rate::BitRate;
use crate::failure::usage;
use crate::length::Length;
use crate::terms::{BandName, PresetName, RefreshName};
use anyhow::Result;
use isv::encode::{Band, Bitrate, FrameQuality, MainSettings, Preset, RateTarget, Refresh, Tools};
use isv::format::StreamHeader;

const DEFAULT_QUALITY: f32 = 50.0;

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
    /// Refuses flags that contradict each other.
    pub(super) fn check(&self) -> Result<()> {
        let given: Vec<_> = self.targets().into_iter().filter(|(given, _)| *given).collect();
        if let [(_, first), (_, second), ..] = given[..] {
            return Err(usage(format!("{first} and {second}: only one of them can be met")));
        }
        if self.passes.is_some() && self.bitrate.is_none() {
            return Err(usage("--passes needs --bitrate"));
        }
        Ok(())
    }

    /// The first of these flags that was given.
    pub(super) fn first_given(&self) -> Option<&'static str> {
        let others = [
            (self.passes.is_some(), "--passes"),
            (self.preset.is_some(), "--preset"),
            (self.refresh.is_some(), "--refresh"),
            (self.without.is_some(), "--without"),
        ];
        let flags = self.targets().into_iter().chain(others);
        flags.filter(|(given, _)| *given).map(|(_, flag)| flag).next()
    }

    /// Whether the rate is to be met by coding everything more than once, and which.
    pub(super) fn two_pass_rate(&self) -> Option<f64> {
        self.bitrate.filter(|_| self.passes == Some(2)).map(BitRate::bits_per_second)
    }

    /// The rate that was asked for, and the most bits that a stream of so many seconds may have to meet it.
    pub(super) fn most_bits(&self, seconds: f64) -> Option<(BitRate, f64)> {
        // What comes in one pass may fill the buffer of a second. The one step of all is found to a percent.
        let allowed = if self.passes == Some(2) { 1.02 * seconds } else { 1.01 * (seconds + 1.0) };
        self.bitrate.map(|rate| (rate, rate.bits_per_second() * allowed))
    }

    /// What the encoder is told.
    pub(super) fn settings(&self, header: &StreamHeader, band: Option<BandName>) -> MainSettings {
        let preset = self.preset.map_or(Preset::Balanced, Preset::from);
        let voxel_m = header.grid.voxel_size.metres();
        let target = match (self.bitrate, self.max_error) {
            (Some(rate), _) if self.passes != Some(2) => {
                RateTarget::Bitrate(Bitrate::new(rate.bits_per_second(), header.frame_rate.per_second()))
            }
            (_, Some(error)) => RateTarget::MaxError(error.metres() / voxel_m),
            _ => RateTarget::Constant,
        };
        MainSettings {
            quality: FrameQuality::of_quality(self.quality.unwrap_or(DEFAULT_QUALITY)),
            target,
            band: match band {
                Some(BandName::Full) => Band::Full,
                Some(BandName::Surface) | None => Band::Surface,
            },
            tools: self.without.unwrap_or(Tools::ALL),
            refresh: self.refresh.map_or(Refresh::Keyframes, Refresh::from),
            ..preset.settings()
        }
    }

    fn targets(&self) -> [(bool, &'static str); 3] {
        [
            (self.quality.is_some(), "--quality"),
            (self.bitrate.is_some(), "--bitrate"),
            (self.max_error.is_some(), "--max-error"),
        ]
    }
}

fn quality(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number| (0.0..=100.0).contains(number));
    number.ok_or_else(|| "a quality is a number from 0 to 100".to_owned())
}
