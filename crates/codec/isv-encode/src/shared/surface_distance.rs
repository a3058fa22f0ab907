//! How far a decoded volume's surface is from the source's, both ways: what moved, what was lost, and what is there that never was.

use foldhash::HashMap;
use glam::DVec3;
use isv_spatial::PointTree;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_volume::{BlockIndex, CODES_PER_VOXEL, SparseVolume, TriangleMesh};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Vertices that one thread looks at; fixed, so that sums round the same on any number of threads.
const CHUNK: usize = 4096;

/// Root mean square, in voxels, of the distance between the surfaces of two volumes, at their vertices. It is the square root of
/// the mean of the mean squares of both directions.
///
/// - A decoded vertex with a source vertex within about a voxel counts with the distance that the source's field says there.
/// - A source vertex with a decoded vertex as near counts with the mean square of these distances.
/// - Any other vertex, of what was lost or never was there, counts with the distance to the nearest vertex of the other surface.
/// - Where one of the two has no surface at all, that is the diagonal of the other's bounding box.
///
/// 0 if neither has a surface. Takes several times as long as [`surface_rms_voxels`](crate::surface_rms_voxels), and the memory of
/// both surfaces.
///
/// # Panics
/// If the two are on different grids.
#[must_use]
pub fn surface_distance_voxels(source: &SparseVolume, decoded: &SparseVolume) -> f64 {
    SourceSurface::new(source).distance_voxels(decoded)
}

/// A volume with its surface, for any number of decoded ones to be compared with.
#[derive(Debug)]
pub(crate) struct SourceSurface<'a> {
    volume: &'a SparseVolume,
    index: BlockIndex,
    surface: Surface,
}

impl<'a> SourceSurface<'a> {
    pub(crate) fn new(volume: &'a SparseVolume) -> Self {
        Self { volume, index: volume.index(), surface: Surface::new(volume) }
    }

    /// Distance between the source's surface and a decoded one, as in [`surface_distance_voxels`].
    pub(crate) fn distance_voxels(&self, decoded: &SparseVolume) -> f64 {
        assert_eq!(self.volume.grid(), decoded.grid(), "volumes are compared on one grid");
        let decoded = Surface::new(decoded);
        let Seen { near, far } = decoded.seen(|vertex| self.distance_near(vertex), &self.surface);
        // Of the source's vertices that have some near, the mean distance is that of these.
        let back = self.surface.seen(|vertex| decoded.is_near(vertex).then_some(0.0), &decoded);
        let still_there =
            MeanSquare { squares: near.mean() * back.near.count as f64, count: back.near.count };
        (0.5 * (still_there.and(back.far).mean() + near.and(far).mean())).sqrt()
    }

    /// How far a place is from the surface, as the field says, where some of its vertices are near.
    fn distance_near(&self, place: DVec3) -> Option<f64> {
        self.surface.is_near(place).then(|| field_at(self.volume, &self.index, place))?
    }
}

/// The field of a volume, in voxels, at a place between two voxels that are neighbours along an axis; `None` if one was not observed.
fn field_at(volume: &SparseVolume, index: &BlockIndex, place: DVec3) -> Option<f64> {
    let lower = place.floor();
    let fraction = (place - lower).max_element();
    let ahead = (place - lower).ceil();
    let [lower, upper] =
        [lower, lower + ahead].map(|voxel| sample(volume, index, voxel.as_ivec3().to_array()));
    Some(lower? * (1.0 - fraction) + upper? * fraction)
}

/// An observed sample, in voxels.
fn sample(volume: &SparseVolume, index: &BlockIndex, voxel: [i32; 3]) -> Option<f64> {
    let edge = volume.grid().edge;
    let block = index.get(voxel.map(|c| c >> edge.log2()).into())? as usize;
    let [x, y, z] = voxel.map(|c| c as usize % edge.voxels());
    let voxel = edge.voxel_index(x, y, z);
    let observed = volume.unobserved(block).is_none_or(|mask| !mask.contains(voxel));
    observed.then(|| f64::from(volume.block(block)[voxel]) / f64::from(CODES_PER_VOXEL))
}

/// The vertices of a surface, in voxels from the centre of the grid's first one.
#[derive(Debug)]
struct Surface {
    vertices: Vec<DVec3>,
    /// The unit cells that have vertices.
    cells: CellSet,
    /// Made when it is first needed: hardly any frame that is good enough has need of it.
    tree: OnceLock<PointTree>,
}

/// What is seen of a surface from another.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Distances of the vertices that are near to it.
    near: MeanSquare,
    /// Distances of all other vertices.
    far: MeanSquare,
}

impl Surface {
    fn new(volume: &SparseVolume) -> Self {
        let TriangleMesh { vertices, .. } = extract_surface(volume, &SurfaceOptions::default());
        let voxel_m = volume.grid().voxel_size.metres();
        let vertices: Vec<DVec3> =
            vertices.into_par_iter().map(|vertex| on_grid(vertex / voxel_m - 0.5)).collect();
        let mut cells = CellSet::default();
        vertices.iter().for_each(|vertex| cells.insert(cell_of(*vertex)));
        Self { vertices, cells, tree: OnceLock::new() }
    }

    /// The distances of its vertices from another surface: what `near` says, or else to the nearest vertex.
    fn seen(&self, near: impl Fn(DVec3) -> Option<f64> + Sync, from: &Self) -> Seen {
        let of_chunk = |vertices: &[DVec3]| {
            let mut seen = Seen::default();
            for vertex in vertices {
                match near(*vertex) {
                    Some(distance) => seen.near.add(distance),
                    None => seen.far.add(from.distance(*vertex, self)),
                }
            }
            seen
        };
        let chunks: Vec<Seen> = self.vertices.par_chunks(CHUNK).map(of_chunk).collect();
        let both = |a: Seen, b: &Seen| Seen { near: a.near.and(b.near), far: a.far.and(b.far) };
        chunks.iter().fold(Seen::default(), both)
    }

    /// Whether the cell of a position or one around it has a vertex.
    fn is_near(&self, position: DVec3) -> bool {
        let [x, y, z] = cell_of(position);
        let around = |at: usize| [0, -1, 1][at];
        (0..27)
            .any(|at| self.cells.contains([x + around(at % 3), y + around(at / 3 % 3), z + around(at / 9)]))
    }

    /// How far the nearest vertex is from a position on the other surface.
    fn distance(&self, position: DVec3, other: &Self) -> f64 {
        match self.vertices.is_empty() {
            true => other.diagonal(),
            false => {
                self.tree.get_or_init(|| PointTree::new(self.vertices.clone())).nearest_sq(position).sqrt()
            }
        }
    }

    fn diagonal(&self) -> f64 {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = self.vertices.iter().fold(empty, |(low, high), v| (low.min(*v), high.max(*v)));
        if self.vertices.is_empty() { 0.0 } else { low.distance(high) }
    }
}

/// Unit cells, as bits of cubes of 8x8x8.
#[derive(Debug, Default)]
struct CellSet {
    cubes: HashMap<[i32; 3], [u64; 8]>,
}

impl CellSet {
    fn insert(&mut self, cell: [i32; 3]) {
        let (cube, layer, bit) = Self::place_of(cell);
        self.cubes.entry(cube).or_default()[layer] |= 1 << bit;
    }

    fn contains(&self, cell: [i32; 3]) -> bool {
        let (cube, layer, bit) = Self::place_of(cell);
        self.cubes.get(&cube).is_some_and(|layers| layers[layer] >> bit & 1 != 0)
    }

    /// The cube of a cell, and in it the layer along z and the bit in this.
    fn place_of(cell: [i32; 3]) -> ([i32; 3], usize, usize) {
        let [x, y, z] = cell.map(|c| c as usize & 7);
        (cell.map(|c| c >> 3), z, 8 * y + x)
    }
}

/// A vertex without what rounding has added across its edge.
fn on_grid(vertex: DVec3) -> DVec3 {
    let whole = vertex.round();
    DVec3::select((vertex - whole).abs().cmplt(DVec3::splat(1e-6)), whole, vertex)
}

fn cell_of(position: DVec3) -> [i32; 3] {
    position.floor().as_ivec3().to_array()
}

/// Mean square of distances; 0 if there are none.
#[derive(Clone, Copy, Debug, Default)]
struct MeanSquare {
    squares: f64,
    count: u64,
}

impl MeanSquare {
    fn add(&mut self, distance: f64) {
        self.squares += distance * distance;
        self.count += 1;
    }

    fn and(self, other: Self) -> Self {
        Self { squares: self.squares + other.squares, count: self.count + other.count }
    }

    fn mean(self) -> f64 {
        self.squares / self.count.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::volume_of;
    use isv_volume::{BlockEdge, Grid, Truncation, VoxelSize};

    fn balls(edge: BlockEdge, balls: &[([f64; 3], f64)]) -> SparseVolume {
        let grid = Grid {
            voxel_size: VoxelSize::from_metres(0.005).unwrap(),
            edge,
            truncation: Truncation::DEFAULT,
        };
        let distance = |p: [f64; 3]| {
            let from =
                |(centre, radius): &([f64; 3], f64)| DVec3::from(p).distance(DVec3::from(*centre)) - radius;
            balls.iter().map(from).fold(f64::INFINITY, f64::min)
        };
        volume_of(grid, 48 / edge.voxels() as i32, distance, |_| false)
    }

    const LARGE: ([f64; 3], f64) = ([-16.2, 0.3, 0.4], 20.0);
    const SMALL: ([f64; 3], f64) = ([30.1, 0.2, -0.3], 3.0);

    #[test]
    fn of_a_moved_ball_it_is_what_the_ball_has_moved_along_its_normals() {
        for (edge, shift) in [(BlockEdge::E8, 0.3), (BlockEdge::E4, 0.7), (BlockEdge::E16, 1.2)] {
            let ([x, y, z], radius) = LARGE;
            let moved = balls(edge, &[([x, y + shift, z], radius)]);
            let rms = surface_distance_voxels(&balls(edge, &[LARGE]), &moved);
            // Of the component along the normal, over a sphere, the mean square is a third.
            let expected = shift / 3f64.sqrt();
            assert!((rms - expected).abs() < 0.03 * expected, "{rms} {expected}");
        }
    }

    #[test]
    fn what_is_lost_and_what_never_was_count_with_their_distance() {
        let both = balls(BlockEdge::E8, &[LARGE, SMALL]);
        let large = balls(BlockEdge::E8, &[LARGE]);
        assert!(surface_distance_voxels(&both, &both) < 1e-3);
        // Vertices are spread about evenly over the surfaces, and the small one is about 26 voxels from the nearest of the large.
        let share = SMALL.1.powi(2) / (SMALL.1.powi(2) + LARGE.1.powi(2));
        let expected = (0.5 * share * (26.3f64.powi(2) + 2.0)).sqrt();
        for rms in [surface_distance_voxels(&both, &large), surface_distance_voxels(&large, &both)] {
            assert!((rms - expected).abs() < 0.1 * expected, "{rms} {expected}");
        }
    }

    #[test]
    fn without_a_surface_it_is_the_size_of_the_other() {
        let nothing = SparseVolume::empty(*balls(BlockEdge::E8, &[SMALL]).grid());
        let small = balls(BlockEdge::E8, &[SMALL]);
        assert_eq!(surface_distance_voxels(&nothing, &nothing), 0.0);
        for rms in [surface_distance_voxels(&small, &nothing), surface_distance_voxels(&nothing, &small)] {
            // One direction has no vertices and says nothing.
            let diagonal = 2.0 * SMALL.1 * 3f64.sqrt();
            assert!((rms - diagonal * 0.5f64.sqrt()).abs() < 0.1 * diagonal, "{rms}");
        }
    }
}
