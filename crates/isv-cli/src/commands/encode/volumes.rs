//! Captured frames to volumes: the part of encoding before the codec.

use crate::capture::{CapturedFrame, Content};
use crate::length::Length;
use crate::progress::Progress;
use crate::stats::timed;
use crate::terms::BandName;
use anyhow::{Context, Result};
use isv::ingest::{IngestError, MeshIngest, SignDecision, SignEvidence, SignMode, decide_sign, ingest_mesh};
use isv::io::Geometry;
use isv::surface::{SurfaceOptions, extract_surface, surface_band};
use isv::volume::{Grid, SparseVolume, TriangleMesh};
use std::sync::Arc;

/// A frame ready to be encoded.
pub(super) struct IngestedFrame {
    /// Its number in the capture.
    pub(super) number: usize,
    pub(super) volume: SparseVolume,
    /// Blocks within the truncation band, before any were left out.
    pub(super) blocks_band: usize,
    pub(super) ingest_ms: f64,
}

/// Makes volumes; what is decided on the first frame holds for all.
pub(super) struct VolumeMaker {
    pub(super) mesh: MeshIngest,
    pub(super) sign: Option<SignDecision>,
    pub(super) band: BandName,
    pub(super) progress: Arc<Progress>,
}

impl VolumeMaker {
    /// The volume of a frame.
    pub(super) fn ingest(&mut self, frame: CapturedFrame) -> Result<IngestedFrame> {
        let CapturedFrame { number, name, content } = frame;
        let (volume, ingest_ms) = timed(|| match content {
            Content::Geometry(Geometry::Mesh(mesh)) => self.mesh_to_volume(&name, &mesh),
            Content::Geometry(Geometry::Points(_)) => todo!(),
            Content::Volume(volume) => self.volume_to_volume(&name, volume),
        });
        let volume = volume.with_context(|| name)?;
        let blocks_band = volume.block_count();
        let volume = match self.band {
            BandName::Full => volume,
            BandName::Surface => surface_band(&volume),
        };
        Ok(IngestedFrame { number, volume, blocks_band, ingest_ms })
    }

    fn mesh_to_volume(&mut self, name: &str, mesh: &TriangleMesh) -> Result<SparseVolume> {
        let sign = match self.sign {
            Some(sign) => sign,
            None => {
                let (sign, evidence) = decide_sign(mesh, self.mesh.sign);
                self.progress.note(&sign_sentence(sign, evidence, self.mesh.sign));
                self.warn_if_tiny(name, mesh);
                *self.sign.insert(sign)
            }
        };
        ingest_mesh(mesh, &self.mesh, sign).map_err(with_advice)
    }

    /// A volume on another grid is sampled anew, from its surface.
    fn volume_to_volume(&mut self, name: &str, volume: SparseVolume) -> Result<SparseVolume> {
        if *volume.grid() == self.mesh.grid {
            return Ok(volume);
        }
        self.mesh_to_volume(name, &extract_surface(&volume, &SurfaceOptions::default()))
    }

    /// A wrong unit that makes the surface small is no error, but leaves little of it.
    fn warn_if_tiny(&self, name: &str, mesh: &TriangleMesh) {
        let Grid { voxel_size, edge, .. } = self.mesh.grid;
        let diagonal_m = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        if diagonal_m < voxel_size.metres() * edge.voxels() as f64 {
            let diagonal = Length::from_metres(diagonal_m);
            self.progress.note(&format!("{name}: only {diagonal} across, less than a block: check --units"));
        }
    }
}

/// What was decided about the sign, and why.
fn sign_sentence(decision: SignDecision, evidence: SignEvidence, mode: SignMode) -> String {
    let why = match mode {
        SignMode::Auto => format!("{:.0} % of the first frame looks closed", 100.0 * evidence.closed_share),
        SignMode::Closed | SignMode::Offset => "as --sign asks".to_owned(),
    };
    format!("{decision} ({why})")
}

/// Names the option to change where a coarser voxel would do.
fn with_advice(error: IngestError) -> anyhow::Error {
    match error {
        IngestError::TooManyBlocks { voxel_that_fits_m, .. }
        | IngestError::OutOfRange { voxel_that_fits_m, .. } => {
            let fits = Length::from_metres(voxel_that_fits_m);
            anyhow::anyhow!("{error}: try --voxel {fits}, or check --units")
        }
        other => other.into(),
    }
}
