//! The edges of a mesh, each with all faces at it. Vertices at exactly the same position count as one.

use crate::topology::sorted_sides;
use isv_spatial::Weld;
use isv_volume::TriangleMesh;

/// The edges of a mesh whose faces have an area.
pub(crate) struct Edges {
    /// The positions of each face's corners, by number.
    pub(crate) corners: Vec<[u32; 3]>,
    /// Number of positions.
    pub(crate) positions: usize,
    /// The sides of all faces, those at one edge together, ordered by opposite corner and then by face.
    sides: Vec<FaceSide>,
}

/// Side of a face. It has the ends of its edge, the lower in the high half, the corner opposite, and four
/// times the face plus the side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct FaceSide {
    ends: u64,
    opposite: u32,
    number: u32,
}

impl Edges {
    /// Finds the edges of a mesh.
    pub(crate) fn new(mesh: &TriangleMesh) -> Self {
        let Weld { positions, count } = Weld::new(&mesh.vertices);
        let corners =
            mesh.triangles.iter().map(|triangle| triangle.map(|vertex| positions[vertex as usize])).collect();
        let sides = sorted_sides(&mesh.triangles, &positions);
        let side = |(ends, opposite, number)| FaceSide { ends, opposite, number };
        Self { corners, positions: count, sides: sides.into_iter().map(side).collect() }
    }

    /// Iterates over edges: all sides at each.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[FaceSide]> {
        self.sides.chunk_by(|a, b| a.ends == b.ends)
    }

    /// Tells whether a side runs from the higher end to the lower.
    pub(crate) fn is_reversed(&self, side: FaceSide) -> bool {
        self.corners[side.face() as usize][side.side()] != side.ends()[0]
    }

    /// Tells whether faces agree along every edge of two, and none is there twice.
    pub(crate) fn agree(&self) -> bool {
        self.iter().all(|sides| match sides {
            [_] => true,
            [a, b] => self.is_reversed(*a) != self.is_reversed(*b) && a.opposite != b.opposite,
            // Sides are in the order of their opposite corners.
            _ => sides.windows(2).all(|pair| pair[0].opposite != pair[1].opposite),
        })
    }
}

impl FaceSide {
    /// The face.
    pub(crate) fn face(self) -> u32 {
        self.number / 4
    }

    /// Number of the side, 0 to 2: the one from that corner to the next.
    pub(crate) fn side(self) -> usize {
        (self.number % 4) as usize
    }

    /// Positions of the ends, the lower first.
    pub(crate) fn ends(self) -> [u32; 2] {
        [(self.ends >> 32) as u32, self.ends as u32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::{cube, sheet};

    #[test]
    fn faces_of_sound_meshes_agree_and_turned_or_doubled_ones_do_not() {
        let sound = cube(0.4);
        assert!(Edges::new(&sound).agree());
        assert!(Edges::new(&sound).iter().all(|sides| sides.len() == 2));
        assert_eq!(Edges::new(&sheet(1.0)).iter().filter(|sides| sides.len() == 1).count(), 4);
        for face in [0, 7] {
            let mut turned = sound.clone();
            turned.triangles[face].swap(0, 2);
            assert!(!Edges::new(&turned).agree());
            let mut doubled = sound.clone();
            doubled.triangles.push(sound.triangles[face]);
            assert!(!Edges::new(&doubled).agree());
            doubled.triangles[sound.triangles.len()].swap(0, 1);
            assert!(!Edges::new(&doubled).agree());
        }
    }
}
