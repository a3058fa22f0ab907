//! Tang et al. 2018, with a transform that both sides have.

use super::volumes::{VolumeMaker, step_size, surface};
use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, timed};
use crate::record::BytesByKind;
use crate::{StudyError, StudySettings};
use isv::raw::decode::Limits;
use isv::raw::io::Geometry;
use isv::raw::volume::TriangleMesh;
use isv_baseline::{BlockBasis, TangDecoder, TangEncoder, TangSettings};

/// Bytes in front of each frame, which say how long it is.
const LENGTH_BYTES: u64 = 4;

pub(crate) struct TangEncoding {
    volumes: VolumeMaker,
    encoder: TangEncoder,
    stream: TangStream,
}

impl TangEncoding {
    pub(crate) fn new(
        basis: &BlockBasis,
        coefficients: u16,
        step_m: f64,
        settings: &StudySettings,
    ) -> Result<Self, StudyError> {
        let tang = TangSettings {
            grid: settings.ingest.grid,
            coefficients: usize::from(coefficients),
            step: step_size(step_m, settings)?,
        };
        let stream = TangStream {
            basis: basis.clone(),
            settings: tang,
            frames: Vec::new(),
            kinds: BytesByKind::default(),
        };
        Ok(Self { volumes: VolumeMaker::published(settings), encoder: TangEncoder::new(basis, tang), stream })
    }
}

impl Encoding for TangEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let (volume, prepare_ms) = self.volumes.make(mesh)?;
        let (frame, encode_ms) = timed(|| self.encoder.encode(&volume));
        let kinds = &mut self.stream.kinds;
        kinds.occupancy += frame.bytes_occupancy as f64;
        kinds.masks += frame.bytes_masks as f64;
        kinds.ac += frame.bytes_coefficients as f64;
        kinds.headers += (frame.bytes_headers() as u64 + LENGTH_BYTES) as f64;
        let bytes = frame.bytes.len() as u64 + LENGTH_BYTES;
        self.stream.frames.push(frame.bytes);
        Ok(EncodedFrame { bytes, prepare_ms, encode_ms, colour_ms: None, memory: Memory::OfThisProcess })
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        Ok(Box::new(self.stream))
    }
}

struct TangStream {
    basis: BlockBasis,
    settings: TangSettings,
    frames: Vec<Vec<u8>>,
    kinds: BytesByKind,
}

impl Stream for TangStream {
    fn bytes(&self) -> u64 {
        self.frames.iter().map(|frame| frame.len() as u64 + LENGTH_BYTES).sum()
    }

    fn kinds(&self) -> Option<BytesByKind> {
        Some(self.kinds)
    }

    fn decode(
        &self,
        _colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let mut decoder = TangDecoder::new(&self.basis, self.settings, Limits::default());
        Ok(Box::new(self.frames.iter().map(move |bytes| {
            let (mesh, ms) = timed(|| decoder.decode(bytes).map(|volume| surface(&volume)));
            Ok(DecodedFrame { shape: Geometry::Mesh(mesh?), ms, memory: Memory::OfThisProcess })
        })))
    }
}
