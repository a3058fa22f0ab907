//! Files for the fuzz targets to start from, one folder a target. Small ones: a fuzzer changes them thousands of times a
//! second. Those of the codec are the conformance streams as well.

use anyhow::{Context, Result};
use glam::DVec3;
use isv::encode::{Encoder, EncoderSettings};
use isv::format::{FrameRate, PacketReader, PacketWriter, PaperParameters, Profile, StreamHeader};
use isv::ingest::{MeshIngest, SignDecision, ingest_mesh};
use isv::io::{Format, GlbAnimationWriter, write_mesh_to, write_points_to, write_volume};
use isv::volume::{BlockEdge, Grid, PointCloud, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Writes the seeds of all targets into `corpus`.
pub(crate) fn run(corpus: &str) -> Result<()> {
    let mut seeds = Seeds { corpus: Path::new(corpus), counts: BTreeMap::new() };
    let mut save = |target: &'static str, bytes: &[u8]| seeds.save(target, bytes);
    let mesh = tetrahedron();
    for format in Format::ALL.iter().filter(|format| format.writes_mesh()) {
        let mut bytes = Vec::new();
        write_mesh_to(&mut bytes, &mesh, *format)?;
        save(format.extension(), &bytes)?;
        if *format == Format::Ply {
            save("pipe", &bytes.repeat(2))?;
        }
    }
    save("off", b"OFF\n4 4 0\n0 0 0\n.1 0 0\n0 .1 0\n0 0 .1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")?;
    save("gltf", GLTF.as_bytes())?;
    save("animation", &animation(&mesh)?)?;
    for format in Format::ALL.iter().filter(|format| format.writes_points()) {
        let mut bytes = Vec::new();
        write_points_to(&mut bytes, &points(), *format)?;
        save(format.extension(), &bytes)?;
    }
    save("las", &lidar(false)?)?;
    save("laz", &lidar(true)?)?;
    save("e57", &scan()?)?;
    save("camera_json", CAMERA.as_bytes())?;
    save("rig", RIG.as_bytes())?;
    save("tum", TUM.as_bytes())?;
    save("depth_png", &depth_png()?)?;
    save("depth_exr", &depth_exr()?)?;
    let volume = |grid| ingest_mesh(&mesh, &MeshIngest::new(grid), SignDecision::Closed { flipped: false });
    let paper = Profile::Paper(PaperParameters { coefficients: 20, dc_step: 819, ac_step: 2048 });
    save("arrays", &arrays(&volume(grid(BlockEdge::E4))?)?)?;
    let mut streams = conformance_streams(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../conformance"))?;
    streams.retain(|stream| stream.len() <= MOST_STREAM_BYTES);
    streams.sort();
    streams.push(stream(paper, &volume(grid(BlockEdge::E4))?)?);
    streams.push(stream(Profile::Main, &volume(grid(BlockEdge::E8))?)?);
    for stream in &streams {
        for target in ["container", "live", "stream"] {
            save(target, stream)?;
        }
        for target in ["packet", "syntax", "differential"] {
            save(target, first_frames(stream))?;
        }
    }
    let noise: Vec<u8> = (0..240u8).map(|i| i.wrapping_mul(37)).collect();
    for target in ["ingest", "encoder"] {
        save(target, &noise)?;
    }
    for range in ["bytes=0-9", "bytes=5-", "bytes=-5", "bytes=0-1,4-5"] {
        save("range_header", range.as_bytes())?;
    }
    save("range_decoder", &[&32u16.to_le_bytes()[..], &noise].concat())?;
    Ok(())
}

/// Larger streams take too long.
const MOST_STREAM_BYTES: usize = 32 << 10;

/// Streams of which all frames are decoded for every input.
const FEW_STREAM_BYTES: usize = 2 << 10;

/// The beginning of a stream, to the end of its second packet; all of it if it is small, or cannot be read so far.
fn first_frames(stream: &[u8]) -> &[u8] {
    let end = || {
        let mut packets = PacketReader::new(stream).ok()?;
        packets.next_packet().ok()??;
        let second = packets.next_packet().ok()??;
        Some(second.at as usize + second.total_bytes())
    };
    if stream.len() <= FEW_STREAM_BYTES { stream } else { &stream[..end().unwrap_or(stream.len())] }
}

/// The streams of a folder and of those in it, those that decoders must refuse included.
fn conformance_streams(folder: &Path) -> Result<Vec<Vec<u8>>> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut streams = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            streams.extend(conformance_streams(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "isv") {
            streams.push(fs::read(path)?);
        }
    }
    Ok(streams)
}

/// Seeds are numbered, so that those of another time do not stay beside them.
struct Seeds<'a> {
    corpus: &'a Path,
    counts: BTreeMap<&'static str, usize>,
}

impl Seeds<'_> {
    fn save(&mut self, target: &'static str, bytes: &[u8]) -> Result<()> {
        let count = self.counts.entry(target).or_default();
        let folder = self.corpus.join(target);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(format!("seed_{count:02}")), bytes)?;
        *count += 1;
        Ok(())
    }
}

fn grid(edge: BlockEdge) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.02).expect("in range"),
        edge,
        truncation: Truncation::from_voxels(2).expect("in range"),
    }
}

fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
            .map(|v| DVec3::from(v.map(f64::from)) / 10.0)
            .to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    }
}

fn points() -> PointCloud {
    let positions = (0..20).map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0) / 100.0).collect();
    PointCloud { positions, normals: vec![DVec3::Z; 20], viewpoint: None }
}

fn animation(mesh: &TriangleMesh) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("frame.glb");
    let mut writer = GlbAnimationWriter::create(&path, 30.0)?;
    for _ in 0..2 {
        writer.push(mesh)?;
    }
    writer.finish()?;
    Ok(fs::read(path)?)
}

fn lidar(compressed: bool) -> Result<Vec<u8>> {
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(6)?;
    builder.point_format.is_compressed = compressed;
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), builder.into_header()?)?;
    for position in points().positions {
        let DVec3 { x, y, z } = position;
        writer.write_point(las::Point { x, y, z, gps_time: Some(0.0), ..Default::default() })?;
    }
    Ok(writer.into_inner()?.into_inner())
}

fn scan() -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = e57::E57Writer::new(&mut bytes, "file")?;
    let prototype =
        vec![e57::Record::CARTESIAN_X_F64, e57::Record::CARTESIAN_Y_F64, e57::Record::CARTESIAN_Z_F64];
    let mut cloud = writer.add_pointcloud("scan", prototype)?;
    for position in points().positions {
        cloud.add_point(position.to_array().map(e57::RecordValue::Double).to_vec())?;
    }
    cloud.finalize()?;
    writer.finalize()?;
    drop(writer);
    Ok(bytes.into_inner())
}

fn depth_png() -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    encoder.write_header()?.write_image_data(&[4, 1].repeat(48))?;
    Ok(bytes)
}

fn depth_exr() -> Result<Vec<u8>> {
    use exr::prelude::*;
    let channels =
        SpecificChannels::build().with_channel("Z").with_pixel_fn(|at: Vec2<usize>| (at.0 as f32,));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_channels((8, 6), channels).write().non_parallel().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

fn arrays(volume: &SparseVolume) -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("frame");
    write_volume(&path, volume)?;
    Ok([fs::read(path.join("coords.npy"))?, fs::read(path.join("tsdf.npy"))?].concat())
}

/// Two frames, the second one predicted.
fn stream(profile: Profile, volume: &SparseVolume) -> Result<Vec<u8>> {
    let frame_rate = FrameRate { numerator: 30, denominator: 1 };
    let header = StreamHeader { profile, grid: *volume.grid(), frame_rate };
    let mut encoder = Encoder::new(&header, EncoderSettings::default());
    let mut writer = PacketWriter::new(Vec::new(), &header)?;
    for _ in 0..2 {
        let frame = encoder.encode(volume);
        writer.write_frame(frame.keyframe, 0, &frame.payload())?;
    }
    Ok(writer.finish()?)
}

const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
 "nodes": [{"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0, 1]}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 4}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
 "bufferViews": [{"buffer": 0, "byteLength": 36}],
 "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;

const CAMERA: &str = r#"{"width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "fps": 30,
    "depth_scale_m": 0.001, "poses": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]]}"#;

const RIG: &str = r#"{"fps": 30, "cameras": [{"name": "front", "width": 8, "height": 6, "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5,
 "camera_to_world": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "images": "front", "depth_scale_m": 0.001}]}"#;

const TUM: &str = "# time file\n1.00 depth/0.png\n1.03 depth/0.png\n\n\n# time tx ty tz qx qy qz qw\n1.00 0 0 0 0 0 0 1\n1.03 1 0 0 0 0 0 1\n";
