//! What a stream says of itself beside its frames: whose take it is, its axes, how it was made.

use crate::Up;
use isv_format::MetadataText;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The metadata of a stream: section 6.8 of the specification. Everything may be missing, and decoding needs none of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct Metadata {
    /// Title for people.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// What captured the take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// Unit of the stream's coordinates: `m`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Axis of the stream's coordinates that points up: `y`, `z`, `x`, `-y`, `-z` or `-x`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<String>,
    /// Place of the stream's origin in the coordinates of the capture, in metres along the stream's axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// Colour space of the stream's colours: `sRGB`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub colour_space: Option<String>,
    /// Coordinates of the capture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceMetadata>,
    /// What ingest decided on the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub surface: Option<SurfaceMetadata>,
    /// Program that made the stream, with its version.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder: Option<String>,
    /// Settings of the encoder.
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub settings: Map<String, Value>,
    /// Keys that this build does not know.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

/// Coordinates of a capture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct SourceMetadata {
    /// Unit: `m`, `mm` and so on.
    pub unit: String,
    /// Axis that points up.
    pub up: String,
}

/// How inside is told from outside.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct SurfaceMetadata {
    /// `closed`, `sheet`, `oriented` (points by their normals) or `offset`.
    pub sign: String,
    /// Thickness of the shell around surfaces without inside (mm), if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell_mm: Option<f64>,
}

impl Metadata {
    /// Reads the text of a metadata packet; `None` if it is no JSON object with keys of these types.
    #[must_use]
    pub fn parse(text: &MetadataText) -> Option<Self> {
        serde_json::from_str(text.as_str()).ok()
    }

    /// The axis that points up; Y unless the stream names another one.
    #[must_use]
    pub fn up_axis(&self) -> Up {
        let named = |up: &Up| self.up.as_deref() == Some(up.name());
        Up::ALL.into_iter().find(named).unwrap_or_default()
    }

    /// The text of a metadata packet; `None` if it is too long.
    #[must_use]
    pub fn to_text(&self) -> Option<MetadataText> {
        serde_json::to_string(self).ok().and_then(MetadataText::new)
    }
}

/// Whether a stream gets metadata. A stream with metadata has version 2 of the format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum MetadataChoice {
    /// Yes for a stream with colour, with a title or with a device.
    #[default]
    Auto,
    /// Yes for any stream.
    Always,
    /// No.
    Never,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_is_kept_and_what_is_no_object_is_nothing() {
        let text = |json: &str| MetadataText::new(json.to_owned()).unwrap();
        let parsed = Metadata::parse(&text(r#"{"title":"a take","take":7,"up":"z"}"#)).unwrap();
        assert_eq!((parsed.title.as_deref(), parsed.up.as_deref()), (Some("a take"), Some("z")));
        assert_eq!(parsed.other["take"], 7);
        assert_eq!(Metadata::parse(&parsed.to_text().unwrap()).unwrap(), parsed);
        for wrong in ["", "7", "[]", "{\"title\":7}", "{"] {
            assert_eq!(Metadata::parse(&text(wrong)), None, "{wrong}");
        }
    }
}
