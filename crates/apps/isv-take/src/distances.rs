//! Distances for decoded fields, which profile `main` codes at the surface alone.

use crate::{MemoryError, MemoryLimit};
use isv_ingest::{IngestError, redistance};
use isv_surface::SurfaceOptions;
use isv_volume::SparseVolume;
use thiserror::Error;

/// A decoded frame that cannot be given distances.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DistancesError {
    /// The surface takes too much memory.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The surface cannot become a volume.
    #[error(transparent)]
    Ingest(#[from] IngestError),
}

/// A frame that was decoded in profile `main` with distances wherever it has samples, and not at the surface alone.
///
/// # Errors
/// See [`DistancesError`].
pub fn with_distances(volume: &SparseVolume, memory: MemoryLimit) -> Result<SparseVolume, DistancesError> {
    let surface = memory.surface(volume, SurfaceOptions::default())?;
    let max_blocks = memory.decoder_limits().frame_voxels / volume.grid().edge.block_voxels();
    Ok(redistance(volume, &surface, max_blocks)?)
}
