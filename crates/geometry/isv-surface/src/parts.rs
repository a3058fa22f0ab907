//! The surface of a changing volume in parts, of which those are extracted again that changed.

use crate::extract::{BlockShare, SurfaceOptions, TooManyVertices, extract_blocks};
use isv_volume::{BlockCell, BlockCoord, BlockSet, SparseVolume, TriangleMesh, VoxelMask};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap, HashSet, btree_map};
use std::iter::Peekable;
use std::ops::Range;
use std::sync::Arc;

/// The surface of a volume that changes from frame to frame, in parts of 4x4x4 blocks.
///
/// A part has the triangles of the cells that begin in its blocks, and the vertices of these. A vertex at the border of two parts is in
/// both, the same in both to the last bit. The triangles of all parts in order are those of [`extract_surface`](crate::extract_surface),
/// corner by corner.
///
/// [`Self::update`] takes the next volume. It extracts those parts anew of which a block, or one beside them, changed. Blocks that
/// both volumes share ([`SparseVolume::succeed`]) are not read. So a scene of which little moves costs what moves. The last volume
/// is kept, in memory that it shares with the caller's.
///
/// ```
/// use isv_surface::{SurfaceOptions, SurfaceParts};
/// use isv_volume::{BlockEdge, Grid, Truncation, VolumeBuilder, VoxelSize};
///
/// let grid = Grid {
///     voxel_size: VoxelSize::from_metres(0.01).unwrap(),
///     edge: BlockEdge::E8,
///     truncation: Truncation::DEFAULT,
/// };
/// let dot = |x: i32| {
///     let mut samples = vec![256; 512];
///     samples[grid.edge.voxel_index(3, 3, 3)] = -256;
///     let mut builder = VolumeBuilder::new(grid);
///     builder.push([0, 0, 0].into(), samples.clone(), None);
///     builder.push([x, 0, 0].into(), samples, None);
///     builder.finish()
/// };
/// let mut parts = SurfaceParts::new(SurfaceOptions::default());
/// assert_eq!(parts.update(&dot(9)).changed.len(), 2);
/// // The second octahedron moves into another part.
/// let changes = parts.update(&dot(17));
/// assert_eq!((changes.changed, changes.removed), (vec![[16, 0, 0].into()], vec![[8, 0, 0].into()]));
/// assert_eq!(parts.iter().map(|(_, mesh)| mesh.triangles.len()).sum::<usize>(), 16);
/// ```
#[derive(Clone, Debug, Default)]
pub struct SurfaceParts {
    options: SurfaceOptions,
    /// The volume that the parts are of, and its blocks.
    volume: Option<(SparseVolume, BlockSet)>,
    /// Parts with triangles, by the code of their cell of blocks.
    parts: BTreeMap<u64, Part>,
}

#[derive(Clone, Debug)]
struct Part {
    /// Empty once it was handed over.
    mesh: Arc<TriangleMesh>,
    /// Vertices that the mesh has or had.
    vertices: usize,
}

/// The parts that an update changed, each by its block with the lowest coordinates, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PartChanges {
    /// Parts that are new or were extracted again.
    pub changed: Vec<BlockCoord>,
    /// Parts that have no triangles any more.
    pub removed: Vec<BlockCoord>,
}

impl SurfaceParts {
    /// Creates the surface of nothing.
    #[must_use]
    pub fn new(options: SurfaceOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// Takes the next volume. A volume on another grid changes all parts.
    ///
    /// # Panics
    /// If what changed has more than `u32::MAX` vertices, which takes over 10^9 voxels.
    pub fn update(&mut self, volume: &SparseVolume) -> PartChanges {
        self.update_within(volume, usize::MAX).expect("at most u32::MAX vertices at once")
    }

    /// Takes the next volume, as [`Self::update`], unless all parts together would have more vertices than `limit`.
    ///
    /// # Errors
    /// [`TooManyVertices`]; the parts are what they were. Up to four times the limit is held until that is known.
    pub fn update_within(
        &mut self,
        volume: &SparseVolume,
        limit: usize,
    ) -> Result<PartChanges, TooManyVertices> {
        let mut new = BTreeMap::new();
        let removed = self.advance(volume, limit, |parts| new.extend(parts))?;
        let changed = new.keys().map(|code| corner(*code)).collect();
        self.parts.extend(new);
        Ok(PartChanges { changed, removed })
    }

    /// Takes the next volume, as [`Self::update_within`], for a caller that keeps the meshes itself. Returns the parts that have no
    /// triangles any more.
    ///
    /// `part` gets each mesh that changed, in order, with its block of the lowest coordinates. Here these parts are empty then.
    ///
    /// # Errors
    /// [`TooManyVertices`], perhaps after some parts were given. The surface is that of nothing again.
    pub fn hand_over(
        &mut self,
        volume: &SparseVolume,
        limit: usize,
        mut part: impl FnMut(BlockCoord, TriangleMesh),
    ) -> Result<Vec<BlockCoord>, TooManyVertices> {
        let mut new = Vec::new();
        let removed = self.advance(volume, limit, |parts| {
            for (code, Part { mesh, vertices }) in parts {
                part(corner(code), Arc::unwrap_or_clone(mesh));
                new.push((code, Part { mesh: Arc::default(), vertices }));
            }
        });
        match &removed {
            Ok(_) => self.parts.extend(new),
            Err(_) => *self = Self::new(self.options),
        }
        removed
    }

    /// Finds the parts of the next volume that are others than before, and takes out those that are gone. `found` gets the new ones, run
    /// by run.
    fn advance(
        &mut self,
        volume: &SparseVolume,
        limit: usize,
        mut found: impl FnMut(BTreeMap<u64, Part>),
    ) -> Result<Vec<BlockCoord>, TooManyVertices> {
        let before = self.volume.as_ref().filter(|(before, _)| before.grid() == volume.grid());
        let (blocks, stale) = match before {
            Some((before, blocks)) => {
                let Changes { added, removed, altered } = Changes::between(before, volume);
                let stale = added.union(&removed).union(&altered).dilated();
                (blocks.difference(&removed).union(&added), stale)
            }
            None => {
                let blocks = BlockSet::from_coords(volume.coords());
                (blocks.clone(), blocks)
            }
        };
        // The parts that are extracted again, whole.
        let own = blocks.difference(&blocks.outside_cells_of(&stale));
        let kept =
            |code: &u64| before.is_some() && stale.cells().binary_search_by_key(code, |c| c.code).is_err();
        let mut vertices: usize =
            self.parts.iter().filter(|(code, _)| kept(code)).map(|(_, part)| part.vertices).sum();
        let mut new = HashSet::new();
        for cells in own.cells().chunks(PARTS_AT_ONCE) {
            let own: BlockSet = cells.iter().copied().collect();
            // With the blocks beside them, which vertices and normals depend on.
            let needed = own.dilated().marks_in(&blocks);
            let around = volume.select(|block| needed[block]);
            let parts = extract_parts(&around, self.options, &own, limit.saturating_sub(vertices))
                .map_err(|error| TooManyVertices { vertices: vertices + error.vertices, limit })?;
            vertices += parts.values().map(|part| part.vertices).sum::<usize>();
            new.extend(parts.keys().copied());
            found(parts);
        }

        let removed = self.parts.keys().filter(|code| !kept(code) && !new.contains(code)).copied();
        let removed: Vec<_> = removed.collect();
        removed.iter().for_each(|code| drop(self.parts.remove(code)));
        self.volume = Some((volume.clone(), blocks));
        Ok(removed.into_iter().map(corner).collect())
    }

    /// The parts in Morton order, each with its block of the lowest coordinates. None is empty but those that were handed over.
    pub fn iter(&self) -> impl Iterator<Item = (BlockCoord, &Arc<TriangleMesh>)> {
        self.parts.iter().map(|(code, part)| (corner(*code), &part.mesh))
    }

    /// The part of this block, which need not be the one with the lowest coordinates.
    #[must_use]
    pub fn part(&self, block: BlockCoord) -> Option<&Arc<TriangleMesh>> {
        Some(&self.parts.get(&BlockCell::containing(block).code)?.mesh)
    }
}

/// Parts that are extracted together. A frame that is new as a whole takes memory for the mesh of so many, beside the parts.
const PARTS_AT_ONCE: usize = 1024;

/// The block of a part with the lowest coordinates.
fn corner(code: u64) -> BlockCoord {
    BlockCell { code, blocks: 0 }.corner()
}

/// Blocks that a thread looks at together.
const RUN: usize = 1 << 14;

/// What a volume has other than the one before it.
#[derive(Default)]
struct Changes {
    added: BlockSet,
    removed: BlockSet,
    /// Blocks that both have, with other samples or another mask.
    altered: BlockSet,
}

impl Changes {
    fn between(before: &SparseVolume, now: &SparseVolume) -> Self {
        let (old, new) = (before.coords(), now.coords());
        // Where runs begin, in both volumes.
        let starts = (RUN..new.len()).step_by(RUN).map(|at| {
            let code = new[at].morton();
            (old.partition_point(|block| block.morton() < code), at)
        });
        let starts: Vec<_> = [(0, 0)].into_iter().chain(starts).chain([(old.len(), new.len())]).collect();
        let runs = starts.par_windows(2).map(|ends| {
            let [from, to] = [ends[0], ends[1]];
            Self::in_run(Run::new(before, from.0..to.0), Run::new(now, from.1..to.1))
        });
        runs.reduce(Self::default, |a, b| Self {
            added: a.added.union(&b.added),
            removed: a.removed.union(&b.removed),
            altered: a.altered.union(&b.altered),
        })
    }

    fn in_run(mut before: Run, mut now: Run) -> Self {
        let [mut added, mut removed, mut altered] = [const { Vec::new() }; 3];
        loop {
            let order = match (before.coord(), now.coord()) {
                (Some(old), Some(new)) if old == new => Ordering::Equal,
                (Some(old), Some(new)) => old.morton().cmp(&new.morton()),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (None, None) => break,
            };
            let old = if order.is_le() { before.next() } else { None };
            let new = if order.is_ge() { now.next() } else { None };
            match (old, new) {
                (Some(old), Some(new)) if old.is_same_as(&new) => {}
                (Some(old), Some(_)) => altered.push(old.coord),
                (Some(old), None) => removed.push(old.coord),
                (None, new) => added.extend(new.map(|new| new.coord)),
            }
        }
        let [added, removed, altered] =
            [added, removed, altered].map(|blocks| BlockSet::from_coords(&blocks));
        Self { added, removed, altered }
    }
}

/// Blocks of a volume in order, each with its mask.
struct Run<'a> {
    volume: &'a SparseVolume,
    blocks: Range<usize>,
    masks: Peekable<btree_map::Range<'a, u32, VoxelMask>>,
}

/// A block of a run.
struct RunBlock<'a> {
    coord: BlockCoord,
    samples: &'a [i16],
    mask: Option<&'a VoxelMask>,
}

impl<'a> Run<'a> {
    fn new(volume: &'a SparseVolume, blocks: Range<usize>) -> Self {
        let masks = volume.unobserved_masks().range(blocks.start as u32..).peekable();
        Self { volume, blocks, masks }
    }

    /// The coordinates of the next block.
    fn coord(&self) -> Option<BlockCoord> {
        (!self.blocks.is_empty()).then(|| self.volume.coords()[self.blocks.start])
    }
}

impl<'a> Iterator for Run<'a> {
    type Item = RunBlock<'a>;

    fn next(&mut self) -> Option<RunBlock<'a>> {
        let block = self.blocks.next()?;
        let mask = self.masks.next_if(|(at, _)| **at as usize == block).map(|(_, mask)| mask);
        let (coord, samples) = (self.volume.coords()[block], self.volume.block(block));
        Some(RunBlock { coord, samples, mask })
    }
}

impl RunBlock<'_> {
    /// Whether two blocks at one place are the same. Those in the same memory are not read.
    fn is_same_as(&self, other: &Self) -> bool {
        (std::ptr::eq(self.samples, other.samples) || self.samples == other.samples)
            && self.mask == other.mask
    }
}

/// A part within the mesh that it is taken out of.
struct Share {
    code: u64,
    vertices: Range<usize>,
    triangles: Range<usize>,
}

/// Extracts the parts of these blocks, of a volume that has all blocks around them.
fn extract_parts(
    volume: &SparseVolume,
    options: SurfaceOptions,
    own: &BlockSet,
    limit: usize,
) -> Result<BTreeMap<u64, Part>, TooManyVertices> {
    let mut mesh = TriangleMesh::default();
    // Blocks beside the parts have vertices, too, which are left out in the end: 4^3 blocks of a part are 6^3 with those beside.
    let most = limit.saturating_mul(4).min(u32::MAX as usize);
    let shares = extract_blocks(volume, options, most, &mut mesh, shares_of_parts)?;
    let cells = own.cells();
    let is_own = |share: &Share| cells.binary_search_by_key(&share.code, |cell| cell.code).is_ok();
    let shares = shares.into_par_iter().filter(|share| !share.triangles.is_empty() && is_own(share));
    let part = |scratch: &mut Vec<u32>, share: Share| {
        let mesh = part_of(&mesh, &share, scratch);
        (share.code, Part { vertices: mesh.vertices.len(), mesh: Arc::new(mesh) })
    };
    let parts: BTreeMap<_, _> = shares.map_init(Vec::new, part).collect();
    match parts.values().map(|part| part.vertices).sum() {
        vertices if vertices > limit => Err(TooManyVertices { vertices, limit }),
        _ => Ok(parts),
    }
}

/// Joins the shares of the blocks of each part.
fn shares_of_parts(blocks: &mut dyn Iterator<Item = BlockShare>) -> Vec<Share> {
    let mut shares: Vec<Share> = Vec::new();
    let (mut vertices, mut triangles) = (0, 0);
    for BlockShare { block, vertices: more_vertices, triangles: more_triangles } in blocks {
        let code = BlockCell::containing(block).code;
        let ends = (vertices + more_vertices, triangles + more_triangles);
        match shares.last_mut().filter(|last| last.code == code) {
            Some(last) => (last.vertices.end, last.triangles.end) = ends,
            None => shares.push(Share { code, vertices: vertices..ends.0, triangles: triangles..ends.1 }),
        }
        (vertices, triangles) = ends;
    }
    shares
}

/// Stands for a vertex that is not in a part, or not yet.
const NOWHERE: u32 = u32::MAX;

/// A part as a mesh of its own: its vertices that have triangles, then those of other parts, as triangles name them.
fn part_of(whole: &TriangleMesh, share: &Share, numbers: &mut Vec<u32>) -> TriangleMesh {
    let triangles = &whole.triangles[share.triangles.clone()];
    numbers.clear();
    numbers.resize(share.vertices.len(), NOWHERE);
    let place = |vertex: u32| (vertex as usize).checked_sub(share.vertices.start);
    for vertex in triangles.as_flattened() {
        if let Some(number) = place(*vertex).and_then(|at| numbers.get_mut(at)) {
            *number = 0;
        }
    }
    let mut taken: Vec<u32> = Vec::with_capacity(share.vertices.len());
    for (vertex, number) in (share.vertices.start as u32..).zip(numbers.iter_mut()) {
        if *number != NOWHERE {
            *number = taken.len() as u32;
            taken.push(vertex);
        }
    }
    let mut others = HashMap::new();
    let mut number_of = |vertex: u32| match place(vertex).and_then(|at| numbers.get(at)) {
        Some(number) => *number,
        None => *others.entry(vertex).or_insert_with(|| {
            taken.push(vertex);
            taken.len() as u32 - 1
        }),
    };
    let triangles = triangles.iter().map(|triangle| triangle.map(&mut number_of)).collect();
    let normals = match whole.normals.is_empty() {
        true => Vec::new(),
        false => taken.iter().map(|vertex| whole.normals[*vertex as usize]).collect(),
    };
    let vertices = taken.iter().map(|vertex| whole.vertices[*vertex as usize]).collect();
    TriangleMesh { vertices, normals, triangles, ..TriangleMesh::default() }
}
