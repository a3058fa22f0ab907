//! isv itself, either profile.

use super::volumes::{VolumeMaker, step_size, surface};
use super::{DecodedFrame, EncodedFrame, Encoding, Memory, Stream, timed};
use crate::record::BytesByKind;
use crate::{StudyError, StudySettings};
use isv::raw::decode::{DecodeError, Decoder, Limits};
use isv::raw::encode::colour::{ColourEncoder, ColourSettings};
use isv::raw::encode::{Encoder, EncoderSettings, FrameQuality, MainSettings, MotionMode, Preset};
use isv::raw::format::{
    ColourLayers, FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader,
};
use isv::raw::ingest::mesh_colours;
use isv::raw::io::Geometry;
use isv::raw::take::add_tile_texture;
use isv::raw::volume::TriangleMesh;

pub(crate) struct IsvEncoding {
    header: StreamHeader,
    volumes: VolumeMaker,
    encoder: Encoder,
    writer: PacketWriter<Vec<u8>>,
    frames: u64,
    kinds: BytesByKind,
    /// Quality of colour, 0 to 100, and the preset, for captures that have any; profile `paper` has none.
    colour_quality: Option<(f32, Preset)>,
    /// The coder of colour, from the first frame on, if that has any.
    colour: Option<(ColourEncoder, ColourSettings)>,
}

/// Layers of samples of colour: the default of `isv encode`.
const COLOUR_LAYERS: ColourLayers = ColourLayers::HalfVoxels;

/// The quality whose step a step is, in voxels: geometry and colour of a point have one quality.
fn quality_of_step(step: f32) -> f32 {
    let [coarsest, finest] = [0.0, 100.0].map(|quality| FrameQuality::of_quality(quality).step);
    (100.0 * (step / coarsest).ln() / (finest / coarsest).ln()).clamp(0.0, 100.0)
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
        Self::new(
            profile,
            EncoderSettings { motion, ..EncoderSettings::default() },
            None,
            frame_rate,
            settings,
        )
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
        let encoder = EncoderSettings { main, ..EncoderSettings::default() };
        let colour = Some((quality_of_step(step as f32), preset));
        Self::new(Profile::Main, encoder, colour, frame_rate, settings)
    }

    fn new(
        profile: Profile,
        encoder: EncoderSettings,
        colour_quality: Option<(f32, Preset)>,
        frame_rate: FrameRate,
        settings: &StudySettings,
    ) -> Result<Self, StudyError> {
        let header = StreamHeader::newest(profile, settings.ingest.grid, frame_rate);
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
            colour_quality,
            colour: None,
        })
    }

    /// Makes this a stream with colour if its first frame has any. Its header is written anew, as nothing else is written yet.
    fn begin(&mut self, first: &TriangleMesh) -> Result<(), StudyError> {
        let Some((quality, preset)) = self.colour_quality.filter(|_| first.appearance.is_some()) else {
            return Ok(());
        };
        self.header = self.header.with_colour(COLOUR_LAYERS);
        self.writer = PacketWriter::new(Vec::new(), &self.header)?;
        let settings = ColourSettings::of_quality(quality, COLOUR_LAYERS.count()).with_preset(preset);
        self.colour = Some((ColourEncoder::new(settings), settings));
        Ok(())
    }
}

impl Encoding for IsvEncoding {
    fn encode(&mut self, mesh: &TriangleMesh) -> Result<EncodedFrame, StudyError> {
        if self.frames == 0 {
            self.begin(mesh)?;
        }
        let (volume, prepare_ms) = self.volumes.make(mesh)?;
        let (frame, encode_ms) = timed(|| self.encoder.encode(&volume));
        let timestamp_ns = self.header.frame_rate.timestamp_ns(self.frames);
        let colour = self.colour.as_mut().map(|(encoder, settings)| {
            let decoded = self.encoder.reconstruction().expect("a frame was just coded");
            let spacing_m = f64::from(settings.spacing) * self.header.grid.voxel_size.metres();
            timed(|| encoder.encode(decoded, &mesh_colours(mesh, spacing_m), frame.keyframe))
        });
        let (colour, colour_ms) = colour.map_or((None, None), |(colour, ms)| (Some(colour.bytes), Some(ms)));
        let (keyframe, payload) = (frame.keyframe, frame.payload());
        let bytes =
            self.writer.write_coloured_frame(keyframe, timestamp_ns, &payload, colour.as_deref())? as u64;
        self.kinds.colour += colour.map_or(0.0, |colour| colour.len() as f64);
        self.frames += 1;
        self.kinds.occupancy += (frame.bytes_blocks() - frame.bytes_masks()) as f64;
        self.kinds.masks += frame.bytes_masks() as f64;
        self.kinds.motion += frame.bytes_modes() as f64;
        self.kinds.dc += frame.bytes_dc();
        self.kinds.ac += frame.bytes_coefficients() as f64 - frame.bytes_dc();
        Ok(EncodedFrame { bytes, prepare_ms, encode_ms, colour_ms, memory: Memory::OfThisProcess })
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

    fn bytes_colour(&self) -> u64 {
        self.kinds.colour as u64
    }

    fn kinds(&self) -> Option<BytesByKind> {
        Some(self.kinds)
    }

    fn decode(
        &self,
        colour: bool,
    ) -> Result<Box<dyn Iterator<Item = Result<DecodedFrame, StudyError>> + '_>, StudyError> {
        let mut reader = PacketReader::new(&self.bytes[..])?;
        let header = *reader.header();
        let mut decoder = Decoder::new(&header, Limits::default());
        decoder.keep_colour(colour);
        Ok(Box::new(std::iter::from_fn(move || {
            let packet = match reader.next_frame() {
                Ok(packet) => packet?,
                Err(error) => return Some(Err(error.into())),
            };
            let (mesh, ms) = timed(|| {
                let mut mesh = surface(decoder.decode(&packet)?.volume);
                if let Some(colour) = decoder.colour() {
                    add_tile_texture(&mut mesh, colour, &header.grid);
                }
                Ok::<_, DecodeError>(mesh)
            });
            Some(
                mesh.map(|mesh| DecodedFrame {
                    shape: Geometry::Mesh(mesh),
                    ms,
                    memory: Memory::OfThisProcess,
                })
                .map_err(Into::into),
            )
        })))
    }

    fn isv_file(&self) -> Option<&[u8]> {
        Some(&self.bytes)
    }
}
