//! The test model of V-DMC on the meshes of all frames.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, WholeTake, program_uses, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::{Lattice, Vdmc};

pub(crate) struct VdmcEncoding {
    vdmc: Vdmc,
    rate: u8,
    meshes: Vec<TriangleMesh>,
}

impl VdmcEncoding {
    pub(crate) fn new(vdmc: &Vdmc, rate: u8) -> Self {
        Self { vdmc: vdmc.clone(), rate, meshes: Vec::new() }
    }

    /// The box around all frames.
    fn bounds(&self) -> (glam::DVec3, glam::DVec3) {
        let boxes = self.meshes.iter().filter_map(TriangleMesh::bounds);
        boxes.reduce(|(low, high), (l, h)| (low.min(l), high.max(h))).unwrap_or_default()
    }
}

impl Encoding for VdmcEncoding {
    /// Keeps the frame: the take is encoded at its end.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let (mesh, prepare_ms) =
            timed(|| TriangleMesh { appearance: None, normals: Vec::new(), ..mesh.clone() });
        self.meshes.push(mesh);
        let memory = Memory::OfAProgram(None);
        Ok(EncodedFrame { bytes: 0, prepare_ms, encode_ms: 0.0, colour_ms: None, memory })
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let lattice = Vdmc::lattice(self.bounds());
        let run = self.vdmc.encode(&self.meshes, &lattice, self.rate)?;
        let encoding = WholeTake { encode_ms: run.ms, memory: Memory::OfAProgram(run.peak_memory_bytes) };
        Ok(Box::new(VdmcStream {
            vdmc: self.vdmc,
            lattice,
            frames: self.meshes.len(),
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
