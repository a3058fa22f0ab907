//! Programs of other codecs: those that are on this machine, and stand-ins for those that misbehave.

#![cfg(unix)]

use isv_baseline::{
    CodedPoints, Gltfpack, Lattice, ProgramError, Tmc2, Tmc13, Tmc13Geometry, ToolError, Tools, Vdmc, Voxels,
};
use isv_spatial::Bvh;
use isv_testkit::{Need, skip};
use isv_volume::TriangleMesh;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

/// A folder with a program: a shell script.
fn stand_in(name: &str, script: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    (folder, path)
}

/// Tools with one program named, which may run for 2 s.
fn tools(name: &str, path: &Path) -> Tools {
    let mut tools = Tools::default();
    tools.set(name, path).unwrap();
    tools.set_time_limit(Duration::from_secs(2));
    tools
}

/// A stand-in for `tmc3` that says its version and then does what a script says.
fn tmc13(script: &str) -> (TempDir, Tmc13) {
    let version = "case $1 in --help) echo MPEG PCC tmc3 version release-v23.0; exit 1;; esac";
    let (folder, path) = stand_in("tmc3", &format!("{version}\n{script}"));
    let found = Tmc13::find(&tools("tmc3", &path)).unwrap().expect("it is there");
    (folder, found)
}

fn encode(tmc13: &Tmc13) -> Result<Vec<u8>, ToolError> {
    let voxels = Voxels { places: vec![[0, 0, 0], [1, 0, 0]], colours: Vec::new() };
    Ok(tmc13.encode(&voxels, Tmc13Geometry::Octree, 28)?.output.bytes)
}

#[test]
fn a_crash_is_told_in_the_programs_own_words() {
    let (_folder, tmc13) = tmc13("echo out of range; kill -SEGV $$");
    let error = encode(&tmc13).unwrap_err();
    assert!(error.to_string().contains("out of range"), "{error}");
    assert!(!error.is_of_all_settings());
}

#[test]
fn a_program_that_hangs_is_ended() {
    let (_folder, tmc13) = tmc13("exec sleep 600");
    let error = encode(&tmc13).unwrap_err();
    assert!(matches!(error, ToolError::Program(ProgramError::TooLong { .. })), "{error}");
    assert!(error.is_of_all_settings());
}

#[test]
fn output_that_cannot_be_read_is_an_error() {
    let (_folder, nothing) = tmc13("exit 0");
    let error = encode(&nothing).unwrap_err();
    assert!(error.to_string().contains("wrote no file"), "{error}");

    let (_folder, noise) = tmc13("echo ply noise > decoded.ply");
    let error = noise.decode(b"bytes").unwrap_err();
    assert!(matches!(error, ToolError::Read { .. }), "{error}");

    let triangle = "ply\\nformat ascii 1.0\\nelement vertex 3\\nproperty float x\\nproperty float y\\nproperty float z\\n\
                    element face 1\\nproperty list uchar int vertex_indices\\nend_header\\n0 0 0\\n1 0 0\\n0 1 0\\n3 0 1 2\\n";
    let (_folder, mesh) = tmc13(&format!("printf '{triangle}' > decoded.ply"));
    let error = mesh.decode(b"bytes").unwrap_err();
    assert!(error.to_string().ends_with("its output is not points"), "{error}");
}

#[test]
fn another_program_of_the_same_name_is_not_used() {
    let (_folder, path) = stand_in("tmc3", "echo usage: tmc3 FILE");
    let error = Tmc13::find(&tools("tmc3", &path)).unwrap_err();
    assert!(matches!(error, ToolError::Version { .. }) && error.to_string().contains("usage"), "{error}");
    assert!(error.is_of_all_settings());
}

#[test]
fn another_version_is_used_and_noted() {
    let (_folder, path) = stand_in("gltfpack", "echo gltfpack 0.9");
    let found = Gltfpack::find(&tools("gltfpack", &path)).unwrap().unwrap();
    let note = found.version().note(Gltfpack::PROGRAM).unwrap();
    assert_eq!(note, "gltfpack is version 0.9; isv's settings are tested with 1.2");
    let (_folder, same) = tmc13("");
    assert_eq!(same.version().note(Tmc13::PROGRAM), None);
}

/// The program, if this machine has it; says so plainly if not.
fn installed<T>(name: &str, found: Result<Option<T>, ToolError>) -> Option<T> {
    let found = found.unwrap();
    if found.is_none() {
        skip(Need::OtherCodecs, format!("{name} is not installed"));
    }
    found
}

fn sphere() -> (TriangleMesh, Lattice) {
    let mesh = isv_testkit::sphere(0.5, 40);
    let lattice = Lattice::spanning(mesh.bounds().unwrap(), 7);
    (mesh, lattice)
}

#[test]
fn an_octree_comes_back_without_loss() {
    let Some(tmc13) = installed("tmc3", Tmc13::find(&Tools::default())) else { return };
    let (mesh, mut lattice) = sphere();
    // Coordinates below zero too.
    lattice.origin += 0.25;
    let voxels = lattice.voxels(&mesh).unwrap();
    let encoded = tmc13.encode(&voxels, Tmc13Geometry::Octree, 28).unwrap();
    assert!(encoded.command.starts_with("tmc3 --mode=0"), "{}", encoded.command);
    let CodedPoints { bytes, colour_bytes } = encoded.output;
    assert!(bytes.len() < voxels.places.len() / 2, "{} bytes", bytes.len());
    assert_eq!(colour_bytes, 0);
    let decoded = tmc13.decode(&bytes).unwrap().output;
    let mut back: Vec<_> = decoded.positions.iter().map(|p| p.to_array().map(|x| x as i32)).collect();
    back.sort_unstable();
    assert_eq!(back, voxels.places);
}

#[test]
fn colours_of_points_come_back_the_better_the_smaller_their_steps() {
    let Some(tmc13) = installed("tmc3", Tmc13::find(&Tools::default())) else { return };
    let (mesh, lattice) = sphere();
    let mut voxels = lattice.voxels(&mesh).unwrap();
    let colour_at =
        |[x, y, z]: [i32; 3]| [x, y, z].map(|at| (128.0 + 100.0 * (f64::from(at) * 0.2).sin()) as u8);
    voxels.colours = voxels.places.iter().map(|place| colour_at(*place)).collect();
    let errors = [22, 40].map(|qp| {
        let coded = tmc13.encode(&voxels, Tmc13Geometry::Octree, qp).unwrap().output;
        assert!((1..coded.bytes.len() as u64).contains(&coded.colour_bytes), "{} bytes", coded.colour_bytes);
        let decoded = tmc13.decode(&coded.bytes).unwrap().output;
        let squares = decoded.positions.iter().zip(&decoded.colours).map(|(position, colour)| {
            let expected = colour_at(position.to_array().map(|x| x as i32));
            expected.iter().zip(colour).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum::<f64>()
        });
        (coded.colour_bytes, squares.sum::<f64>() / (3 * decoded.positions.len()) as f64)
    });
    assert!(errors[0].0 > 2 * errors[1].0 && 4.0 * errors[0].1 < errors[1].1, "{errors:?}");
    assert!(errors[0].1 < 10.0, "{errors:?}");
}

#[test]
fn trisoup_comes_back_near_the_surface() {
    let Some(tmc13) = installed("tmc3", Tmc13::find(&Tools::default())) else { return };
    let (mesh, lattice) = sphere();
    let voxels = lattice.voxels(&mesh).unwrap();
    let surface = Bvh::new(&mesh);
    let bytes = [2, 3].map(|node_size_log2| {
        let geometry = Tmc13Geometry::Trisoup { node_size_log2 };
        let encoded = tmc13.encode(&voxels, geometry, 28).unwrap().output.bytes;
        let decoded = lattice.placed(tmc13.decode(&encoded).unwrap().output);
        let farthest = decoded.positions.iter().map(|p| surface.distance(*p)).fold(0.0, f64::max);
        assert!(farthest < 3.0 * lattice.step_m, "{farthest} m");
        encoded.len()
    });
    assert!(bytes[0] > bytes[1], "{bytes:?}");
}

#[test]
fn a_packed_mesh_comes_back() {
    let Some(gltfpack) = installed("gltfpack", Gltfpack::find(&Tools::default())) else { return };
    let (mesh, _) = sphere();
    let encoded = gltfpack.encode(&mesh, 12).unwrap().output;
    let decoded = gltfpack.decode(&encoded).unwrap().output;
    // Faces without area, which the sphere has at its poles, do not come back.
    assert!((mesh.triangles.len() - decoded.triangles.len()) * 50 < mesh.triangles.len());
    let surface = Bvh::new(&mesh);
    let farthest = decoded.vertices.iter().map(|p| surface.distance(*p)).fold(0.0, f64::max);
    assert!(farthest < 1.0 / 4095.0, "{farthest} m");
}

/// Programs of a codec of whole takes that keep the first frame as it is, in a folder with a configuration.
fn keeper(programs: [(&str, &str); 2], configuration: Option<&str>) -> (TempDir, Tools) {
    let folder = tempfile::tempdir().unwrap();
    let mut tools = Tools::default();
    for (name, script) in programs {
        let (_other, path) = stand_in(name, script);
        let here = folder.path().join(name);
        fs::copy(path, &here).unwrap();
        tools.set(name, &here).unwrap();
    }
    if let Some(file) = configuration {
        let path = folder.path().join("cfg").join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }
    (folder, tools)
}

const TMC2: [(&str, &str); 2] = [
    // A unit of attributes, with its size in a byte before it: the first frame.
    (
        "PccAppEncoder",
        "echo PccAppEncoder v24.0; [ -f points_0000.ply ] || exit
         size=$(($(wc -c <points_0000.ply) + 1))
         { printf '\\040\\'$(printf %03o $((size >> 8)))'\\'$(printf %03o $((size & 255)))'\\040'; cat points_0000.ply; } >take.bin",
    ),
    ("PccAppDecoder", "tail -c +5 take.bin >decoded_0000.ply"),
];

const VDMC: [(&str, &str); 2] = [
    ("encode", "echo MPEG VMESH version v4.0; cp mesh_0000.obj take.vmesh"),
    ("decode", "cp take.vmesh decoded_0000.obj"),
];

#[test]
fn whole_takes_go_through_the_programs_of_v_pcc() {
    let (_folder, tools) = keeper(TMC2, Some("common/ctc-common.cfg"));
    let tmc2 = Tmc2::find(&tools).unwrap().unwrap();
    assert_eq!(tmc2.version().note("PccAppEncoder"), None);
    let colours = vec![[9, 8, 7], [6, 5, 4]];
    let voxels = Voxels { places: vec![[1, 2, 3], [4, 5, 6]], colours: colours.clone() };
    let encoded = tmc2.encode(std::slice::from_ref(&voxels), 10, 3).unwrap();
    assert!(encoded.command.contains("--config=CFG/rate/ctc-r3.cfg"), "{}", encoded.command);
    assert!(encoded.command.contains("--noAttributes=0"), "{}", encoded.command);
    let CodedPoints { bytes, colour_bytes } = encoded.output;
    assert_eq!(colour_bytes, bytes.len() as u64 - 1);
    let decoded = tmc2.decode(&bytes, 1).unwrap().output;
    assert_eq!(decoded[0].positions, [[1.0, 2.0, 3.0].into(), [4.0, 5.0, 6.0].into()]);
    assert_eq!(decoded[0].colours, colours);
    // Without colours of all frames none are coded.
    let plain = tmc2.encode(&[voxels.clone(), Voxels { colours: Vec::new(), ..voxels }], 10, 3).unwrap();
    assert!(plain.command.contains("--noAttributes=1"), "{}", plain.command);
    // A frame that does not come back.
    let error = tmc2.decode(&bytes, 2).unwrap_err();
    assert!(error.to_string().contains("wrote no file"), "{error}");
}

#[test]
fn whole_takes_go_through_the_programs_of_v_dmc() {
    let (_folder, tools) = keeper(VDMC, Some("hm/displacements-ai.cfg"));
    let vdmc = Vdmc::find(&tools).unwrap().unwrap();
    let mesh = isv_testkit::cube(0.5);
    let lattice = Vdmc::lattice(mesh.bounds().unwrap());
    let encoded = vdmc.encode(std::slice::from_ref(&mesh), &lattice, 3).unwrap();
    let decoded = vdmc.decode(&encoded.output, &lattice, 1).unwrap().output;
    assert_eq!(decoded[0].triangles, mesh.triangles);
    assert!(decoded[0].vertices.iter().zip(&mesh.vertices).all(|(a, b)| a.distance(*b) < 1e-4));
}

#[test]
fn programs_without_their_configurations_are_not_used() {
    let (_folder, tools) = keeper(TMC2, None);
    let error = Tmc2::find(&tools).unwrap_err();
    assert!(matches!(error, ToolError::Configuration { .. }), "{error}");
    let (_folder, tools) = keeper(VDMC, None);
    assert!(matches!(Vdmc::find(&tools).unwrap_err(), ToolError::Configuration { .. }));
}
