//! The samples of one tile.

use crate::cells::{self, Cells};
use crate::continuation::continue_outwards;
use crate::crossings::{Column, for_each_inside};
use crate::descent::{Cube, LANES, PARTS, list_cells, measure_cells, part_position};
use crate::holes::WideHoles;
use crate::parts::PartMemory;
use crate::rims::Rims;
use crate::scatter::TileDistances;
use crate::scene::{Connections, Measure, Scene};
use crate::sheet_block::SheetBlock;
use crate::sheet_tile::{SheetScene, SheetTile, VoxelSide};
use crate::sheets::Sheets;
use crate::sides::Sides;
use crate::tiles::{Band, TILE_BLOCKS, Tile};
use fearless_simd::{Simd, dispatch};
use glam::{IVec3, Vec3};
use isv_kernels::simd;
use isv_volume::{BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, VoxelMask};

/// Everything samples are made from.
pub(crate) struct Source<'a> {
    pub(crate) grid: Grid,
    /// The band in which distances are exact where all of it is wanted.
    pub(crate) band: Band,
    /// The band in which they are exact where only the surface is wanted. Either way a block is kept if an observed voxel of it is in this.
    pub(crate) near: Band,
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) sign: &'a Sign,
}

impl Source<'_> {
    /// Sides that unobserved samples are blended by, if they are. They are coded like any other where the
    /// whole band is wanted, and not coded where only the surface is.
    pub(crate) fn blending(&self) -> Option<&Sides> {
        match (self.sign, &self.scene.measure) {
            (Sign::Closed(sides), Measure::Exact(_)) => Some(sides),
            _ => None,
        }
    }

    /// The scene of a tile that has sheets.
    fn sheet_scene(&self, tile: &Tile) -> Option<SheetScene<'_>> {
        let Sign::Parts(parts) = self.sign else { return None };
        let Parts { sheets, holes, .. } = &**parts;
        let mesh = &self.scene.mesh;
        let scene = SheetScene { mesh, sheets, holes: holes.as_ref(), reach: self.near.width };
        sheets.touch(tile).then_some(scene)
    }
}

/// Source of the sign of a sample.
pub(crate) enum Sign {
    /// Eq. 8: what is inside.
    Closed(Sides),
    /// Eq. 9: the offset in voxels.
    Offset(f32),
    /// Closed parts by what is inside, open ones by their sides.
    Parts(Box<Parts>),
}

/// Signs part by part: closed parts have an inside, sheets have two sides.
pub(crate) struct Parts {
    /// Inside of the closed parts, if there are any.
    pub(crate) bodies: Option<Sides>,
    /// Holes of the closed parts that stay open, if there are any.
    pub(crate) holes: Option<WideHoles>,
    pub(crate) sheets: Sheets,
    /// Decisions on the parts, for the next frame.
    pub(crate) memory: PartMemory,
}

impl Sign {
    /// Returns which parts are open, if that was decided part by part.
    pub(crate) fn memory(&self) -> Option<&PartMemory> {
        match self {
            Self::Parts(parts) => Some(&parts.memory),
            Self::Closed(_) | Self::Offset(_) => None,
        }
    }

    /// Returns the inside, if anything has one.
    pub(crate) fn sides(&self) -> Option<&Sides> {
        match self {
            Self::Closed(sides) => Some(sides),
            Self::Parts(parts) => parts.bodies.as_ref(),
            Self::Offset(_) => None,
        }
    }
}

/// The active blocks of a tile, in Morton order.
#[derive(Default)]
pub(crate) struct TileBlocks {
    pub(crate) coords: Vec<BlockCoord>,
    pub(crate) samples: Vec<i16>,
    /// By position in `coords`.
    pub(crate) masks: Vec<(usize, VoxelMask)>,
    /// Positions of those with voxels closest to a sheet.
    pub(crate) of_sheets: Vec<usize>,
}

/// The distances of the voxels of a block; its buffers are reused from block to block.
#[derive(Default)]
struct BlockDistances {
    /// Unsigned distances in voxels; none in a block that is not near the surface.
    distances: Vec<f32>,
    /// Voxels whose closest surface point lies on a wide hole.
    unobserved: Option<VoxelMask>,
    /// Side of each voxel; empty where no sheet is near.
    sides: Vec<VoxelSide>,
}

impl BlockDistances {
    /// Forgets everything, and makes room for the distances of so many voxels.
    fn restart(&mut self, voxels: usize) {
        self.distances.resize(voxels, 0.0);
        self.unobserved = None;
        self.sides.clear();
    }

    /// Whether there is an observed voxel in the band.
    fn is_active(&self, band: f32) -> bool {
        let observed = |voxel: usize| !self.unobserved.as_ref().is_some_and(|mask| mask.contains(voxel));
        self.distances.iter().enumerate().any(|(voxel, d)| *d <= band && observed(voxel))
    }
}

/// Buffers of one thread.
pub(crate) struct Workspace {
    /// Cells of the tile at hand, relative to its centre, and those that reach into each of its octants.
    cells: Cells,
    lists: [Vec<u32>; LANES],
    /// Squared distances of the octant at hand, in cubes of 2 x 2 x 2 voxels, of all parts. The other list is
    /// of those on a wide hole.
    nearest: Vec<[f32; LANES]>,
    on_hole: Vec<[f32; LANES]>,
    /// The voxels of a block by their Morton numbers.
    voxels: Vec<u16>,
    /// Distances near the surface in the tile at hand.
    near: TileDistances,
    /// The closest faces in the tile at hand, if it has sheets, and its blocks are not of 8 voxels.
    sheets: SheetTile,
    /// The block at hand of a tile that has sheets.
    sheet: SheetBlock,
    /// The blocks of the tile at hand.
    blocks: Vec<BlockDistances>,
}

impl Default for Workspace {
    fn default() -> Self {
        Self {
            cells: Cells::default(),
            lists: std::array::from_fn(|_| Vec::new()),
            nearest: Vec::new(),
            on_hole: Vec::new(),
            voxels: Vec::new(),
            near: TileDistances::default(),
            sheet: SheetBlock::default(),
            sheets: SheetTile::default(),
            blocks: (0..PARTS).map(|_| BlockDistances::default()).collect(),
        }
    }
}

/// Samples all blocks of a tile.
pub(crate) fn sample_tile(source: &Source, tile: &Tile, work: &mut Workspace) -> TileBlocks {
    match (source.sheet_scene(tile), &source.scene.measure) {
        (Some(scene), _) => measure_sheets(source, &scene, tile, work),
        (None, Measure::Exact(connections)) => measure_exactly(source, connections, tile, work),
        (None, Measure::Near(rims)) => measure_near(source, rims.as_ref(), tile, work),
    }
    let near = source.near.width as f32;
    let active: Vec<usize> = (0..PARTS).filter(|block| work.blocks[*block].is_active(near)).collect();
    let size = source.grid.edge.block_voxels();
    let sides = source.sign.sides();
    let column = sides.and_then(|sides| sides.crossings.column([tile.coord.y, tile.coord.z]));
    let mut out = TileBlocks { samples: vec![0; active.len() * size], ..TileBlocks::default() };
    for (block, samples) in active.into_iter().zip(out.samples.chunks_exact_mut(size)) {
        let coord = (tile.coord * TILE_BLOCKS + IVec3::from_array(part_position(block))).to_array().into();
        write_samples(source, &work.blocks[block], coord, column, samples);
        if let Some(mask) = work.blocks[block].unobserved.take() {
            out.masks.push((out.coords.len(), mask));
        }
        if work.blocks[block].sides.iter().any(|side| side.of_sheet) {
            out.of_sheets.push(out.coords.len());
        }
        out.coords.push(coord);
    }
    out
}

/// Writes the samples of a block; `column`: what is inside in its tile.
fn write_samples(
    source: &Source,
    block: &BlockDistances,
    coord: BlockCoord,
    column: Option<&Column>,
    samples: &mut [i16],
) {
    let (grid, n) = (&source.grid, source.grid.edge.voxels());
    let offset = if let Sign::Offset(offset) = source.sign { *offset } else { 0.0 };
    for (sample, distance) in samples.iter_mut().zip(&block.distances) {
        *sample = code(grid, distance - offset);
    }
    let [x, y, z] = coord.to_array().map(|c| c * n as i32);
    if let Some(column) = column {
        for (row, samples) in samples.chunks_exact_mut(n).enumerate() {
            let crossings = column.row([y + (row % n) as i32, z + (row / n) as i32]);
            for_each_inside(crossings, x, n, |inside| {
                // Code 0 is outside: on a surface that has no outside, such a voxel would be a speck of it.
                samples[inside].iter_mut().for_each(|s| *s = (-*s).min(-1));
            });
        }
    }
    for ((sample, distance), side) in samples.iter_mut().zip(&block.distances).zip(&block.sides) {
        if side.of_sheet {
            let in_front = code(grid, *distance);
            *sample = if side.is_behind { (-in_front).min(-1) } else { in_front };
        }
    }
    if let (Some(sides), Some(mask)) = (source.blending(), &block.unobserved) {
        let voxels: Vec<usize> = (0..samples.len()).filter(|v| mask.contains(*v)).collect();
        let distance = |voxel: usize| block.distances[voxel];
        for (voxel, sample) in blend_across_hole(grid, sides, coord, &voxels, distance) {
            samples[voxel] = sample;
        }
    }
}

/// Adding 1.5 * 2^23 to a small `f32` leaves no bits for a fraction: the sum's lowest bits are the number, rounded to the
/// nearest integer. Library rounding and saturating casts do not vectorise on plain x86-64.
const ROUNDER: f32 = 12_582_912.0;

/// A distance in voxels as a sample (Eq. 1): clamped and rounded.
pub(crate) fn code(grid: &Grid, distance: f32) -> i16 {
    let limit = f32::from(grid.truncation.codes());
    ((distance * CODES_PER_VOXEL as f32).clamp(-limit, limit) + ROUNDER).to_bits() as i16
}

/// Finds the distances and the unobserved voxels of the blocks of a tile, exactly in all of the band.
fn measure_exactly(source: &Source, connections: &Connections, tile: &Tile, work: &mut Workspace) {
    let edge = source.band.tile_edge();
    let Connections { topology, directions, holes } = connections;
    let parts = cells::Parts { mesh: &source.scene.mesh, topology, directions, holes: holes.as_ref() };
    work.cells.restart((tile.coord.as_dvec3() + 0.5) * f64::from(edge), 0.5 * (edge - 1) as f32);
    work.cells.add(&parts, tile.faces());
    work.lists.iter_mut().for_each(Vec::clear);
    let Workspace { cells, lists, .. } = work;
    let cube = Cube { centre: Vec3::ZERO, edge: edge as usize };
    let band = source.band.width as f32;
    dispatch!(simd::level(), simd => list_cells(simd, cells, &cube, band, lists));
    for octant in 0..LANES {
        measure_octant(source, work, octant);
    }
}

/// Finds the distances of the blocks of a tile, exactly near the surface.
fn measure_near(source: &Source, rims: Option<&Rims>, tile: &Tile, work: &mut Workspace) {
    let edge = source.near.tile_edge();
    let first = tile.coord.as_dvec3() * f64::from(edge) + 0.5;
    let reach = source.near.width as f32;
    let Workspace { near, blocks, .. } = work;
    dispatch!(simd::level(), simd => near.scatter::<_, false>(simd, &source.scene.mesh, tile.faces, first, reach));
    for (block, taken) in blocks.iter_mut().enumerate() {
        let position = part_position(block);
        taken.restart(0);
        dispatch!(simd::level(), simd => take_near(simd, near, position, reach, &mut taken.distances));
        if let Some(rims) = rims.filter(|_| !taken.distances.is_empty()) {
            let first = first + IVec3::from_array(position).as_dvec3() * f64::from(source.near.edge);
            taken.unobserved = rims.unobserved(tile.coord, first, &taken.distances);
        }
    }
}

/// Finds the distances and the sides of the blocks of a tile that has sheets, exactly near the surface.
fn measure_sheets(source: &Source, scene: &SheetScene, tile: &Tile, work: &mut Workspace) {
    let Workspace { near, sheets, sheet, blocks, .. } = work;
    let edge = source.near.tile_edge();
    let first = tile.coord.as_dvec3() * f64::from(edge) + 0.5;
    let is_vectorised = source.grid.edge == BlockEdge::E8;
    if is_vectorised {
        let (mesh, faces, reach) = (scene.mesh, tile.faces, scene.reach as f32);
        dispatch!(simd::level(), simd => near.scatter::<_, true>(simd, mesh, faces, first, reach));
    } else {
        sheets.scatter(scene, tile, edge as usize);
    }
    for (block, taken) in blocks.iter_mut().enumerate() {
        taken.restart(0);
        let (position, BlockDistances { distances, sides, .. }) = (part_position(block), &mut *taken);
        if is_vectorised {
            let from = (&mut *near, scene, tile);
            dispatch!(simd::level(), simd => sheet.take(simd, from, first, position, distances, sides));
        } else {
            sheets.take(scene, position, distances, sides);
        }
        for voxel in (0..taken.sides.len()).filter(|voxel| taken.sides[*voxel].is_unobserved) {
            let mask = taken.unobserved.get_or_insert_with(|| VoxelMask::empty(source.grid.edge));
            mask.insert(voxel);
        }
    }
}

/// Takes over the distances of a block that was measured near the surface, and continues them; none if it is farther away.
#[inline(always)]
fn take_near<S: Simd>(
    simd: S,
    near: &mut TileDistances,
    position: [i32; 3],
    reach: f32,
    distances: &mut Vec<f32>,
) {
    if near.take(simd, position, reach, distances) {
        continue_outwards(simd, distances, reach);
    } else {
        distances.clear();
    }
}

/// Finds the distances and the unobserved voxels of the eight blocks of an octant of the tile.
fn measure_octant(source: &Source, work: &mut Workspace, octant: usize) {
    let edge = 2 * source.band.edge;
    let Workspace { cells, lists, nearest, on_hole, .. } = work;
    for cubes in [&mut *nearest, &mut *on_hole] {
        cubes.resize(edge.pow(3) as usize / LANES, [f32::INFINITY; LANES]);
        cubes.fill([f32::INFINITY; LANES]);
    }
    let corner = IVec3::from_array(part_position(octant)) - 1;
    let cube = Cube { centre: (corner.as_vec3() + 0.5) * edge as f32, edge: edge as usize };
    let (listed, band) = ((&*cells, &lists[octant][..]), source.band.width as f32);
    dispatch!(simd::level(), simd => measure_cells(simd, listed, &cube, band, nearest, on_hole));
    for block in 0..LANES {
        take_distances(source, work, octant, block);
    }
}

/// Takes over what was measured in a block of the octant at hand.
fn take_distances(source: &Source, work: &mut Workspace, octant: usize, block: usize) {
    let (edge, width) = (source.grid.edge, source.band.width as f32);
    let size = edge.block_voxels();
    let nearest = &mut work.nearest.as_flattened_mut()[block * size..][..size];
    let taken = &mut work.blocks[octant * LANES + block];
    if !nearest.iter().any(|distance_sq| distance_sq.is_finite()) {
        taken.restart(0);
        return;
    }
    taken.restart(size);
    if work.voxels.is_empty() {
        work.voxels.extend((0..size).map(|number| voxel_at(edge, number) as u16));
    }
    if source.scene.has_wide_holes() {
        let on_hole = &work.on_hole.as_flattened()[block * size..][..size];
        for ((nearest, on_hole), voxel) in nearest.iter().zip(on_hole).zip(&work.voxels) {
            if nearest == on_hole && nearest.is_finite() {
                let mask = taken.unobserved.get_or_insert_with(|| VoxelMask::empty(edge));
                mask.insert(usize::from(*voxel));
            }
        }
    }
    for number in &mut *nearest {
        let distance = number.sqrt();
        *number = if distance <= width { distance } else { width + 1.0 };
    }
    for (distance, voxel) in nearest.iter().zip(&work.voxels) {
        taken.distances[usize::from(*voxel)] = *distance;
    }
}

/// The voxel of a block with a Morton number.
fn voxel_at(edge: BlockEdge, number: usize) -> usize {
    let along =
        |axis: usize| (0..edge.log2() as usize).map(|bit| (number >> (3 * bit + axis) & 1) << bit).sum();
    edge.voxel_index(along(0), along(1), along(2))
}

/// Samples of the unobserved voxels of a block: distance times `1 - 2 w`, with the generalized winding
/// number. It passes through zero smoothly from one side of a hole to the other.
pub(crate) fn blend_across_hole(
    grid: &Grid,
    sides: &Sides,
    coord: BlockCoord,
    voxels: &[usize],
    distance: impl Fn(usize) -> f32,
) -> Vec<(usize, i16)> {
    let n = grid.edge.voxels();
    let place = |voxel: &usize| {
        let [x, y, z] = [voxel % n, voxel / n % n, voxel / (n * n)].map(|c| c as i32);
        IVec3::from_array(coord.to_array()) * n as i32 + IVec3::new(x, y, z)
    };
    let blend = |(voxel, w): (&usize, f64)| {
        let blend = (1.0 - 2.0 * w.abs()).clamp(-1.0, 1.0);
        (*voxel, code(grid, distance(*voxel) * blend as f32))
    };
    let places: Vec<IVec3> = voxels.iter().map(place).collect();
    voxels.iter().zip(sides.winding_numbers(&places)).map(blend).collect()
}
