//! Sampling of a mesh by somebody else, such as a GPU. This module prepares what to sample, and finishes what
//! was sampled.
//!
//! ```text
//! TriangleMesh ─> MeshJob: checks, holes, triangles over them ─> LatticeMesh ─> distances and signs of blocks, elsewhere
//!                    └─ teeth, caps and specks at wide holes <─────────── SparseVolume ─┘
//! ```
//!
//! [`MeshIngester`](crate::MeshIngester) is the reference for what is to be sampled.

use crate::boundary::Boundary;
use crate::caps::{Blocks, VoxelAt};
use crate::closure::close;
use crate::holes::WideHoles;
use crate::ingester::{measured_reach, with_area};
use crate::lattice::LatticeMesh;
use crate::sides::{Caps, Sides};
use crate::tiles::Band;
use crate::{IngestError, MeshIngest, Reach, SignDecision, limits};
use isv_volume::{Grid, SparseVolume, TriangleMesh, VoxelMask};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// A mesh made ready to be sampled.
pub struct MeshJob<'m> {
    mesh: Cow<'m, TriangleMesh>,
    settings: MeshIngest,
    /// Band in which blocks have to have a voxel.
    near: Band,
    /// Band in which the rim of a wide hole may be closest.
    band: Band,
    /// Delta of Eq. 9, if the surface is open.
    offset: Option<f64>,
    holes: Option<Holes>,
    /// Whether parts of it are signed by their sides.
    has_sheets: bool,
    lattice: Option<LatticeMesh>,
}

/// What is to be known of wide holes once there are samples.
struct Holes {
    wide: WideHoles,
    /// The triangles over all holes.
    closing: Vec<[u32; 3]>,
    /// Whether unobserved samples are coded like any other.
    are_coded: bool,
}

impl<'m> MeshJob<'m> {
    /// Makes a mesh ready, of which [`crate::ingest_mesh`] says what is to come of it.
    ///
    /// # Errors
    /// See [`IngestError`]; but how many blocks there are is asked of [`Self::check_blocks`].
    pub fn new(
        mesh: &'m TriangleMesh,
        settings: &MeshIngest,
        decision: SignDecision,
    ) -> Result<Self, IngestError> {
        let mesh = with_area(mesh)?;
        let margin = limits::check_offset(settings, decision)?;
        limits::check_range(&mesh, &settings.grid, margin)?;
        let voxel_mesh = limits::in_voxels(&mesh, settings.grid.voxel_size.metres());
        let band = Band::new(&settings.grid, margin);
        let (reach, near) = measured_reach(settings, margin);
        let (mut closing, mut wide) = (Vec::new(), None);
        if let SignDecision::Closed { .. } = decision {
            let boundary = Boundary::new(&voxel_mesh);
            closing = close(&boundary.chain, &voxel_mesh.vertices);
            if let Err(error) = limits::check_closing(&voxel_mesh, &closing, settings) {
                // If the mesh alone is too large, that is what there is to say.
                limits::list_tiles(&mesh, &voxel_mesh, settings, &near)?;
                return Err(error);
            }
            wide = WideHoles::find(&voxel_mesh, &boundary);
        }
        let rims = wide.as_ref().map_or(&[][..], |wide| &wide.rims);
        // Marching cubes look a voxel farther.
        let lattice = LatticeMesh::new(&voxel_mesh, &closing, rims, band.width + 2.0);
        drop(voxel_mesh);
        let holes = wide.map(|wide| Holes { wide, closing, are_coded: reach == Reach::Band });
        let offset = matches!(decision, SignDecision::Offset).then_some(margin);
        let has_sheets = decision == SignDecision::Sheet;
        Ok(Self { mesh, settings: *settings, near, band, offset, holes, has_sheets, lattice })
    }

    /// The grid to sample on.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.settings.grid
    }

    /// What to sample; `None` if it is too large for a lattice.
    #[must_use]
    pub fn lattice(&self) -> Option<&LatticeMesh> {
        self.lattice.as_ref()
    }

    /// Whether signs are those of [`SignDecision::Sheet`], which a lattice says nothing of.
    #[must_use]
    pub fn has_sheets(&self) -> bool {
        self.has_sheets
    }

    /// Distance from a face up to which a voxel is near, in voxels. Blocks with an observed near voxel are
    /// those of the volume, and distances are exact there.
    #[must_use]
    pub fn near(&self) -> f64 {
        self.near.width
    }

    /// Voxels closer than this to the rim of a wide hole are unobserved if no face is closer. In voxels.
    #[must_use]
    pub fn band(&self) -> f64 {
        self.band.width
    }

    /// By what distances are lowered (Eq. 9), in voxels; `None` if the sign is that of the winding number (Eq. 8).
    #[must_use]
    pub fn offset(&self) -> Option<f64> {
        self.offset
    }

    /// Whether [`Self::finish`] does anything to samples.
    #[must_use]
    pub fn has_wide_holes(&self) -> bool {
        self.holes.is_some()
    }

    /// Blocks that the volume may have.
    #[must_use]
    pub fn max_blocks(&self) -> usize {
        self.settings.max_blocks
    }

    /// Refuses a mesh that needs more blocks than [`Self::max_blocks`], and says which voxel size would not; for whoever finds many.
    ///
    /// # Errors
    /// [`IngestError::Fit`].
    pub fn check_blocks(&self) -> Result<(), IngestError> {
        let voxel_mesh = limits::in_voxels(&self.mesh, self.settings.grid.voxel_size.metres());
        limits::list_tiles(&self.mesh, &voxel_mesh, &self.settings, &self.near).map(drop)
    }

    /// The volume of what was sampled: without teeth, specks and invented surfaces at wide holes.
    #[must_use]
    pub fn finish(&self, sampled: SparseVolume) -> SparseVolume {
        let Some(Holes { wide, closing, are_coded }) = &self.holes else { return sampled };
        let grid = self.grid();
        let voxel_mesh = limits::in_voxels(&self.mesh, grid.voxel_size.metres());
        let caps = Caps::new(&voxel_mesh, closing, Some(wide), &self.near);
        // Only now that there are no more blocks than allowed: these are as many numbers as the mesh has rows of voxels.
        let blending = are_coded.then(|| Sides::new(&voxel_mesh, closing, Some(wide), &self.near));
        let mut blocks = Blocks {
            coords: sampled.coords().to_vec(),
            samples: sampled.samples().collect(),
            masks: sampled.unobserved_masks().clone(),
            of_sheets: BTreeSet::new(),
        };
        if let Some(sides) = &blending {
            blocks.blend(grid, sides, &unobserved(&blocks.masks));
        }
        blocks.open_caps(grid, &caps, blending.as_ref());
        blocks.trim_rims(grid.edge);
        SparseVolume::from_parts(*grid, blocks.coords, blocks.samples, blocks.masks)
    }
}

/// The voxels in some masks.
fn unobserved(masks: &BTreeMap<u32, VoxelMask>) -> BTreeSet<VoxelAt> {
    let voxels = |(block, mask): (&u32, &VoxelMask)| -> Vec<VoxelAt> {
        (0..64 * mask.words().len() as u32)
            .filter(|voxel| mask.contains(*voxel as usize))
            .map(|voxel| (*block, voxel))
            .collect()
    };
    masks.iter().flat_map(voxels).collect()
}
