//! Real captures, which are not in the repository.

use crate::{Need, skip};
use std::path::{Path, PathBuf};

/// A file or folder of the captures, by its path among them: in the folder that `ISV_DATA` names, else in `../shared/data` beside the
/// checkout. Where it is not, what needs it is [skipped](skip).
#[must_use]
pub fn capture(name: &str) -> Option<PathBuf> {
    let data = std::env::var_os("ISV_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/data"), PathBuf::from);
    let path = data.join(name);
    if path.exists() {
        return Some(path);
    }
    skip(Need::Captures, format_args!("no data at {}", path.display()));
    None
}
