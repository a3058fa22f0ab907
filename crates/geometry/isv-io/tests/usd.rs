//! USD files, read back by USD itself where Python has it (`usd-core`).

use glam::DVec3;
use isv_io::{UsdEncoding, UsdStage, UsdWriter, was_made_by_isv};
use isv_testkit::{Need, skip};
use isv_volume::{Appearance, TriangleMesh};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

const STAGE: UsdStage = UsdStage {
    frames_per_second: 30.0,
    metres_per_unit: 0.01,
    z_up: true,
    translation: DVec3::new(512_000.25, 0.0, -3.5),
};
/// Names of files, and their encodings.
const FILES: [(&str, UsdEncoding); 2] =
    [("take.usda", UsdEncoding::Text), ("take.usdc", UsdEncoding::Binary)];

/// A fan of triangles. Frames have different numbers of vertices.
fn fan(corners: u32) -> TriangleMesh {
    let angle = |corner: u32| f64::from(corner) / f64::from(corners) * std::f64::consts::TAU;
    let rim = (0..corners).map(|corner| DVec3::new(angle(corner).cos(), angle(corner).sin(), 0.25));
    let vertices: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain(rim).collect();
    let triangles = (0..corners).map(|corner| [0, 1 + corner, 1 + (corner + 1) % corners]).collect();
    let vertex_colours = (0..=corners).map(|corner| [255, 188, (corner * 10) as u8]).collect();
    let appearance = Some(Arc::new(Appearance { vertex_colours, ..Appearance::default() }));
    TriangleMesh { normals: vec![DVec3::Z; vertices.len()], vertices, triangles, appearance }
}

fn write(path: &Path, encoding: UsdEncoding, frames: &[(f64, TriangleMesh)]) {
    let mut writer = UsdWriter::create(path, STAGE, encoding).unwrap();
    for (start_s, mesh) in frames {
        writer.push(*start_s, mesh).unwrap();
    }
    writer.finish(frames[frames.len() - 1].0 + 1.0 / 30.0).unwrap();
}

/// Prints what USD reads in a file.
const READ: &str = r#"
import sys
from pxr import Usd, UsdGeom
stage = Usd.Stage.Open(sys.argv[1])
root = stage.GetDefaultPrim()
mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/take/surface"))
print("stage", UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage), root.GetPath())
print("times", stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond(), mesh.GetPointsAttr().GetTimeSamples())
print("place", list(UsdGeom.Xformable(root).GetLocalTransformation().ExtractTranslation()))
print("look", mesh.GetSubdivisionSchemeAttr().Get(), mesh.GetOrientationAttr().Get(), mesh.GetDoubleSidedAttr().Get(), mesh.GetNormalsInterpolation(), mesh.GetDisplayColorPrimvar().GetInterpolation())
for code in mesh.GetPointsAttr().GetTimeSamples() or [Usd.TimeCode.Default()]:
    points = mesh.GetPointsAttr().Get(code)
    colour = mesh.GetDisplayColorAttr().Get(code)
    counts = mesh.GetFaceVertexCountsAttr().Get(code)
    ok, why = UsdGeom.Mesh.ValidateTopology(mesh.GetFaceVertexIndicesAttr().Get(code), counts, len(points))
    extent = list(mesh.GetExtentAttr().Get(code))
    print("frame", len(points), len(counts), sum(mesh.GetFaceVertexIndicesAttr().Get(code)), ok, len(extent) == 2 and (len(points) == 0 or list(UsdGeom.PointBased.ComputeExtent(points)) == extent), [round(c, 4) for c in colour[1]] if len(colour) else [])
"#;

/// Prints whether files hold the same layer, and errors that USD's own validators find.
const COMPARE: &str = r#"
import sys
from pxr import Sdf, Usd
texts = [Sdf.Layer.FindOrOpen(path).ExportToString() for path in sys.argv[1:]]
print("same" if len(set(texts)) == 1 else "different:\n" + "\n".join(text[:4000] for text in texts))
try:
    from pxr import UsdValidation
except ImportError:
    sys.exit()  # Older ones have none.
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
for path in sys.argv[1:]:
    for error in UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(path)):
        print(path, error.GetErrorAsString())
"#;

/// Prints what a script in Python says of files; `None` without USD.
fn run(script: &str, paths: &[&Path]) -> Option<String> {
    let python = std::env::var_os("ISV_PYTHON").unwrap_or_else(|| "python3".into());
    let run = |script: &str| Command::new(&python).args(["-c", script]).args(paths).output();
    if !run("import pxr").is_ok_and(|output| output.status.success()) {
        let why = format_args!("{} has no usd-core; ISV_PYTHON names another", python.display());
        skip(Need::Usd, why);
        return None;
    }
    let output = run(script).unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && stderr.is_empty(), "{stderr}");
    Some(String::from_utf8(output.stdout).unwrap())
}

/// Writes frames in each encoding. Returns what USD reads in the files, which is the same; `None` without USD.
fn read_back(frames: &[(f64, TriangleMesh)]) -> Option<String> {
    let folder = tempfile::tempdir().unwrap();
    let paths = FILES.map(|(name, encoding)| {
        let path = folder.path().join(name);
        write(&path, encoding, frames);
        assert!(was_made_by_isv(&std::fs::read(&path).unwrap()[..256]), "{name}");
        path
    });
    assert_eq!(folder.path().read_dir().unwrap().count(), FILES.len());
    let paths = paths.each_ref().map(|path| &**path);
    assert_eq!(run(COMPARE, &paths)?, "same\n");
    let [text, binary] = paths.map(|path| run(READ, &[path]));
    assert_eq!(text, binary);
    binary
}

#[test]
fn usd_reads_a_sequence_of_changing_meshes() {
    let frames = [(0.0, fan(5)), (1.0 / 30.0, TriangleMesh::default()), (0.1, fan(7))];
    let Some(found) = read_back(&frames) else { return };
    let expected = "stage 0.01 Z /take\n\
        times 0.0 3.0 30.0 [0.0, 1.0, 3.0]\n\
        place [512000.25, 0.0, -3.5]\n\
        look none rightHanded True vertex vertex\n\
        frame 6 5 30 True True [1.0, 0.5029, 0.003]\n\
        frame 0 0 0 True True []\n\
        frame 8 7 56 True True [1.0, 0.5029, 0.003]\n";
    assert_eq!(found, expected);
}

#[test]
fn one_frame_has_no_times() {
    let Some(found) = read_back(&[(0.0, fan(3))]) else { return };
    assert!(found.contains("times 0.0 0.0 24.0 []\n"), "{found}");
    assert!(found.contains("frame 4 3 12 True True"), "{found}");
}

#[test]
fn large_frames_come_back() {
    // More vertices than 16 bits count, and text that does not fit into memory.
    let Some(found) = read_back(&[(0.0, fan(100_000)), (0.5, fan(70_000))]) else { return };
    assert!(found.contains("times 0.0 15.0 30.0 [0.0, 15.0]\n"), "{found}");
    // Each corner of the rim is in two triangles.
    for corners in [70_000u64, 100_000] {
        let frame = format!("frame {} {corners} {} True True", corners + 1, corners * (corners + 1));
        assert!(found.contains(&frame), "{found}");
    }
}

#[test]
fn integers_of_all_sizes_come_back() {
    let mut mesh = fan(70_000);
    // Neighbours of all distances, so that all codes occur.
    let next = |[a, b, c]: [u32; 3], at: u32| match at % 4 {
        0 => [a, b, c],
        1 => [b, a, c],
        2 => [b, c, (c + 200) % 70_000],
        _ => [(b + 60_000) % 70_000, c, a],
    };
    mesh.triangles = mesh.triangles.iter().zip(0..).map(|(triangle, at)| next(*triangle, at)).collect();
    let sum: u64 = mesh.triangles.as_flattened().iter().map(|index| u64::from(*index)).sum();
    let Some(found) = read_back(&[(0.0, mesh)]) else { return };
    assert!(found.contains(&format!("frame 70001 70000 {sum} True True")), "{found}");
}

#[test]
fn meshes_without_colours_and_normals_have_no_such_attributes() {
    let bare = |corners| TriangleMesh { normals: Vec::new(), appearance: None, ..fan(corners) };
    let folder = tempfile::tempdir().unwrap();
    let paths = FILES.map(|(name, encoding)| {
        let path = folder.path().join(name);
        write(&path, encoding, &[(0.0, bare(3)), (1.0, bare(30))]);
        path
    });
    let script = "import sys; from pxr import Usd\n\
        stage = Usd.Stage.Open(sys.argv[1])\n\
        print(stage.GetPrimAtPath('/take/surface').GetAuthoredPropertyNames())";
    let expected = "['doubleSided', 'extent', 'faceVertexCounts', 'faceVertexIndices', 'orientation', 'points', 'subdivisionScheme']\n";
    for path in &paths {
        let Some(found) = run(script, &[path]) else { return };
        assert_eq!(found, expected, "{}", path.display());
    }
}

#[test]
fn what_stands_still_is_written_once() {
    let folder = tempfile::tempdir().unwrap();
    let size = |frames: &[(f64, TriangleMesh)]| {
        let path = folder.path().join("take.usdc");
        write(&path, UsdEncoding::Binary, frames);
        std::fs::metadata(&path).unwrap().len()
    };
    let one = size(&[(0.0, fan(1000))]);
    let moved = |mesh: TriangleMesh| {
        let vertices = mesh.vertices.iter().map(|vertex| *vertex + DVec3::X).collect();
        TriangleMesh { vertices, ..mesh }
    };
    assert!(one > 3 * 12_000);
    assert!(size(&[(0.0, fan(1000)), (1.0, fan(1000)), (2.0, fan(1000))]) < one + 1000);
    let points = size(&[(0.0, fan(1000)), (1.0, moved(fan(1000)))]) - one;
    assert!((12_000..13_000).contains(&points), "{points}");
}

#[test]
fn what_cannot_be_written_is_refused_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    for (name, encoding) in FILES {
        let path = folder.path().join(name);
        let error = |push: &dyn Fn(&mut UsdWriter) -> Result<(), isv_io::WriteError>| {
            let mut writer = UsdWriter::create(&path, STAGE, encoding).unwrap();
            writer.push(1.0, &fan(3)).unwrap();
            push(&mut writer).unwrap_err().to_string()
        };
        let earlier = error(&|writer| writer.push(0.5, &fan(3)));
        assert!(earlier.contains("0.5 s is no time of a frame"), "{earlier}");
        let endless = error(&|writer| writer.push(f64::NAN, &fan(3)));
        assert!(endless.contains("no time of a frame"), "{endless}");
        let nowhere = TriangleMesh { vertices: vec![DVec3::NAN; 3], ..TriangleMesh::default() };
        let nowhere = error(&|writer| writer.push(2.0, &nowhere));
        assert!(nowhere.contains("not finite"), "{nowhere}");
        let empty = UsdWriter::create(&path, STAGE, encoding).unwrap().finish(0.0);
        assert!(empty.unwrap_err().to_string().contains("at least one frame"));
    }
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told() {
    for (name, encoding) in FILES {
        let mut writer = UsdWriter::create(Path::new("/dev/full"), STAGE, encoding).unwrap();
        writer.push(0.0, &fan(10)).unwrap();
        let error = writer.finish(1.0).unwrap_err().to_string();
        assert!(error.starts_with("/dev/full: cannot write: No space left"), "{name}: {error}");
    }
}
