//! USD files, read back by USD itself where Python has it (`usd-core`).

use glam::DVec3;
use isv_io::{UsdStage, UsdWriter, was_made_by_isv};
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
const LIMIT: u64 = 1 << 20;

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

fn write(path: &Path, frames: &[(f64, TriangleMesh)]) {
    let mut writer = UsdWriter::create(path, STAGE, LIMIT).unwrap();
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
    print("frame", len(points), len(counts), sum(mesh.GetFaceVertexIndicesAttr().Get(code)), ok, len(points) == 0 or list(UsdGeom.PointBased.ComputeExtent(points)) == extent, [round(c, 4) for c in colour[1]] if len(colour) else [])
"#;

/// What USD says of a file; `None` without USD.
fn read(path: &Path) -> Option<String> {
    let python = std::env::var_os("ISV_PYTHON").unwrap_or_else(|| "python3".into());
    let run = |arguments: &[&std::ffi::OsStr]| Command::new(&python).args(arguments).output();
    let has_usd = run(&["-c".as_ref(), "import pxr".as_ref()]).is_ok_and(|output| output.status.success());
    if !has_usd {
        let why = format_args!("{} has no usd-core; ISV_PYTHON names another", python.display());
        skip(Need::Usd, why);
        return None;
    }
    let output = run(&["-c".as_ref(), READ.as_ref(), path.as_os_str()]).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

#[test]
fn usd_reads_a_sequence_of_changing_meshes() {
    let folder = tempfile::tempdir().unwrap();
    let frames = [(0.0, fan(5)), (1.0 / 30.0, TriangleMesh::default()), (0.1, fan(7))];
    for name in ["take.usda", "take.usd"] {
        let path = folder.path().join(name);
        write(&path, &frames);
        assert!(was_made_by_isv(&std::fs::read(&path).unwrap()[..256]), "{name}");
        let Some(found) = read(&path) else { return };
        let expected = "stage 0.01 Z /take\n\
            times 0.0 3.0 30.0 [0.0, 1.0, 3.0]\n\
            place [512000.25, 0.0, -3.5]\n\
            look none rightHanded True vertex vertex\n\
            frame 6 5 30 True True [1.0, 0.5029, 0.003]\n\
            frame 0 0 0 True True []\n\
            frame 8 7 56 True True [1.0, 0.5029, 0.003]\n";
        assert_eq!(found, expected, "{name}");
    }
}

#[test]
fn one_frame_has_no_times() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.usda");
    write(&path, &[(0.0, fan(3))]);
    let Some(found) = read(&path) else { return };
    assert!(found.contains("times 0.0 0.0 24.0 []\n"), "{found}");
    assert!(found.contains("frame 4 3 12 True True"), "{found}");
}

#[test]
fn what_cannot_be_written_is_refused_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("take.usda");
    let error = |push: &dyn Fn(&mut UsdWriter) -> Result<(), isv_io::WriteError>| {
        let mut writer = UsdWriter::create(&path, STAGE, LIMIT).unwrap();
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
    let large = error(&|writer| writer.push(2.0, &fan(20_000)));
    assert!(large.contains("more than 1 MiB"), "{large}");
    let empty = UsdWriter::create(&path, STAGE, LIMIT).unwrap().finish(0.0);
    assert!(empty.unwrap_err().to_string().contains("at least one frame"));
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}
