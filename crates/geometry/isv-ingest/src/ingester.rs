//! A sequence of meshes to volumes, frame after frame.

use crate::boundary::Boundary;
use crate::caps::Blocks;
use crate::closure::close;
use crate::edges::Edges;
use crate::holes::WideHoles;
use crate::orientation::agreeing;
use crate::parts::{PartMemory, open_faces};
use crate::reuse::{Stage, to_sample, unchanged};
use crate::sampler::{Parts, Sign, Source, Workspace, sample_tile};
use crate::scene::Scene;
use crate::sheets::{Sheets, closed_parts};
use crate::sides::Sides;
use crate::tiles::{Band, Tile, VoxelMesh};
use crate::{IngestError, MeshIngest, Reach, SignDecision, faces, limits};
use isv_volume::{BlockCoord, BlockEdge, BlockOrigin, MeshError, SparseVolume, TriangleMesh, VoxelMask};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use tracing::debug_span;

/// In voxels, more than the length of a cell's diagonal: a voxel that far from the surface has only neighbours on its side.
const CELL_DIAGONAL: f64 = 1.75;

/// Tiles whose blocks are held apart from the volume at one time.
const TILES_AT_ONCE: usize = 256;

/// Makes volumes of the meshes of a sequence, of which it takes over what stands still.
///
/// Each volume is the one that [`crate::ingest_mesh`] makes of the same mesh, bit for bit but for samples of
/// unobserved voxels. With [`SignDecision::Sheet`], parts stay what they were in the frame before, closed or
/// open. Surroundings of triangles that stay where they were cost next to nothing. The triangles may be
/// numbered anew, as long as their order stays.
pub struct MeshIngester {
    settings: MeshIngest,
    before: Option<Frame<'static>>,
}

/// A frame, and what it was made of.
struct Frame<'m> {
    scene: Scene<'m>,
    decision: SignDecision,
    sign: Sign,
    /// The blocks of each of the scene's tiles in the volume.
    tiles: Vec<Range<usize>>,
    volume: SparseVolume,
    /// How many of its blocks are those of the frame before.
    kept: usize,
}

/// What became of the tiles of a scene.
struct Sampled {
    /// The blocks of each in the volume.
    tiles: Vec<Range<usize>>,
    volume: SparseVolume,
    kept: usize,
}

impl MeshIngester {
    /// An ingester that has seen no frame yet.
    #[must_use]
    pub fn new(settings: MeshIngest) -> Self {
        Self { settings, before: None }
    }

    /// The volume of the next frame. A frame whose sign is found in another way than that of the one before starts afresh.
    ///
    /// # Errors
    /// As [`crate::ingest_mesh`]. The frame after starts afresh.
    pub fn ingest(&mut self, mesh: &TriangleMesh, sign: SignDecision) -> Result<SparseVolume, IngestError> {
        let before = self.before.take().filter(|before| before.decision == sign);
        // Within the pool of threads: from outside, each parallel loop would put this thread to sleep and wake it again.
        let frame = rayon::scope(|_| {
            let mesh = Prepared::new(mesh, sign)?;
            Ok::<_, IngestError>(Frame::new(&mesh, &self.settings, sign, before)?.into_owned())
        })?;
        let volume = frame.volume.clone();
        self.before = Some(frame);
        Ok(volume)
    }

    /// How meshes become volumes.
    #[must_use]
    pub fn settings(&self) -> &MeshIngest {
        &self.settings
    }

    /// How many blocks of the last volume were taken over from the one before.
    #[must_use]
    pub fn kept_blocks(&self) -> usize {
        self.before.as_ref().map_or(0, |frame| frame.kept)
    }
}

/// The volume of a mesh that belongs to no sequence.
pub(crate) fn volume_of(
    mesh: &TriangleMesh,
    settings: &MeshIngest,
    sign: SignDecision,
) -> Result<SparseVolume, IngestError> {
    rayon::scope(|_| {
        let mesh = Prepared::new(mesh, sign)?;
        Ok(Frame::new(&mesh, settings, sign, None)?.volume)
    })
}

/// The mesh without faces that have no area, if it is one.
pub(crate) fn with_area(mesh: &TriangleMesh) -> Result<Cow<'_, TriangleMesh>, IngestError> {
    mesh.validate()?;
    let mesh = faces::with_area(mesh);
    if mesh.triangles.is_empty() { Err(MeshError::NoFaces.into()) } else { Ok(mesh) }
}

/// A mesh as it is sampled: without faces that have no area, and with faces that agree where sides count.
struct Prepared<'m> {
    mesh: Cow<'m, TriangleMesh>,
    /// Edges of the mesh, where sides count.
    edges: Option<Edges>,
}

impl<'m> Prepared<'m> {
    fn new(mesh: &'m TriangleMesh, sign: SignDecision) -> Result<Self, IngestError> {
        let mesh = with_area(mesh)?;
        if sign != SignDecision::Sheet {
            return Ok(Self { mesh, edges: None });
        }
        let (mesh, edges) = agreeing(mesh);
        Ok(Self { mesh, edges: Some(edges) })
    }
}

impl<'m> Frame<'m> {
    fn new(
        prepared: &'m Prepared,
        settings: &MeshIngest,
        decision: SignDecision,
        before: Option<Frame<'static>>,
    ) -> Result<Self, IngestError> {
        let mesh = &*prepared.mesh;
        let offset = limits::check_offset(settings, decision)?;
        limits::check_range(mesh, &settings.grid, offset)?;
        let voxel_mesh = limits::in_voxels(mesh, settings.grid.voxel_size.metres());
        let before = match before {
            Some(before) if before.scene.mesh == voxel_mesh => {
                return Ok(Frame { kept: before.volume.block_count(), ..before });
            }
            before => before,
        };
        let band = Band::new(&settings.grid, offset);
        let (reach, near) = measured_reach(settings, offset);
        let list = debug_span!("ingest tiles")
            .in_scope(|| limits::list_tiles(mesh, &voxel_mesh, settings, &near))?;
        let (sign, holes) = debug_span!("ingest sides").in_scope(|| match (&prepared.edges, decision) {
            (Some(edges), _) => {
                let memory = before.as_ref().and_then(|before| before.sign.memory());
                find_parts(mesh, edges, &voxel_mesh, settings, &near, memory)
            }
            (None, SignDecision::Offset) => Ok((Sign::Offset(offset as f32), None)),
            (None, _) => {
                find_inside(&voxel_mesh, settings, &near).map(|(sides, holes)| (Sign::Closed(sides), holes))
            }
        })?;
        let scene = match reach {
            Reach::Band => Scene::exact(voxel_mesh, list, holes),
            Reach::Surface => Scene::near_surface(voxel_mesh, list, holes, &band),
        };
        let source = Source { grid: settings.grid, band, near, scene: &scene, sign: &sign };
        let Sampled { tiles, volume, kept } = sample_scene(&source, before);
        Ok(Self { scene, decision, sign, tiles, volume, kept })
    }

    /// The frame with data of its own, which lives as long as one likes.
    fn into_owned(self) -> Frame<'static> {
        Frame { scene: self.scene.into_owned(), ..self }
    }
}

/// How far the blocks of a volume reach, and up to where distances are exact and blocks have to have a voxel.
pub(crate) fn measured_reach(settings: &MeshIngest, offset: f64) -> (Reach, Band) {
    let band = Band::new(&settings.grid, offset);
    match settings.reach {
        Reach::Surface if settings.grid.edge == BlockEdge::E8 => {
            (Reach::Surface, band.within(offset + CELL_DIAGONAL))
        }
        _ => (Reach::Band, band),
    }
}

/// Finds the open parts of a mesh, and the inside and the wide holes of the closed ones. `in_voxels` is the same mesh in voxels.
fn find_parts(
    mesh: &TriangleMesh,
    edges: &Edges,
    in_voxels: &VoxelMesh,
    settings: &MeshIngest,
    band: &Band,
    memory: Option<&PartMemory>,
) -> Result<(Sign, Option<WideHoles>), IngestError> {
    let (open, memory) = open_faces(mesh, edges, memory);
    let (bodies, holes) = if open.contains(&false) {
        let (sides, holes) = find_inside(&closed_parts(in_voxels, &open), settings, band)?;
        (Some(sides), holes)
    } else {
        (None, None)
    };
    let sheets = Sheets::new(mesh, edges, open);
    let parts = Parts { bodies, holes: holes.clone(), sheets, memory };
    Ok((Sign::Parts(Box::new(parts)), holes))
}

/// Finds the inside of a mesh once it is closed, and the holes that stay open.
fn find_inside(
    mesh: &VoxelMesh,
    settings: &MeshIngest,
    band: &Band,
) -> Result<(Sides, Option<WideHoles>), IngestError> {
    let boundary = Boundary::new(mesh);
    let closing = close(&boundary.chain, &mesh.vertices);
    limits::check_closing(mesh, &closing, settings)?;
    let holes = WideHoles::find(mesh, &boundary);
    Ok((Sides::new(mesh, &closing, holes.as_ref(), band), holes))
}

/// Samples the tiles of a scene that are not as they were in the frame before, and takes over the others.
fn sample_scene(source: &Source, before: Option<Frame>) -> Sampled {
    let tiles = source.scene.tiles();
    let same = before.as_ref().map_or_else(
        || vec![None; tiles.len()],
        |before| {
            let _span = debug_span!("ingest unchanged tiles").entered();
            let now = Stage { scene: source.scene, tiles: &tiles, sign: source.sign };
            unchanged(&now, &Stage { scene: &before.scene, tiles: &before.scene.tiles(), sign: &before.sign })
        },
    );
    let fresh = sample(source, &to_sample(&tiles, &same, source.sign));
    let _span = debug_span!("ingest volume").entered();
    put_together(source, &tiles, &same, fresh, before)
}

/// Samples some tiles.
fn sample(source: &Source, tiles: &[Tile]) -> Blocks {
    let mut blocks = Blocks::default();
    let workspaces = Mutex::new(Vec::new());
    for tiles in tiles.chunks(TILES_AT_ONCE) {
        let _span = debug_span!("ingest samples").entered();
        let parts: Vec<_> = tiles
            .par_iter()
            .map(|tile| with_workspace(&workspaces, |work| sample_tile(source, tile, work)))
            .collect();
        blocks.samples.reserve(parts.iter().map(|part| part.samples.len()).sum());
        for part in parts {
            let before = blocks.coords.len();
            blocks.of_sheets.extend(part.of_sheets.into_iter().map(|at| (before + at) as u32));
            blocks.masks.extend(part.masks.into_iter().map(|(at, mask)| ((before + at) as u32, mask)));
            blocks.coords.extend(part.coords);
            blocks.samples.extend_from_slice(&part.samples);
        }
    }
    debug_span!("ingest rims").in_scope(|| {
        if let Some(sides) = source.sign.sides()
            && source.scene.has_wide_holes()
        {
            blocks.open_caps(&source.grid, &sides.caps, source.blending());
        }
        blocks.mask_false_crossings(&source.grid);
        blocks.trim_rims(source.grid.edge);
    });
    blocks
}

/// Puts a volume together from blocks sampled now and, for tiles that are the same as one of the frame before, that one's blocks.
fn put_together(
    source: &Source,
    tiles: &[Tile],
    same: &[Option<usize>],
    fresh: Blocks,
    before: Option<Frame>,
) -> Sampled {
    let (old_tiles, old) = before.map_or_else(
        || (Vec::new(), SparseVolume::empty(source.grid)),
        |before| (before.tiles, before.volume),
    );
    let mut parts = Assembly::default();
    let (mut next, mut kept) = (0, 0);
    let mut sampled = Vec::with_capacity(tiles.len());
    for (tile, same) in tiles.iter().zip(same) {
        let first = parts.coords.len();
        let is_fresh = |next: usize| fresh.coords.get(next).is_some_and(|block| tile.has(*block));
        if let Some(before) = same {
            for block in old_tiles[*before].clone() {
                parts.push(old.coords()[block], BlockOrigin::Kept(block as u32), old.unobserved(block));
            }
            kept += parts.coords.len() - first;
            // It was sampled for the sake of others.
            while is_fresh(next) {
                next += 1;
            }
        } else {
            while is_fresh(next) {
                let mask = fresh.masks.get(&(next as u32));
                parts.push(fresh.coords[next], BlockOrigin::Fresh(next as u32), mask);
                next += 1;
            }
        }
        sampled.push(first..parts.coords.len());
    }
    let volume = old.succeed(parts.coords, &parts.origins, fresh.samples, parts.masks);
    Sampled { tiles: sampled, volume, kept }
}

/// A volume while it is put together.
#[derive(Default)]
struct Assembly {
    coords: Vec<BlockCoord>,
    origins: Vec<BlockOrigin>,
    masks: BTreeMap<u32, VoxelMask>,
}

impl Assembly {
    fn push(&mut self, coord: BlockCoord, origin: BlockOrigin, mask: Option<&VoxelMask>) {
        self.masks.extend(mask.map(|mask| (self.coords.len() as u32, mask.clone())));
        self.coords.push(coord);
        self.origins.push(origin);
    }
}

/// Lends an idle workspace, so that there are never more than threads: rayon makes one for each part that it splits work into.
fn with_workspace<T>(idle: &Mutex<Vec<Workspace>>, run: impl FnOnce(&mut Workspace) -> T) -> T {
    let lock = || idle.lock().unwrap_or_else(PoisonError::into_inner);
    let mut work = lock().pop().unwrap_or_default();
    let done = run(&mut work);
    lock().push(work);
    done
}
