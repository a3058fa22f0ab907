//! Codecs measured on the project's own figure.

use isv::raw::format::FrameRate;
use isv::raw::ingest::MeshIngest;
use isv::raw::io::Geometry;
use isv::raw::metrics::CompareOptions;
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use isv_figure::{figure_mesh, painted_figure_mesh};
use isv_study::{
    Codec, Measured, Metric, OperatingPoint, StudyError, StudySettings, Subject, Take, TakeError, TakeFrames,
    Tools,
};
use isv_testkit::{Need, skip};

/// Voxels are coarse, for speed.
const VOXEL_M: f64 = 0.02;

/// Meshes in memory, or what is wrong with them.
struct Meshes(Vec<Result<TriangleMesh, String>>);

impl Meshes {
    fn figure(frames: usize) -> Self {
        let voxel = VoxelSize::from_metres(VOXEL_M).unwrap();
        Self((0..frames).map(|frame| Ok(figure_mesh(frame as f64 / 30.0, voxel))).collect())
    }

    fn painted_figure(frames: usize) -> Self {
        let voxel = VoxelSize::from_metres(VOXEL_M).unwrap();
        Self((0..frames).map(|frame| Ok(painted_figure_mesh(frame as f64 / 30.0, voxel))).collect())
    }
}

impl Take for Meshes {
    fn name(&self) -> &str {
        "meshes"
    }

    fn frames(&self) -> usize {
        self.0.len()
    }

    fn frame_rate(&self) -> FrameRate {
        FrameRate::DEFAULT
    }

    fn meshes(&self) -> Result<TakeFrames<'_>, TakeError> {
        Ok(Box::new(self.0.iter().map(|mesh| mesh.clone().map_err(Into::into))))
    }
}

fn settings() -> StudySettings {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(VOXEL_M).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let compare = CompareOptions { spacing_m: VOXEL_M, ..CompareOptions::default() };
    StudySettings { ingest: MeshIngest::new(grid), gop: 30, compare, picture_frame: 1, first_frame: 0 }
}

/// Faces of the decoded picture frame; none of points.
fn faces(measured: &Measured) -> usize {
    match &measured.picture {
        Geometry::Mesh(mesh) => mesh.triangles.len(),
        Geometry::Points(_) => 0,
    }
}

fn codec(name: &str) -> Codec {
    name.parse().unwrap()
}

/// Measures `count` points of a codec; none if it is not installed.
fn measure_points(name: &str, take: &Meshes, count: usize) -> Option<Vec<Measured>> {
    let (training, settings) = (Meshes::figure(1), settings());
    let Some(subject) =
        Subject::prepare(codec(name), take, &[&training], &settings, &Tools::default()).unwrap()
    else {
        let need = if name.starts_with("draco") { Need::Draco } else { Need::OtherCodecs };
        skip(need, format!("the programs of {name} are not installed"));
        return None;
    };
    let points = subject.points(count);
    Some(points.into_iter().map(|point| subject.measure(point, &mut || ()).unwrap()).collect())
}

#[test]
fn every_byte_is_counted() {
    let take = Meshes::figure(3);
    let measured = measure_points("paper-3dof", &take, 1).unwrap().remove(0);
    let record = &measured.record;
    assert_eq!(record.frames(), 3);
    assert_eq!(record.bytes, measured.isv_file.unwrap().len() as u64);
    let kinds = record.kinds.unwrap();
    let sum: f64 = kinds.named().iter().map(|(_, bytes)| bytes).sum();
    assert!((sum - record.bytes as f64).abs() < 1e-6, "{kinds:?} of {}", record.bytes);
    assert!(kinds.named().iter().all(|(_, bytes)| *bytes >= 0.0), "{kinds:?}");
    assert!(kinds.motion > 0.0 && kinds.dc > 0.0 && kinds.ac > 0.0, "{kinds:?}");
    let frames: u64 = record.frame_bytes.iter().sum();
    assert!(frames < record.bytes && record.bytes - frames < 200, "{frames} of {}", record.bytes);
    assert!((record.mbps() - record.bytes as f64 * 8.0 * 10.0 / 1e6).abs() < 1e-12);
}

#[test]
fn colour_is_measured_where_capture_and_codec_have_it() {
    let take = Meshes::painted_figure(2);
    let points = measure_points("main-realtime", &take, 2).unwrap();
    for Measured { record, .. } in &points {
        assert!(
            (1..record.bytes).contains(&record.bytes_colour),
            "{} of {}",
            record.bytes_colour,
            record.bytes
        );
        assert_eq!(record.kinds.unwrap().colour, record.bytes_colour as f64);
        assert!((record.geometry_mbps() + record.colour_mbps() - record.mbps()).abs() < 1e-9);
        assert_eq!(record.frame_colour_errors.len(), 2);
        assert!(record.colour_encode_ms.is_some());
        for metric in Metric::COLOUR {
            let db = record.value(metric).unwrap();
            assert!((15.0..60.0).contains(&db), "{metric:?}: {db}");
        }
    }
    let [fine, coarse] = [&points[0].record, &points[1].record];
    assert!(fine.bytes_colour > coarse.bytes_colour);
    assert!(fine.value(Metric::ColourY) > coarse.value(Metric::ColourY));

    // Geometry costs what it costs without colour.
    let plain = measure_points("main-realtime", &Meshes::figure(2), 1).unwrap().remove(0).record;
    let middle = measure_points("main-realtime", &take, 1).unwrap().remove(0).record;
    let more = middle.bytes - middle.bytes_colour - plain.bytes;
    assert!(more < 24, "{more} bytes more");
    assert_eq!((plain.bytes_colour, plain.value(Metric::ColourY)), (0, None));
    assert_eq!(plain.frame_bytes.len(), 2);

    for name in ["paper-zero", "draco"] {
        let Some(mut measured) = measure_points(name, &take, 1) else { continue };
        let record = measured.remove(0).record;
        assert_eq!((record.bytes_colour, record.value(Metric::ColourY)), (0, None), "{name}");
    }
    let bytes = |take| measure_points("draco", take, 1).map(|mut measured| measured.remove(0).record.bytes);
    assert_eq!(bytes(&take), bytes(&Meshes::figure(2)), "Draco gets no colour");
}

#[test]
fn a_trained_transforms_bytes_are_those_of_its_frames() {
    let measured = measure_points("tang-scene", &Meshes::figure(2), 1).unwrap().remove(0);
    let (record, kinds) = (&measured.record, measured.record.kinds.unwrap());
    assert_eq!(record.bytes, record.frame_bytes.iter().sum::<u64>());
    let sum: f64 = kinds.named().iter().map(|(_, bytes)| bytes).sum();
    assert!((sum - record.bytes as f64).abs() < 1e-6, "{kinds:?} of {}", record.bytes);
    assert!(measured.isv_file.is_none());
}

#[test]
fn coarser_points_take_fewer_bytes_and_err_more() {
    let take = Meshes::figure(2);
    for name in ["paper-intra", "paper-zero", "tang-scene", "tang-cross", "draco", "draco-25"] {
        let Some(points) = measure_points(name, &take, 3) else { continue };
        for pair in points.windows(2) {
            let [fine, coarse] = [&pair[0].record, &pair[1].record];
            let error = |record: &isv_study::Record| record.value(Metric::PointToSurface).unwrap();
            assert!(coarse.bytes < fine.bytes, "{name} {}: {} bytes", coarse.point, coarse.bytes);
            assert!(error(coarse) > error(fine), "{name} {}: {} mm", coarse.point, error(coarse));
        }
        assert!(faces(&points[0]) > 0);
    }
}

#[test]
fn simplified_meshes_have_fewer_faces() {
    let take = Meshes::figure(2);
    let faces_of = |name| measure_points(name, &take, 1).map(|measured| faces(&measured[0]));
    if let (Some(all), Some(tenth)) = (faces_of("draco"), faces_of("draco-10")) {
        assert!((0.08..0.12).contains(&(tenth as f64 / all as f64)), "{tenth} of {all}");
    }
}

#[test]
fn each_frame_is_a_step_of_both_passes() {
    let (take, settings) = (Meshes::figure(3), settings());
    let subject =
        Subject::prepare(codec("paper-zero"), &take, &[], &settings, &Tools::default()).unwrap().unwrap();
    let mut steps = 0;
    subject.measure(subject.points(1)[0], &mut || steps += 1).unwrap();
    assert_eq!(steps, 6);
}

#[test]
fn what_stands_in_the_way_is_said() {
    let settings = settings();
    let prepare = |name, take| Subject::prepare(codec(name), take, &[], &settings, &Tools::default());
    let (whole, nothing) = (Meshes::figure(1), Meshes(vec![]));
    assert!(matches!(prepare("tang-cross", &whole), Err(StudyError::NoTraining)));
    assert!(matches!(prepare("paper-zero", &nothing), Err(StudyError::NoFrames { .. })));

    let fails = |second| {
        let take = Meshes(vec![Meshes::figure(1).0.remove(0), second]);
        let subject =
            Subject::prepare(codec("paper-zero"), &take, &[], &settings, &Tools::default()).unwrap().unwrap();
        let point = OperatingPoint::Steps { coefficients: 64, dc_step_m: 0.001, ac_step_m: 0.01 };
        subject.measure(point, &mut || ()).err().unwrap().to_string()
    };
    assert_eq!(fails(Err("b.ply: it is torn".to_owned())), "b.ply: it is torn");
    let empty = fails(Ok(TriangleMesh::default()));
    assert!(empty.starts_with("frame 1: "), "{empty}");
}
