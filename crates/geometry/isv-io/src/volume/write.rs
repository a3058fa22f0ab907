//! From a volume to arrays.

use super::description::{Description, TsdfUnit};
use super::{COLOUR_NORMAL, COLOUR_POSITION, COLOUR_RGB, COORDS, DESCRIPTION, TSDF, WEIGHT, npy};
use crate::own::COMMENT;
use crate::{AtomicFile, WriteError};
use isv_volume::{ColourSample, SparseVolume};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// Writes a volume as a folder of arrays, which is made if it is not there. Distances are `float32` in
/// truncation distances. Weights are `uint8`, 1 where observed and 0 elsewhere. The rest is in `grid.json`.
/// Reading it back gives the same volume, but for the samples of unobserved voxels, which have no meaning.
/// Colours that the folder had of another volume are removed.
///
/// # Errors
/// [`WriteError`]; each file is replaced whole or not at all.
pub fn write_volume(folder: &Path, volume: &SparseVolume) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|cause| WriteError::new(folder, cause))?;
    let grid = volume.grid();
    let description = Description {
        comment: COMMENT,
        voxel_size_m: Some(grid.voxel_size.metres()),
        truncation_m: Some(grid.voxel_size.metres() * f64::from(grid.truncation.voxels())),
        tsdf_unit: TsdfUnit::Truncation,
    };
    // First, so that what is there of a job that was killed says whose it is.
    write_file(&folder.join(DESCRIPTION), |file| {
        serde_json::to_writer_pretty(&mut *file, &description)?;
        writeln!(file)
    })?;
    for name in [COLOUR_POSITION, COLOUR_NORMAL, COLOUR_RGB] {
        let path = folder.join(name);
        match std::fs::remove_file(&path) {
            Err(cause) if cause.kind() != ErrorKind::NotFound => return Err(WriteError::new(&path, cause)),
            _ => {}
        }
    }
    let n = grid.edge.voxels();
    let shape = [volume.block_count(), n, n, n];
    write_file(&folder.join(COORDS), |file| {
        file.write_all(&npy::header("<i4", &[volume.block_count(), 3]))?;
        let axes = volume.coords().iter().flat_map(|coord| coord.to_array());
        axes.into_iter().try_for_each(|axis| file.write_all(&axis.to_le_bytes()))
    })?;
    write_file(&folder.join(TSDF), |file| {
        file.write_all(&npy::header("<f4", &shape))?;
        let limit = f32::from(grid.truncation.codes());
        let mut distances = volume.samples().map(|code| f32::from(code) / limit);
        distances.try_for_each(|distance| file.write_all(&distance.to_le_bytes()))
    })?;
    write_file(&folder.join(WEIGHT), |file| {
        file.write_all(&npy::header("|u1", &shape))?;
        (0..volume.block_count()).try_for_each(|block| file.write_all(&weights(volume, block)))
    })
}

/// Writes the colours of a volume's surface beside its arrays: places in metres and unit normals as `float32`, sRGB as `uint8`.
///
/// # Errors
/// [`WriteError`]; each file is replaced whole or not at all.
pub fn write_volume_colours(folder: &Path, samples: &[ColourSample]) -> Result<(), WriteError> {
    let shape = [samples.len(), 3];
    let floats = |name: &str, of: fn(&ColourSample) -> [f32; 3]| {
        write_file(&folder.join(name), |file| {
            file.write_all(&npy::header("<f4", &shape))?;
            samples.iter().flat_map(of).try_for_each(|value| file.write_all(&value.to_le_bytes()))
        })
    };
    floats(COLOUR_POSITION, |sample| sample.position)?;
    floats(COLOUR_NORMAL, |sample| sample.normal)?;
    write_file(&folder.join(COLOUR_RGB), |file| {
        file.write_all(&npy::header("|u1", &shape))?;
        let bytes = |sample: &ColourSample| sample.colour.map(|channel| channel.round() as u8);
        samples.iter().try_for_each(|sample| file.write_all(&bytes(sample)))
    })
}

/// Weights of a block's voxels.
fn weights(volume: &SparseVolume, block: usize) -> Vec<u8> {
    let unobserved = volume.unobserved(block);
    let observed = |voxel| unobserved.is_none_or(|mask| !mask.contains(voxel));
    (0..volume.grid().edge.block_voxels()).map(|voxel| u8::from(observed(voxel))).collect()
}

fn write_file(path: &Path, fill: impl FnOnce(&mut AtomicFile) -> io::Result<()>) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    fill(&mut file).map_err(|cause| WriteError::new(path, cause))?;
    file.commit()
}
