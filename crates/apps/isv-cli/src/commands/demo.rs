//! `isv demo`: the whole codec on a figure of its own.

use crate::output::{Output, check_frame_output, check_stream_output, frames_in_words, print};
use crate::output_name;
use crate::progress::Progress;
use crate::stats::megabits_per_second;
use crate::table::table_of;
use anyhow::{Context, Result};
use isv::raw::decode::{Decoder, Limits};
use isv::raw::encode::{Encoder, EncoderSettings, MotionMode, Preset, surface_rms_voxels};
use isv::raw::format::{
    FrameRate, PacketReader, PacketWriter, PaperParameters, Prediction, Profile, StreamHeader,
};
use isv::raw::ingest::{MeshIngest, SignDecision, decide_sign, ingest_mesh};
use isv::raw::io::{Format, write_mesh};
use isv::raw::metrics::{CompareOptions, compare};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::take::StreamFault;
use isv::raw::take::stream::timed;
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use isv_figure::{BOUNDS_M, figure_mesh};
use isv_render::{Camera, ErrorScale, Picture, Style, colour_bar, contact_sheet, render, render_errors};
use isv_spatial::Bvh;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The codecs shown: the paper's best, and profile `main` under its presets.
const CODECS: [DemoCodec; 4] = [
    DemoCodec::Paper,
    DemoCodec::Main(Preset::Realtime),
    DemoCodec::Main(Preset::Balanced),
    DemoCodec::Main(Preset::Archive),
];

/// The codec whose results are written to files: what `isv encode` does by default.
const KEPT: DemoCodec = DemoCodec::Main(Preset::Balanced);

/// A codec of the demo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DemoCodec {
    /// Profile `paper`, 3-DoF motion, at its steps for people.
    Paper,
    /// Profile `main`.
    Main(Preset),
}

impl DemoCodec {
    fn name(self) -> String {
        match self {
            Self::Paper => "paper, 3dof".to_owned(),
            Self::Main(preset) => format!("main, {preset}"),
        }
    }

    fn profile(self) -> Profile {
        match self {
            // A step is in sixteenths of a code, of which a voxel of 5 mm has 256: 1 mm and 10 mm.
            Self::Paper => Profile::Paper(PaperParameters {
                coefficients: 64,
                dc_step: 16 * 256 / 5,
                ac_step: 16 * 256 * 10 / 5,
            }),
            Self::Main(_) => Profile::Main,
        }
    }

    fn settings(self) -> EncoderSettings {
        let usual = EncoderSettings { checksums: true, ..EncoderSettings::default() };
        match self {
            Self::Paper => EncoderSettings { motion: MotionMode::Fixed(Prediction::ThreeDof), ..usual },
            Self::Main(preset) => EncoderSettings { main: preset.settings(), ..usual },
        }
    }
}

const FRAME_RATE: FrameRate = FrameRate { numerator: 30, denominator: 1 };

/// What is written into the folder: the stream, the pictures, and the folder of the meshes.
const STREAM: &str = "figure.isv";
const PICTURES: &str = "comparison.png";
const MESHES: &str = "decoded";

/// Frames that are measured and drawn.
const PICKS: usize = 4;

/// Width and height in pixels of each picture.
const PICTURE: [usize; 2] = [440, 390];

/// Distance at which the colours of errors end, in metres.
const ERROR_RANGE_M: f64 = 0.002;

/// Voxels that the figure itself is modelled with: not those it is coded with, as no capture would have those.
const MODEL_VOXEL_M: f64 = 0.008;

/// Try it without any input: animate a figure, encode and decode it, measure the error, draw it
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder for the stream, the pictures and the meshes; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "isv-demo")]
    output: PathBuf,
    /// How many frames, at 30 a second
    #[arg(long, value_name = "N", default_value = "24", value_parser = clap::value_parser!(u16).range(1..=300))]
    frames: u16,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<()> {
    let folder = args.output.display();
    output_name::check_folder(&args.output, "a stream, pictures and meshes")?;
    check_free(&args.output, usize::from(args.frames))?;
    std::fs::create_dir_all(&args.output).with_context(|| format!("{folder}: cannot make this folder"))?;
    let take = Take::film(usize::from(args.frames))?;
    let mut table = table_of([
        "profile",
        "Mbps",
        "bytes a frame",
        "surface RMS mm",
        "p2s mean mm",
        "encode ms a frame",
        "decode ms a frame",
    ]);
    for codec in CODECS {
        let coded = take.encode(codec)?;
        let decoded = take.decode(&coded.bytes)?;
        table.add_row(take.row(codec, &coded, &decoded)?);
        if codec == KEPT {
            take.write_files(&args.output, &coded, &decoded)?;
        }
    }
    print(&format!(
        "A figure of {} triangles, {}, voxels of 5mm, decoded volumes verified by hash:\n\n{}\n\n\
         {folder}/{STREAM}       the stream of profile {}; isv info, verify, decode and render read it\n\
         {folder}/{PICTURES}   frames as they were, the same frames decoded, and how far they are apart\n\
         {folder}/{MESHES}          these frames as PLY files",
        take.shown[0].triangles.len(),
        frames_in_words(take.volumes.len()),
        table.trim_fmt(),
        KEPT.name(),
    ))
}

/// Refuses to overwrite what isv did not write.
fn check_free(folder: &Path, frames: usize) -> Result<()> {
    check_stream_output(&[], &folder.join(STREAM))?;
    check_frame_output(&folder.join(PICTURES))?;
    picks(frames).into_iter().try_for_each(|frame| check_frame_output(&folder.join(mesh_name(frame))))
}

fn mesh_name(frame: usize) -> String {
    format!("{MESHES}/frame_{frame:04}.ply")
}

/// The frames to be coded.
struct Take {
    grid: Grid,
    volumes: Vec<SparseVolume>,
    /// Numbers of the frames that are measured and drawn.
    picks: Vec<usize>,
    /// Their meshes.
    shown: Vec<TriangleMesh>,
}

/// A take as coded by one codec.
struct Coded {
    bytes: Vec<u8>,
    /// Mean over frames.
    surface_rms_mm: f64,
    /// All frames.
    encode_ms: f64,
}

/// What came back from the bytes.
struct Decoded {
    /// The frames that are measured and drawn.
    shown: Vec<TriangleMesh>,
    /// All frames.
    decode_ms: f64,
}

impl Take {
    /// Animates the figure and samples its distance field.
    fn film(frames: usize) -> Result<Self> {
        let grid = grid()?;
        let picks = picks(frames);
        let progress = Progress::new(Some(frames), "animating");
        let (mut volumes, mut shown) = (Vec::new(), Vec::new());
        let ingest = MeshIngest::new(grid);
        let mut sign: Option<SignDecision> = None;
        for frame in 0..frames {
            let time_s = frame as f64 / FRAME_RATE.per_second();
            let mesh = figure_mesh(time_s, VoxelSize::from_metres(MODEL_VOXEL_M)?);
            let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
            volumes.push(ingest_mesh(&mesh, &ingest, sign)?);
            if picks.contains(&frame) {
                shown.push(mesh);
            }
            progress.step();
        }
        Ok(Self { grid, volumes, picks, shown })
    }

    fn encode(&self, codec: DemoCodec) -> Result<Coded> {
        let progress = Progress::new(Some(self.volumes.len()), "encoding");
        let header = StreamHeader { profile: codec.profile(), grid: self.grid, frame_rate: FRAME_RATE };
        let mut encoder = Encoder::new(&header, codec.settings());
        let mut writer = PacketWriter::new(Vec::new(), &header)?;
        let (mut surface_rms, mut encode_ms) = (0.0, 0.0);
        for (frame, volume) in self.volumes.iter().enumerate() {
            let (coded, ms) = timed(|| encoder.encode(volume));
            let timestamp_ns = FRAME_RATE.timestamp_ns(frame as u64);
            writer.write_frame(coded.keyframe, timestamp_ns, &coded.payload())?;
            let decoded = encoder.reconstruction().expect("a frame was just encoded");
            surface_rms += surface_rms_voxels(volume, decoded);
            encode_ms += ms;
            progress.step();
        }
        let voxel_mm = self.grid.voxel_size.metres() * 1e3;
        let surface_rms_mm = surface_rms / self.volumes.len() as f64 * voxel_mm;
        Ok(Coded { bytes: writer.finish()?, surface_rms_mm, encode_ms })
    }

    /// Decodes the bytes; every volume must have the hash of the encoder's.
    fn decode(&self, bytes: &[u8]) -> Result<Decoded> {
        let progress = Progress::new(Some(self.volumes.len()), "decoding");
        let mut packets = PacketReader::new(bytes)?;
        let header = packets.header().context("the figure's stream has no header")?;
        let mut decoder = Decoder::new(header, Limits::default());
        let mut decoded = Decoded { shown: Vec::new(), decode_ms: 0.0 };
        let mut frame = 0;
        while let Some(packet) = packets.next_frame()? {
            let (result, ms) = timed(|| decoder.decode_and_verify(&packet));
            let volume =
                result.map_err(|error| StreamFault::from(error).in_stream("the figure's stream"))?.volume;
            if self.picks.contains(&frame) {
                decoded.shown.push(extract_surface(volume, &SurfaceOptions { normals: true }));
            }
            decoded.decode_ms += ms;
            frame += 1;
            progress.step();
        }
        Ok(decoded)
    }

    fn row(&self, codec: DemoCodec, coded: &Coded, decoded: &Decoded) -> Result<Vec<String>> {
        let frames = self.volumes.len();
        let bytes = coded.bytes.len();
        let mut p2s_mean_mm = 0.0;
        for (original, decoded) in self.shown.iter().zip(&decoded.shown) {
            let error = compare(original, decoded, &CompareOptions::default())?;
            p2s_mean_mm += error.p2s_mean_mm.expect("both are surfaces");
        }
        Ok(vec![
            codec.name(),
            format!("{:.2}", megabits_per_second(bytes as u64, frames as f64 / FRAME_RATE.per_second())),
            (bytes / frames).to_string(),
            format!("{:.3}", coded.surface_rms_mm),
            format!("{:.3}", p2s_mean_mm / self.shown.len() as f64),
            format!("{:.0}", coded.encode_ms / frames as f64),
            format!("{:.0}", decoded.decode_ms / frames as f64),
        ])
    }

    fn write_files(&self, folder: &Path, coded: &Coded, decoded: &Decoded) -> Result<()> {
        let mut stream = Output::create(&folder.join(STREAM))?;
        stream.write_all(&coded.bytes)?;
        stream.commit()?;

        let mut picture = Output::create(&folder.join(PICTURES))?;
        self.comparison(decoded).write_png(&mut picture)?;
        picture.commit()?;

        let meshes = folder.join(MESHES);
        let sentence = || format!("{}: cannot make this folder", meshes.display());
        std::fs::create_dir_all(&meshes).with_context(sentence)?;
        for (frame, mesh) in self.picks.iter().zip(&decoded.shown) {
            write_mesh(&folder.join(mesh_name(*frame)), mesh, Format::Ply)?;
        }
        Ok(())
    }

    /// Frames as they were, below them as they come back, and below that how far the two are apart.
    fn comparison(&self, decoded: &Decoded) -> Picture {
        let camera = Camera::fitting(BOUNDS_M, PICTURE).from_direction(25.0, 5.0);
        let (style, scale) = (Style::default(), ErrorScale::new(ERROR_RANGE_M).expect("a length"));
        let mut pictures: Vec<_> =
            self.shown.iter().chain(&decoded.shown).map(|mesh| render(mesh, &camera, &style)).collect();
        for (original, decoded) in self.shown.iter().zip(&decoded.shown) {
            let original = Bvh::new(original);
            let distance = |point| original.distance(point);
            pictures.push(render_errors(decoded, &camera, &style, &scale, distance).picture);
        }
        let sheet = contact_sheet(&pictures, self.shown.len());
        sheet.above(&colour_bar(&scale, sheet.size()[0], style.background))
    }
}

/// What `isv encode` takes by default.
fn grid() -> Result<Grid> {
    Ok(Grid {
        voxel_size: VoxelSize::from_metres(0.005)?,
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(8)?,
    })
}

/// Numbers of up to [`PICKS`] frames, from the first to the last, evenly spaced.
fn picks(frames: usize) -> Vec<usize> {
    let count = PICKS.min(frames);
    (0..count).map(|i| i * (frames - 1) / (count - 1).max(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_spread_over_all_frames() {
        assert_eq!(picks(24), [0, 7, 15, 23]);
        assert_eq!(picks(3), [0, 1, 2]);
        assert_eq!(picks(1), [0]);
    }
}
