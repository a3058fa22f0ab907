//! Frames that are kept until a codec of whole takes codes them all.

use super::{EncodedFrame, timed};
use glam::DVec3;
use isv::raw::volume::TriangleMesh;

/// Meshes without normals.
#[derive(Default)]
pub(super) struct KeptFrames {
    pub(super) meshes: Vec<TriangleMesh>,
}

impl KeptFrames {
    /// Keeps a frame with its colour, whose bytes are not known yet.
    pub(super) fn keep(&mut self, mesh: &TriangleMesh) -> EncodedFrame {
        let (mesh, prepare_ms) = timed(|| TriangleMesh { normals: Vec::new(), ..mesh.clone() });
        self.meshes.push(mesh);
        EncodedFrame::by_program(0, prepare_ms, 0.0, None)
    }

    /// Keeps a frame without its colour, whose bytes are not known yet.
    pub(super) fn keep_shape(&mut self, mesh: &TriangleMesh) -> EncodedFrame {
        let (mesh, prepare_ms) =
            timed(|| TriangleMesh { appearance: None, normals: Vec::new(), ..mesh.clone() });
        self.meshes.push(mesh);
        EncodedFrame::by_program(0, prepare_ms, 0.0, None)
    }

    /// The box around all frames.
    pub(super) fn bounds(&self) -> (DVec3, DVec3) {
        let boxes = self.meshes.iter().filter_map(TriangleMesh::bounds);
        boxes.reduce(|(low, high), (l, h)| (low.min(l), high.max(h))).unwrap_or_default()
    }
}
