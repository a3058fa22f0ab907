//! Volumes from the GPU against those of `isv-ingest`.

use super::*;
use crate::tests::{captured_mesh, gpu_alone, gpu_for_tests, gpu_with_segments, grid};
use isv_ingest::{Reach, SignMode, decide_sign, ingest_mesh};
use isv_testkit::{sheet, sphere};
use isv_volume::{BlockIndex, CODES_PER_VOXEL, Grid, VoxelSize};

const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

fn settings(voxel_m: f64, reach: Reach) -> MeshIngest {
    let grid = Grid { voxel_size: VoxelSize::from_metres(voxel_m).unwrap(), ..grid() };
    MeshIngest { reach, ..MeshIngest::new(grid) }
}

/// How two volumes of a mesh differ.
#[derive(Debug, Default)]
struct Difference {
    voxels: usize,
    /// By more than a code or two where both are observed and distances exact.
    off: usize,
    /// On the other side of the surface, farther from it than rounding explains.
    other_side: usize,
    /// Observed in one alone, where distances are exact.
    masked: usize,
    /// Blocks of one alone.
    blocks: usize,
}

fn compare(found: &SparseVolume, expected: &SparseVolume, exact_voxels: f64) -> Difference {
    let index = BlockIndex::new(found.coords());
    let mut difference = Difference::default();
    let exact = (exact_voxels * f64::from(CODES_PER_VOXEL)) as i32 - 2;
    for (number, coord) in expected.coords().iter().enumerate() {
        let Some(other) = index.get(*coord) else {
            difference.blocks += 1;
            continue;
        };
        let is_masked = |volume: &SparseVolume, block: usize, voxel: usize| {
            volume.unobserved(block).is_some_and(|mask| mask.contains(voxel))
        };
        let samples = found.block(other as usize).iter().zip(expected.block(number));
        for (voxel, (a, b)) in samples.enumerate() {
            let (a, b) = (i32::from(*a), i32::from(*b));
            let masked = [is_masked(found, other as usize, voxel), is_masked(expected, number, voxel)];
            difference.voxels += 1;
            difference.masked += usize::from(b.abs() <= exact && masked[0] != masked[1]);
            if masked != [false; 2] {
                continue;
            }
            difference.off += usize::from(b.abs() <= exact && (a - b).abs() > 2);
            difference.other_side += usize::from((a < 0) != (b < 0) && a.abs().max(b.abs()) > 2);
        }
    }
    let missing = expected.block_count() - difference.blocks;
    difference.blocks += found.block_count() - missing;
    difference
}

/// Meshes on CPU and GPU; returns what the GPU makes.
fn check(
    ingester: &mut GpuMeshIngester,
    mesh: &TriangleMesh,
    sign: SignDecision,
    name: &str,
) -> SparseVolume {
    let settings = *ingester.settings();
    let expected = ingest_mesh(mesh, &settings, sign).unwrap();
    let found = ingester.ingest(mesh, sign).unwrap();
    let exact = match settings.reach {
        Reach::Band => f64::from(settings.grid.truncation.voxels()),
        Reach::Surface => 1.75,
    };
    let difference = compare(&found, &expected, exact);
    println!("{name}: {} blocks, {difference:?}", found.block_count());
    // The lattice moves vertices by less than a hundred-thousandth of a voxel, which tips what is on an edge.
    let few = difference.voxels / 20_000;
    assert!(difference.off <= few, "{name}: {difference:?}");
    assert!(difference.other_side <= few, "{name}: {difference:?}");
    assert!(difference.masked <= difference.voxels / 500, "{name}: {difference:?}");
    assert!(difference.blocks <= found.block_count() / 100, "{name}: {difference:?}");
    found
}

#[test]
fn closed_open_and_holed_meshes_become_the_volumes_of_the_cpu() {
    let Some(gpu) = gpu_for_tests() else {
        return;
    };
    let store = VolumeStore::new(&gpu).unwrap();
    let ball = sphere(0.11, 40);
    let mut coarse = sphere(0.31, 4);
    for vertex in &mut coarse.vertices {
        *vertex = (vertex.x - 7.003, vertex.y + 0.017, vertex.z + 31.0).into();
    }
    let mut holed = ball.clone();
    holed.triangles.retain(|triangle| triangle.iter().any(|v| ball.vertices[*v as usize].z < 0.085));
    for reach in [Reach::Surface, Reach::Band] {
        let mut ingester = GpuMeshIngester::new(&store, settings(0.01, reach)).unwrap();
        let inside = check(&mut ingester, &ball, CLOSED, "ball");
        assert!(
            inside.samples().filter(|sample| *sample < 0).count() > 4000
                && inside.unobserved_masks().is_empty()
        );
        check(&mut ingester, &coarse, CLOSED, "coarse ball");
        check(&mut ingester, &sheet(0.3), SignDecision::Offset, "sheet");
        let open = check(&mut ingester, &holed, CLOSED, "holed ball");
        assert!(!open.unobserved_masks().is_empty());
        // It stays there, or comes back.
        for mesh in [&ball, &holed] {
            let volume = ingester.ingest_to_gpu(mesh, CLOSED).unwrap();
            assert!(volume.download().unwrap() == ingester.ingest(mesh, CLOSED).unwrap());
        }
    }
}

/// Large enough to need more than one table, and buffers so small that lists are made in parts.
#[test]
fn what_does_not_fit_a_buffer_is_split() {
    let Some(small) = gpu_with_segments(1 << 20) else { return };
    let Some(large) = gpu_with_segments(1 << 27) else { return };
    let mesh = sphere(0.3, 120);
    let volumes = [small, large].map(|gpu| {
        let store = VolumeStore::new(&gpu).unwrap();
        let mut ingester = GpuMeshIngester::new(&store, settings(0.01, Reach::Band)).unwrap();
        ingester.entries = 64;
        let volume = ingester.ingest(&mesh, CLOSED).unwrap();
        assert!(ingester.entries > 64);
        volume
    });
    assert!(volumes[0] == volumes[1]);
}

#[test]
fn what_cannot_be_done_is_said() {
    let Some(gpu) = gpu_alone() else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    let mesh = sphere(0.3, 20);
    let few = MeshIngest { max_blocks: 100, ..settings(0.01, Reach::Surface) };
    let error = GpuMeshIngester::new(&store, few).unwrap().ingest(&mesh, CLOSED).unwrap_err();
    assert_eq!(error, GpuIngestError::Ingest(ingest_mesh(&mesh, &few, CLOSED).unwrap_err()));
    // A wrong unit, and a hole as well: what the CPU says of it, before anything is made of so many triangles.
    let mut huge = sphere(6.0, 20);
    huge.triangles.truncate(700);
    for reach in [Reach::Surface, Reach::Band] {
        let settings = MeshIngest { max_blocks: 10_000, ..settings(0.005, reach) };
        let error = GpuMeshIngester::new(&store, settings).unwrap().ingest(&huge, CLOSED).unwrap_err();
        assert_eq!(error, GpuIngestError::Ingest(ingest_mesh(&huge, &settings, CLOSED).unwrap_err()));
    }
    let mut ingester = GpuMeshIngester::new(&store, settings(0.01, Reach::Surface)).unwrap();
    let error = ingester.ingest(&TriangleMesh::default(), CLOSED).unwrap_err();
    assert!(matches!(error, GpuIngestError::Ingest(IngestError::Mesh(_))), "{error}");
    gpu.lose();
    let error = ingester.ingest(&mesh, CLOSED).unwrap_err();
    assert!(matches!(error, GpuIngestError::Gpu(GpuError::Lost(_))), "{error}");
}

/// A captured person, closed but for seams and with open soles.
#[test]
fn captures_become_the_volumes_of_the_cpu() {
    let Some(gpu) = gpu_with_segments(1 << 27) else { return };
    let store = VolumeStore::new(&gpu).unwrap();
    for take in ["dancer", "thomas"] {
        let Some(mesh) = captured_mesh(take) else { continue };
        let (sign, _) = decide_sign(&mesh, SignMode::Paper);
        for reach in [Reach::Surface, Reach::Band] {
            let mut ingester = GpuMeshIngester::new(&store, settings(0.01, reach)).unwrap();
            check(&mut ingester, &mesh, sign, take);
        }
    }
}
