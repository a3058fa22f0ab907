//! The samples of one tile.

use crate::cells::{Cells, Directions, Parts};
use crate::continuation::continue_outwards;
use crate::descent::{Cube, LANES, PARTS, list_cells, measure_cells, part_position};
use crate::holes::WideHoles;
use crate::regions::{Regions, TileVoxel};
use crate::scatter::TileDistances;
use crate::tiles::{Band, Measure, TILE_BLOCKS, Tile, VoxelMesh};
use crate::topology::Topology;
use fearless_simd::dispatch;
use glam::{DVec3, IVec3, Vec3};
use isv_kernels::simd;
use isv_spatial::WindingNumber;
use isv_volume::{BlockCoord, BlockEdge, CODES_PER_VOXEL, Grid, VoxelMask};

/// Everything samples are made from.
pub(crate) struct Source<'a> {
    pub(crate) grid: Grid,
    /// Where distances are exact in tiles that are measured exactly.
    pub(crate) band: Band,
    /// Where they are exact in all others, and where blocks have to have a voxel.
    pub(crate) near: Band,
    /// The triangles of tiles that are measured near the surface only.
    pub(crate) mesh: &'a VoxelMesh<'a>,
    /// What is known of those of tiles that are measured exactly, if there are any.
    pub(crate) connections: Option<&'a Connections>,
    pub(crate) sign: &'a Sign,
}

/// How triangles hang together, where they point, and the holes to keep open, if any.
pub(crate) struct Connections {
    /// The triangles that are spoken of, if not those of the whole mesh.
    part: Option<VoxelMesh<'static>>,
    topology: Topology,
    directions: Directions,
    holes: Option<WideHoles>,
}

impl Connections {
    /// What is to be known of all triangles of a mesh.
    pub(crate) fn of_all(mesh: &VoxelMesh, holes: Option<WideHoles>) -> Self {
        let (topology, directions) = rayon::join(|| Topology::of(mesh), || Directions::of(mesh));
        Self { part: None, topology, directions, holes }
    }

    /// The same of some triangles, with their holes.
    pub(crate) fn of_part(part: VoxelMesh<'static>, holes: WideHoles) -> Self {
        let all = Self::of_all(&part, Some(holes));
        Self { part: Some(part), ..all }
    }

    /// The triangles that are spoken of, given the whole mesh.
    pub(crate) fn mesh<'a>(&'a self, whole: &'a VoxelMesh<'a>) -> &'a VoxelMesh<'a> {
        self.part.as_ref().unwrap_or(whole)
    }

    /// The holes to keep open, if any.
    pub(crate) fn holes(&self) -> Option<&WideHoles> {
        self.holes.as_ref()
    }
}

impl Source<'_> {
    /// Whether there are holes to keep open.
    pub(crate) fn has_wide_holes(&self) -> bool {
        self.connections.is_some_and(|connections| connections.holes.is_some())
    }
}

/// Where the sign of a sample comes from.
pub(crate) enum Sign {
    /// Eq. 8: the winding number in metres.
    Closed(WindingNumber),
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
    /// What their signs rest on, where they rest on more than the tile.
    pub(crate) answers: Answers,
}

/// What the winding number answered in a tile.
#[derive(Default)]
pub(crate) struct Answers {
    /// Points that were asked about together, in metres, and whether each is inside.
    sides: Vec<(Vec<DVec3>, Vec<bool>)>,
    /// One of the unobserved voxels, whose samples go by the number itself.
    blended: Option<(DVec3, f64)>,
}

impl Answers {
    /// Whether they would be the same with another winding number.
    pub(crate) fn hold(&self, winding: &WindingNumber) -> bool {
        self.sides.iter().all(|(points, inside)| winding.exceed_half(points) == *inside)
            && self.blended.is_none_or(|(point, number)| (winding.at(point) - number).abs() <= STEADY)
    }
}

/// A change of the winding number that makes no difference to what nobody sees: a sample that is 8 voxels from a hole changes by as
/// many codes.
const STEADY: f64 = 1.0 / 512.0;

/// Buffers of one thread.
pub(crate) struct Workspace {
    /// Cells of the tile at hand, relative to its centre, and those that reach into each of its octants.
    cells: Cells,
    lists: [Vec<u32>; LANES],
    /// Squared distances of the octant at hand, in cubes of 2 x 2 x 2 voxels: of all parts, and of those on a wide hole.
    nearest: Vec<[f32; LANES]>,
    on_hole: Vec<[f32; LANES]>,
    /// The voxels of a block by their Morton numbers.
    voxels: Vec<u16>,
    /// Distances near the surface in the tile at hand.
    near: TileDistances,
    /// The blocks of the tile at hand.
    blocks: Vec<Regions>,
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
            blocks: (0..PARTS).map(|_| Regions::default()).collect(),
        }
    }
}

/// Samples all blocks of a tile.
pub(crate) fn sample_tile(source: &Source, tile: &Tile, work: &mut Workspace) -> TileBlocks {
    match tile.measure {
        Measure::Exact => measure_exactly(source, tile, work),
        Measure::Scatter => measure_near(source, tile, work),
    }
    let near = source.near.width as f32;
    let active: Vec<usize> = (0..PARTS).filter(|block| is_active(&work.blocks[*block], near)).collect();
    let coord = |block: usize| {
        BlockCoord::from((tile.coord * TILE_BLOCKS + IVec3::from_array(part_position(block))).to_array())
    };
    let size = source.grid.edge.block_voxels();
    let mut out = TileBlocks { samples: vec![0; active.len() * size], ..TileBlocks::default() };
    if let Sign::Closed(winding) = source.sign {
        out.answers = find_sides(source, winding, work, &active, coord);
    }
    for (block, samples) in active.into_iter().zip(out.samples.chunks_exact_mut(size)) {
        write_samples(source, &work.blocks[block], coord(block), samples);
        if let Some(mask) = work.blocks[block].unobserved.take() {
            out.masks.push((out.coords.len(), mask));
        }
        out.coords.push(coord(block));
    }
    out
}

/// Whether a block has an observed voxel in the band.
fn is_active(block: &Regions, band: f32) -> bool {
    let observed = |voxel: usize| !block.unobserved.as_ref().is_some_and(|mask| mask.contains(voxel));
    block.distances.iter().enumerate().any(|(voxel, d)| *d <= band && observed(voxel))
}

/// Finds which voxels of the active blocks of a tile are inside (Eq. 8): where the winding number exceeds one half. Returns what that
/// rests on.
fn find_sides(
    source: &Source,
    winding: &WindingNumber,
    work: &mut Workspace,
    active: &[usize],
    coord: impl Fn(usize) -> BlockCoord,
) -> Answers {
    let grid = &source.grid;
    let centre_of = |(block, voxel): &TileVoxel| centre(grid, coord(*block), *voxel);
    let mut answers = Answers::default();
    let are_inside = |voxels: &[TileVoxel]| {
        let points: Vec<DVec3> = voxels.iter().map(centre_of).collect();
        let inside = winding.exceed_half(&points);
        answers.sides.push((points, inside.clone()));
        inside
    };
    for &block in active {
        work.blocks[block].divide(grid.edge);
    }
    Regions::settle(&mut work.blocks, active, grid.edge, are_inside);
    let masked = active.iter().find_map(|block| {
        let mask = work.blocks[*block].unobserved.as_ref()?;
        (0..grid.edge.block_voxels()).find(|voxel| mask.contains(*voxel)).map(|voxel| (*block, voxel))
    });
    answers.blended = masked.map(|voxel| centre_of(&voxel)).map(|point| (point, winding.at(point)));
    answers
}

/// Writes the samples of a block.
fn write_samples(source: &Source, block: &Regions, coord: BlockCoord, samples: &mut [i16]) {
    let grid = &source.grid;
    let offset = if let Sign::Offset(offset) = *source.sign { offset } else { 0.0 };
    for (sample, distance) in samples.iter_mut().zip(&block.distances) {
        *sample = code(grid, distance - offset);
    }
    let Sign::Closed(winding) = source.sign else { return };
    for (voxel, sample) in samples.iter_mut().enumerate() {
        *sample = if block.is_inside(voxel) { -*sample } else { *sample };
    }
    if let Some(mask) = &block.unobserved {
        let voxels: Vec<usize> = (0..samples.len()).filter(|v| mask.contains(*v)).collect();
        let distance = |voxel: usize| block.distances[voxel];
        for (voxel, sample) in blend_across_hole(grid, winding, coord, &voxels, distance) {
            samples[voxel] = sample;
        }
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

/// Finds the distances and the unobserved voxels of the blocks of a tile, exactly in all of the band.
fn measure_exactly(source: &Source, tile: &Tile, work: &mut Workspace) {
    let edge = source.band.tile_edge();
    let connections = source.connections.expect("there are connections where tiles are measured exactly");
    let Connections { topology, directions, holes, .. } = connections;
    let parts = Parts { mesh: connections.mesh(source.mesh), topology, directions, holes: holes.as_ref() };
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
fn measure_near(source: &Source, tile: &Tile, work: &mut Workspace) {
    let edge = source.near.tile_edge();
    let first = tile.coord.as_dvec3() * f64::from(edge) + 0.5;
    let reach = source.near.width as f32;
    let Workspace { near, blocks, .. } = work;
    near.restart(edge as usize);
    dispatch!(simd::level(), simd => near.scatter(simd, source.mesh, tile.faces(), first, reach));
    for (block, taken) in blocks.iter_mut().enumerate() {
        take_near(near, source.grid.edge, part_position(block), reach, taken);
    }
}

/// Takes over the distances of a block that was measured near the surface, and continues them.
fn take_near(near: &TileDistances, edge: BlockEdge, position: [i32; 3], reach: f32, taken: &mut Regions) {
    let n = edge.voxels();
    let first = position.map(|c| c as usize * n);
    let rows = || (0..n * n).map(|row| near.row([first[0], first[1] + row % n, first[2] + row / n], n));
    if !rows().flatten().any(|square| *square <= reach * reach) {
        taken.restart(0, reach);
        return;
    }
    taken.restart(edge.block_voxels(), reach);
    for (row, squares) in taken.distances.chunks_exact_mut(n).zip(rows()) {
        row.iter_mut().zip(squares).for_each(|(distance, square)| *distance = square.sqrt());
    }
    let distances = &mut taken.distances[..];
    dispatch!(simd::level(), simd => continue_outwards(simd, distances, reach));
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
        taken.restart(0, width);
        return;
    }
    taken.restart(size, width);
    if work.voxels.is_empty() {
        work.voxels.extend((0..size).map(|number| voxel_at(edge, number) as u16));
    }
    if source.has_wide_holes() {
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

/// The samples of unobserved voxels of a block: distance times `1 - 2 w`, which passes through zero smoothly from one side of
/// a hole to the other.
pub(crate) fn blend_across_hole(
    grid: &Grid,
    winding: &WindingNumber,
    coord: BlockCoord,
    voxels: &[usize],
    distance: impl Fn(usize) -> f32,
) -> Vec<(usize, i16)> {
    let blend = |(voxel, w): (&usize, f64)| {
        let blend = (1.0 - 2.0 * w.abs()).clamp(-1.0, 1.0);
        (*voxel, code(grid, distance(*voxel) * blend as f32))
    };
    let points: Vec<DVec3> = voxels.iter().map(|voxel| centre(grid, coord, *voxel)).collect();
    let numbers = winding.at_points(&points);
    voxels.iter().zip(numbers).map(blend).collect()
}

/// The centre of a voxel of a block, in metres.
fn centre(grid: &Grid, coord: BlockCoord, voxel: usize) -> DVec3 {
    let n = grid.edge.voxels();
    grid.voxel_centre_m(coord, [voxel % n, voxel / n % n, voxel / (n * n)])
}
