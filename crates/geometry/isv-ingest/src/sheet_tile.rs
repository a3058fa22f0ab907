//! Distances and sides of the voxels of a tile that has sheets, one by one. They serve blocks of other edges
//! than 8, and as the reference of [`crate::sheet_block`].
//!
//! Near the surface, each face is scattered into the voxels around it, which finds the closest face of each voxel. The other voxels
//! take the closest face among those of their neighbours (Danielsson 1980, "Euclidean distance mapping"). Their distance and side are
//! exact, except for a few voxels whose closest face is that of no neighbour. Propagating points instead of faces costs 12 % more bytes.

use crate::holes::WideHoles;
use crate::sheets::{SheetDistance, Sheets};
use crate::tiles::{TILE_BLOCKS, Tile, VoxelMesh};
use glam::{DVec3, IVec3};
use isv_spatial::{Feature, closest_on_triangle};

/// Side of a voxel: the kind of its closest part, and the sign there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct VoxelSide {
    /// Whether a sheet is closest: its sign is `is_behind`, not that of the closed parts.
    pub(crate) of_sheet: bool,
    pub(crate) is_behind: bool,
    pub(crate) is_unobserved: bool,
}

/// The closest face of a voxel, if one is known.
#[derive(Clone, Copy)]
struct Nearest {
    distance_sq: f64,
    face: u32,
}

const NONE: Nearest = Nearest { distance_sq: f64::INFINITY, face: u32::MAX };

/// Mesh and sheets that tiles are measured from.
pub(crate) struct SheetScene<'a> {
    pub(crate) mesh: &'a VoxelMesh<'a>,
    pub(crate) sheets: &'a Sheets,
    /// Holes of the closed parts that stay open.
    pub(crate) holes: Option<&'a WideHoles>,
    /// Distance up to which distances are exact (voxels).
    pub(crate) reach: f64,
}

/// The closest faces of the voxels of a tile; its buffers are reused from tile to tile.
#[derive(Default)]
pub(crate) struct SheetTile {
    nearest: Vec<Nearest>,
    /// Voxels along the edge of the tile.
    edge: usize,
    /// The centre of its first voxel.
    first: DVec3,
    block: Vec<Nearest>,
}

impl SheetTile {
    /// Finds the closest faces of all voxels of a tile within reach.
    pub(crate) fn scatter(&mut self, scene: &SheetScene, tile: &Tile, edge: usize) {
        self.edge = edge;
        self.first = tile.coord.as_dvec3() * edge as f64 + 0.5;
        self.nearest.clear();
        self.nearest.resize(edge.pow(3), NONE);
        for face in tile.faces() {
            self.lower(face, scene.mesh.corners(face).map(|corner| corner - self.first), scene.reach);
        }
    }

    /// Lowers the distances around a face, given relative to the first voxel.
    fn lower(&mut self, face: u32, corners: [DVec3; 3], reach: f64) {
        let [a, b, c] = corners;
        let last = IVec3::splat(self.edge as i32 - 1);
        let lo = (a.min(b).min(c) - reach).ceil().as_ivec3().max(IVec3::ZERO);
        let hi = (a.max(b).max(c) + reach).floor().as_ivec3().min(last);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for z in lo.z..=hi.z {
            for y in lo.y..=hi.y {
                let row = (z as usize * self.edge + y as usize) * self.edge;
                for x in lo.x..=hi.x {
                    let p = IVec3::new(x, y, z).as_dvec3();
                    let nearest = &mut self.nearest[row + x as usize];
                    let height = normal.dot(p - a);
                    // Among equals the first one counts.
                    if height.abs() > reach || height * height >= nearest.distance_sq {
                        continue;
                    }
                    let distance_sq = closest_on_triangle(p, &corners).0.distance_squared(p);
                    if distance_sq < nearest.distance_sq && distance_sq <= reach * reach {
                        *nearest = Nearest { distance_sq, face };
                    }
                }
            }
        }
    }

    /// Takes the distances and sides of the block at a position in the tile, x fastest; none if no voxel of it is within reach.
    pub(crate) fn take(
        &mut self,
        scene: &SheetScene,
        position: [i32; 3],
        distances: &mut Vec<f32>,
        sides: &mut Vec<VoxelSide>,
    ) {
        let n = self.edge / TILE_BLOCKS as usize;
        let first = IVec3::from_array(position) * n as i32;
        distances.clear();
        sides.clear();
        self.block.clear();
        for voxel in 0..n.pow(3) {
            let at = first + place(voxel, n);
            let index = (at.z as usize * self.edge + at.y as usize) * self.edge + at.x as usize;
            self.block.push(self.nearest[index]);
        }
        if self.block.iter().all(|nearest| nearest.face == NONE.face) {
            return;
        }
        let corner = first.as_dvec3() + self.first;
        propagate_faces(scene.mesh, &mut self.block, n, corner);
        for (voxel, nearest) in self.block.iter().enumerate() {
            let (distance, side) = scene.measure(corner + place(voxel, n).as_dvec3(), nearest.face);
            distances.push(distance as f32);
            sides.push(side);
        }
    }
}

/// Returns the position of a voxel in its block.
fn place(voxel: usize, n: usize) -> IVec3 {
    IVec3::new((voxel % n) as i32, (voxel / n % n) as i32, (voxel / (n * n)) as i32)
}

impl SheetScene<'_> {
    /// Measures the distance of a voxel from a face, and finds its side.
    pub(crate) fn measure(&self, p: DVec3, face: u32) -> (f64, VoxelSide) {
        let (point, feature) = closest_on_triangle(p, &self.mesh.corners(face));
        if self.sheets.has(face) {
            let SheetDistance { distance, is_observed } =
                self.sheets.signed_distance(p - point, face, feature);
            let (is_behind, is_unobserved) = (distance < 0.0, !is_observed);
            return (distance.abs(), VoxelSide { of_sheet: true, is_behind, is_unobserved });
        }
        let is_unobserved = self.is_on_hole(face, feature);
        (p.distance(point), VoxelSide { is_unobserved, ..VoxelSide::default() })
    }

    /// Whether a feature of a closed part lies on a wide hole.
    pub(crate) fn is_on_hole(&self, face: u32, feature: Feature) -> bool {
        let corner = |corner: u8| self.mesh.triangles[face as usize][usize::from(corner)];
        self.holes.is_some_and(|holes| match feature {
            Feature::Face => false,
            Feature::Edge(side) => holes.has_edge(face, usize::from(side)),
            Feature::Vertex(number) => holes.has_vertex(corner(number)),
        })
    }
}

/// Propagates closest faces to the voxels of a block that have none, forwards and then backwards. `corner` is the centre of the first
/// voxel.
fn propagate_faces(mesh: &VoxelMesh, block: &mut [Nearest], n: usize, corner: DVec3) {
    let known: Vec<bool> = block.iter().map(|nearest| nearest.face != NONE.face).collect();
    let settle = |block: &mut [Nearest], voxel: usize, way: i32| {
        if known[voxel] {
            return;
        }
        let at = place(voxel, n);
        let p = corner + at.as_dvec3();
        let mut tried = block[voxel].face;
        // The 13 neighbours that come before in the order of voxels, or after.
        for step in 0..13 {
            let other = at + way * (IVec3::new(step % 3, step / 3 % 3, step / 9) - 1);
            if other.min_element() < 0 || other.max_element() >= n as i32 {
                continue;
            }
            let face = block[(other.z as usize * n + other.y as usize) * n + other.x as usize].face;
            if face == NONE.face || face == tried || face == block[voxel].face {
                continue;
            }
            tried = face;
            let distance_sq = closest_on_triangle(p, &mesh.corners(face)).0.distance_squared(p);
            if distance_sq < block[voxel].distance_sq {
                block[voxel] = Nearest { distance_sq, face };
            }
        }
    };
    for voxel in 0..block.len() {
        settle(block, voxel, 1);
    }
    for voxel in (0..block.len()).rev() {
        settle(block, voxel, -1);
    }
}
