//! Draco as a program, if it is installed.

use isv_baseline::{Draco, DracoError, ProgramError};
use isv_spatial::PointTree;
use isv_testkit::{Need, skip};
use isv_volume::{MeshError, TriangleMesh};

mod support;

/// The programs, if they are there; says so plainly if they are not.
fn installed() -> Option<Draco> {
    let found = Draco::find();
    if found.is_none() {
        skip(Need::Draco, "draco_encoder is not installed");
    }
    found
}

/// Every decoded vertex lies in the cell of the quantizer around an original one, and every face is there.
fn check(draco: &Draco, mesh: &TriangleMesh, bits: u8) {
    let encoded = draco.encode(mesh, bits).unwrap();
    let decoded = draco.decode(&encoded.output).unwrap();
    assert_eq!(decoded.output.triangles.len(), mesh.triangles.len());
    let (low, high) = mesh.bounds().unwrap();
    let quantum = (high - low).max_element() / f64::from((1u32 << bits) - 1);
    let tree = PointTree::new(mesh.vertices.clone());
    for vertex in &decoded.output.vertices {
        let away = tree.nearest_sq(*vertex).sqrt();
        assert!(away <= 0.5 * quantum * 3f64.sqrt() * 1.001 + 1e-6, "{away} m with a quantum of {quantum} m");
    }
    assert!((decoded.output.area() / mesh.area() - 1.0).abs() < 0.05);
    assert!(encoded.ms > 0.0 && decoded.ms > 0.0);
}

/// A program that is over before it was looked at has no peak; this one takes a while.
#[test]
fn the_memory_of_a_program_is_seen() {
    let Some(draco) = installed() else { return };
    let encoded = draco.encode(&isv_testkit::sphere(1.0, 300), 14).unwrap();
    let decoded = draco.decode(&encoded.output).unwrap();
    if cfg!(target_os = "linux") {
        for peak in [encoded.peak_memory_bytes, decoded.peak_memory_bytes] {
            assert!((1 << 20..1 << 30).contains(&peak.expect("Linux tells")), "{peak:?}");
        }
    }
}

#[test]
fn a_cube_comes_back() {
    let Some(draco) = installed() else { return };
    check(&draco, &isv_testkit::cube(0.7), 12);
}

#[test]
fn a_capture_comes_back() {
    let Some(draco) = installed() else { return };
    let Some(mesh) = support::load("dancer", 0) else { return };
    check(&draco, &mesh, 10);
    check(&draco, &mesh, 14);
}

#[test]
fn texture_coordinates_come_back() {
    let Some(draco) = installed() else { return };
    let square = support::textured_square(20);
    let encoded = draco.encode_textured(&square, 12, 14).unwrap();
    let decoded = draco.decode_textured(&encoded.output).unwrap().output;
    assert_eq!(decoded.triangles.len(), square.triangles.len());
    // Half a step of positions and half a step of coordinates, which span 3.
    let most = 0.5 / 4095.0 + 1.5 / 16_383.0 + 1e-5;
    let farthest = support::farthest_coordinate(&decoded);
    assert!(farthest <= most, "{farthest}");
    let coarser = draco.encode_textured(&square, 12, 8).unwrap();
    assert!(coarser.output.len() < encoded.output.len());
    assert!(matches!(draco.encode_textured(&square, 31, 12), Err(DracoError::PositionBits { .. })));
}

#[test]
fn normals_are_not_coded() {
    let Some(draco) = installed() else { return };
    let plain = isv_testkit::cube(1.0);
    let normals = plain.vertices.iter().map(|v| v.normalize()).collect();
    let lit = TriangleMesh { normals, ..plain.clone() };
    let [plain, lit] = [plain, lit].map(|mesh| draco.encode(&mesh, 10).unwrap().output);
    assert_eq!(plain, lit);
}

#[test]
fn what_cannot_be_coded_is_refused() {
    let Some(draco) = installed() else { return };
    let cube = isv_testkit::cube(1.0);
    for bits in [0, 31] {
        assert!(matches!(draco.encode(&cube, bits), Err(DracoError::PositionBits { .. })));
    }
    let nothing = draco.encode(&TriangleMesh::default(), 10);
    assert!(matches!(nothing, Err(DracoError::Mesh(MeshError::NoFaces))));
    let error = draco.decode(b"not a mesh").unwrap_err();
    assert!(matches!(error, DracoError::Program(ProgramError::Failed { .. })), "{error}");
}
