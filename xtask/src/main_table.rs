//! Profile `main` on a real sequence: rate, error and time under several settings.

use crate::takes::{Sequence, decode_stream};
use anyhow::{Context, Result, bail, ensure};
use isv::raw::encode::{
    Band, Bitrate, EncodedFrame, Encoder, EncoderSettings, FrameQuality, MainSettings, Preset, RateTarget,
};
use isv::raw::format::{FrameRate, PacketWriter, Profile, StreamHeader};
use isv::raw::ingest::{MeshIngest, decide_sign, ingest_mesh};
use isv::raw::metrics::{CompareOptions, GeometryError, compare};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use isv_study::Take;
use std::path::Path;
use std::time::Instant;

/// Measures the first `frames` frames of a folder of meshes in metres, once for each of `settings`, and
/// prints a table. With `to_and_fro` they are played there and back until there are so many: a longer take of the same kind. The settings are lists such as `step=2.2,trials=1`.
pub(crate) fn run(
    folder: &str,
    frames: usize,
    voxel_mm: f64,
    to_and_fro: Option<usize>,
    settings: &[String],
) -> Result<()> {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_mm / 1000.0)?,
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let header = StreamHeader::newest(Profile::Main, grid, FrameRate::DEFAULT);
    let ingest = MeshIngest::new(grid);
    let (mut meshes, mut volumes, mut sign) = (Vec::new(), Vec::new(), None);
    for mesh in Sequence::open(Path::new(folder), frames)?.meshes().map_err(anyhow::Error::from_boxed)? {
        let mesh = mesh.map_err(anyhow::Error::from_boxed)?;
        let sign = *sign.get_or_insert_with(|| decide_sign(&mesh, ingest.sign).0);
        volumes.push(ingest_mesh(&mesh, &ingest, sign)?);
        meshes.push(mesh);
    }
    ensure!(!volumes.is_empty(), "{folder} has no frames");
    if let Some(length) = to_and_fro {
        let there_and_back = (0..volumes.len()).chain((1..volumes.len().saturating_sub(1)).rev());
        let order: Vec<usize> = there_and_back.cycle().take(length).collect();
        volumes = order.iter().map(|frame| volumes[*frame].clone()).collect();
        meshes = order.iter().map(|frame| meshes[*frame].clone()).collect();
    }
    println!(
        "| settings | file, Mbps | GOP 30, Mbps | keyframe, B | P-frame, B | blocks | masks | modes | coefficients | bits of \
         occupancy a block | point to surface, mm | Hausdorff, mm | normals, degrees | components | encode, ms | decode, ms |"
    );
    println!("|{}", "---|".repeat(16));
    let none = [String::new()];
    for text in if settings.is_empty() { &none[..] } else { settings } {
        let row = measure(&header, &parse(text)?, &meshes, &volumes)?;
        println!("| {text} {row}");
    }
    Ok(())
}

/// Settings from a list of `name=value`.
fn parse(text: &str) -> Result<EncoderSettings> {
    let mut settings = EncoderSettings::default();
    let main: &mut MainSettings = &mut settings.main;
    for pair in text.split(',').filter(|pair| !pair.is_empty()) {
        let (name, value) = pair.split_once('=').context("settings are name=value")?;
        match name {
            "step" => main.quality.step = value.parse()?,
            "lambda" => main.quality = FrameQuality { lambda: value.parse()?, ..main.quality },
            "trials" => main.trials = value.parse()?,
            "filter" => main.filter.0 = value.parse()?,
            "filter_search" => main.filter_search = value.parse()?,
            "refinement" => main.refinement = value.parse()?,
            "keyframe_lambda" => main.keyframe_lambda = value.parse()?,
            "half" => main.half_voxel_vectors = value.parse()?,
            "preset" => *main = preset(value)?.settings(),
            "quality" => main.quality = FrameQuality::of_quality(value.parse()?),
            "error" => main.target = RateTarget::MaxError(value.parse()?),
            "mbps" => {
                main.target = RateTarget::Bitrate(Bitrate::new(1e6 * value.parse::<f64>()?, 30.0));
            }
            "without" => main.tools = main.tools.without(value)?,
            "band" if value == "full" => main.band = Band::Full,
            "slices" => settings.slices = Some(value.parse()?),
            "gop" => settings.gop = value.parse()?,
            _ => bail!("there is no setting {name}"),
        }
    }
    Ok(settings)
}

fn preset(name: &str) -> Result<Preset> {
    let found = Preset::ALL.into_iter().find(|preset| format!("{preset:?}").eq_ignore_ascii_case(name));
    found.with_context(|| format!("there is no preset {name}"))
}

fn measure(
    header: &StreamHeader,
    settings: &EncoderSettings,
    meshes: &[TriangleMesh],
    volumes: &[SparseVolume],
) -> Result<String> {
    let mut encoder = Encoder::new(header, *settings);
    let mut writer = PacketWriter::new(Vec::new(), header)?;
    let (mut frames, mut encode_ms): (Vec<(EncodedFrame, usize)>, _) = (Vec::new(), Vec::new());
    let mut reconstructions = Vec::new();
    for volume in volumes {
        let start = Instant::now();
        let frame = encoder.encode(volume);
        encode_ms.push(start.elapsed().as_secs_f64() * 1e3);
        let timestamp = header.frame_rate.timestamp_ns(frames.len() as u64);
        let bytes = writer.write_frame(frame.keyframe, timestamp, &frame.payload())?;
        frames.push((frame, bytes));
        reconstructions.push(encoder.reconstruction().cloned());
    }
    let stream = writer.finish()?;
    let (decoded, decode_ms) = decode_stream(&stream, |_| ())?;
    ensure!(
        decoded.iter().zip(&reconstructions).all(|(a, b)| Some(a) == b.as_ref()),
        "the decoder disagrees with the encoder"
    );
    let options = CompareOptions { spacing_m: header.grid.voxel_size.metres(), seed: 1 };
    let errors: Vec<GeometryError> = meshes
        .iter()
        .zip(&decoded)
        .map(|(mesh, volume)| {
            compare(mesh, &extract_surface(volume, &SurfaceOptions { normals: false }), &options)
        })
        .collect::<Result<_, _>>()?;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let part = |get: &dyn Fn(&EncodedFrame) -> usize| {
        mean(&frames.iter().skip(1).map(|(frame, _)| get(frame) as f64).collect::<Vec<_>>())
    };
    let sizes: Vec<f64> = frames.iter().map(|(_, bytes)| *bytes as f64).collect();
    let error = |get: fn(&GeometryError) -> Option<f64>| {
        mean(&errors.iter().map(|e| get(e).unwrap_or(f64::NAN)).collect::<Vec<_>>())
    };
    let p_frame = mean(&sizes[1..]);
    let blocks = part(&|f| f.payload().header.blocks as usize);
    let block_set = part(&|f| f.bytes_blocks() - f.bytes_masks());
    Ok(format!(
        "| {:.3} | {:.3} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.0} | {:.2} | {:.3} | {:.1} | {:.2} | {:.1} | {:.0} | {:.0} |",
        stream.len() as f64 * 240.0 / volumes.len() as f64 / 1e6,
        (sizes[0] + 29.0 * p_frame) * 8.0 / 1e6,
        sizes[0],
        p_frame,
        block_set,
        part(&EncodedFrame::bytes_masks),
        part(&EncodedFrame::bytes_modes),
        part(&EncodedFrame::bytes_coefficients),
        8.0 * block_set / blocks,
        error(|e| e.p2s_mean_mm),
        error(|e| e.hausdorff_mm),
        error(|e| e.normal_error_deg),
        error(|e| e.components_test),
        mean(&encode_ms[1.min(encode_ms.len() - 1)..]),
        mean(&decode_ms[1.min(decode_ms.len() - 1)..]),
    ))
}
