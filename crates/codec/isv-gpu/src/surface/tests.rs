//! Surfaces from the GPU against those of `isv-surface`.

use super::*;
use crate::GpuChoice;
use crate::tests::{captured_mesh, gpu_alone, gpu_for_tests, grid, noise};
use isv_ingest::{MeshIngest, SignMode, decide_sign, ingest_mesh};
use isv_surface::extract_surface;
use isv_testkit::{Need, ball, skip, volume_of};
use isv_volume::{BlockCoord, SparseVolume, TriangleMesh};

/// Extractors with and without normals.
struct Extractors {
    store: VolumeStore,
    with_normals: GpuSurfaceExtractor,
    plain: GpuSurfaceExtractor,
}

impl Extractors {
    fn new(gpu: &Gpu) -> Self {
        let store = VolumeStore::new(gpu).unwrap();
        let extractor = |normals| GpuSurfaceExtractor::new(&store, SurfaceOptions { normals }).unwrap();
        Self { with_normals: extractor(true), plain: extractor(false), store }
    }

    /// Compares the meshes of a volume with those from the CPU; returns one.
    fn check(&mut self, volume: &SparseVolume) -> GpuMesh {
        let uploaded = GpuVolume::upload(&self.store, volume).unwrap();
        let expected = extract_surface(volume, &SurfaceOptions { normals: true });
        let mesh = self.with_normals.extract(&uploaded).unwrap();
        let voxel_m = volume.grid().voxel_size.metres();
        let counts = (expected.vertices.len(), expected.triangles.len());
        assert_eq!((mesh.vertex_count(), mesh.triangle_count()), counts);
        let found = mesh.download().unwrap();
        assert!(found.triangles == expected.triangles, "triangles");
        assert!(found.normals.len() == expected.normals.len(), "a normal for each vertex");
        for (vertex, (found, expected)) in found.vertices.iter().zip(&expected.vertices).enumerate() {
            for axis in 0..3 {
                let allowed_m = 1e-6 * voxel_m + expected[axis].abs() / f64::from(1 << 22);
                let off_m = (found[axis] - expected[axis]).abs();
                assert!(off_m <= allowed_m, "vertex {vertex}: {found} m, not {expected} m");
            }
        }
        for (vertex, (found, expected)) in found.normals.iter().zip(&expected.normals).enumerate() {
            assert!((found - expected).length() <= 1e-4, "normal {vertex}: {found}, not {expected}");
        }
        let plain = self.plain.extract(&uploaded).unwrap().download().unwrap();
        assert!(plain == TriangleMesh { normals: Vec::new(), ..found }, "without normals");
        mesh
    }
}

/// A volume without each `every`-th block.
fn with_holes(volume: &SparseVolume, every: usize) -> SparseVolume {
    volume.select(|block| block % every != 3)
}

#[test]
fn noise_is_meshed_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut extractors = Extractors::new(&gpu);
    // Masks, holes, and four segments of the pool; one extractor for all sizes.
    for (volume, parts) in [
        (with_holes(&noise(300, 1), 11), 2),
        (with_holes(&noise(3000, 2), 17), 10),
        (noise(1, 3), 1),
        (noise(64, 4), 1),
    ] {
        let mesh = extractors.check(&volume);
        let split = mesh.positions_m.shares().count();
        println!("{} blocks, {} vertices in {split} parts", volume.block_count(), mesh.vertex_count());
        assert!(mesh.vertex_count() > 0 && split >= parts);
    }
}

/// Codes -1, 0 and 1: many edges with a gradient of zero, and vertices in the middle of all.
#[test]
fn the_lowest_codes_are_meshed_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let volume = noise(60, 5);
    let samples = volume.samples().map(|code| code.rem_euclid(3) - 1).collect();
    let (coords, masks) = (volume.coords().to_vec(), volume.unobserved_masks().clone());
    Extractors::new(&gpu).check(&SparseVolume::from_parts(grid(), coords, samples, masks));
}

#[test]
fn smooth_shapes_are_meshed_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut extractors = Extractors::new(&gpu);
    let torus = |[x, y, z]: [f64; 3]| (x.hypot(y) - 40.3).hypot(z) - 14.9;
    let sphere = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt() - 30.7;
    let seen = |_| false;
    for (volume, hole) in [
        (volume_of(grid(), 8, torus, seen), false),
        (volume_of(grid(), 5, sphere, seen), false),
        (ball(grid(), 1.0), true),
    ] {
        let mesh = extractors.check(&volume);
        assert!(mesh.triangle_count() > 1000);
        // Of a closed surface, three edges to two triangles: V - E + F is 2 for the sphere, 0 for the torus.
        let euler = mesh.vertex_count() as i64 - mesh.triangle_count() as i64 / 2;
        assert!(hole || [0, 2].contains(&euler), "{euler}");
    }
}

/// Far from the origin, and at the ends of what coordinates can be.
#[test]
fn far_blocks_are_meshed_as_on_the_cpu() {
    let Some(gpu) = gpu_for_tests() else { return };
    let volume = noise(27, 6);
    let far = |block: BlockCoord| block.offset([-1_000_000, 900_000, 1_000_000]);
    let mut coords: Vec<_> = volume.coords().iter().copied().map(far).collect();
    coords.sort_unstable_by_key(|coord| coord.morton());
    let samples = (0..volume.block_count()).flat_map(|block| volume.block(block).to_vec()).collect();
    let volume = SparseVolume::from_parts(grid(), coords, samples, [].into());
    assert!(Extractors::new(&gpu).check(&volume).vertex_count() > 1000);
}

#[test]
fn volumes_without_a_surface_have_none() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut extractors = Extractors::new(&gpu);
    let one_sign = volume_of(grid(), 3, |_| 3.0, |_| false);
    let nothing_seen = volume_of(grid(), 2, |[x, ..]| x, |_| true);
    for volume in [noise(0, 1), one_sign, noise(200, 1), nothing_seen, noise(0, 1)] {
        let mesh = extractors.check(&volume);
        assert_eq!(mesh.triangle_count() == 0, volume.block_count() != 200);
    }
}

#[test]
fn a_lost_device_is_an_error() {
    let Some(gpu) = gpu_alone() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    let volume = GpuVolume::upload(&store, &noise(50, 1)).unwrap();
    let mut extractor = GpuSurfaceExtractor::new(&store, SurfaceOptions::default()).unwrap();
    let mesh = extractor.extract(&volume).unwrap();
    gpu.lose();
    assert!(matches!(extractor.extract(&volume), Err(GpuError::Lost(_))));
    assert!(matches!(mesh.download(), Err(GpuError::Lost(_))));
}

#[test]
fn captures_are_meshed_as_on_the_cpu() {
    let choice = GpuChoice { software: true, ..GpuChoice::default() };
    let gpu = match Gpu::open(&choice) {
        Ok(gpu) => gpu,
        Err(error) => return skip(Need::Gpu, error),
    };
    let mut extractors = Extractors::new(&gpu);
    for name in ["dancer", "flag", "xbot"] {
        let Some(mesh) = captured_mesh(name) else { return };
        let settings = MeshIngest::new(grid());
        let volume = ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Paper).0).unwrap();
        let mesh = extractors.check(&volume);
        println!("{name}: {} blocks, {} triangles", volume.block_count(), mesh.triangle_count());
        assert!(mesh.triangle_count() > 1000);
    }
}
