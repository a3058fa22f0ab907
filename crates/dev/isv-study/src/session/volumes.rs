//! Meshes to volumes and back, as all codecs of volumes have it.

use super::timed;
use crate::{StudyError, StudySettings};
use isv::raw::encode::Band;
use isv::raw::ingest::{MeshIngest, Reach, SignDecision, decide_sign, ingest_mesh};
use isv::raw::kernels::quant::{STEP_FRACTION_BITS, StepSize};
use isv::raw::surface::{SurfaceOptions, extract_surface};
use isv::raw::volume::{CODES_PER_VOXEL, SparseVolume, TriangleMesh};

/// Makes volumes; the sign is decided on the first frame.
pub(super) struct VolumeMaker {
    ingest: MeshIngest,
    sign: Option<SignDecision>,
    frame: usize,
}

impl VolumeMaker {
    /// Volumes as published codecs have them.
    pub(super) fn published(settings: &StudySettings) -> Self {
        Self { ingest: settings.published_ingest(), sign: None, frame: settings.first_frame }
    }

    /// Volumes as profile `main` has them, with the blocks that it codes.
    pub(super) fn main(settings: &StudySettings, band: Band) -> Self {
        let reach = match band {
            Band::Surface => Reach::Surface,
            Band::Full => Reach::Band,
        };
        Self { ingest: MeshIngest { reach, ..settings.ingest }, sign: None, frame: settings.first_frame }
    }

    /// The volume of the next frame, and the milliseconds it took.
    pub(super) fn make(&mut self, mesh: &TriangleMesh) -> Result<(SparseVolume, f64), StudyError> {
        let (volume, ms) = timed(|| {
            let sign = *self.sign.get_or_insert_with(|| decide_sign(mesh, self.ingest.sign).0);
            ingest_mesh(mesh, &self.ingest, sign)
        });
        let frame = self.frame;
        self.frame += 1;
        Ok((volume.map_err(|cause| StudyError::Ingest { frame, cause })?, ms))
    }
}

/// The surface of a decoded volume.
pub(super) fn surface(volume: &SparseVolume) -> TriangleMesh {
    extract_surface(volume, &SurfaceOptions { normals: false })
}

/// A step in metres as the quantizer has it.
pub(super) fn step_size(metres: f64, settings: &StudySettings) -> Result<StepSize, StudyError> {
    let voxel_m = settings.ingest.grid.voxel_size.metres();
    let sixteenths = (metres / voxel_m * f64::from(CODES_PER_VOXEL << STEP_FRACTION_BITS)).round();
    StepSize::new(sixteenths as u32).ok_or(StudyError::Step { metres, voxel_m })
}
