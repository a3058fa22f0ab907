//! A volume that grows image by image.

use crate::backend::{Cpu, FusionBackend};
use crate::blocks::Blocks;
use crate::{FusionError, FusionSettings, limits};
use isv_volume::{DepthImage, SparseVolume};

/// Fuses images taken one after the other, by a camera that moves through a scene that stands still.
///
/// Later images refine what was seen before, extend it, and take away what is no longer there. A voxel behind
/// a surface becomes free space once images see past it, for longer than the surface had been seen.
#[derive(Clone, Debug)]
pub struct Accumulator<B: FusionBackend = Cpu> {
    settings: FusionSettings,
    backend: B,
    sums: B::Sums,
    /// Why the sums are gone, if they are.
    lost: Option<FusionError>,
}

impl Accumulator {
    /// An accumulator that has seen nothing.
    #[must_use]
    pub fn new(settings: FusionSettings) -> Self {
        Self::with_backend(Cpu, settings)
    }

    /// The volume of all that was seen so far; empty before the first images.
    #[must_use]
    pub fn volume(&self) -> SparseVolume {
        let grid = self.settings.grid;
        Blocks::new(grid, Cpu::coords(&self.sums), self.sums.resolve(&grid)).finish()
    }
}

impl<B: FusionBackend> Accumulator<B> {
    /// An accumulator that has seen nothing, its sums kept by a backend.
    #[must_use]
    pub fn with_backend(backend: B, settings: FusionSettings) -> Self {
        Self { settings, backend, sums: B::Sums::default(), lost: None }
    }

    /// Adds the images of one instant.
    ///
    /// # Errors
    /// See [`FusionError`]; [`FusionSettings::max_blocks`] counts all blocks so far. After an error the
    /// accumulator is as it was before. If the backend failed while it added up, its sums are gone, and every
    /// later call gives that error.
    pub fn integrate(&mut self, images: &[DepthImage]) -> Result<(), FusionError> {
        self.check_sums()?;
        let views = limits::checked_views(&mut self.backend, images, &self.settings)?;
        let known = B::coords(&self.sums);
        let touched = limits::checked_blocks(&mut self.backend, &views, &self.settings, &known)?;
        let done = self.backend.accumulate(&mut self.sums, &views, &self.settings.grid, &touched);
        self.lost = done.clone().err();
        done
    }

    /// Fails if the sums are gone.
    fn check_sums(&self) -> Result<(), FusionError> {
        self.lost.clone().map_or(Ok(()), Err)
    }

    /// [`Accumulator::volume`] of any backend.
    ///
    /// # Errors
    /// [`FusionError::Backend`].
    pub fn try_volume(&mut self) -> Result<SparseVolume, FusionError> {
        self.check_sums()?;
        let grid = self.settings.grid;
        let sampled = self.backend.resolve(&self.sums, &grid)?;
        Ok(Blocks::new(grid, B::coords(&self.sums), sampled).finish())
    }
}
