//! How often each voxel is enclosed: the winding number, counted along rows of voxels.
//!
//! Around a closed mesh, the winding number of a voxel counts triangles along its row of voxels in x. It is
//! how many the row passes from the front before it gets there, less how many from the back. Triangles are
//! drawn onto the plane of y and z, as a picture is. Each row is inside or outside of a triangle, exactly. A
//! row that meets an edge or a vertex is counted by the one triangle that has it by the rule of the
//! rasterizers. Corners are moved onto a lattice of 2^-16 voxel for that. So the counts are exactly those of
//! a closed mesh that is nowhere farther than that from the given one, and nothing is in doubt.

use crate::tiles::VoxelMesh;
use glam::DVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::ops::{Mul, Sub};

/// Bits of a coordinate below the voxel.
const FRACTION: u32 = 16;
/// Centre of a voxel, on the lattice.
const CENTRE: i64 = 1 << (FRACTION - 1);

/// Largest triangle whose edge functions fit 64 bits, in steps of the lattice.
const SMALL: i64 = 1 << 30;

/// Width of a triangle (voxels) above which the part of each row inside is estimated before it is looked at.
const WIDE: i64 = 16;

/// Triangles drawn at a time.
const BATCH: usize = 2048;

/// A change of the winding number along a row of voxels.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Crossing {
    /// The first voxel beyond.
    from: i32,
    change: i32,
}

/// All changes along the rows of voxels of tiles one behind the other along x.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Column {
    edge_log2: u32,
    /// Beginning of the crossings of each row, y fastest, and the end of the last one's.
    starts: Vec<u32>,
    crossings: Vec<Crossing>,
}

/// The changes along all rows of voxels.
#[derive(Clone)]
pub(crate) struct Crossings {
    /// Rows along the edge of a column, as a power of two.
    edge_log2: u32,
    /// Columns by their positions, in columns along y and z.
    numbers: FxHashMap<[i32; 2], u32>,
    columns: Vec<Column>,
}

/// A crossing, and the y and z of its row.
type Entry = ([i32; 2], Crossing);

impl Crossings {
    /// Crossings of a mesh that some more triangles close. `edge_log2`: the edge of a tile in voxels, as a
    /// power of two.
    pub(crate) fn new(mesh: &VoxelMesh, closing: &[[u32; 3]], edge_log2: u32) -> Self {
        let corners: Vec<Corner> = mesh.vertices.par_iter().map(Corner::at).collect();
        let draw = |triangles: &[[u32; 3]]| {
            let mut entries = Vec::new();
            for triangle in triangles {
                draw(&triangle.map(|vertex| &corners[vertex as usize]), &mut entries);
            }
            entries
        };
        let mut drawn: Vec<Vec<Entry>> = mesh.triangles.par_chunks(BATCH).map(draw).collect();
        drawn.push(draw(closing));
        Self::sort(&drawn, edge_log2)
    }

    /// Sorts crossings into rows.
    fn sort(drawn: &[Vec<Entry>], edge_log2: u32) -> Self {
        let mut numbers: FxHashMap<[i32; 2], u32> = FxHashMap::default();
        let mut entries: Vec<Vec<Entry>> = Vec::new();
        let mut last = None;
        for entry in drawn.iter().flatten() {
            let position = entry.0.map(|c| c >> edge_log2);
            let number = match last {
                Some((known, number)) if known == position => number,
                _ => *numbers.entry(position).or_insert_with(|| {
                    entries.push(Vec::new());
                    entries.len() as u32 - 1
                }),
            };
            last = Some((position, number));
            entries[number as usize].push(*entry);
        }
        let columns = entries.par_iter().map(|entries| Column::new(entries, edge_log2)).collect();
        Self { edge_log2, numbers, columns }
    }

    /// The changes along the row of voxels at y and z, ascending.
    pub(crate) fn row(&self, place: [i32; 2]) -> &[Crossing] {
        self.column(place.map(|c| c >> self.edge_log2)).map_or(&[], |column| column.row(place))
    }

    /// The winding number of a voxel.
    pub(crate) fn winding_number(&self, [x, y, z]: [i32; 3]) -> i32 {
        self.row([y, z])
            .iter()
            .take_while(|crossing| crossing.from <= x)
            .map(|crossing| crossing.change)
            .sum()
    }

    /// The changes in the tiles at a place along y and z, if there are any.
    pub(crate) fn column(&self, position: [i32; 2]) -> Option<&Column> {
        self.numbers.get(&position).map(|number| &self.columns[*number as usize])
    }

    /// Whether all voxels of a tile have the winding numbers they have in another frame.
    pub(crate) fn are_alike_in(&self, other: &Self, tile: [i32; 3]) -> bool {
        let [x, y, z] = tile;
        match (self.column([y, z]), other.column([y, z])) {
            (None, None) => true,
            (Some(a), Some(b)) if a == b => true,
            (a, b) => {
                let (first, rows) = (x << self.edge_log2, 1 << (2 * self.edge_log2));
                let voxels = first..first + (1 << self.edge_log2);
                let changes = |column: Option<&Column>, row| {
                    let mut changes = vec![0; voxels.len()];
                    for crossing in column.map_or(&[][..], |column| column.row_at(row)) {
                        if crossing.from < voxels.end {
                            changes[(crossing.from.max(first) - first) as usize] += crossing.change;
                        }
                    }
                    changes
                };
                (0..rows).all(|row| changes(a, row) == changes(b, row))
            }
        }
    }
}

impl Column {
    fn new(entries: &[Entry], edge_log2: u32) -> Self {
        let row = |place: &[i32; 2]| row_number(*place, edge_log2);
        let mut starts = vec![0u32; (1 << (2 * edge_log2)) + 1];
        for (place, _) in entries {
            starts[row(place) + 1] += 1;
        }
        for row in 1..starts.len() {
            starts[row] += starts[row - 1];
        }
        let mut next = starts.clone();
        let mut crossings = vec![Crossing::default(); entries.len()];
        for (place, crossing) in entries {
            let next = &mut next[row(place)];
            crossings[*next as usize] = *crossing;
            *next += 1;
        }
        for bounds in starts.windows(2) {
            crossings[bounds[0] as usize..bounds[1] as usize].sort_unstable_by_key(|crossing| crossing.from);
        }
        Self { edge_log2, starts, crossings }
    }

    /// The changes along the row of voxels at y and z, ascending.
    pub(crate) fn row(&self, place: [i32; 2]) -> &[Crossing] {
        self.row_at(row_number(place, self.edge_log2))
    }

    fn row_at(&self, row: usize) -> &[Crossing] {
        &self.crossings[self.starts[row] as usize..self.starts[row + 1] as usize]
    }
}

/// The number of the row at y and z in its column.
fn row_number(place: [i32; 2], edge_log2: u32) -> usize {
    let [y, z] = place.map(|c| (c & ((1 << edge_log2) - 1)) as usize);
    z << edge_log2 | y
}

/// Calls `run` with the voxels of runs whose winding number is not zero, among `count` of a row from `first` on.
pub(crate) fn for_each_inside(
    row: &[Crossing],
    first: i32,
    count: usize,
    mut run: impl FnMut(std::ops::Range<usize>),
) {
    let (mut number, mut place) = (0, 0);
    for crossing in row {
        let next = (i64::from(crossing.from) - i64::from(first)).clamp(0, count as i64) as usize;
        if number != 0 && next > place {
            run(place..next);
        }
        place = next;
        number += crossing.change;
    }
}

/// A vertex on the lattice.
struct Corner {
    /// In voxels.
    x: f64,
    /// In steps of the lattice.
    y: i64,
    z: i64,
}

impl Corner {
    fn at(position: &DVec3) -> Self {
        let on_lattice = |c: f64| (c * f64::from(1 << FRACTION)).round() as i64;
        Self { x: position.x, y: on_lattice(position.y), z: on_lattice(position.z) }
    }
}

/// A number that edge functions are made of.
trait Wide: Copy + From<i64> + Mul<Output = Self> + Sub<Output = Self> + PartialOrd + Default {
    fn to_f64(self) -> f64;
}

impl Wide for i64 {
    fn to_f64(self) -> f64 {
        self as f64
    }
}

impl Wide for i128 {
    fn to_f64(self) -> f64 {
        self as f64
    }
}

/// Draws a triangle onto the plane of y and z.
fn draw(triangle: &[&Corner; 3], entries: &mut Vec<Entry>) {
    let [a, b, c] = triangle;
    let bounds = |p: i64, q: i64, r: i64| {
        // Rows of voxels by their centres.
        let (lo, hi) = (p.min(q).min(r), p.max(q).max(r));
        ((lo - CENTRE + (1 << FRACTION) - 1) >> FRACTION, (hi - CENTRE) >> FRACTION, hi - lo)
    };
    let (y_first, y_last, y_size) = bounds(a.y, b.y, c.y);
    let (z_first, z_last, z_size) = bounds(a.z, b.z, c.z);
    if y_first > y_last || z_first > z_last {
        return;
    }
    let rows = [[y_first, y_last], [z_first, z_last]];
    if y_size.max(z_size) <= SMALL {
        draw_rows::<i64>(triangle, rows, entries);
    } else {
        draw_rows::<i128>(triangle, rows, entries);
    }
}

/// Edge function of a side from one corner to another, in the plane of y and z. It is positive for a point on
/// the left of the side.
fn edge_function<T: Wide>(from: &Corner, to: &Corner, [y, z]: [i64; 2]) -> T {
    T::from(to.y - from.y) * T::from(z - from.z) - T::from(to.z - from.z) * T::from(y - from.y)
}

/// Draws a triangle onto the rows that its bounds hold.
fn draw_rows<T: Wide>(triangle: &[&Corner; 3], [ys, zs]: [[i64; 2]; 2], entries: &mut Vec<Entry>) {
    let [a, mut b, mut c] = *triangle;
    let mut area: T = edge_function(a, b, [c.y, c.z]);
    // Its normal points along x where the area is positive: a row leaves the inside there.
    let change = if area > T::default() { -1 } else { 1 };
    if area < T::default() {
        (b, c) = (c, b);
        area = T::default() - area;
    }
    if area == T::default() {
        return;
    }
    let sides = [(b, c), (c, a), (a, b)];
    // A row on a side belongs to the triangle that it gets into when moved a little along y, and even less along z.
    let owns = sides.map(|(from, to)| to.z < from.z || (to.z == from.z && to.y > from.y));
    for z in zs[0]..=zs[1] {
        let [first, last] = if ys[1] - ys[0] > WIDE { within(&sides, z, ys) } else { ys };
        for y in first..=last {
            let at = [y, z].map(|row| (row << FRACTION) + CENTRE);
            let weights: [T; 3] = sides.map(|(from, to)| edge_function(from, to, at));
            let is_inside =
                |side: usize| weights[side] > T::default() || (weights[side] == T::default() && owns[side]);
            if is_inside(0) && is_inside(1) && is_inside(2) {
                let [to_b, to_c] = [weights[1], weights[2]].map(|weight| weight.to_f64() / area.to_f64());
                let x = a.x + to_b * (b.x - a.x) + to_c * (c.x - a.x);
                let crossing = Crossing { from: (x - 0.5).ceil() as i32, change };
                entries.push(([y as i32, z as i32], crossing));
            }
        }
    }
}

/// The rows at some z that may be inside a triangle, at least, of those between two.
fn within(sides: &[(&Corner, &Corner); 3], z: i64, ys: [i64; 2]) -> [i64; 2] {
    let z = (z << FRACTION) + CENTRE;
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for (from, to) in sides {
        if (from.z.min(to.z)..=from.z.max(to.z)).contains(&z) {
            let ends = [from.y as f64, to.y as f64];
            let share = (z - from.z) as f64 / (to.z - from.z) as f64;
            let here = if from.z == to.z { ends } else { [ends[0] + share * (ends[1] - ends[0]); 2] };
            lo = lo.min(here[0]).min(here[1]);
            hi = hi.max(here[0]).max(here[1]);
        }
    }
    let row = |y: f64| (y / f64::from(1 << FRACTION)).floor() as i64;
    [ys[0].max(row(lo) - 1), ys[1].min(row(hi) + 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_spatial::{Bvh, exact_winding_number};
    use isv_testkit::{Random, sphere};
    use isv_volume::TriangleMesh;

    const EDGE_LOG2: u32 = 3;

    fn check(mesh: &TriangleMesh) {
        let voxel_mesh = VoxelMesh { vertices: mesh.vertices.clone(), triangles: (&mesh.triangles).into() };
        let crossings = Crossings::new(&voxel_mesh, &[], EDGE_LOG2);
        let (lo, hi) = mesh.bounds().unwrap();
        let (lo, hi) = (lo.floor().as_ivec3() - 1, hi.ceil().as_ivec3() + 1);
        let bvh = Bvh::new(mesh);
        let mut enclosed = 0;
        for z in lo.z..hi.z {
            for y in lo.y..hi.y {
                let mut inside = vec![false; (hi.x - lo.x) as usize];
                for_each_inside(crossings.row([y, z]), lo.x, inside.len(), |run| inside[run].fill(true));
                for x in lo.x..hi.x {
                    let number = crossings.winding_number([x, y, z]);
                    assert_eq!(inside[(x - lo.x) as usize], number != 0);
                    let centre = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) + 0.5;
                    if bvh.distance(centre) > 1e-6 {
                        // Beside edges in the direction of rows, as rows are.
                        let exact = exact_winding_number(mesh, centre + DVec3::new(0.0, 1e-7, 1e-10));
                        assert_eq!(f64::from(number), exact.round() + 0.0, "{centre}");
                    }
                    enclosed += usize::from(number != 0);
                }
            }
        }
        assert!(enclosed > 100);
    }

    #[test]
    fn corners_and_edges_on_rows_are_counted_once() {
        // All vertices on centres of voxels, or between them.
        let mut random = Random::new(5);
        for _ in 0..20 {
            let mut mesh = sphere(6.0, 8);
            for vertex in &mut mesh.vertices {
                *vertex = (2.0 * *vertex).round() * 0.5 + 0.5 * (2.0 * random.point()).round();
            }
            let poles = [mesh.vertices[0], mesh.vertices[mesh.vertices.len() - 1]];
            let count = mesh.vertices.len();
            for (i, vertex) in mesh.vertices.iter_mut().enumerate() {
                // The sphere's poles are many vertices in one place.
                *vertex = if i < 16 {
                    poles[0]
                } else if i >= count - 16 {
                    poles[1]
                } else {
                    *vertex
                };
            }
            check(&mesh);
        }
    }

    #[test]
    fn large_triangles_count_as_small_ones_do() {
        let mesh = sphere(40.0, 3);
        check(&mesh);
        let tetrahedron = TriangleMesh {
            vertices: vec![
                [-9e4, -5e4, -7e4].into(),
                [8e4, -6e4, 3e3].into(),
                [2e3, 9e4, -4e4].into(),
                [1e3, 3e3, 8e4].into(),
            ],
            normals: Vec::new(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
            appearance: None,
        };
        let voxel_mesh =
            VoxelMesh { vertices: tetrahedron.vertices.clone(), triangles: (&tetrahedron.triangles).into() };
        let mut entries = Vec::new();
        for triangle in voxel_mesh.triangles.iter() {
            let corners = triangle.map(|vertex| Corner::at(&voxel_mesh.vertices[vertex as usize]));
            // A few rows of it.
            draw_rows::<i128>(&[&corners[0], &corners[1], &corners[2]], [[-20, 20], [-10, 10]], &mut entries);
        }
        let crossings = Crossings::sort(&[entries], EDGE_LOG2);
        for x in [-60_000, -30_000, -5_000, 0, 4_000, 50_000] {
            let p = DVec3::new(f64::from(x), 3.0, -4.0) + 0.5;
            let expected = exact_winding_number(&tetrahedron, p).round();
            assert_eq!(f64::from(crossings.winding_number([x, 3, -4])), expected, "{x}");
        }
    }
}
