//! TMC2 on the voxels of all frames' surfaces.

use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, WholeTake, program_uses, timed};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::{Lattice, Tmc2};

pub(crate) struct Tmc2Encoding {
    tmc2: Tmc2,
    bits: u8,
    rate: u8,
    meshes: Vec<TriangleMesh>,
}

impl Tmc2Encoding {
    pub(crate) fn new(tmc2: &Tmc2, bits: u8, rate: u8) -> Self {
        Self { tmc2: tmc2.clone(), bits, rate, meshes: Vec::new() }
    }

    /// The box around all frames.
    fn bounds(&self) -> (glam::DVec3, glam::DVec3) {
        let boxes = self.meshes.iter().filter_map(TriangleMesh::bounds);
        boxes.reduce(|(low, high), (l, h)| (low.min(l), high.max(h))).unwrap_or_default()
    }
}

impl Encoding for Tmc2Encoding {
    /// Keeps the frame: the take is encoded at its end.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let (mesh, prepare_ms) =
            timed(|| TriangleMesh { appearance: None, normals: Vec::new(), ..mesh.clone() });
        self.meshes.push(mesh);
        let memory = Memory::OfAProgram(None);
        Ok(EncodedFrame { bytes: 0, prepare_ms, encode_ms: 0.0, colour_ms: None, memory })
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let lattice = Lattice::spanning(self.bounds(), self.bits);
        let voxels = self.meshes.iter().map(|mesh| lattice.voxels(mesh)).collect::<Result<Vec<_>, _>>()?;
        let run = self.tmc2.encode(&voxels, self.bits, self.rate)?;
        let encoding = WholeTake { encode_ms: run.ms, memory: Memory::OfAProgram(run.peak_memory_bytes) };
        Ok(Box::new(Tmc2Stream {
            tmc2: self.tmc2,
            lattice,
            frames: voxels.len(),
            bytes: run.output,
            command: run.command,
            encoding,
        }))
    }
}

/// One file, and the lattice.
struct Tmc2Stream {
    tmc2: Tmc2,
    lattice: Lattice,
    frames: usize,
    bytes: Vec<u8>,
    command: String,
    encoding: WholeTake,
}

impl Stream for Tmc2Stream {
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
        let commands = [self.command.clone(), self.tmc2.decoder_command()];
        program_uses(Tmc2::PROGRAMS, self.tmc2.version(), commands)
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let run = self.tmc2.decode(&self.bytes, self.frames)?;
        let (ms, memory) = (run.ms / self.frames.max(1) as f64, Memory::OfAProgram(run.peak_memory_bytes));
        Ok(Box::new(run.output.into_iter().map(move |points| {
            let shape = Geometry::Points(self.lattice.placed(points));
            Ok(DecodedFrame { shape, ms, memory })
        })))
    }
}
