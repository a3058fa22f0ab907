//! What the samples of a frame are made of, tile by tile.

use crate::holes::WideHoles;
use crate::sampler::Connections;
use crate::tiles::{Band, Measure, Tile, TileList, VoxelMesh};
use glam::{DVec3, IVec3};
use rustc_hash::FxHashMap;
use tracing::debug_span;

/// The triangles of a mesh, which of them matter in each tile, and what else has to be known of them there.
pub(crate) struct Scene<'m> {
    pub(crate) mesh: VoxelMesh<'m>,
    /// All tiles, and how they are measured.
    list: TileList,
    measure: Measure,
    /// The tiles beside wide holes where others are not measured exactly; their triangles are those of the connections.
    beside: Option<TileList>,
    pub(crate) connections: Option<Connections>,
}

impl Scene<'_> {
    /// A scene all of whose tiles are measured exactly.
    pub(crate) fn exact(mesh: VoxelMesh, list: TileList, holes: Option<WideHoles>) -> Scene {
        let connections = Some(Connections::of_all(&mesh, holes));
        Scene { mesh, list, measure: Measure::Exact, beside: None, connections }
    }

    /// A scene that is measured exactly only near wide holes, which is where what is unobserved ends. The bands are those of all
    /// tiles, and of those beside holes.
    pub(crate) fn near_surface<'m>(
        mesh: VoxelMesh<'m>,
        list: TileList,
        holes: Option<WideHoles>,
        bands: [&Band; 2],
    ) -> Scene<'m> {
        let beside = holes.map(|holes| {
            debug_span!("ingest beside holes").in_scope(|| {
                let touching: Vec<u32> =
                    (0..mesh.triangles.len() as u32).filter(|face| holes.touch(&mesh, *face)).collect();
                let mut list = TileList::around(&mesh, bands, &touching);
                let faces = list.faces();
                list.renumber(&faces);
                let (part, vertices) = mesh.part(&faces);
                (list, Connections::of_part(part, holes.part(&faces, &vertices)))
            })
        });
        let (beside, connections) = beside.unzip();
        Scene { mesh, list, measure: Measure::Scatter, beside, connections }
    }

    /// The same, for as long as one likes.
    pub(crate) fn into_owned(self) -> Scene<'static> {
        Scene { mesh: self.mesh.into_owned(), ..self }
    }

    /// All tiles, in Morton order.
    pub(crate) fn tiles(&self) -> Vec<Tile<'_>> {
        let mut tiles = self.list.tiles(self.measure);
        if let Some(beside) = &self.beside {
            let others = beside.tiles(Measure::Exact).into_iter().map(|tile| (tile.coord, tile));
            let others: FxHashMap<IVec3, Tile> = others.collect();
            for tile in &mut tiles {
                *tile = others.get(&tile.coord).copied().unwrap_or(*tile);
            }
        }
        tiles
    }

    /// The mesh that names the triangles of a tile, and the holes in it.
    fn parts(&self, measure: Measure) -> (&VoxelMesh<'_>, Option<&WideHoles>) {
        match (&self.connections, measure) {
            (Some(connections), Measure::Exact) => (connections.mesh(&self.mesh), connections.holes()),
            _ => (&self.mesh, None),
        }
    }

    /// Whether there are holes to keep open.
    pub(crate) fn has_wide_holes(&self) -> bool {
        self.connections.as_ref().is_some_and(|connections| connections.holes().is_some())
    }

    /// Whether some of a tile's triangles lie on a wide hole.
    pub(crate) fn is_beside_hole(&self, tile: &Tile) -> bool {
        let (mesh, holes) = self.parts(tile.measure);
        holes.is_some_and(|holes| tile.faces().any(|face| holes.touch(mesh, face)))
    }

    /// Whether the distances in a tile are made of the same as those in a tile of another scene, bit for bit.
    pub(crate) fn has_alike(&self, tile: &Tile, other: &Scene, other_tile: &Tile) -> bool {
        let ((mesh, holes), (other_mesh, other_holes)) =
            (self.parts(tile.measure), other.parts(other_tile.measure));
        let bits = |corners: [DVec3; 3]| corners.map(|corner| corner.to_array().map(f64::to_bits));
        let marks = |holes: Option<&WideHoles>, mesh, face| holes.map_or(0, |holes| holes.marks(mesh, face));
        let is_alike = |(a, b): (u32, u32)| {
            bits(mesh.corners(a)) == bits(other_mesh.corners(b))
                && marks(holes, mesh, a) == marks(other_holes, other_mesh, b)
        };
        tile.measure == other_tile.measure
            && tile.faces().len() == other_tile.faces().len()
            && tile.faces().zip(other_tile.faces()).all(is_alike)
    }
}
