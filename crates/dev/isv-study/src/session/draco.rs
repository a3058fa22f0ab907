//! Draco as a user runs it, after simplification if asked for.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, prepared_mesh, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::Draco;

pub(crate) struct DracoEncoding {
    faces_percent: u8,
    stream: DracoStream,
}

impl DracoEncoding {
    pub(crate) fn new(draco: &Draco, faces_percent: u8, bits: u8, first_frame: usize) -> Self {
        let stream = DracoStream { draco: draco.clone(), bits, first_frame, frames: Vec::new() };
        Self { faces_percent, stream }
    }
}

impl Encoding for DracoEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let frame = self.stream.next_frame();
        let (mesh, prepare_ms) = timed(|| prepared_mesh(mesh, self.faces_percent, frame));
        let run = self.stream.draco.encode(&mesh?, self.stream.bits);
        let run = run.map_err(|cause| StudyError::Draco { frame, cause })?;
        let bytes = run.output.len() as u64;
        self.stream.frames.push(run.output);
        Ok(EncodedFrame::by_program(bytes, prepare_ms, run.ms, run.peak_memory_bytes))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        Ok(Box::new(self.stream))
    }
}

/// One file a frame.
struct DracoStream {
    draco: Draco,
    bits: u8,
    first_frame: usize,
    frames: Vec<Vec<u8>>,
}

impl DracoStream {
    /// Number of the frame that is coded next.
    fn next_frame(&self) -> usize {
        self.first_frame + self.frames.len()
    }
}

impl Stream for DracoStream {
    fn bytes(&self) -> u64 {
        self.frames.iter().map(|frame| frame.len() as u64).sum()
    }

    fn kinds(&self) -> Option<BytesByKind> {
        None
    }

    fn programs(&self) -> Vec<ProgramUse> {
        // Neither program says its version.
        let uses = |command| ProgramUse { version: String::new(), command, note: None };
        Draco::commands(self.bits).map(uses).to_vec()
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        Ok(Box::new((self.first_frame..).zip(&self.frames).map(|(frame, bytes)| {
            let run = self.draco.decode(bytes).map_err(|cause| StudyError::Draco { frame, cause })?;
            Ok(DecodedFrame {
                shape: Geometry::Mesh(run.output),
                ms: run.ms,
                memory: Memory::OfAProgram(run.peak_memory_bytes),
            })
        })))
    }
}
