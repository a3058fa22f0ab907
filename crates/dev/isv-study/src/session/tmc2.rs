//! TMC2 on the voxels of all frames' surfaces, with their colours if they have any.

use super::kept_frames::KeptFrames;
use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, WholeTake, program_uses};
use crate::StudyError;
use crate::record::{BytesByKind, ProgramUse};
use isv::raw::io::Geometry;
use isv::raw::volume::{PointCloud, TriangleMesh};
use isv_baseline::{CodedPoints, Lattice, Tmc2};

pub(crate) struct Tmc2Encoding {
    tmc2: Tmc2,
    bits: u8,
    rate: u8,
    frames: KeptFrames,
}

impl Tmc2Encoding {
    pub(crate) fn new(tmc2: &Tmc2, bits: u8, rate: u8) -> Self {
        Self { tmc2: tmc2.clone(), bits, rate, frames: KeptFrames::default() }
    }
}

impl Encoding for Tmc2Encoding {
    /// Keeps the frame: the take is encoded at its end.
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        Ok(self.frames.keep(mesh))
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let lattice = Lattice::spanning(self.frames.bounds(), self.bits);
        let voxels =
            self.frames.meshes.iter().map(|mesh| lattice.voxels(mesh)).collect::<Result<Vec<_>, _>>()?;
        let run = self.tmc2.encode(&voxels, self.bits, self.rate)?;
        let memory = Memory::OfAProgram(run.peak_memory_bytes);
        let encoding = WholeTake { encode_ms: run.ms, colour_ms: None, memory };
        Ok(Box::new(Tmc2Stream {
            tmc2: self.tmc2,
            lattice,
            frames: voxels.len(),
            coded: run.output,
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
    coded: CodedPoints,
    command: String,
    encoding: WholeTake,
}

impl Stream for Tmc2Stream {
    fn bytes(&self) -> u64 {
        Lattice::BYTES + self.coded.bytes.len() as u64
    }

    fn bytes_colour(&self) -> u64 {
        self.coded.colour_bytes
    }

    fn point_step_m(&self) -> Option<f64> {
        Some(self.lattice.step_m)
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
        let run = self.tmc2.decode(&self.coded.bytes, self.frames)?;
        let has_colours = self.coded.colour_bytes > 0;
        let (ms, memory) = (run.ms / self.frames.max(1) as f64, Memory::OfAProgram(run.peak_memory_bytes));
        Ok(Box::new(run.output.into_iter().map(move |points| {
            let colours = if has_colours { points.colours } else { Vec::new() };
            let shape = Geometry::Points(self.lattice.placed(PointCloud { colours, ..points }));
            Ok(DecodedFrame { shape, ms, memory })
        })))
    }
}
