//! gltfpack as a user runs it, after simplification if asked for.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, prepared_mesh, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::Gltfpack;

pub(crate) struct GltfpackEncoding {
    faces_percent: u8,
    bits: u8,
    stream: GltfpackStream,
}

impl GltfpackEncoding {
    pub(crate) fn new(gltfpack: &Gltfpack, faces_percent: u8, bits: u8, first_frame: usize) -> Self {
        let stream = GltfpackStream {
            gltfpack: gltfpack.clone(),
            first_frame,
            frames: Vec::new(),
            command: String::new(),
        };
        Self { faces_percent, bits, stream }
    }
}

impl Encoding for GltfpackEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let frame = self.stream.first_frame + self.stream.frames.len();
        let (mesh, prepare_ms) = timed(|| prepared_mesh(mesh, self.faces_percent, frame));
        let run = self.stream.gltfpack.encode(&mesh?, self.bits);
        let run = run.map_err(|cause| StudyError::Tool { frame, cause })?;
        let bytes = run.output.len() as u64;
        self.stream.frames.push(run.output);
        self.stream.command = run.command;
        Ok(EncodedFrame::by_program(bytes, prepare_ms, run.ms, run.peak_memory_bytes))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        Ok(Box::new(self.stream))
    }
}

/// One file a frame.
struct GltfpackStream {
    gltfpack: Gltfpack,
    first_frame: usize,
    frames: Vec<Vec<u8>>,
    /// How the last frame was packed.
    command: String,
}

impl Stream for GltfpackStream {
    fn bytes(&self) -> u64 {
        self.frames.iter().map(|frame| frame.len() as u64).sum()
    }

    fn kinds(&self) -> Option<BytesByKind> {
        None
    }

    fn programs(&self) -> Vec<ProgramUse> {
        let version = self.gltfpack.version();
        let note = version.note(Gltfpack::PROGRAM);
        vec![ProgramUse { version: version.version.clone(), command: self.command.clone(), note }]
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        Ok(Box::new((self.first_frame..).zip(&self.frames).map(|(frame, bytes)| {
            let run = self.gltfpack.decode(bytes).map_err(|cause| StudyError::Tool { frame, cause })?;
            Ok(DecodedFrame { shape: Geometry::Mesh(run.output), ms: run.ms, memory: Memory::OfThisProcess })
        })))
    }
}
