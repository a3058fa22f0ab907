//! The metadata of a stream that is encoded: what the user says of it, and what was decided.

use super::error::{OptionName, OptionsError};
use super::options::DEFAULT_QUALITY;
use super::volumes::SurfaceDecision;
use super::{EncodeOptions, ProfileChoice};
use crate::Up;
use crate::metadata::{Metadata, MetadataChoice, SourceMetadata, SurfaceMetadata};
use isv_encode::{Preset, RateTarget};
use isv_format::{FormatVersion, MetadataText, StreamHeader};
use serde_json::{Map, Value, json};
use std::sync::{Arc, OnceLock};

/// What a user may say of a take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MetadataOptions {
    /// Whether streams get metadata.
    pub choice: MetadataChoice,
    /// Title for people.
    pub title: Option<String>,
    /// What captured the take.
    pub device: Option<String>,
}

/// Bytes of a title, or of a device's name, at most.
const MOST_BYTES: usize = 4096;

impl MetadataOptions {
    /// Refuses text that is longer than anybody reads: with it all metadata might be longer than a stream may have.
    pub(super) fn check(&self) -> Result<(), OptionsError> {
        let is_long = |text: &Option<String>| text.as_ref().is_some_and(|text| text.len() > MOST_BYTES);
        let texts = [(OptionName::Title, &self.title), (OptionName::Device, &self.device)];
        match texts.into_iter().find(|(_, text)| is_long(text)) {
            Some((option, _)) => Err(OptionsError::Range { option, what: "text of at most 4096 bytes" }),
            None => Ok(()),
        }
    }

    /// Options, with what a stream that is coded anew says of itself in place of what is not given.
    pub(super) fn or(&self, source: Option<&Metadata>) -> Self {
        let said = |own: &Option<String>, theirs: fn(&Metadata) -> &Option<String>| {
            own.clone().or_else(|| source.and_then(|source| theirs(source).clone()))
        };
        let title = said(&self.title, |source| &source.title);
        Self { choice: self.choice, title, device: said(&self.device, |source| &source.device) }
    }

    /// Sets the version of the format in which metadata can be, if the stream is to have any.
    pub(super) fn versioned(&self, header: StreamHeader) -> StreamHeader {
        if self.is_wanted(&header) { StreamHeader { version: FormatVersion::V2, ..header } } else { header }
    }

    /// Whether a stream with this header gets metadata. Where nobody chose, colour and what was said of the take are reasons.
    fn is_wanted(&self, header: &StreamHeader) -> bool {
        match self.choice {
            MetadataChoice::Auto => {
                header.colour_layers.is_some() || self.title.is_some() || self.device.is_some()
            }
            MetadataChoice::Always => true,
            MetadataChoice::Never => false,
        }
    }
}

/// Metadata of which all is known but what the first frame decides.
pub(super) struct MetadataDraft {
    metadata: Metadata,
    surface: Arc<OnceLock<SurfaceDecision>>,
}

impl MetadataDraft {
    /// The draft for a stream with this header; `None` if it gets none. `up`: the axis of the stream, if it is known.
    pub(super) fn new(
        options: &EncodeOptions,
        header: &StreamHeader,
        up: Option<String>,
        surface: &Arc<OnceLock<SurfaceDecision>>,
    ) -> Option<Self> {
        let MetadataOptions { title, device, .. } = &options.metadata;
        if !options.metadata.is_wanted(header) {
            return None;
        }
        let turn = options.up.to_y_up();
        let metadata = Metadata {
            title: title.clone(),
            device: device.clone(),
            unit: Some("m".to_owned()),
            up,
            origin: options
                .origin
                .map(|place| (turn * (glam::DVec3::from(place) * options.unit.metres())).to_array()),
            colour_space: header.colour_layers.is_some().then(|| "sRGB".to_owned()),
            source: Some(SourceMetadata { unit: options.unit.to_string(), up: options.up.name().to_owned() }),
            encoder: Some(concat!("isv ", env!("CARGO_PKG_VERSION")).to_owned()),
            settings: settings(options, header),
            ..Metadata::default()
        };
        Some(Self { metadata, surface: Arc::clone(surface) })
    }

    /// The text, once the first frame has been ingested. A title that is too long for it is left out.
    pub(super) fn finish(mut self) -> Option<MetadataText> {
        self.metadata.surface = self
            .surface
            .get()
            .map(|surface| SurfaceMetadata { sign: surface.sign.to_owned(), shell_mm: surface.shell_mm });
        self.metadata.to_text()
    }
}

/// Axis of a stream that points up, if it is known: Y, as ingest turns captures. Volumes stay as they are,
/// and so do streams that are coded anew.
pub(super) fn stream_up(
    options: &EncodeOptions,
    is_turned: bool,
    source: Option<&Metadata>,
) -> Option<String> {
    match source {
        Some(source) => source.up.clone(),
        None if is_turned => Some(Up::Y.name().to_owned()),
        None => (options.up != Up::Y).then(|| options.up.name().to_owned()),
    }
}

/// Settings that say how a stream was coded. What was not chosen is left out, but for what a reader asks first.
fn settings(options: &EncodeOptions, header: &StreamHeader) -> Map<String, Value> {
    let mut settings = Map::new();
    let mut set = |key: &str, value: Value| _ = settings.insert(key.to_owned(), value);
    set("profile", json!(header.profile.name()));
    set("voxel_mm", json!(rounded(header.grid.voxel_size.metres() * 1e3)));
    set("gop", json!(options.gop.get()));
    if options.profile_choice() == ProfileChoice::Main {
        let coded = options.encoder_settings(header).main;
        set("preset", json!(options.main.preset.unwrap_or(Preset::Balanced).to_string()));
        match (coded.target, options.main.bitrate) {
            (_, Some(rate)) => set("bitrate_mbps", json!(rate.bits_per_second() / 1e6)),
            (RateTarget::MaxError(voxels), None) => {
                set("max_error_mm", json!(rounded(voxels * header.grid.voxel_size.metres() * 1e3)));
            }
            _ => set("quality", json!(options.main.quality.unwrap_or(DEFAULT_QUALITY))),
        }
        if let Some(quality) = options.colour.quality {
            set("colour_quality", json!(quality));
        }
    }
    settings
}

/// Millionths are enough of a length in millimetres.
fn rounded(mm: f64) -> f64 {
    (mm * 1e6).round() / 1e6
}
