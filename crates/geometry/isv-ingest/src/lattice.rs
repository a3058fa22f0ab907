//! A mesh as whole numbers, in parts no longer than a block: what is sampled elsewhere than here.

use crate::tiles::VoxelMesh;
use glam::{DVec3, IVec3};
use isv_volume::BlockCoord;

/// Longest edge of a part along each axis, in voxels.
pub const LONGEST_EDGE: u32 = 8;

/// Base-2 logarithms of the steps in a voxel: at least, so that nothing of a thousandth of a voxel is lost, and at most.
const FRACTION_BITS: std::ops::RangeInclusive<u32> = 10..=16;

/// Bits of a coordinate in steps, without its sign.
const COORDINATE_BITS: u32 = 30;

/// Parts that the triangles of a mesh may be split into, beside one for each.
const MOST_PARTS: usize = 1 << 22;

/// Triangles with corners on a lattice, none longer than [`LONGEST_EDGE`] voxels along an axis.
///
/// Long edges are halved, again and again, whatever triangle they belong to: two triangles that share an edge share its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeMesh {
    /// The block whose lowest corner is where the lattice begins. Nothing that close to the mesh as in `blocks` lies below it.
    pub origin: BlockCoord,
    /// Blocks along x, y and z from there on that anything within the truncation and two voxels of the mesh lies in.
    pub blocks: [u32; 3],
    /// Base-2 logarithm of the steps in a voxel, 10 to 16.
    pub fraction_bits: u32,
    /// Positions in steps.
    pub vertices: Vec<[i32; 3]>,
    /// The faces of the mesh, then the triangles that close it, then the rims of its wide holes, whose last two corners are the same.
    pub triangles: Vec<[u32; 3]>,
    /// How many triangles are faces.
    pub faces: usize,
    /// How many close the mesh.
    pub closing: usize,
}

impl LatticeMesh {
    /// How many triangles are rims of wide holes.
    #[must_use]
    pub fn rims(&self) -> usize {
        self.triangles.len() - self.faces - self.closing
    }

    /// A mesh with the triangles that close it and the rims of its wide holes. `None` if it is so large that
    /// the lattice would be too coarse, or has too many long triangles. `margin`: how far around it anything
    /// matters, in voxels.
    pub(crate) fn new(
        mesh: &VoxelMesh,
        closing: &[[u32; 3]],
        rims: &[[DVec3; 2]],
        margin: f64,
    ) -> Option<Self> {
        // Vertices that no triangle has may be anywhere.
        let corners = mesh.triangles.iter().flatten().map(|vertex| mesh.vertices[*vertex as usize]);
        let bounds = corners.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], corner| {
            [lo.min(corner), hi.max(corner)]
        });
        let [first, last] = [bounds[0] - margin, bounds[1] + margin].map(|p| (p / 8.0).floor().as_ivec3());
        let blocks = (last - first + 1).max(IVec3::ONE).as_uvec3();
        let size_bits = (8 * blocks.max_element()).next_power_of_two().ilog2();
        let fraction_bits = COORDINATE_BITS.checked_sub(size_bits)?.min(*FRACTION_BITS.end());
        if fraction_bits < *FRACTION_BITS.start() {
            return None;
        }
        let mut splitter = Splitter {
            origin: (8 * first).as_dvec3(),
            steps: f64::from(1u32 << fraction_bits),
            vertices: Vec::with_capacity(mesh.vertices.len()),
            triangles: Vec::with_capacity(mesh.triangles.len() + closing.len() + rims.len()),
            most: mesh.triangles.len() + closing.len() + rims.len() + MOST_PARTS,
        };
        mesh.vertices.iter().for_each(|vertex| {
            splitter.vertex(*vertex);
        });
        splitter.add_all(mesh, &mesh.triangles)?;
        let faces = splitter.triangles.len();
        splitter.add_all(mesh, closing)?;
        let closing = splitter.triangles.len() - faces;
        for rim in rims {
            splitter.split_rim(*rim)?;
        }
        let Splitter { vertices, triangles, .. } = splitter;
        let origin = BlockCoord::from(first.to_array());
        Some(Self { origin, blocks: blocks.to_array(), fraction_bits, vertices, triangles, faces, closing })
    }
}

/// Triangles on their way to the lattice.
struct Splitter {
    /// In voxels.
    origin: DVec3,
    /// In a voxel.
    steps: f64,
    vertices: Vec<[i32; 3]>,
    triangles: Vec<[u32; 3]>,
    most: usize,
}

impl Splitter {
    /// Some triangles of a mesh whose vertices are the first ones; nothing if there are too many parts.
    fn add_all(&mut self, mesh: &VoxelMesh, triangles: &[[u32; 3]]) -> Option<()> {
        for triangle in triangles {
            let corners = triangle.map(|vertex| mesh.vertices[vertex as usize]);
            if (0..3).any(|side| is_long(corners[side], corners[(side + 1) % 3])) {
                self.split(corners)?;
            } else {
                self.triangles.push(*triangle);
            }
        }
        Some(())
    }

    /// Halves the longest of the long edges until there are none. Halves are halves in exact numbers, whichever end is first.
    fn split(&mut self, corners: [DVec3; 3]) -> Option<()> {
        let mut stack = vec![corners];
        while let Some([a, b, c]) = stack.pop() {
            let sides = [[a, b, c], [b, c, a], [c, a, b]];
            let long = sides.into_iter().filter(|[from, to, _]| is_long(*from, *to));
            let longest =
                long.max_by(|[a, b, _], [c, d, _]| a.distance_squared(*b).total_cmp(&c.distance_squared(*d)));
            if let Some([from, to, apex]) = longest {
                let middle = 0.5 * (from + to);
                stack.extend([[from, middle, apex], [middle, to, apex]]);
            } else {
                self.push([a, b, c])?;
            }
        }
        Some(())
    }

    /// Halves a rim as the edge that it is.
    fn split_rim(&mut self, rim: [DVec3; 2]) -> Option<()> {
        let mut stack = vec![rim];
        while let Some([from, to]) = stack.pop() {
            if is_long(from, to) {
                let middle = 0.5 * (from + to);
                stack.extend([[from, middle], [middle, to]]);
            } else {
                self.push([from, to, to])?;
            }
        }
        Some(())
    }

    /// A part with vertices of its own; nothing if there are too many.
    fn push(&mut self, corners: [DVec3; 3]) -> Option<()> {
        let triangle = corners.map(|corner| self.vertex(corner));
        self.triangles.push(triangle);
        (self.triangles.len() <= self.most).then_some(())
    }

    /// A new vertex.
    fn vertex(&mut self, position: DVec3) -> u32 {
        let steps = (position - self.origin) * self.steps;
        self.vertices.push(steps.round().as_ivec3().to_array());
        self.vertices.len() as u32 - 1
    }
}

/// Whether an edge has to be halved.
fn is_long(from: DVec3, to: DVec3) -> bool {
    (to - from).abs().max_element() > f64::from(LONGEST_EDGE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isv_testkit::sphere;
    use std::collections::BTreeMap;

    fn lattice(radius: f64, place: DVec3) -> Option<LatticeMesh> {
        let mesh = sphere(radius, 6);
        let vertices: Vec<DVec3> = mesh.vertices.iter().map(|v| *v + place).collect();
        let rims = [[vertices[9], vertices[10]]];
        let voxel_mesh = VoxelMesh { vertices, triangles: (&mesh.triangles).into() };
        LatticeMesh::new(&voxel_mesh, &mesh.triangles[..4], &rims, 9.5)
    }

    #[test]
    fn parts_are_short_and_fit_together() {
        for (radius, place) in [(3.0, DVec3::ZERO), (90.0, DVec3::new(1e4, -3e4, 7.0))] {
            let mesh = lattice(radius, place).unwrap();
            assert_eq!(mesh.fraction_bits, 16);
            assert!(mesh.closing >= 4 && mesh.rims().is_power_of_two());
            let most = i32::try_from(LONGEST_EDGE << mesh.fraction_bits).unwrap() + 1;
            let mut sides: BTreeMap<[[i32; 3]; 2], i32> = BTreeMap::new();
            for (number, triangle) in mesh.triangles.iter().enumerate() {
                let corners = triangle.map(|vertex| mesh.vertices[vertex as usize]);
                for side in 0..3 {
                    let [from, to] = [corners[side], corners[(side + 1) % 3]];
                    assert!((0..3).all(|axis| (from[axis] - to[axis]).abs() <= most));
                    if number < mesh.faces {
                        *sides.entry([from, to]).or_default() += 1;
                        *sides.entry([to, from]).or_default() -= 1;
                    }
                }
                let size = mesh.blocks.map(|blocks| 8 * blocks as i32);
                let margin = 9 << mesh.fraction_bits;
                assert!(corners.iter().all(|corner| (0..3).all(|axis| {
                    corner[axis] >= margin && corner[axis] <= (size[axis] << mesh.fraction_bits) - margin
                })));
            }
            // As many sides one way as the other: it is as closed as it was.
            assert!(sides.values().all(|count| *count == 0));
        }
    }

    #[test]
    fn positions_are_as_fine_as_they_can_be() {
        assert_eq!(lattice(20_000.0, DVec3::ZERO), None, "four million parts");
        let far = |size: f64| {
            // Two triangles so far apart.
            let corners = [DVec3::ZERO, DVec3::Y, DVec3::Z];
            let vertices = [0.0, size].map(|x| corners.map(|corner| corner + x * DVec3::X)).concat();
            let triangles: Vec<[u32; 3]> = vec![[0, 1, 2], [3, 4, 5]];
            LatticeMesh::new(&VoxelMesh { vertices, triangles: triangles.into() }, &[], &[], 2.0)
        };
        assert_eq!(far(30_000.0).map(|mesh| mesh.fraction_bits), Some(15));
        assert_eq!(far(1_000_000.0).map(|mesh| mesh.fraction_bits), Some(10));
        assert_eq!(far(2_000_000.0), None);
        // What no triangle has does not count.
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::splat(8e6)];
        let triangles: Vec<[u32; 3]> = vec![[0, 1, 2]];
        let mesh = VoxelMesh { vertices, triangles: triangles.into() };
        assert_eq!(LatticeMesh::new(&mesh, &[], &[], 2.0).map(|mesh| mesh.fraction_bits), Some(16));
    }
}
