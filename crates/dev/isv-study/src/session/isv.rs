//! isv itself, either profile.

use super::volumes::{VolumeMaker, step_size, surface};
use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, timed};
use crate::record::BytesByKind;
use crate::{StudyError, StudySettings};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, FrameQuality, MainSettings, MotionMode, Preset};
use isv::raw::format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv::raw::volume::TriangleMesh;

pub(crate) struct IsvEncoding {
    header: StreamHeader,
    volumes: VolumeMaker,
    encoder: Encoder,
    writer: PacketWriter<Vec<u8>>,
    frames: u64,
    kinds: BytesByKind,
}

impl IsvEncoding {
    /// Profile `paper`. `steps` are those of the DC coefficient and of all others, in metres.
    pub(crate) fn paper(
        motion: MotionMode,
        coefficients: u16,
        steps: [f64; 2],
        frame_rate: FrameRate,
        settings: &StudySettings,
    ) -> Result<Self, StudyError> {
        let profile = Profile::Paper(PaperParameters {
            coefficients,
            dc_step: step_size(steps[0], settings)?.sixteenths(),
            ac_step: step_size(steps[1], settings)?.sixteenths(),
        });
        Self::new(profile, EncoderSettings { motion, ..EncoderSettings::default() }, frame_rate, settings)
    }

    /// Profile `main` under a preset, with one step for all frames, in metres.
    pub(crate) fn main(
        preset: Preset,
        step_m: f64,
        frame_rate: FrameRate,
        settings: &StudySettings,
    ) -> Result<Self, StudyError> {
        let step = step_m / settings.ingest.grid.voxel_size.metres();
        let main = MainSettings { quality: FrameQuality::of_step(step as f32), ..preset.settings() };
        Self::new(Profile::Main, EncoderSettings { main, ..EncoderSettings::default() }, frame_rate, settings)
    }

    fn new(
        profile: Profile,
        encoder: EncoderSettings,
        frame_rate: FrameRate,
        settings: &StudySettings,
    ) -> Result<Self, StudyError> {
        let header = StreamHeader::new(profile, settings.ingest.grid, frame_rate);
        Ok(Self {
            header,
            volumes: match profile {
                Profile::Main => VolumeMaker::main(settings, encoder.main.band),
                Profile::Paper(_) => VolumeMaker::published(settings),
            },
            encoder: Encoder::new(&header, EncoderSettings { gop: settings.gop, ..encoder }),
            writer: PacketWriter::new(Vec::new(), &header)?,
            frames: 0,
            kinds: BytesByKind::default(),
        })
    }
}

impl Encoding for IsvEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        let (volume, prepare_ms) = self.volumes.make(mesh)?;
        let (frame, encode_ms) = timed(|| self.encoder.encode(&volume));
        let timestamp_ns = self.header.frame_rate.timestamp_ns(self.frames);
        let bytes = self.writer.write_frame(frame.keyframe, timestamp_ns, &frame.payload())? as u64;
        self.frames += 1;
        self.kinds.occupancy += (frame.bytes_blocks() - frame.bytes_masks()) as f64;
        self.kinds.masks += frame.bytes_masks() as f64;
        self.kinds.motion += frame.bytes_modes() as f64;
        self.kinds.dc += frame.bytes_dc();
        self.kinds.ac += frame.bytes_coefficients() as f64 - frame.bytes_dc();
        Ok(EncodedFrame { bytes, prepare_ms, encode_ms, memory: Memory::OfThisProcess })
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn Stream>, StudyError> {
        let bytes = self.writer.finish()?;
        let mut kinds = self.kinds;
        kinds.headers = bytes.len() as f64 - kinds.named().iter().map(|(_, bytes)| bytes).sum::<f64>();
        Ok(Box::new(IsvStream { bytes, kinds }))
    }
}

struct IsvStream {
    bytes: Vec<u8>,
    kinds: BytesByKind,
}

impl Stream for IsvStream {
    fn bytes(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn kinds(&self) -> Option<BytesByKind> {
        Some(self.kinds)
    }

    fn decode(&self) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let mut reader = PacketReader::new(&self.bytes[..])?;
        let header = *reader.header();
        let mut decoder = Decoder::new(&header, Limits::default());
        Ok(Box::new(std::iter::from_fn(move || {
            let packet = match reader.next_frame() {
                Ok(packet) => packet?,
                Err(error) => return Some(Err(error.into())),
            };
            let (mesh, ms) = timed(|| decoder.decode(&packet).map(|frame| surface(frame.volume)));
            Some(
                mesh.map(|mesh| DecodedFrame { mesh, ms, memory: Memory::OfThisProcess }).map_err(Into::into),
            )
        })))
    }

    fn isv_file(&self) -> Option<&[u8]> {
        Some(&self.bytes)
    }
}
