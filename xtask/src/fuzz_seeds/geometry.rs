//! Meshes and points as files, and as frames on a pipe.

use super::{Seeds, tetrahedron};
use anyhow::Result;
use glam::DVec3;
use isv::raw::io::{Format, write_mesh_to, write_points_to};
use isv::raw::volume::PointCloud;
use isv_testfiles::{e57, lidar, pcd, ply, tar, text};

pub(super) fn save(seeds: &mut Seeds) -> Result<()> {
    save_written(seeds)?;
    for (name, text) in text::MESHES {
        let target = if name.ends_with("stl") {
            "stl"
        } else if name.ends_with("off") {
            "off"
        } else {
            "obj"
        };
        seeds.save(target, text.as_bytes())?;
    }
    for text in text::TWO_POINTS.iter().chain(&text::NORMALS) {
        seeds.save("xyz", text.as_bytes())?;
    }
    for encoding in ply::ENCODINGS {
        seeds.save("ply", &ply::baroque(encoding))?;
        for kind in ply::TYPES {
            seeds.save("ply", &ply::triangle_of_type(encoding, kind))?;
        }
    }
    seeds.save("ply", ply::STRIPS.as_bytes())?;
    seeds.save("ply", ply::POINTS.as_bytes())?;
    for file in pcd::baroque_files() {
        seeds.save("pcd", &file)?;
    }
    seeds.save("pcd", PCD_OF_OLD.as_bytes())?;
    seeds.save("pcd", PCD_IMAGE.as_bytes())?;
    seeds.save("pcd", &pcd_with_long_repeats())?;
    save_lidar(seeds)?;
    for scans in [
        vec![e57::cartesian(None)],
        vec![e57::cartesian(Some(e57::quarter_turn()))],
        vec![e57::spherical()],
        vec![e57::of_all_types()],
        vec![e57::cartesian(Some(e57::quarter_turn())), e57::spherical()],
    ] {
        seeds.save("e57", &e57::file(scans))?;
    }
    save_pipes(seeds)
}

/// What the library writes, with normals and without.
fn save_written(seeds: &mut Seeds) -> Result<()> {
    let mut mesh = tetrahedron();
    for normals in [vec![], vec![DVec3::Y; 4]] {
        mesh.normals = normals;
        for format in Format::ALL.iter().filter(|format| format.writes_mesh()) {
            let mut bytes = Vec::new();
            write_mesh_to(&mut bytes, &mesh, *format)?;
            seeds.save(format.extension(), &bytes)?;
        }
    }
    for points in [points(), PointCloud { viewpoint: Some(DVec3::Z), normals: vec![], ..points() }] {
        for format in Format::ALL.iter().filter(|format| format.writes_points()) {
            let mut bytes = Vec::new();
            write_points_to(&mut bytes, &points, *format)?;
            seeds.save(format.extension(), &bytes)?;
        }
    }
    Ok(())
}

fn points() -> PointCloud {
    let positions = (0..20).map(|i| DVec3::new(f64::from(i % 5), f64::from(i / 5), 0.0) / 100.0).collect();
    PointCloud {
        positions,
        normals: vec![DVec3::Z; 20],
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

/// Points of a lidar file.
const LIDAR_POINTS: usize = 20;
/// Points a chunk, so that there are several.
const CHUNK_POINTS: u32 = 7;

/// Each point format without compression, and with each version of LASzip's, in one chunk and in several.
fn save_lidar(seeds: &mut Seeds) -> Result<()> {
    for format in 0..=10 {
        for (extra_bytes, chunk_points) in [(0, 1000), (3, CHUNK_POINTS)] {
            let plain = lidar::file(format, false, extra_bytes, LIDAR_POINTS);
            seeds.save("las", &plain)?;
            for items in lidar::item_versions(format, extra_bytes) {
                let compressed = lidar::compressed(&plain, items, chunk_points);
                seeds.save("laz", &compressed)?;
                if format < 6 && extra_bytes == 0 {
                    seeds.save("laz", &lidar::without_chunks(&compressed))?;
                }
            }
        }
    }
    Ok(())
}

const PCD_OF_OLD: &str = "COLUMNS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n";

/// Points in rows and columns, some of them missing.
const PCD_IMAGE: &str = "FIELDS x y z\nWIDTH 2\nHEIGHT 2\nDATA ascii\n1 2 3\nnan 1 1\n4 5 6\n1 nan nan\n";

/// Compressed points that are packed by back references of both lengths.
fn pcd_with_long_repeats() -> Vec<u8> {
    let columns = [[1f32; 20], [2.5; 20], [-3.0; 20]].concat();
    let bytes: Vec<u8> = columns.iter().flat_map(|value| value.to_le_bytes()).collect();
    [b"FIELDS x y z\nPOINTS 20\nDATA binary_compressed\n", &pcd::compressed(&bytes)[..]].concat()
}

/// Archives of each kind of header and of several kinds of frames, and PLY files one after the other.
fn save_pipes(seeds: &mut Seeds) -> Result<()> {
    let [mut binary, mut obj] = [Vec::new(), Vec::new()];
    write_mesh_to(&mut binary, &tetrahedron(), Format::Ply)?;
    write_mesh_to(&mut obj, &tetrahedron(), Format::Obj)?;
    let text = ply::text_of(&tetrahedron());
    for files in [
        [&binary[..], &binary].concat(),
        [&text[..], &binary, b"\n", &text].concat(),
        [ply::baroque("ascii"), ply::baroque("binary_big_endian")].concat(),
        [ply::POINTS.as_bytes(), ply::POINTS.as_bytes()].concat(),
    ] {
        seeds.save("pipe", &files)?;
    }
    let [pcd, _, _] = pcd::baroque_files();
    for archive in [
        tar::archive([("0.ply", &binary[..]), ("1.ply", &text)]),
        tar::archive([("0.obj", &obj[..]), ("a/1.OBJ", &obj)]),
        tar::archive([("0.pcd", &pcd[..])]),
        tar::archive([("0.xyz", text::TWO_POINTS[0].as_bytes()), ("1.xyz", text::NORMALS[0].as_bytes())]),
        tar::archive([(&tar::long_name()[..], &text[..])]),
        tar::with_others([("take/a.ply", &text[..])]),
        tar::with_pax_records("named by pax.ply", &text),
    ] {
        seeds.save("pipe", &archive)?;
    }
    Ok(())
}
