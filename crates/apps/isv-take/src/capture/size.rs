//! How many bytes a capture takes.

use super::kinds::Kind;
use crate::Input;
use crate::stream::load_index;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Bytes of the files that hold a range of frames; none where that is not known. `whole`: the input, if the range is all of it.
pub(super) fn bytes(kind: &Kind, range: &Range<usize>, whole: Option<&Path>) -> Option<u64> {
    match kind {
        Kind::Files(sequence, _) => {
            let paths = sequence.paths().get(range.clone())?;
            // The buffers of these lie in other files.
            let is_gltf = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
            if paths.iter().any(|path| is_gltf(path)) {
                return None;
            }
            paths.iter().map(|path| file_bytes(path)).sum()
        }
        Kind::Animation { .. } => whole
            .filter(|path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb")))
            .and_then(file_bytes),
        Kind::Depth(depth) => range.clone().flat_map(|frame| depth.image_paths(frame)).map(file_bytes).sum(),
        Kind::Volumes { volumes, .. } => {
            let bytes = |path: &PathBuf| if path.is_dir() { folder_bytes(path) } else { file_bytes(path) };
            volumes.paths().get(range.clone())?.iter().map(bytes).sum()
        }
        Kind::Stream(path, ..) => {
            let bytes = file_bytes(path)?;
            if whole.is_some() {
                return Some(bytes);
            }
            let frames = load_index(&Input::from(path)).ok()?.frames;
            let end = frames.get(range.end).map_or(bytes, |frame| frame.at);
            end.checked_sub(frames.get(range.start)?.at)
        }
        Kind::PipedStream(_) | Kind::PipedGeometry(_) => None,
    }
}

fn file_bytes(path: &Path) -> Option<u64> {
    path.metadata().ok().map(|file| file.len())
}

/// Bytes of the files in a folder, not of those in its folders.
fn folder_bytes(folder: &Path) -> Option<u64> {
    let files = fs::read_dir(folder).ok()?.flatten().filter_map(|entry| entry.metadata().ok());
    Some(files.filter(fs::Metadata::is_file).map(|file| file.len()).sum())
}
