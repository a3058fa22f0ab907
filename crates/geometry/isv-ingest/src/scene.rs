//! What the samples of a frame are made of, tile by tile.

use crate::cells::Directions;
use crate::holes::WideHoles;
use crate::rims::Rims;
use crate::tiles::{Band, Tile, TileList, VoxelMesh};
use crate::topology::Topology;
use glam::DVec3;

/// The triangles of a mesh, which of them matter in each tile, and what else has to be known of them there.
pub(crate) struct Scene<'m> {
    pub(crate) mesh: VoxelMesh<'m>,
    list: TileList,
    pub(crate) measure: Measure,
}

/// How the distances of a scene are measured, and what that takes.
pub(crate) enum Measure {
    /// Exactly in all of the band, with the parts of the mesh that are closest ([`crate::descent`]).
    Exact(Box<Connections>),
    /// Near the surface ([`crate::scatter`]), and from there on ([`crate::continuation`]); with the rims of wide holes, if there are any.
    Near(Option<Rims>),
}

/// How triangles hang together, where they point, and the holes to keep open, if any.
pub(crate) struct Connections {
    pub(crate) topology: Topology,
    pub(crate) directions: Directions,
    pub(crate) holes: Option<WideHoles>,
}

impl Scene<'_> {
    /// A scene all of whose band is measured exactly.
    pub(crate) fn exact(mesh: VoxelMesh, list: TileList, holes: Option<WideHoles>) -> Scene {
        let (topology, directions) = rayon::join(|| Topology::new(&mesh), || Directions::new(&mesh));
        let connections = Connections { topology, directions, holes };
        Scene { mesh, list, measure: Measure::Exact(Box::new(connections)) }
    }

    /// A scene that is measured near the surface. The band: that in which rims of holes may be closest.
    pub(crate) fn near_surface<'m>(
        mesh: VoxelMesh<'m>,
        list: TileList,
        holes: Option<WideHoles>,
        band: &Band,
    ) -> Scene<'m> {
        let rims = holes.map(|holes| Rims::new(&holes, band));
        Scene { mesh, list, measure: Measure::Near(rims) }
    }

    /// The scene with data of its own, which lives as long as one likes.
    pub(crate) fn into_owned(self) -> Scene<'static> {
        Scene { mesh: self.mesh.into_owned(), ..self }
    }

    /// All tiles, in Morton order.
    pub(crate) fn tiles(&self) -> Vec<Tile<'_>> {
        self.list.tiles()
    }

    /// Whether there are holes to keep open.
    pub(crate) fn has_wide_holes(&self) -> bool {
        match &self.measure {
            Measure::Exact(connections) => connections.holes.is_some(),
            Measure::Near(rims) => rims.is_some(),
        }
    }

    /// Whether the rim of a wide hole matters in a tile.
    pub(crate) fn is_beside_hole(&self, tile: &Tile) -> bool {
        match &self.measure {
            Measure::Exact(connections) => {
                let holes = connections.holes.as_ref();
                holes.is_some_and(|holes| tile.faces().any(|face| holes.touch(&self.mesh, face)))
            }
            Measure::Near(rims) => {
                rims.as_ref().is_some_and(|rims| rims.in_tile(tile.coord).next().is_some())
            }
        }
    }

    /// Whether the distances in a tile are made of the same as those in a tile of another scene, bit for bit.
    pub(crate) fn has_alike(&self, tile: &Tile, other: &Scene, other_tile: &Tile) -> bool {
        let bits = |corner: DVec3| corner.to_array().map(f64::to_bits);
        let alike_faces = |(a, b)| self.mesh.corners(a).map(bits) == other.mesh.corners(b).map(bits);
        if tile.faces().len() != other_tile.faces().len()
            || !tile.faces().zip(other_tile.faces()).all(alike_faces)
        {
            return false;
        }
        match (&self.measure, &other.measure) {
            (Measure::Exact(own), Measure::Exact(others)) => {
                let marks = |holes: &Option<WideHoles>, mesh, face| {
                    holes.as_ref().map_or(0, |holes: &WideHoles| holes.marks(mesh, face))
                };
                let is_alike =
                    |(a, b)| marks(&own.holes, &self.mesh, a) == marks(&others.holes, &other.mesh, b);
                tile.faces().zip(other_tile.faces()).all(is_alike)
            }
            (Measure::Near(own), Measure::Near(others)) => {
                let rims = |rims: &Option<Rims>| -> Vec<[[u64; 3]; 2]> {
                    rims.iter().flat_map(|rims| rims.in_tile(tile.coord)).map(|rim| rim.map(bits)).collect()
                };
                rims(own) == rims(others)
            }
            _ => false,
        }
    }
}
