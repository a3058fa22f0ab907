//! The passes over blocks against the definition: every voxel and every cell looked at by itself, in order.

use crate::cases::{CASES, edge_start};
use crate::{SurfaceOptions, extract_surface};
use glam::DVec3;
use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv_io::{Unit, read_mesh};
use isv_testkit::capture;
use isv_volume::{
    BlockEdge, BlockIndex, Grid, SparseVolume, TriangleMesh, Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use proptest::prelude::*;
use std::collections::HashMap;

/// A volume as a field of voxels, counted from the origin.
struct Field<'a> {
    volume: &'a SparseVolume,
    index: BlockIndex,
}

type Voxel = [i32; 3];

fn step(mut voxel: Voxel, axis: usize, by: i32) -> Voxel {
    voxel[axis] += by;
    voxel
}

impl<'a> Field<'a> {
    fn new(volume: &'a SparseVolume) -> Self {
        Self { volume, index: volume.index() }
    }

    /// The code of a voxel, if it is there and was observed.
    fn code(&self, voxel: Voxel) -> Option<i16> {
        let edge = self.volume.grid().edge;
        let n = edge.voxels() as i32;
        let block = self.index.get(voxel.map(|c| c.div_euclid(n)).into())? as usize;
        let [x, y, z] = voxel.map(|c| c.rem_euclid(n) as usize);
        let i = edge.voxel_index(x, y, z);
        let hidden = self.volume.unobserved(block).is_some_and(|mask| mask.contains(i));
        (!hidden).then(|| self.volume.block(block)[i])
    }

    /// The signs of the corners of a cell that was observed.
    fn pattern(&self, lowest: Voxel) -> Option<usize> {
        (0..8).try_fold(0, |pattern, corner| {
            let at = [0, 1, 2].map(|axis| lowest[axis] + (corner >> axis & 1));
            Some(pattern | usize::from(self.code(at)? < 0) << corner)
        })
    }

    /// Whether there is a vertex between a voxel and the next one along an axis.
    fn has_vertex(&self, voxel: Voxel, axis: usize) -> bool {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let around = [(0, 0), (-1, 0), (0, -1), (-1, -1)];
        let mut cells = around.map(|(du, dv)| step(step(voxel, u, du), v, dv)).into_iter();
        cells.any(|cell| self.pattern(cell).is_some())
            && (self.code(voxel) < Some(0)) != (self.code(step(voxel, axis, 1)) < Some(0))
    }

    fn gradient(&self, voxel: Voxel) -> DVec3 {
        let code = |voxel| self.code(voxel).map(f64::from);
        DVec3::from_array([0, 1, 2].map(|axis| {
            match (code(step(voxel, axis, -1)), code(voxel), code(step(voxel, axis, 1))) {
                (Some(before), _, Some(after)) => (after - before) / 2.0,
                (Some(before), Some(here), None) => here - before,
                (None, Some(here), Some(after)) => after - here,
                _ => 0.0,
            }
        }))
    }

    /// Position and normal of a vertex.
    fn vertex(&self, voxel: Voxel, axis: usize) -> (DVec3, DVec3) {
        let next = step(voxel, axis, 1);
        let [a, b] =
            [voxel, next].map(|v| self.code(v).unwrap()).map(|c| if c == 0 { 1.0 } else { f64::from(c) });
        let fraction = a / (a - b);
        let (grid, n) = (self.volume.grid(), self.volume.grid().edge.voxels() as i32);
        let origin_m = grid.voxel_centre_m(voxel.map(|c| c.div_euclid(n)).into(), [0; 3]);
        let mut voxels = DVec3::from_array(voxel.map(|c| f64::from(c.rem_euclid(n))));
        voxels[axis] += fraction;
        let gradient = self.gradient(voxel).lerp(self.gradient(next), fraction);
        let along_edge = DVec3::AXES[axis] * if a < 0.0 { 1.0 } else { -1.0 };
        (origin_m + voxels * grid.voxel_size.metres(), gradient.normalize_or(along_edge))
    }

    /// All voxels, in order.
    fn voxels(&self) -> impl Iterator<Item = Voxel> {
        let n = self.volume.grid().edge.voxels() as i32;
        let in_block = move |i: i32| [i % n, i / n % n, i / (n * n)];
        self.volume.coords().iter().flat_map(move |coord| {
            let lowest = coord.to_array().map(|c| c * n);
            (0..n * n * n).map(in_block).map(move |v| [0, 1, 2].map(|axis| lowest[axis] + v[axis]))
        })
    }

    fn surface(&self) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        let mut numbers = HashMap::new();
        for voxel in self.voxels() {
            for axis in (0..3).filter(|axis| self.has_vertex(voxel, *axis)) {
                numbers.insert((voxel, axis), mesh.vertices.len() as u32);
                let (position_m, normal) = self.vertex(voxel, axis);
                mesh.vertices.push(position_m);
                mesh.normals.push(normal);
            }
        }
        for voxel in self.voxels() {
            let Some(pattern) = self.pattern(voxel) else { continue };
            for triangle in CASES[pattern].triangles() {
                mesh.triangles.push(triangle.map(|edge| {
                    let (axis, start) = edge_start(usize::from(edge));
                    numbers[&([0, 1, 2].map(|i| voxel[i] + start[i] as i32), axis)]
                }));
            }
        }
        mesh
    }
}

fn bits(vectors: &[DVec3]) -> Vec<[u64; 3]> {
    vectors.iter().map(|v| v.to_array().map(f64::to_bits)).collect()
}

/// Compares the mesh with the definition, bit for bit; returns it.
fn check(volume: &SparseVolume) -> TriangleMesh {
    let expected = Field::new(volume).surface();
    let mesh = extract_surface(volume, &SurfaceOptions { normals: true });
    assert!(bits(&mesh.vertices) == bits(&expected.vertices), "positions");
    assert!(bits(&mesh.normals) == bits(&expected.normals), "normals");
    assert!(mesh.triangles == expected.triangles, "triangles");
    let plain = extract_surface(volume, &SurfaceOptions { normals: false });
    assert!(plain == TriangleMesh { normals: Vec::new(), ..mesh.clone() }, "without normals");
    mesh
}

fn grid(edge: BlockEdge, metres: f64) -> Grid {
    let truncation = Truncation::DEFAULT;
    Grid { voxel_size: VoxelSize::from_metres(metres).unwrap(), edge, truncation }
}

const EDGES: [BlockEdge; 3] = [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Noise in 3x3x3 blocks about the origin, of which some are missing, all of one sign or not observed in places.
    #[test]
    fn noise_is_meshed_as_defined(
        edge in prop::sample::select(&EDGES[..]),
        seed: u64,
        inside_percent in 1u64..99,
        hidden_per_mille in prop::sample::select(&[0u64, 1, 30, 300][..]),
    ) {
        let mut state = seed;
        let mut random = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state >> 33
        };
        let mut builder = VolumeBuilder::new(grid(edge, 0.007));
        for place in 0..27 {
            let kind = random() % 8;
            let mut mask = VoxelMask::empty(edge);
            let codes = (0..edge.block_voxels()).map(|voxel| {
                if random() % 1000 < hidden_per_mille {
                    mask.insert(voxel);
                }
                let inside = if kind < 3 { kind == 2 } else { random() % 100 < inside_percent };
                let distance = (random() % 40) as i16;
                if inside { -distance } else { distance }
            });
            let codes: Vec<_> = codes.collect();
            if kind > 0 {
                builder.push([place % 3 - 1, place / 3 % 3 - 1, place / 9 - 1].into(), codes, Some(mask));
            }
        }
        check(&builder.finish());
    }
}

/// A frame of a capture, if there is one.
fn load(name: &str) -> Option<TriangleMesh> {
    let path = capture(&format!("{name}/frame_0000.ply"))?;
    Some(read_mesh(&path, Unit::Metre).unwrap())
}

#[test]
fn captures_are_meshed_as_defined() {
    for (name, metres) in [("dancer", 0.025), ("flag", 0.05), ("xbot", 0.05)] {
        let Some(mesh) = load(name) else { return };
        for edge in EDGES {
            let settings = MeshIngest::new(grid(edge, metres));
            let volume = ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Paper).0).unwrap();
            let surface = check(&volume);
            println!("{name}, {edge:?}: {} blocks, {} faces", volume.block_count(), surface.triangles.len());
            assert!(surface.triangles.len() > 1000);
        }
    }
}
