//! How much memory a frame may ask for.

use isv_decode::Limits;
use isv_surface::{PartChanges, SurfaceExtractor, SurfaceOptions, SurfaceParts, TooManyVertices};
use isv_volume::{BlockSet, SparseVolume, TriangleMesh};
use thiserror::Error;

/// Bytes that decoding takes at its peak for each voxel of a frame, rounded up. These are two samples of two
/// bytes, of the frame and of the one before. Levels, tables and what is made of the volume take as much
/// (`docs/design/031-hostile-files.md`).
const BYTES_PER_VOXEL: u64 = 8;

/// Memory for the frames of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryLimit {
    /// Bytes; `None` for 3 billion voxels, and no more than what the stream's bytes make likely.
    pub bytes: Option<u64>,
}

/// A frame that needs more memory than there is.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MemoryError {
    /// A surface with too many vertices.
    #[error(transparent)]
    Surface(#[from] TooManyVertices),
    /// A volume whose decoded frame would be refused.
    #[error("the decoded frame would have {blocks} blocks, above the limit of {limit}")]
    Frame {
        /// Blocks of the decoded frame.
        blocks: usize,
        /// Blocks that there is memory for.
        limit: usize,
    },
}

impl MemoryLimit {
    /// Bounds on what a stream may ask of its decoder. Who says how much memory there is trusts the stream to use it.
    #[must_use]
    pub fn decoder_limits(self) -> Limits {
        self.bytes.map_or_else(Limits::default, |bytes| Limits {
            frame_voxels: usize::try_from(bytes / BYTES_PER_VOXEL).unwrap_or(usize::MAX),
            voxels_per_byte: usize::MAX,
        })
    }

    /// Largest payload (bytes) of a packet worth reading: a frame that is larger than its samples was not compressed.
    #[must_use]
    pub fn largest_payload(self) -> u32 {
        let bytes = self.bytes.map_or(u64::MAX, |bytes| bytes / 4);
        u32::try_from(bytes).unwrap_or(u32::MAX)
    }

    /// Extracts the surface of a volume, of as many vertices as there is memory for. Each takes, with its
    /// normal and its triangles, what eight voxels do.
    ///
    /// # Errors
    /// [`MemoryError::Surface`].
    pub fn surface(
        self,
        volume: &SparseVolume,
        options: SurfaceOptions,
    ) -> Result<TriangleMesh, MemoryError> {
        let mut extractor = SurfaceExtractor::new(options);
        extractor.extract_within(volume, self.most_vertices().min(u32::MAX as usize))?;
        Ok(extractor.into_mesh())
    }

    /// Brings the parts of a surface up to a volume, if there is memory for as many vertices.
    ///
    /// # Errors
    /// [`MemoryError::Surface`].
    pub fn update_parts(
        self,
        parts: &mut SurfaceParts,
        volume: &SparseVolume,
    ) -> Result<PartChanges, MemoryError> {
        Ok(parts.update_within(volume, self.most_vertices())?)
    }

    fn most_vertices(self) -> usize {
        self.decoder_limits().frame_voxels / 8
    }

    /// Refuses a volume whose decoded frame would be refused. `extended`: whether decoders make up the blocks around it, as they do
    /// in profile `main`.
    ///
    /// # Errors
    /// [`MemoryError::Frame`].
    pub fn check_frame(self, volume: &SparseVolume, extended: bool) -> Result<(), MemoryError> {
        let limit = self.decoder_limits().frame_voxels / volume.grid().edge.block_voxels();
        let with_neighbours = || BlockSet::from_coords(volume.coords()).dilated().count();
        let blocks = match extended {
            // Mostly there is room for all neighbours that so many blocks can have.
            true if volume.block_count() > limit / 27 => with_neighbours(),
            _ => volume.block_count(),
        };
        if blocks <= limit { Ok(()) } else { Err(MemoryError::Frame { blocks, limit }) }
    }
}
