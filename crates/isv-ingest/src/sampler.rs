//! The samples of one tile.

use crate::descent::{Level, corners, octant_centre};
use crate::distance::{LANES, LocalTriangle, Points, TriangleFrame, nearest_distances};
use crate::holes::HoleMarks;
use crate::regions::Regions;
use crate::tiles::{Band, TILE_BLOCKS, Tile, VoxelMesh};
use glam::{DVec3, IVec3};
use isv_spatial::{WindingNumber, closest_on_triangle};
use isv_volume::{BlockCoord, CODES_PER_VOXEL, Grid, VoxelMask};

/// Everything samples are made from.
pub(crate) struct Source<'a> {
    pub(crate) grid: Grid,
    pub(crate) band: Band,
    pub(crate) mesh: VoxelMesh<'a>,
    pub(crate) sign: Sign,
}

/// Where the sign of a sample comes from.
pub(crate) enum Sign {
    /// Eq. 8: the winding number in metres, and the holes to keep open, if any.
    Closed(WindingNumber, Option<HoleMarks>),
    /// Eq. 9: the offset in voxels.
    Offset(f32),
}

/// The active blocks of a tile, in Morton order.
#[derive(Default)]
pub(crate) struct TileBlocks {
    pub(crate) coords: Vec<BlockCoord>,
    pub(crate) samples: Vec<i16>,
    /// By position in `coords`.
    pub(crate) masks: Vec<(usize, VoxelMask)>,
}

/// Buffers of one thread.
#[derive(Default)]
pub(crate) struct Workspace {
    tile: Triangles,
    block: Triangles,
    tile_levels: [Level; TILE_BLOCKS.ilog2() as usize],
    block_levels: [Level; 3],
    /// Unsigned distances of the block at hand in voxels, exact up to the band's width and more than it beyond.
    distances: Vec<f32>,
    /// Voxels of the block at hand whose closest surface point lies on a wide hole.
    unobserved: Option<VoxelMask>,
    regions: Regions,
}

/// Triangles near a tile or a block.
#[derive(Default)]
struct Triangles {
    faces: Vec<u32>,
    frames: Vec<TriangleFrame>,
    local: Vec<LocalTriangle>,
    /// 0, 1, 2, ...
    all: Vec<u32>,
}

/// Samples all blocks of a tile.
pub(crate) fn sample_tile(source: &Source, tile: &Tile, work: &mut Workspace) -> TileBlocks {
    let edge = source.band.tile_edge();
    let centre = (tile.coord.as_dvec3() + 0.5) * f64::from(edge);
    let triangles = &mut work.tile;
    triangles.clear();
    for face in tile.faces() {
        let frame = TriangleFrame::new(source.mesh.corners(face));
        triangles.local.push(frame.relative_to(centre));
        triangles.frames.push(frame);
        triangles.faces.push(face);
    }
    triangles.all.extend(0..triangles.faces.len() as u32);
    let mut levels = std::mem::take(&mut work.tile_levels);
    let all = std::mem::take(&mut work.tile.all);
    let mut sampler = TileSampler { source, work, out: TileBlocks::default() };
    sampler.descend(&mut levels, &all, [0.0; 3], edge as usize, tile.coord * TILE_BLOCKS);
    let out = sampler.out;
    work.tile_levels = levels;
    work.tile.all = all;
    out
}

impl Triangles {
    fn clear(&mut self) {
        self.faces.clear();
        self.frames.clear();
        self.local.clear();
        self.all.clear();
    }
}

struct TileSampler<'a> {
    source: &'a Source<'a>,
    work: &'a mut Workspace,
    out: TileBlocks,
}

impl TileSampler<'_> {
    /// Visits the blocks of the cube of `edge` voxels around `centre` (relative to the tile's centre) that have triangles
    /// in reach, in Morton order.
    fn descend(&mut self, levels: &mut [Level], list: &[u32], centre: [f32; 3], edge: usize, first: IVec3) {
        let Some((level, below)) = levels.split_first_mut() else {
            self.sample_block(list, BlockCoord::from(first.to_array()));
            return;
        };
        level.split(&self.work.tile.local, list, centre, edge, self.source.band.width as f32);
        let half = (edge / 2) as i32 / self.source.band.edge;
        for (octant, list) in level.octants.iter().enumerate() {
            if !list.is_empty() {
                let step = IVec3::new(octant as i32 & 1, octant as i32 >> 1 & 1, octant as i32 >> 2);
                let centre = octant_centre(centre, edge, octant);
                self.descend(below, list, centre, edge / 2, first + step * half);
            }
        }
    }

    /// Samples one block; kept if it is active.
    fn sample_block(&mut self, list: &[u32], coord: BlockCoord) {
        let source = self.source;
        measure_block(source, self.work, list, coord);
        let work = &mut *self.work;
        let observed = |voxel: usize| !work.unobserved.as_ref().is_some_and(|mask| mask.contains(voxel));
        let width = source.band.width as f32;
        if !work.distances.iter().enumerate().any(|(voxel, d)| *d <= width && observed(voxel)) {
            return;
        }
        let start = self.out.samples.len();
        self.out.samples.resize(start + work.distances.len(), 0);
        let samples = &mut self.out.samples[start..];
        match &source.sign {
            Sign::Offset(offset) => {
                for (sample, d) in samples.iter_mut().zip(&work.distances) {
                    *sample = code(&source.grid, d - offset);
                }
            }
            Sign::Closed(winding, _) => sign_block(&source.grid, winding, work, coord, samples),
        }
        if let Some(mask) = work.unobserved.take() {
            self.out.masks.push((self.out.coords.len(), mask));
        }
        self.out.coords.push(coord);
    }
}

/// Adding 1.5 * 2^23 to a small `f32` leaves no bits for a fraction: the sum's lowest bits are the number, rounded to the
/// nearest integer. Library rounding and saturating casts do not vectorise on plain x86-64.
const ROUNDER: f32 = 12_582_912.0;

/// A distance in voxels as a sample (Eq. 1): clamped and rounded.
fn code(grid: &Grid, distance: f32) -> i16 {
    let limit = f32::from(grid.truncation.codes());
    ((distance * CODES_PER_VOXEL as f32).clamp(-limit, limit) + ROUNDER).to_bits() as i16
}

/// Finds the distances and the unobserved voxels of a block. The triangles are described anew relative to the block's
/// centre: a block's samples depend on nothing but where the triangles are relative to it.
fn measure_block(source: &Source, work: &mut Workspace, list: &[u32], coord: BlockCoord) {
    let edge = source.grid.edge.voxels();
    let centre = (IVec3::from_array(coord.to_array()).as_dvec3() + 0.5) * edge as f64;
    work.block.clear();
    for t in list {
        work.block.local.push(work.tile.frames[*t as usize].relative_to(centre));
        work.block.faces.push(work.tile.faces[*t as usize]);
    }
    work.block.all.extend(0..list.len() as u32);
    work.distances.clear();
    work.distances.resize(source.grid.edge.block_voxels(), source.band.width as f32 + 1.0);
    work.unobserved = None;
    let holes = match &source.sign {
        Sign::Closed(_, Some(holes)) if work.block.faces.iter().any(|face| holes.touch(*face)) => Some(holes),
        _ => None,
    };
    let mut block = BlockMeter {
        source,
        holes,
        centre,
        triangles: &work.block,
        distances: &mut work.distances,
        unobserved: &mut work.unobserved,
    };
    let levels = edge.ilog2() as usize - 1;
    block.descend(&mut work.block_levels[..levels], &work.block.all, [0.0; 3], edge, [0; 3]);
}

/// Measures the distances of one block.
struct BlockMeter<'a> {
    source: &'a Source<'a>,
    /// Set if a wide hole is in reach.
    holes: Option<&'a HoleMarks>,
    /// Centre of the block, in voxels.
    centre: DVec3,
    triangles: &'a Triangles,
    distances: &'a mut [f32],
    unobserved: &'a mut Option<VoxelMask>,
}

impl BlockMeter<'_> {
    /// Measures the cube of `edge` voxels whose first voxel is `first` and whose centre is `centre` (relative to the
    /// block's).
    fn descend(
        &mut self,
        levels: &mut [Level],
        list: &[u32],
        centre: [f32; 3],
        edge: usize,
        first: [usize; 3],
    ) {
        let Some((level, below)) = levels.split_first_mut() else {
            self.measure(list, centre, first);
            return;
        };
        level.split(&self.triangles.local, list, centre, edge, self.source.band.width as f32);
        for (octant, list) in level.octants.iter().enumerate() {
            if !list.is_empty() {
                let first = [0, 1, 2].map(|axis| first[axis] + (octant >> axis & 1) * edge / 2);
                self.descend(below, list, octant_centre(centre, edge, octant), edge / 2, first);
            }
        }
    }

    /// Measures a cube of 2 x 2 x 2 voxels.
    fn measure(&mut self, list: &[u32], centre: [f32; 3], first: [usize; 3]) {
        let points = corners(centre, 0.5);
        let nearest = nearest_distances(&self.triangles.local, list, &points);
        for lane in 0..LANES {
            let voxel = self.voxel(first, lane);
            if nearest[lane] <= self.source.band.width as f32 {
                self.distances[voxel] = nearest[lane];
            }
        }
        if let Some(holes) = self.holes
            && list.iter().any(|t| holes.touch(self.triangles.faces[*t as usize]))
        {
            self.mark_unobserved(holes, list, &points, first);
        }
    }

    fn voxel(&self, first: [usize; 3], lane: usize) -> usize {
        self.source.grid.edge.voxel_index(
            first[0] + (lane & 1),
            first[1] + (lane >> 1 & 1),
            first[2] + (lane >> 2),
        )
    }

    /// Marks the voxels of a cube whose closest surface point lies on a wide hole.
    fn mark_unobserved(&mut self, holes: &HoleMarks, list: &[u32], points: &Points, first: [usize; 3]) {
        for lane in 0..LANES {
            let p = self.centre + DVec3::from_array([0, 1, 2].map(|axis| f64::from(points[axis][lane])));
            let (mut nearest_sq, mut on_hole) = (f64::INFINITY, false);
            for t in list {
                let face = self.triangles.faces[*t as usize];
                let (point, feature) = closest_on_triangle(p, &self.source.mesh.corners(face));
                let distance_sq = point.distance_squared(p);
                if distance_sq < nearest_sq {
                    nearest_sq = distance_sq;
                    on_hole = holes.contain(face, feature);
                }
            }
            if on_hole {
                let voxel = self.voxel(first, lane);
                self.unobserved.get_or_insert_with(|| VoxelMask::empty(self.source.grid.edge)).insert(voxel);
            }
        }
    }
}

/// Signs the distances of a block (Eq. 8): negative where the winding number exceeds one half.
fn sign_block(
    grid: &Grid,
    winding: &WindingNumber,
    work: &mut Workspace,
    coord: BlockCoord,
    samples: &mut [i16],
) {
    let distances = &work.distances;
    let is_inside = |voxel| winding_at(grid, winding, coord, voxel) > 0.5;
    work.regions.classify(distances, grid.edge, work.unobserved.as_ref(), is_inside);
    for (sample, distance) in samples.iter_mut().zip(distances) {
        *sample = code(grid, *distance);
    }
    for voxel in work.regions.inside_voxels() {
        samples[voxel] = -samples[voxel];
    }
    if let Some(mask) = &work.unobserved {
        for voxel in (0..samples.len()).filter(|v| mask.contains(*v)) {
            samples[voxel] = blend_across_hole(grid, winding, coord, voxel, distances[voxel]);
        }
    }
}

/// The sample of an unobserved voxel: its distance times `1 - 2 w`, which passes through zero smoothly from one side of a
/// hole to the other.
pub(crate) fn blend_across_hole(
    grid: &Grid,
    winding: &WindingNumber,
    coord: BlockCoord,
    voxel: usize,
    distance: f32,
) -> i16 {
    let blend = (1.0 - 2.0 * winding_at(grid, winding, coord, voxel)).clamp(-1.0, 1.0);
    code(grid, distance * blend as f32)
}

/// Magnitude of the winding number at the centre of a voxel.
fn winding_at(grid: &Grid, winding: &WindingNumber, coord: BlockCoord, voxel: usize) -> f64 {
    let n = grid.edge.voxels();
    winding.at(grid.voxel_centre_m(coord, [voxel % n, voxel / n % n, voxel / (n * n)])).abs()
}
