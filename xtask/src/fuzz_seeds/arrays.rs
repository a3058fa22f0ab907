//! Volumes as arrays, one file after the other: what describes them, if anything does, then places, distances, and weights.

use super::Seeds;
use super::streams::volume;
use anyhow::Result;
use isv::io::write_volume;
use isv::volume::BlockEdge;
use isv_testfiles::npy::{bytes_of, coords, file, ramp, tsdf};
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
