//! Volumes as arrays, one file after the other: what describes them, if anything does, then places, distances, and weights.

use super::Seeds;
use super::streams::volume;
use anyhow::Result;
use isv::raw::io::write_volume;
use isv::raw::volume::BlockEdge;
use isv_testfiles::npy::{archive, bytes_of, coords, file, ramp, tsdf};
use std::fs;

/// The shape of one block.
const BLOCK: &str = "(1, 4, 4, 4)";

pub(super) fn save(seeds: &mut Seeds) -> Result<()> {
    seeds.save("arrays", &written()?)?;
    let (places, distances) = (coords(&[[0, 0, 0]]), tsdf(&ramp(1)));
    for description in [
        r#"{"voxel_size_m": 0.005, "truncation_m": 0.02, "tsdf_unit": "m"}"#,
        r#"{"tsdf_unit": "voxel", "comment": [1]}"#,
        r#"{"truncation_m": 1e-2, "voxel_size_m": null, "tsdf_unit": "truncation"}"#,
    ] {
        seeds.save("arrays", &[description.as_bytes(), &places, &distances].concat())?;
    }
    for places in [
        file("|i1", "(1, 3)", &[255, 1, 0]),
        file(">u2", "(1, 3)", &[0, 1, 0, 2, 0, 3]),
        file("<i8", "(1, 3)", &bytes_of([-1, 0, 7], i64::to_le_bytes)),
        file("<u4", "(1, 3)", &bytes_of([1, 0, 7], u32::to_le_bytes)),
    ] {
        seeds.save("arrays", &[&places[..], &distances].concat())?;
    }
    for distances in [
        file("<f2", BLOCK, &bytes_of((0..64).map(|i| 0x3000 + 16 * i), u16::to_le_bytes)),
        file(">f4", "(1, 4, 4, 4, 1)", &bytes_of(ramp(1), f32::to_be_bytes)),
        file("<f8", BLOCK, &bytes_of(ramp(1).into_iter().map(f64::from), f64::to_le_bytes)),
        of_version_2(&distances),
    ] {
        seeds.save("arrays", &[&places[..], &distances].concat())?;
    }
    let with_holes: Vec<f32> =
        ramp(2).iter().enumerate().map(|(i, value)| if i % 5 == 0 { f32::NAN } else { *value }).collect();
    let two = [coords(&[[7, -1, 2], [0, 0, 0]]), tsdf(&with_holes)].concat();
    let shape = "(2, 4, 4, 4)";
    for weights in [
        file("|u1", shape, &[[1; 64], [0; 64]].concat()),
        file("|b1", shape, &[1; 128]),
        file("<i2", shape, &bytes_of(-2..126, i16::to_le_bytes)),
        file(">f4", shape, &bytes_of(with_holes, f32::to_be_bytes)),
    ] {
        seeds.save("arrays", &[&two[..], &weights].concat())?;
    }
    dense(seeds)
}

/// Dense fields behind a byte of options: single arrays of each type, and archives.
fn dense(seeds: &mut Seeds) -> Result<()> {
    let shape = "(8, 8, 8)";
    let field: Vec<f32> = (0..512).map(|i| (i / 64) as f32 - 3.2).collect();
    let plain = file("<f4", shape, &bytes_of(field.iter().copied(), f32::to_le_bytes));
    let arrays = [
        plain.clone(),
        file("<f2", "(8, 8, 8, 1)", &bytes_of((0..512).map(|i| 0x3000 + 16 * i), u16::to_le_bytes)),
        file("|i1", shape, &(0..512).map(|i| i as u8).collect::<Vec<_>>()),
        file(">f8", shape, &bytes_of(field.into_iter().map(f64::from), f64::to_be_bytes)),
    ];
    let number = |metres: f64| file("<f8", "()", &metres.to_le_bytes());
    let (voxel, truncation) = (number(0.02), number(0.08));
    let origin = file("<f8", "(3,)", &bytes_of([0.005, 0.0, -0.013], f64::to_le_bytes));
    let weights = file("|u1", shape, &[1; 512]);
    let members: [(&str, &[u8]); 5] = [
        ("tsdf", &plain),
        ("weight", &weights),
        ("voxel_size", &voxel),
        ("truncation", &truncation),
        ("origin", &origin),
    ];
    for (options, array) in (0..).zip(arrays) {
        seeds.save("dense", &[&[options], &array[..]].concat())?;
    }
    for packed in [false, true] {
        for members in [&members[..], &members[..1]] {
            seeds.save("dense", &[&[0], &archive(members, packed)[..]].concat())?;
        }
    }
    Ok(())
}

/// What the library writes, but for the description.
fn written() -> Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("frame");
    write_volume(&path, &volume(BlockEdge::E4)?)?;
    Ok([fs::read(path.join("coords.npy"))?, fs::read(path.join("tsdf.npy"))?].concat())
}

/// A file of format 1.0 as one of 2.0, whose header may be longer.
fn of_version_2(file: &[u8]) -> Vec<u8> {
    [&file[..6], &[2, 0], &file[8..10], &[0, 0], &file[10..]].concat()
}
