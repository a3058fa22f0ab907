//! OpenVDB files (version 224): a volume as one level set, a float grid of the tree 5-4-3.
//!
//! ```text
//! file header, metadata of the file, grid descriptor
//! grid: compression flags, metadata, transform, tree topology (root, nodes of 32^3, nodes of 16^3, leaf masks), leaf values
//! ```
//!
//! Nothing is compressed, but inactive tiles, which are all plus or minus the background, take a bit each. Verified with OpenVDB
//! itself: `docs/design/012-volumes-out.md`.

mod leaf;
mod sign;
mod tree;

use crate::own::COMMENT;
use crate::{AtomicFile, Unit, WriteError};
use glam::DVec3;
use isv_volume::SparseVolume;
use leaf::Leaves;
use std::io::Write;
use std::path::Path;
use tree::write_topology;

/// First bytes of a file.
const MAGIC: [u8; 8] = *b" BDV\0\0\0\0";
/// Version of the file format.
const FILE_VERSION: u32 = 224;
/// Version of the library that first wrote what is written here.
const LIBRARY_VERSION: [u32; 2] = [10, 0];
/// Identifies a file among copies of itself; ours are the same whenever they are written.
const UUID: &[u8; 36] = b"00000000-0000-0000-0000-000000000000";
const TREE: &str = "Tree_float_5_4_3";
/// Compression flag: nodes say by a mask which inactive tiles are the background and which minus the background.
const ACTIVE_MASK: u32 = 2;
/// All values of a leaf follow.
const ALL_VALUES: u8 = 6;

/// Writes a volume as an OpenVDB level set named `tsdf`.
///
/// Values are metres, positive outside, clamped to the truncation, which is the background. Voxels are active that were
/// observed and lie within the truncation; others hold plus or minus the background. Voxel `i` has its centre at
/// `(i + 0.5) * voxel size`, as the grid's transform says. Regions that no block covers are inside or outside as the blocks
/// around them are.
///
/// # Errors
/// [`WriteError`]; the file appears whole or not at all.
pub fn write_vdb(path: &Path, volume: &SparseVolume) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    write_vdb_to(&mut file, volume).map_err(|cause| WriteError::new(path, cause))?;
    file.commit()
}

/// Writes what [`write_vdb`] does to anything that takes bytes.
///
/// # Errors
/// Those of `file`.
pub fn write_vdb_to(file: &mut impl Write, volume: &SparseVolume) -> std::io::Result<()> {
    write_vdb_placed(file, volume, Unit::Metre, DVec3::ZERO)
}

/// Writes what [`write_vdb`] does with distances and places in a unit, and with the volume's origin at `origin` in that unit.
///
/// # Errors
/// Those of `file`.
pub fn write_vdb_placed(
    file: &mut impl Write,
    volume: &SparseVolume,
    unit: Unit,
    origin: DVec3,
) -> std::io::Result<()> {
    let leaves = Leaves::new(volume, unit);
    let header = file_header();
    let grid = grid_header(&leaves, origin);
    // The three positions are the last fields of the descriptor.
    let mut descriptor = text("tsdf");
    descriptor.extend(text(TREE));
    descriptor.extend(text(""));
    let grid_at = header.len() + descriptor.len() + 3 * size_of::<u64>();
    let values_at = grid_at + grid.len();
    let end = values_at + leaves.origins().len() * leaf::VALUE_BYTES;
    [grid_at, values_at, end].iter().for_each(|at| descriptor.extend((*at as u64).to_le_bytes()));
    file.write_all(&header)?;
    file.write_all(&descriptor)?;
    file.write_all(&grid)?;
    leaves.origins().iter().try_for_each(|origin| file.write_all(&leaves.leaf(*origin).to_bytes()))
}

fn file_header() -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(FILE_VERSION.to_le_bytes());
    LIBRARY_VERSION.iter().for_each(|part| bytes.extend(part.to_le_bytes()));
    // Positions of the grid follow, so that a reader may seek.
    bytes.push(1);
    bytes.extend(UUID);
    bytes.extend(metadata(&[("creator", "string", COMMENT.as_bytes())]));
    // One grid.
    bytes.extend(1u32.to_le_bytes());
    bytes
}

/// Names, types and values after their number.
fn metadata(entries: &[(&str, &str, &[u8])]) -> Vec<u8> {
    let mut bytes = (entries.len() as u32).to_le_bytes().to_vec();
    for (name, kind, value) in entries {
        bytes.extend(text(name));
        bytes.extend(text(kind));
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(*value);
    }
    bytes
}

/// All of the grid but the values of its leaves.
fn grid_header(leaves: &Leaves, origin: DVec3) -> Vec<u8> {
    let mut bytes = ACTIVE_MASK.to_le_bytes().to_vec();
    bytes.extend(metadata(&[
        ("class", "string", b"level set"),
        ("name", "string", b"tsdf"),
        ("is_saved_as_half_float", "bool", &[0]),
    ]));
    bytes.extend(transform(leaves.voxel_size(), origin));
    // One buffer a leaf.
    bytes.extend(1u32.to_le_bytes());
    write_topology(leaves, &mut bytes);
    bytes
}

/// Transform from voxel indices to places, with what the library keeps of it. These are translation, scale,
/// voxel size, 1 / scale, 1 / scale^2 and 1 / (2 scale), three numbers each.
fn transform(size: f64, origin: DVec3) -> Vec<u8> {
    let mut bytes = text("UniformScaleTranslateMap");
    for axis in origin.to_array() {
        bytes.extend((axis + 0.5 * size).to_le_bytes());
    }
    for value in [size, size, 1.0 / size, 1.0 / (size * size), 0.5 / size] {
        (0..3).for_each(|_| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// A text after its length.
fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}
