//! Files for the fuzz targets to start from, one folder a target. Small ones: a fuzzer changes them thousands
//! of times a second. But there is one of every kind that is read. What stands behind a type, a compression
//! or a checksum, no fuzzer finds from a file without it.

mod arrays;
mod depth;
mod geometry;
mod gltf;
mod streams;

use anyhow::Result;
use glam::DVec3;
use isv::raw::volume::{BlockEdge, Grid, TriangleMesh, Truncation, VoxelSize};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Writes the seeds of all targets into `corpus`.
pub(crate) fn run(corpus: &str) -> Result<()> {
    let mut seeds = Seeds { corpus: Path::new(corpus), counts: BTreeMap::new() };
    geometry::save(&mut seeds)?;
    gltf::save(&mut seeds)?;
    depth::save(&mut seeds)?;
    arrays::save(&mut seeds)?;
    streams::save(&mut seeds)?;
    for range in ["bytes=0-9", "bytes=5-", "bytes=-5", "bytes=0-1,4-5"] {
        seeds.save("range_header", range.as_bytes())?;
    }
    Ok(())
}

/// Seeds are numbered, so that those of another time do not stay beside them.
struct Seeds<'a> {
    corpus: &'a Path,
    counts: BTreeMap<&'static str, usize>,
}

impl Seeds<'_> {
    fn save(&mut self, target: &'static str, bytes: &[u8]) -> Result<()> {
        let count = self.counts.entry(target).or_default();
        let folder = self.corpus.join(target);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(format!("seed_{count:02}")), bytes)?;
        *count += 1;
        Ok(())
    }
}

fn grid(edge: BlockEdge) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.02).expect("in range"),
        edge,
        truncation: Truncation::from_voxels(2).expect("in range"),
    }
}

fn tetrahedron() -> TriangleMesh {
    TriangleMesh {
        vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
            .map(|v| DVec3::from(v.map(f64::from)) / 10.0)
            .to_vec(),
        normals: Vec::new(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        appearance: None,
    }
}
