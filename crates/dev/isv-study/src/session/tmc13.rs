//! TMC13 on the voxels of each frame's surface, with their colours if it has any.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, program_uses, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::{CodedPoints, Lattice, Tmc13, Tmc13Geometry};

pub(crate) struct Tmc13Encoding {
    bits: u8,
    geometry: Tmc13Geometry,
    colour_qp: u8,
    tmc13: Tmc13,
    first_frame: usize,
    /// The lattice of the first frame, which is that of all.
    lattice: Option<Lattice>,
    frames: Vec<CodedPoints>,
    command: String,
}

impl Tmc13Encoding {
    pub(crate) fn new(
        tmc13: &Tmc13,
        geometry: Tmc13Geometry,
        bits: u8,
        colour_qp: u8,
        first_frame: usize,
    ) -> Self {
        let (lattice, frames, command) = (None, Vec::new(), String::new());
        Self { bits, geometry, colour_qp, tmc13: tmc13.clone(), first_frame, lattice, frames, command }
    }
}

impl Encoding for Tmc13Encoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let frame = self.first_frame + self.frames.len();
        let failed = |cause| StudyError::Tool { frame, cause };
        let bits = self.bits;
        let lattice =
            self.lattice.get_or_insert_with(|| Lattice::spanning(mesh.bounds().unwrap_or_default(), bits));
        let (voxels, prepare_ms) = timed(|| lattice.voxels(mesh));
        let run =
            self.tmc13.encode(&voxels.map_err(failed)?, self.geometry, self.colour_qp).map_err(failed)?;
        // The first frame brings the lattice.
        let bytes = run.output.bytes.len() as u64 + if self.frames.is_empty() { Lattice::BYTES } else { 0 };
        self.frames.push(run.output);
        self.command = run.command;
        Ok(EncodedFrame::by_program(bytes, prepare_ms, run.ms, run.peak_memory_bytes))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        Ok(Box::new(Tmc13Stream(*self)))
    }
}

/// One file a frame, and the lattice.
struct Tmc13Stream(Tmc13Encoding);

impl Stream for Tmc13Stream {
    fn bytes(&self) -> u64 {
        Lattice::BYTES + self.0.frames.iter().map(|frame| frame.bytes.len() as u64).sum::<u64>()
    }

    fn bytes_colour(&self) -> u64 {
        self.0.frames.iter().map(|frame| frame.colour_bytes).sum()
    }

    fn point_step_m(&self) -> Option<f64> {
        self.0.lattice.map(|lattice| lattice.step_m)
    }

    fn kinds(&self) -> Option<BytesByKind> {
        None
    }

    fn programs(&self) -> Vec<ProgramUse> {
        let Tmc13Encoding { tmc13, command, .. } = &self.0;
        let commands = [command.clone(), tmc13.decoder_command()];
        program_uses([Tmc13::PROGRAM; 2], tmc13.version(), commands)
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let Tmc13Encoding { tmc13, first_frame, lattice, frames, .. } = &self.0;
        Ok(Box::new((*first_frame..).zip(frames).map(move |(frame, CodedPoints { bytes, .. })| {
            let run = tmc13.decode(bytes).map_err(|cause| StudyError::Tool { frame, cause })?;
            let points = lattice.map_or_else(Default::default, |lattice| lattice.placed(run.output));
            let memory = Memory::OfAProgram(run.peak_memory_bytes);
            Ok(DecodedFrame { shape: Geometry::Points(points), ms: run.ms, memory })
        })))
    }
}
