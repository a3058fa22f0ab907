//! Arrays as NumPy writes them.

use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A file of NumPy's format 1.0. `descr` is NumPy's name of the type, `shape` a Python tuple.
#[must_use]
pub fn file(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

/// The bytes of numbers, one after the other.
pub fn bytes_of<const N: usize, T>(
    values: impl IntoIterator<Item = T>,
    to_bytes: fn(T) -> [u8; N],
) -> Vec<u8> {
    values.into_iter().flat_map(to_bytes).collect()
}

/// Places of blocks, a row each.
#[must_use]
pub fn coords(rows: &[[i32; 3]]) -> Vec<u8> {
    file("<i4", &format!("({}, 3)", rows.len()), &bytes_of(rows.iter().flatten().copied(), i32::to_le_bytes))
}

/// `n` blocks of 4 whose values count up in steps of 1/128, from -1 on.
#[must_use]
pub fn ramp(n: usize) -> Vec<f32> {
    (0..64 * n).map(|i| (i % 256) as f32 / 128.0 - 1.0).collect()
}

/// Distances in blocks of 4.
#[must_use]
pub fn tsdf(values: &[f32]) -> Vec<u8> {
    let shape = format!("({}, 4, 4, 4)", values.len() / 64);
    file("<f4", &shape, &bytes_of(values.iter().copied(), f32::to_le_bytes))
}

/// An archive of arrays by name, as `numpy.savez` writes it, or packed as `numpy.savez_compressed` does.
#[must_use]
pub fn archive(arrays: &[(&str, &[u8])], packed: bool) -> Vec<u8> {
    let method = if packed { CompressionMethod::Deflated } else { CompressionMethod::Stored };
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        archive
            .start_file(format!("{name}.npy"), SimpleFileOptions::default().compression_method(method))
            .unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}
