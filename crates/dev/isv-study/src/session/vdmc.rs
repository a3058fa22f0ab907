//! The test model of V-DMC on the meshes of all frames.

use super::kept_frames::KeptFrames;
use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, WholeTake, program_uses};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::{Lattice, Vdmc};

pub(crate) struct VdmcEncoding {
    vdmc: Vdmc,
    rate: u8,
    frames: KeptFrames,
}

impl VdmcEncoding {
    pub(crate) fn new(vdmc: &Vdmc, rate: u8) -> Self {
        Self { vdmc: vdmc.clone(), rate, frames: KeptFrames::default() }
    }
}

impl Encoding for VdmcEncoding {
    /// Keeps the frame: the take is encoded at its end.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        Ok(self.frames.keep_shape(mesh))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let lattice = Vdmc::lattice(self.frames.bounds());
        let run = self.vdmc.encode(&self.frames.meshes, &lattice, self.rate)?;
        let memory = Memory::OfAProgram(run.peak_memory_bytes);
        let encoding = WholeTake { encode_ms: run.ms, colour_ms: None, memory };
        Ok(Box::new(VdmcStream {
            vdmc: self.vdmc,
            lattice,
            frames: self.frames.meshes.len(),
            bytes: run.output,
            command: run.command,
            encoding,
        }))
    }
}

/// One file, and the lattice.
struct VdmcStream {
    vdmc: Vdmc,
    lattice: Lattice,
    frames: usize,
    bytes: Vec<u8>,
    command: String,
    encoding: WholeTake,
}

impl Stream for VdmcStream {
    fn bytes(&self) -> u64 {
        Lattice::BYTES + self.bytes.len() as u64
    }

    fn kinds(&self) -> Option<BytesByKind> {
        None
    }

    fn whole_take(&self) -> Option<WholeTake> {
        Some(self.encoding)
    }

    fn programs(&self) -> Vec<ProgramUse> {
        let commands = [self.command.clone(), self.vdmc.decoder_command()];
        program_uses(Vdmc::PROGRAMS, self.vdmc.version(), commands)
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let run = self.vdmc.decode(&self.bytes, &self.lattice, self.frames)?;
        let (ms, memory) = (run.ms / self.frames.max(1) as f64, Memory::OfAProgram(run.peak_memory_bytes));
        Ok(Box::new(run.output.into_iter().map(move |mesh| {
            let shape = Geometry::Mesh(mesh);
            Ok(DecodedFrame { shape, ms, memory })
        })))
    }
}
