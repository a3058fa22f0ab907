//! Decoded frames.

use crate::{Error, ErrorKind, Mesh, Points};
use isv_decode::colour::{ColourFrame, surface_colours};
use isv_format::{Profile, StreamHeader};
use isv_surface::{PartChanges, PointDensity, SurfaceOptions, SurfaceParts, sample_evenly};
use isv_take::MemoryLimit;
use isv_take::stream::StreamFrame;
use isv_volume::{BlockSet, CODES_PER_VOXEL, Grid, SparseVolume, TriangleMesh};
use std::sync::Arc;
use std::time::Duration;

/// A decoded frame. Its surface and its field are made when they are asked for.
#[derive(Clone, Debug)]
pub struct Frame {
    number: usize,
    timestamp: Duration,
    volume: SparseVolume,
    /// Blocks that were coded, in profile `main`.
    coded_blocks: Option<BlockSet>,
    /// Colour, if the stream has any.
    colour: Option<Arc<ColourFrame>>,
    profile: Profile,
    grid: Grid,
    memory: MemoryLimit,
}

/// A sparse signed distance field. Blocks that are not there are outside, or were not observed.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Edge of a voxel (m).
    pub voxel_m: f64,
    /// Edge of a block (voxels): 4, 8 or 16.
    pub edge: u32,
    /// Distance from the surface at which distances are cut off (voxels).
    pub truncation_voxels: u32,
    /// The blocks, each of them once.
    pub blocks: Vec<Block>,
}

/// A sparse signed distance field as plain arrays: what [`Volume`] holds, block after block.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeArrays {
    /// Edge of a voxel (m).
    pub voxel_m: f64,
    /// Edge of a block (voxels): 4, 8 or 16.
    pub edge: u32,
    /// Distance from the surface at which distances are cut off (voxels).
    pub truncation_voxels: u32,
    /// Places of the blocks, in blocks, each of them once.
    pub coords: Vec<[i32; 3]>,
    /// Distances of all blocks, in the order of [`Self::coords`]; those of a block as in [`Block::distances_m`].
    pub distances_m: Vec<f32>,
}

/// A block of a [`Volume`].
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Place of the block, in blocks: its lowest corner is at `coord * edge * voxel_m`.
    pub coord: [i32; 3],
    /// Distances at the centres of the voxels (m), negative inside, x fastest, then y, then z; NaN where a voxel was not observed.
    pub distances_m: Vec<f32>,
}

impl Frame {
    pub(crate) fn new(frame: StreamFrame, header: &StreamHeader, memory: MemoryLimit) -> Result<Self, Error> {
        let StreamFrame { number, timestamp_ns, volume, coded_blocks, colour, .. } = frame;
        let volume = volume.into_sparse()?;
        let timestamp = Duration::from_nanos(timestamp_ns);
        let (profile, grid) = (header.profile, header.grid);
        Ok(Self { number, timestamp, volume, coded_blocks, colour, profile, grid, memory })
    }

    /// Number in the stream, from 0.
    #[must_use]
    pub fn number(&self) -> usize {
        self.number
    }

    /// Time at which it is shown, from the stream's start or, in a live stream, from 1970.
    #[must_use]
    pub fn timestamp(&self) -> Duration {
        self.timestamp
    }

    /// Extracts the surface, with normals, and with colours if the stream has any.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a surface that there is no memory for.
    pub fn mesh(&self) -> Result<Mesh, Error> {
        self.mesh_with(SurfaceOptions { normals: true })
    }

    /// Extracts the surface as [`Self::mesh`] does, without normals, which saves the time to find them.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a surface that there is no memory for.
    pub fn mesh_without_normals(&self) -> Result<Mesh, Error> {
        self.mesh_with(SurfaceOptions { normals: false })
    }

    fn mesh_with(&self, options: SurfaceOptions) -> Result<Mesh, Error> {
        Ok(self.coloured(self.memory.surface(&self.volume, options)?))
    }

    /// A part of the surface with its colours.
    pub(crate) fn coloured(&self, mesh: TriangleMesh) -> Mesh {
        let colours = self.colour.as_ref().map(|colour| surface_colours(colour, &self.grid, &mesh.vertices));
        Mesh { colours: colours.unwrap_or_default(), ..Mesh::from_raw(mesh) }
    }

    /// Brings the parts of a surface up to this frame.
    pub(crate) fn update_parts(&self, parts: &mut SurfaceParts) -> Result<PartChanges, Error> {
        Ok(self.memory.update_parts(parts, &self.volume)?)
    }

    /// Spreads so many points evenly over the surface, with normals, and with colours if the stream has any.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a surface or points that there is no memory for.
    pub fn points(&self, count: usize) -> Result<Points, Error> {
        self.points_with(PointDensity::Count(count))
    }

    /// Spreads points evenly over the surface, each for a square of it with an edge of a voxel.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a surface or points that there is no memory for.
    pub fn points_by_voxel(&self) -> Result<Points, Error> {
        self.points_with(PointDensity::Spacing(self.volume.grid().voxel_size.metres()))
    }

    fn points_with(&self, density: PointDensity) -> Result<Points, Error> {
        let mesh = self.memory.surface(&self.volume, SurfaceOptions { normals: true })?;
        let points = sample_evenly(&mesh, density).map_err(|why| Error::new(ErrorKind::Memory, why))?;
        let colours =
            self.colour.as_ref().map(|colour| surface_colours(colour, &self.grid, &points.positions));
        Ok(Points { colours: colours.unwrap_or_default(), ..Points::from_raw(&points) })
    }

    /// Returns the field as [`Self::volume`] does, as plain arrays.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a field that there is no memory for.
    pub fn volume_arrays(&self) -> Result<VolumeArrays, Error> {
        let field = self.field()?;
        Ok(arrays_of(&field))
    }

    /// Returns the field. Streams of profile `main` keep distances near the surface alone; without the feature `io` the others of
    /// their field are extrapolations.
    ///
    /// # Errors
    /// [`ErrorKind::Memory`](crate::ErrorKind::Memory) for a field that there is no memory for.
    pub fn volume(&self) -> Result<Volume, Error> {
        let field = self.field()?;
        Ok(volume_of(&field))
    }

    #[cfg(feature = "io")]
    fn field(&self) -> Result<std::borrow::Cow<'_, SparseVolume>, Error> {
        use isv_take::DistancesError;
        use std::borrow::Cow;
        if self.profile != Profile::Main {
            return Ok(Cow::Borrowed(&self.volume));
        }
        let coded = self.coded_blocks.as_ref();
        if let Some(field) = coded.and_then(|coded| isv_ingest::coded_field(&self.volume, coded)) {
            return Ok(Cow::Owned(field));
        }
        let field = isv_take::with_distances(&self.volume, self.memory);
        field.map(Cow::Owned).map_err(|error| match error {
            DistancesError::Memory(error) => error.into(),
            other => Error::new(crate::ErrorKind::Frame, other),
        })
    }

    #[cfg(not(feature = "io"))]
    fn field(&self) -> Result<SparseVolume, Error> {
        let _ = (&self.coded_blocks, &self.profile);
        Ok(self.volume.clone())
    }
}

fn volume_of(volume: &SparseVolume) -> Volume {
    let VolumeArrays { voxel_m, edge, truncation_voxels, coords, distances_m } = arrays_of(volume);
    let blocks = distances_m.chunks_exact(volume.grid().edge.block_voxels());
    let block = |(coord, distances_m): (_, &[f32])| Block { coord, distances_m: distances_m.to_vec() };
    Volume { voxel_m, edge, truncation_voxels, blocks: coords.into_iter().zip(blocks).map(block).collect() }
}

fn arrays_of(volume: &SparseVolume) -> VolumeArrays {
    let grid = volume.grid();
    let metres_per_code = (grid.voxel_size.metres() / f64::from(CODES_PER_VOXEL)) as f32;
    let mut distances_m = Vec::with_capacity(volume.block_count() * grid.edge.block_voxels());
    for index in 0..volume.block_count() {
        let distances = volume.block(index).iter().map(|code| f32::from(*code) * metres_per_code);
        match volume.unobserved(index) {
            None => distances_m.extend(distances),
            Some(mask) => distances_m.extend(
                distances.enumerate().map(|(voxel, m)| if mask.contains(voxel) { f32::NAN } else { m }),
            ),
        }
    }
    VolumeArrays {
        voxel_m: grid.voxel_size.metres(),
        edge: grid.edge.voxels() as u32,
        truncation_voxels: grid.truncation.voxels(),
        coords: volume.coords().iter().map(|coord| coord.to_array()).collect(),
        distances_m,
    }
}
