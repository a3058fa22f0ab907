//! Real captures for tests.

use isv_io::{Unit, read_mesh};
use isv_volume::TriangleMesh;
use std::path::PathBuf;

/// One frame of a sequence, if the data is there; says so plainly if it is not.
pub(crate) fn load(sequence: &str, frame: usize) -> Option<TriangleMesh> {
    let root = std::env::var_os("ISV_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(sequence).join(format!("frame_{frame:04}.ply"));
    if !path.exists() {
        println!("skipped: no data at {}", path.display());
        return None;
    }
    Some(read_mesh(&path, Unit::Metre).expect("a mesh"))
}
