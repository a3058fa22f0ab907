//! Which voxels are inside a mesh (Eq. 8): where its winding number is not zero, once it is closed.

use crate::crossings::Crossings;
use crate::holes::WideHoles;
use crate::tiles::{Band, OverLimit, TileList, VoxelMesh};
use glam::{DVec3, IVec3};
use isv_spatial::WindingNumber;
use isv_volume::TriangleMesh;

/// Change of the winding number that makes no difference to what nobody sees. An unobserved sample that is 8
/// voxels from a hole changes by as many codes.
const STEADY: f64 = 1.0 / 512.0;

/// What is inside a mesh.
pub(crate) struct Sides {
    /// Crossings of the mesh and the triangles that close it.
    pub(crate) crossings: Crossings,
    pub(crate) caps: Caps,
}

/// What closes a mesh.
pub(crate) struct Caps {
    /// The triangles by themselves, in voxels, if there are any.
    closing: Option<WindingNumber>,
    /// The tiles that those over holes to keep open pass through, or are within a voxel of.
    pub(crate) tiles: Vec<IVec3>,
    /// In voxels.
    tile_edge: f64,
}

impl Sides {
    /// Sides of a mesh that some more triangles close. `holes`: those that are to stay open, if any.
    pub(crate) fn new(
        mesh: &VoxelMesh,
        closing: &[[u32; 3]],
        holes: Option<&WideHoles>,
        band: &Band,
    ) -> Self {
        let crossings = Crossings::new(mesh, closing, band.tile_edge().ilog2());
        Self { crossings, caps: Caps::new(mesh, closing, holes, band) }
    }

    /// Generalized winding numbers of voxels in the mesh as it is, with its holes (Jacobson et al. 2013).
    /// They are those in the closed mesh, less what the triangles over the holes add.
    pub(crate) fn winding_numbers(&self, voxels: &[IVec3]) -> Vec<f64> {
        let whole = |voxel: &IVec3| f64::from(self.crossings.winding_number(voxel.to_array()));
        let Some(closing) = &self.caps.closing else { return voxels.iter().map(whole).collect() };
        let points: Vec<DVec3> = voxels.iter().map(|voxel| voxel.as_dvec3() + 0.5).collect();
        voxels
            .iter()
            .zip(closing.at_points(&points))
            .map(|(voxel, over_holes)| whole(voxel) - over_holes)
            .collect()
    }
}

impl Caps {
    /// Creates caps of the triangles that close a mesh; `holes` as in [`Sides::new`].
    pub(crate) fn new(
        mesh: &VoxelMesh,
        closing: &[[u32; 3]],
        holes: Option<&WideHoles>,
        band: &Band,
    ) -> Self {
        let is_cap = |triangle: &&[u32; 3]| {
            holes.is_some_and(|holes| triangle.iter().any(|vertex| holes.has_vertex(*vertex)))
        };
        let over_wide: Vec<[u32; 3]> = closing.iter().filter(is_cap).copied().collect();
        let over_holes = (!closing.is_empty()).then(|| WindingNumber::new(&by_themselves(mesh, closing)));
        let tiles = tiles_of(by_themselves(mesh, &over_wide), band);
        Self { closing: over_holes, tiles, tile_edge: f64::from(band.tile_edge()) }
    }

    /// Whether what closes the mesh adds about as much to the winding numbers in a tile as in another frame.
    pub(crate) fn are_alike_in(&self, other: &Self, tile: IVec3) -> bool {
        let centre = (tile.as_dvec3() + 0.5) * self.tile_edge;
        let added = |caps: &Self| caps.closing.as_ref().map_or(0.0, |closing| closing.at(centre));
        (added(self) - added(other)).abs() <= STEADY
    }
}

/// Some triangles of the vertices of a mesh, with vertices of their own.
fn by_themselves(mesh: &VoxelMesh, triangles: &[[u32; 3]]) -> TriangleMesh {
    TriangleMesh {
        vertices: triangles.iter().flatten().map(|vertex| mesh.vertices[*vertex as usize]).collect(),
        normals: Vec::new(),
        triangles: (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        appearance: None,
    }
}

/// The tiles that some triangles pass through, or are within a voxel of.
fn tiles_of(mesh: TriangleMesh, band: &Band) -> Vec<IVec3> {
    let mesh = VoxelMesh { vertices: mesh.vertices, triangles: mesh.triangles.into() };
    let list = TileList::build(&mesh, &band.within(1.0), usize::MAX);
    let places = |list: TileList| list.tiles().iter().map(|tile| tile.coord).collect();
    list.map_or_else(|OverLimit| Vec::new(), places)
}
