//! Colours of meshes and points, read and written.

mod captures;
mod gltf;
mod images;
mod meshes;
mod output;
mod points;

use isv_io::{Colours, Geometry, ReadError, ReadOptions, Unit, parse_geometry_as, read_geometry_as};
use isv_volume::{Appearance, PointCloud, TriangleMesh};
use std::path::Path;

const KEEP: ReadOptions =
    ReadOptions { unit: Unit::Metre, invalid_points: isv_io::InvalidPoints::Refuse, colours: Colours::Keep };

fn as_mesh(geometry: Geometry) -> TriangleMesh {
    match geometry {
        Geometry::Mesh(mesh) => mesh,
        Geometry::Points(points) => panic!("{points:?}"),
    }
}

fn as_points(geometry: Geometry) -> PointCloud {
    match geometry {
        Geometry::Points(points) => points,
        Geometry::Mesh(mesh) => panic!("{mesh:?}"),
    }
}

fn parse(name: &str, bytes: &[u8]) -> Result<Geometry, ReadError> {
    parse_geometry_as(Path::new(name), bytes, &KEEP)
}

/// Reads the first of some files of a folder. Without colours it must read as well, with the same geometry.
fn read(files: &[(&str, &[u8])]) -> Result<Geometry, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let path = folder.path().join(files[0].0);
    let plain = read_geometry_as(&path, &ReadOptions::new(Unit::Metre)).unwrap();
    let read = read_geometry_as(&path, &KEEP);
    if let Ok(coloured) = &read {
        let mut bare = coloured.clone();
        match &mut bare {
            Geometry::Mesh(mesh) => mesh.appearance = None,
            Geometry::Points(points) => points.colours.clear(),
        }
        assert_eq!(bare, plain, "colours change no geometry");
    }
    read
}

/// The message of an error, without the folder of its file.
fn message(files: &[(&str, &[u8])]) -> String {
    let text = read(files).unwrap_err().to_string();
    text[text.find(files[0].0).unwrap()..].to_owned()
}

/// Colour of a corner of a face, rounded.
fn corner(mesh: &TriangleMesh, face: usize, corner: usize) -> [u8; 3] {
    let mut weights = [0.0; 3];
    weights[corner] = 1.0;
    colour(mesh, face, weights)
}

fn colour(mesh: &TriangleMesh, face: usize, weights: [f32; 3]) -> [u8; 3] {
    let colour = appearance(mesh).colour(face, mesh.triangles[face], weights);
    colour.map(|value| value.round() as u8)
}

fn appearance(mesh: &TriangleMesh) -> &Appearance {
    mesh.appearance.as_deref().unwrap()
}

const RED: [u8; 3] = [255, 0, 0];
const GREEN: [u8; 3] = [0, 255, 0];
const BLUE: [u8; 3] = [0, 0, 255];
const WHITE: [u8; 3] = [255; 3];
