//! Meshes and points as files, and as frames on a pipe.

use super::{Seeds, tetrahedron};
use anyhow::Result;
use glam::DVec3;
use isv::raw::io::{Format, decode_image, write_mesh_to, write_points_to};
use isv::raw::volume::{Appearance, Material, PointCloud, TriangleMesh};
use isv_testfiles::{e57, image, lidar, pcd, ply, tar, text};
use std::sync::Arc;

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
    save_coloured(seeds)?;
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

/// Files with colours, and images of textures.
fn save_coloured(seeds: &mut Seeds) -> Result<()> {
    for (_, bytes, _) in image::gradients() {
        seeds.save("image", &bytes)?;
    }
    for bytes in [image::GREY_JPEG, image::ASTC_KTX2, &image::four_colours()] {
        seeds.save("image", bytes)?;
    }
    for mesh in [coloured(), textured()?] {
        for format in [Format::Ply, Format::Obj, Format::Glb] {
            let mut bytes = Vec::new();
            write_mesh_to(&mut bytes, &mesh, format)?;
            seeds.save(format.extension(), &bytes)?;
            if format == Format::Glb {
                seeds.save("animation", &bytes)?;
            }
        }
    }
    for text in [MATERIALS, MATERIAL_OPTIONS] {
        seeds.save("obj", text.as_bytes())?;
    }
    seeds.save("ply", PLY_TEXTURES.as_bytes())?;
    seeds.save("off", b"COFF\n3 1 0\n0 0 0 1 0 0 1\n1 0 0 0 1 0 1\n0 1 0 0 0 1 1\n3 0 1 2 0.5 0.5 0.5\n")?;
    seeds.save(
        "pcd",
        b"FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 1\nDATA ascii\n1 2 3 4.2107520e+06\n",
    )?;
    seeds.save("xyz", b"# x y z r g b\n1 2 3 255 0 0\n")?;
    let points = PointCloud { colours: vec![[1, 2, 3]; 20], ..points() };
    for format in [Format::Ply, Format::Pcd, Format::Xyz] {
        let mut bytes = Vec::new();
        write_points_to(&mut bytes, &points, format)?;
        seeds.save(format.extension(), &bytes)?;
    }
    Ok(())
}

/// An OBJ file and its library, whose first material begins it.
const MATERIALS: &str = "mtllib frame.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\n\
    f 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3\nnewmtl a\nKd 1 0.5 0\nmap_Kd a.png\nnewmtl b\nKd 0 0 1\n";
const MATERIAL_OPTIONS: &str = "mtllib frame.mtl\nv 0 0 0\nv 4 1 0\nv 0 2 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\n\
    f 1/-3 2/-2 3/-1 4/1\nnewmtl a\nmap_Kd -s 1 2 3 -o 0.5 -clamp on -mm 0 1 -imfchan m ./a.png\n";

/// Two textures, of which the faces say which is theirs.
const PLY_TEXTURES: &str = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nproperty float s\nproperty float t\nelement face 2\nproperty list uchar int vertex_indices\n\
    property list uchar float texcoord\nproperty int texnumber\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
    end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2 6 0 0 1 0 0 1 0 1 2 3\n3 0 1 2 0 -1 4 5 6\n";

fn coloured() -> TriangleMesh {
    let vertex_colours = vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3]];
    let appearance = Appearance { vertex_colours, ..Appearance::default() };
    TriangleMesh { appearance: Some(Arc::new(appearance)), ..tetrahedron() }
}

fn textured() -> Result<TriangleMesh> {
    let image = Arc::new(decode_image(&image::four_colours(), "seed")?);
    let skin = Material { texture: Some(image), ..Material::default() };
    let appearance = Appearance {
        texture_coordinates: vec![[[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]; 4],
        face_materials: vec![0, 1, 0, 1],
        materials: vec![skin, Material { base_colour: [0.5; 3], ..Material::default() }],
        ..Appearance::default()
    };
    Ok(TriangleMesh { appearance: Some(Arc::new(appearance)), ..tetrahedron() })
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
