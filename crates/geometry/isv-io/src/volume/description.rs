//! `grid.json`: how the arrays relate to the world.

use super::{DESCRIPTION, VolumeError};
use crate::{regular_file, text};
use serde::{Deserialize, Serialize};
use std::io;
use std::path::Path;

/// Largest file that is read; a real one has a hundred bytes.
const LARGEST: u64 = 1 << 16;

/// What `grid.json` says; entries that are not known are passed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Description {
    /// Whose the arrays are. Says nothing to readers.
    #[serde(skip_deserializing)]
    pub(super) comment: &'static str,
    /// Edge of a voxel in metres.
    pub(super) voxel_size_m: Option<f64>,
    /// Truncation distance in metres.
    pub(super) truncation_m: Option<f64>,
    /// What the distances count.
    #[serde(default)]
    pub(super) tsdf_unit: TsdfUnit,
}

/// Unit of the distances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum TsdfUnit {
    /// Metres.
    #[serde(rename = "m")]
    Metre,
    /// Truncation distances, so that values lie in -1..1.
    #[default]
    #[serde(rename = "truncation")]
    Truncation,
    /// Voxel edges.
    #[serde(rename = "voxel")]
    Voxel,
}

impl Description {
    /// Reads the description of a folder; without a file it is empty.
    pub(super) fn read(folder: &Path) -> Result<Self, VolumeError> {
        let path = folder.join(DESCRIPTION);
        let flaw = |why: String| VolumeError::Description { path: path.clone(), why };
        match path.metadata() {
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            Ok(data) if data.len() > LARGEST => return Err(flaw(format!("more than {LARGEST} bytes"))),
            _ => {}
        }
        let bytes =
            regular_file::read(&path).map_err(|cause| VolumeError::Io { path: path.clone(), cause })?;
        let description: Self =
            serde_json::from_slice(&text::decode(&bytes)).map_err(|cause| flaw(cause.to_string()))?;
        let lengths =
            [("voxel_size_m", description.voxel_size_m), ("truncation_m", description.truncation_m)];
        for (key, length) in lengths {
            if let Some(length) = length.filter(|length| !(length.is_finite() && *length > 0.0)) {
                return Err(flaw(format!("\"{key}\" is {length}, it must be above 0")));
            }
        }
        Ok(description)
    }
}
