//! Real captures for tests.

use isv_io::{Unit, read_mesh};
use isv_testkit::capture;
use isv_volume::TriangleMesh;

/// One frame of a sequence, if the data is there; says so plainly if it is not.
pub(crate) fn load(sequence: &str, frame: usize) -> Option<TriangleMesh> {
    let path = capture(&format!("{sequence}/frame_{frame:04}.ply"))?;
    Some(read_mesh(&path, Unit::Metre).expect("a mesh"))
}
