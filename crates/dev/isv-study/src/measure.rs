//! Encode, decode, compare: one codec at one point.

use crate::codec::PointGeometry;
use crate::cubes::cubes;
use crate::memory::{peak_bytes, reset_peak};
use crate::record::Timing;
use crate::session::{
    DracoEncoding, DracoVideoEncoding, Encoding, GltfpackEncoding, IsvEncoding, Memory, Stream, TangEncoding,
    Tmc2Encoding, Tmc13Encoding, VdmcEncoding,
};
use crate::{Codec, OperatingPoint, Record, Scale, StudyError, Training};
use isv::raw::format::FrameRate;
use isv::raw::ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv::raw::io::Geometry;
use isv::raw::metrics::{
    ColourError, CompareOptions, GeometryError, Shape, colour_summary, compare, compare_colours,
    compare_views, summary,
};
use isv::raw::volume::TriangleMesh;
use isv_baseline::{
    BlockBasis, BlockMoments, Draco, Gltfpack, TextureVideo, Tmc2, Tmc13, Tmc13Geometry, Tools, Vdmc,
    VideoSettings,
};

/// Most points of a frame that are drawn as cubes, to compare pictures: 4 GB of memory. Of more there are no such figures.
const MOST_DRAWN_POINTS: usize = 4_000_000;

/// An error of whoever provides a take.
pub type TakeError = Box<dyn std::error::Error + Send + Sync>;

/// Frames of a take, one after the other.
pub type TakeFrames<'a> = Box<dyn Iterator<Item = Result<TriangleMesh, TakeError>> + 'a>;

/// A sequence of meshes that can be read again and again.
pub trait Take {
    /// What to call it.
    fn name(&self) -> &str;

    /// Number of frames.
    fn frames(&self) -> usize;

    /// Frames a second.
    fn frame_rate(&self) -> FrameRate;

    /// Reads it from the first frame on.
    ///
    /// # Errors
    /// What stands in the way.
    fn meshes(&self) -> Result<TakeFrames<'_>, TakeError>;
}

/// What all codecs of a study have in common.
#[derive(Clone, Copy, Debug)]
pub struct StudySettings {
    /// Grid of the codecs of volumes, and how meshes become volumes.
    pub ingest: MeshIngest,
    /// A keyframe every this many frames, for the codecs that have others.
    pub gop: u32,
    /// How decoded frames are compared with those that went in.
    pub compare: CompareOptions,
    /// Place in the take of the frame whose decoded mesh is kept for the pictures.
    pub picture_frame: usize,
    /// Number, in what the take is a part of, of its first frame: messages name frames by it.
    pub first_frame: usize,
}

impl StudySettings {
    /// Places in a take of so many frames of those that a contact sheet shows, each once.
    #[must_use]
    pub fn sheet_frames(&self, frames: usize) -> Vec<usize> {
        let mut shown = vec![0, self.picture_frame, frames.saturating_sub(1)];
        shown.dedup();
        shown
    }

    /// Settings of published codecs, which make shells of open surfaces (Eq. 9) unless another way was asked for.
    #[must_use]
    pub fn published_ingest(&self) -> MeshIngest {
        let sign = if self.ingest.sign == SignMode::Auto { SignMode::Paper } else { self.ingest.sign };
        MeshIngest { sign, ..self.ingest }
    }
}

/// A codec ready to be measured on a take: with its transform trained, its program found.
pub struct Subject<'a> {
    codec: Codec,
    take: &'a dyn Take,
    settings: &'a StudySettings,
    scale: Scale,
    needed: Needed,
}

/// What a codec needs beside the take.
enum Needed {
    /// Nothing.
    Nothing,
    /// A trained transform.
    Basis(Box<BlockBasis>),
    /// The programs of another codec.
    Draco(Draco),
    DracoVideo(Draco, TextureVideo),
    Gltfpack(Gltfpack),
    Tmc13(Tmc13),
    Tmc2(Tmc2),
    Vdmc(Vdmc),
}

/// What came of a point.
pub struct Measured {
    /// The figures; the key is left empty.
    pub record: Record,
    /// The decoded picture frame.
    pub picture: Geometry,
    /// The stream, where other commands can read it.
    pub isv_file: Option<Vec<u8>>,
    /// Decoded frames of a stream that other commands cannot read, each with its place in the take: those of
    /// [`StudySettings::sheet_frames`].
    pub sheet_frames: Vec<(usize, Geometry)>,
}

impl<'a> Subject<'a> {
    /// Prepares a codec for all its points on a take. `Ok(None)` if it cannot run here, because its program is not installed.
    ///
    /// # Errors
    /// A take that cannot be read, or nothing to train on.
    pub fn prepare(
        codec: Codec,
        take: &'a dyn Take,
        training: &[&dyn Take],
        settings: &'a StudySettings,
        tools: &Tools,
    ) -> Result<Option<Self>, StudyError> {
        let basis =
            |takes: &[&dyn Take]| Ok::<_, StudyError>(Needed::Basis(Box::new(train(takes, settings)?)));
        let needed = match codec {
            Codec::Paper(_) | Codec::Main(_) => Some(Needed::Nothing),
            Codec::Tang(Training::Scene) => Some(basis(&[take])?),
            Codec::Tang(Training::CrossScene) if training.is_empty() => return Err(StudyError::NoTraining),
            Codec::Tang(Training::CrossScene) => Some(basis(training)?),
            Codec::Draco { .. } => Draco::find_in(tools).map(Needed::Draco),
            Codec::DracoVideo { .. } => Draco::find_in(tools)
                .zip(TextureVideo::find(tools)?)
                .map(|(draco, video)| Needed::DracoVideo(draco, video)),
            Codec::Gltfpack { .. } => Gltfpack::find(tools)?.map(Needed::Gltfpack),
            Codec::Tmc13(_) => Tmc13::find(tools)?.map(Needed::Tmc13),
            Codec::Tmc2 => Tmc2::find(tools)?.map(Needed::Tmc2),
            Codec::Vdmc => Vdmc::find(tools)?.map(Needed::Vdmc),
        };
        let Some(needed) = needed else { return Ok(None) };
        Ok(Some(Self { codec, take, settings, scale: scale(take, settings)?, needed }))
    }

    /// The points at which the codec is measured, as [`Codec::points`].
    #[must_use]
    pub fn points(&self, count: usize) -> Vec<OperatingPoint> {
        self.codec.points(self.scale, count)
    }

    /// The codec's encoder at a point.
    fn encoding(&self, point: OperatingPoint) -> Result<Box<dyn Encoding>, StudyError> {
        let settings = self.settings;
        let first = settings.first_frame;
        let colour_qp = Codec::colour_qp(self.scale, point);
        Ok(match (self.codec, point, &self.needed) {
            (Codec::Paper(motion), OperatingPoint::Steps { coefficients, dc_step_m, ac_step_m }, _) => {
                let (steps, rate) = ([dc_step_m, ac_step_m], self.take.frame_rate());
                Box::new(IsvEncoding::paper(motion, coefficients, steps, rate, settings)?)
            }
            (Codec::Main(preset), OperatingPoint::Step { step_m }, _) => {
                Box::new(IsvEncoding::main(preset, step_m, self.take.frame_rate(), settings)?)
            }
            (Codec::Tang(_), OperatingPoint::UniformStep { coefficients, step_m }, Needed::Basis(basis)) => {
                Box::new(TangEncoding::new(basis, coefficients, step_m, settings)?)
            }
            (Codec::Draco { faces_percent }, OperatingPoint::PositionBits(bits), Needed::Draco(draco)) => {
                Box::new(DracoEncoding::new(draco, faces_percent, bits, first))
            }
            (
                Codec::DracoVideo { faces_percent },
                OperatingPoint::BitsAndVideo { bits, crf },
                Needed::DracoVideo(draco, video),
            ) => {
                let texture = VideoSettings { crf, gop: settings.gop, frame_rate: self.take.frame_rate() };
                Box::new(DracoVideoEncoding::new(draco, video, faces_percent, bits, texture, first)?)
            }
            (
                Codec::Gltfpack { faces_percent },
                OperatingPoint::PositionBits(bits),
                Needed::Gltfpack(gltfpack),
            ) => Box::new(GltfpackEncoding::new(gltfpack, faces_percent, bits, first)),
            (
                Codec::Tmc13(PointGeometry::Octree),
                OperatingPoint::PositionBits(bits),
                Needed::Tmc13(tmc13),
            ) => Box::new(Tmc13Encoding::new(tmc13, Tmc13Geometry::Octree, bits, colour_qp, first)),
            (
                Codec::Tmc13(PointGeometry::Trisoup),
                OperatingPoint::Nodes { bits, size_log2 },
                Needed::Tmc13(tmc13),
            ) => {
                let geometry = Tmc13Geometry::Trisoup { node_size_log2: size_log2 };
                Box::new(Tmc13Encoding::new(tmc13, geometry, bits, colour_qp, first))
            }
            (Codec::Tmc2, OperatingPoint::TestRate { bits, rate }, Needed::Tmc2(tmc2)) => {
                Box::new(Tmc2Encoding::new(tmc2, bits, rate))
            }
            (Codec::Vdmc, OperatingPoint::TestRate { rate, .. }, Needed::Vdmc(vdmc)) => {
                Box::new(VdmcEncoding::new(vdmc, rate))
            }
            _ => panic!("{point} is no point of {}", self.codec),
        })
    }

    /// Encodes the take at a point, decodes its bytes, and compares every frame with what went in. `step` is called after
    /// each frame of each of the two passes: encoding, and comparing what was decoded.
    ///
    /// # Errors
    /// What went wrong first, with the number of the frame.
    ///
    /// # Panics
    /// If the point is of another kind of codec.
    pub fn measure(&self, point: OperatingPoint, step: &mut dyn FnMut()) -> Result<Measured, StudyError> {
        let encoded = self.encode(point, step)?;
        let decoded = time_decoding(&*encoded.stream)?;
        let Compared { frame_errors, frame_colour_errors, picture, sheet_frames } =
            self.compare_frames(&*encoded.stream, step)?;
        let frames = encoded.frame_bytes.len();
        if frame_errors.len() != frames {
            return Err(StudyError::FrameCount { encoded: frames, decoded: frame_errors.len() });
        }
        let no_frames = || StudyError::NoFrames { take: self.take.name().to_owned() };
        let record = Record {
            key: String::new(),
            codec: self.codec.to_string(),
            point: point.to_string(),
            frames_per_second: self.take.frame_rate().per_second(),
            bytes: encoded.stream.bytes(),
            bytes_colour: encoded.stream.bytes_colour(),
            frame_bytes: encoded.frame_bytes,
            kinds: encoded.stream.kinds(),
            prepare_ms: Timing::from_ms(encoded.prepare_ms),
            encode_ms: Timing::from_ms(encoded.encode_ms),
            colour_encode_ms: encoded.colour_ms.map(Timing::from_ms),
            decode_ms: Timing::from_ms(decoded.ms),
            encode_peak_bytes: encoded.peak_bytes,
            decode_peak_bytes: decoded.peak_bytes,
            error: summary(&frame_errors).ok_or_else(no_frames)?,
            frame_errors,
            colour_error: colour_summary(&frame_colour_errors),
            frame_colour_errors,
            point_step_m: encoded.stream.point_step_m(),
            programs: encoded.stream.programs(),
        };
        Ok(Measured {
            record,
            picture: picture.ok_or_else(no_frames)?,
            isv_file: encoded.stream.isv_file().map(<[u8]>::to_vec),
            sheet_frames,
        })
    }

    fn encode(&self, point: OperatingPoint, step: &mut dyn FnMut()) -> Result<Encoded, StudyError> {
        let (mut frame_bytes, mut prepare_ms, mut encode_ms) = (Vec::new(), Vec::new(), Vec::new());
        let (mut colour_ms, mut memory) = (Vec::new(), Vec::new());
        let alone = reset_peak();
        let mut encoding = self.encoding(point)?;
        for mesh in self.take.meshes().map_err(StudyError::Take)? {
            let frame = encoding.encode(&mesh.map_err(StudyError::Take)?)?;
            frame_bytes.push(frame.bytes);
            prepare_ms.push(frame.prepare_ms);
            encode_ms.push(frame.encode_ms);
            colour_ms.extend(frame.colour_ms);
            memory.push(frame.memory);
            step();
        }
        let stream = encoding.finish()?;
        if let Some(whole) = stream.whole_take() {
            // Frames have equal shares: the program tells of none alone.
            let frames = frame_bytes.len() as u64;
            frame_bytes = (0..frames)
                .map(|i| stream.bytes() / frames + u64::from(i < stream.bytes() % frames))
                .collect();
            encode_ms = vec![whole.encode_ms / frames as f64; frame_bytes.len()];
            colour_ms = whole.colour_ms.map_or(Vec::new(), |ms| vec![ms / frames as f64; frame_bytes.len()]);
            memory.push(whole.memory);
        }
        Ok(Encoded {
            stream,
            frame_bytes,
            prepare_ms,
            encode_ms,
            colour_ms: (!colour_ms.is_empty()).then_some(colour_ms),
            peak_bytes: Memory::peak(&memory, peak_bytes().filter(|_| alone)),
        })
    }

    /// Decodes again, with colour, and compares.
    fn compare_frames(&self, stream: &dyn Stream, step: &mut dyn FnMut()) -> Result<Compared, StudyError> {
        let mut compared = Compared::default();
        let shown = self.settings.sheet_frames(self.take.frames());
        for (original, decoded) in self.take.meshes().map_err(StudyError::Take)?.zip(stream.decode(true)?) {
            let (original, decoded) = (original.map_err(StudyError::Take)?, decoded?);
            let frame = compared.frame_errors.len();
            let number = self.settings.first_frame + frame;
            let in_frame = |cause| StudyError::Compare { frame: number, cause };
            let options = &self.settings.compare;
            let test = match &decoded.shape {
                Geometry::Mesh(mesh) => Shape::Mesh(mesh),
                Geometry::Points(points) => Shape::Points(points),
            };
            compared.frame_errors.push(compare(&original, test, options).map_err(in_frame)?);
            let mut colours = compare_colours(&original, test, options).map_err(in_frame)?;
            let has_colours = match &decoded.shape {
                Geometry::Mesh(mesh) => mesh.appearance.is_some(),
                Geometry::Points(points) => !points.colours.is_empty(),
            };
            if let Geometry::Points(points) = &decoded.shape
                && has_colours
                && original.appearance.is_some()
                && points.positions.len() <= MOST_DRAWN_POINTS
            {
                let step_m = stream.point_step_m().unwrap_or_default();
                let views = compare_views(&original, &cubes(points, step_m));
                colours.render_y_psnr_db = views.y_psnr_db;
                colours.render_ssim = views.ssim;
            }
            compared.frame_colour_errors.push(colours);
            if stream.isv_file().is_none() && shown.contains(&frame) {
                compared.sheet_frames.push((frame, decoded.shape.clone()));
            }
            if frame == self.settings.picture_frame {
                compared.picture = Some(decoded.shape);
            }
            step();
        }
        Ok(compared)
    }
}

/// The size of a take by its first frame.
fn scale(take: &dyn Take, settings: &StudySettings) -> Result<Scale, StudyError> {
    let first = take.meshes().map_err(StudyError::Take)?.next();
    let first = first.ok_or_else(|| StudyError::NoFrames { take: take.name().to_owned() })?;
    Ok(Scale::new(&first.map_err(StudyError::Take)?, &settings.ingest.grid))
}

/// The transform trained on all frames of some takes.
fn train(takes: &[&dyn Take], settings: &StudySettings) -> Result<BlockBasis, StudyError> {
    let training = |cause| StudyError::Training { take: takes[0].name().to_owned(), cause };
    let mut moments = BlockMoments::new(&settings.ingest.grid).map_err(training)?;
    for take in takes {
        let (ingest, mut sign) = (settings.published_ingest(), None);
        for (frame, mesh) in take.meshes().map_err(StudyError::Take)?.enumerate() {
            let mesh = mesh.map_err(StudyError::Take)?;
            let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
            let volume = ingest_mesh(&mesh, &ingest, sign);
            moments.add(&volume.map_err(|cause| StudyError::Ingest { frame, cause })?);
        }
    }
    moments.klt().map_err(training)
}

/// A take as coded, and what that took.
struct Encoded {
    stream: Box<dyn Stream>,
    frame_bytes: Vec<u64>,
    prepare_ms: Vec<f64>,
    encode_ms: Vec<f64>,
    colour_ms: Option<Vec<f64>>,
    peak_bytes: Option<u64>,
}

/// Errors of a decoded take.
#[derive(Default)]
struct Compared {
    frame_errors: Vec<GeometryError>,
    frame_colour_errors: Vec<ColourError>,
    /// The decoded picture frame.
    picture: Option<Geometry>,
    /// Frames for [`Measured::sheet_frames`].
    sheet_frames: Vec<(usize, Geometry)>,
}

/// What decoding took.
struct Decoding {
    ms: Vec<f64>,
    peak_bytes: Option<u64>,
}

/// Decodes all geometry for the sake of time and memory alone: comparing would blur both.
fn time_decoding(stream: &dyn Stream) -> Result<Decoding, StudyError> {
    let (mut ms, mut memory) = (Vec::new(), Vec::new());
    let alone = reset_peak();
    for frame in stream.decode(false)? {
        let frame = frame?;
        ms.push(frame.ms);
        memory.push(frame.memory);
    }
    Ok(Decoding { ms, peak_bytes: Memory::peak(&memory, peak_bytes().filter(|_| alone)) })
}
