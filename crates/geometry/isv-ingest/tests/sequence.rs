//! What a sequence takes over from frame to frame is what a frame by itself would have.

mod support;

use glam::DVec3;
use isv_ingest::{MeshIngest, MeshIngester, Reach, SignDecision, SignMode, decide_sign, ingest_mesh};
use isv_testkit::{open_box, sheet, sphere};
use isv_volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};

const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

/// Codes by which samples of unobserved voxels may differ, which go by the winding number itself.
const UNSEEN_CODES: u16 = 8;

fn settings(voxel_m: f64, reach: Reach) -> MeshIngest {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    MeshIngest { reach, ..MeshIngest::new(grid) }
}

/// Several meshes in one.
fn together(parts: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for part in parts {
        let first = all.vertices.len() as u32;
        all.vertices.extend_from_slice(&part.vertices);
        all.triangles.extend(part.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
    }
    all
}

fn moved(mut mesh: TriangleMesh, way: DVec3) -> TriangleMesh {
    mesh.vertices.iter_mut().for_each(|vertex| *vertex += way);
    mesh
}

/// Checks that all observed voxels of a volume are as expected.
fn assert_alike(name: &str, volume: &SparseVolume, expected: &SparseVolume) {
    assert!(volume.coords() == expected.coords(), "{name}: other blocks");
    for block in 0..expected.block_count() {
        let [mask, truth] = [volume, expected].map(|volume| volume.unobserved(block));
        assert_eq!(
            mask,
            truth,
            "{name}: block {block} of {}, {:?}",
            expected.block_count(),
            expected.coords()[block]
        );
    }
    for block in 0..expected.block_count() {
        let mask = expected.unobserved(block);
        let pairs = volume.block(block).iter().zip(expected.block(block));
        for (voxel, (sample, expected)) in pairs.enumerate() {
            let unseen = mask.is_some_and(|mask| mask.contains(voxel));
            let most = if unseen { UNSEEN_CODES } else { 0 };
            assert!(sample.abs_diff(*expected) <= most, "{name}: block {block}, voxel {voxel}");
        }
    }
}

/// Ingests a sequence, checks each volume against that of the mesh alone, and returns the share of blocks that each took over.
fn check(name: &str, settings: MeshIngest, sign: SignDecision, meshes: &[TriangleMesh]) -> Vec<f64> {
    let mut ingester = MeshIngester::new(settings);
    let mut share = |mesh: &TriangleMesh| {
        let volume = ingester.ingest(mesh, sign).unwrap();
        assert_alike(name, &volume, &ingest_mesh(mesh, &settings, sign).unwrap());
        ingester.kept_blocks() as f64 / volume.block_count() as f64
    };
    meshes.iter().map(&mut share).collect()
}

/// A still box that is open at the top, and a ball that passes beside it, and through its opening.
fn ball_and_box() -> Vec<TriangleMesh> {
    let places = [[1.2, 0.0], [1.0, 0.0], [0.0, 0.55], [0.0, 0.35], [-1.2, 0.0], [-1.2, 0.0]];
    let scene = |(frame, [x, z]): (usize, [f64; 2])| {
        // More or fewer faces, so that the numbers of the box's change.
        let ball = sphere(0.1, 20 + frame as u32 % 2);
        together(&[moved(ball, DVec3::new(x, 0.0, z)), open_box(0.3)])
    };
    places.into_iter().enumerate().map(scene).collect()
}

#[test]
fn a_still_part_with_a_hole_is_taken_over() {
    for reach in [Reach::Band, Reach::Surface] {
        let shares = check("ball and box", settings(0.005, reach), CLOSED, &ball_and_box());
        println!("{reach:?}: {shares:?}");
        assert_eq!(shares[0], 0.0);
        assert!(shares[1] > 0.5, "{shares:?}");
        assert!(shares[2] < shares[1], "what is around the hole is not as it was: {shares:?}");
        assert!(shares[5] > 0.5 && shares[5] < 1.0, "the ball has other faces: {shares:?}");
    }
    let shells = check("shells", settings(0.005, Reach::Surface), SignDecision::Offset, &ball_and_box());
    assert!(shells[1..].iter().all(|share| *share > 0.4), "{shells:?}");
}

/// A ball passes beside a still sheet, and over it.
#[test]
fn a_still_sheet_is_taken_over() {
    let places = [[1.2, 0.3], [1.0, 0.3], [0.0, 0.55], [0.0, 0.12], [-1.2, 0.3], [-1.2, 0.3]];
    let scene = |[x, z]: [f64; 2]| {
        together(&[moved(sphere(0.1, 20), DVec3::new(x, 0.1, z)), moved(sheet(0.4), DVec3::splat(0.011))])
    };
    let meshes: Vec<_> = places.into_iter().map(scene).collect();
    for reach in [Reach::Band, Reach::Surface] {
        let sheets = check("ball and sheet", settings(0.005, reach), SignDecision::Sheet, &meshes);
        println!("{reach:?}: {sheets:?}");
        assert!(sheets[1] > 0.5 && sheets[2] > 0.5 && sheets[5] == 1.0, "{sheets:?}");
        assert!(sheets[3] > 0.1 && sheets[3] < sheets[1], "the ball is near the sheet: {sheets:?}");
    }
}

#[test]
fn a_still_part_changes_sides_when_something_moves_over_it() {
    let still = sphere(0.1, 20);
    let far = DVec3::new(4.0, 0.0, 0.0);
    let meshes = [far, DVec3::ZERO, DVec3::ZERO, 0.5 * far].map(|place| {
        let hull = moved(sphere(1.5, 40), place);
        together(&[hull, still.clone()])
    });
    for reach in [Reach::Band, Reach::Surface] {
        let shares = check("inside a hull", settings(0.02, reach), CLOSED, &meshes);
        assert_eq!(shares[1], 0.0, "nothing is as it was");
        assert_eq!(shares[2], 1.0, "all is");
    }
}

#[test]
fn another_sign_starts_afresh_and_so_does_an_error() {
    let settings = settings(0.02, Reach::Surface);
    let mesh = sphere(0.3, 30);
    let mut ingester = MeshIngester::new(settings);
    let mut kept = |mesh: &TriangleMesh, sign| {
        let volume = ingester.ingest(mesh, sign).ok()?;
        assert_alike("a sphere", &volume, &ingest_mesh(mesh, &settings, sign).unwrap());
        Some(ingester.kept_blocks())
    };
    assert_eq!(kept(&mesh, CLOSED), Some(0));
    assert!(kept(&mesh, CLOSED) > Some(0));
    assert_eq!(kept(&mesh, SignDecision::Offset), Some(0));
    assert!(kept(&mesh, SignDecision::Offset) > Some(0));
    assert_eq!(kept(&TriangleMesh::default(), SignDecision::Offset), None);
    assert_eq!(kept(&mesh, SignDecision::Offset), Some(0));
}

#[test]
fn any_number_of_threads_takes_over_the_same() {
    let volumes = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut ingester = MeshIngester::new(settings(0.02, Reach::Surface));
        let mut ingest =
            |mesh: &TriangleMesh| (ingester.ingest(mesh, CLOSED).unwrap(), ingester.kept_blocks());
        pool.install(|| ball_and_box().iter().map(&mut ingest).collect::<Vec<_>>())
    };
    let expected = volumes(1);
    assert!([2, 5].into_iter().all(|threads| volumes(threads) == expected));
}

/// A building through which five people walk, and a dancer of whom nothing stands still.
#[test]
fn captures_take_over_what_stands_still() {
    // Of sheets less is taken over: whatever hangs together with a hole of a closed part near somebody is made anew.
    for (name, voxel_m, frames, mode, least) in [
        ("monastery", 0.04, 20, SignMode::Paper, 0.9),
        ("monastery", 0.02, 3, SignMode::Paper, 0.95),
        ("monastery", 0.04, 3, SignMode::Auto, 0.25),
        ("dancer", 0.01, 2, SignMode::Auto, 0.0),
    ] {
        let meshes: Option<Vec<_>> = (0..frames).map(|frame| support::load(name, frame)).collect();
        let Some(meshes) = meshes else { return };
        let sign = decide_sign(&meshes[0], mode).0;
        let shares = check(name, settings(voxel_m, Reach::Surface), sign, &meshes);
        println!("{name} at {voxel_m} m: {shares:?}");
        assert!(shares[1..].iter().all(|share| *share >= least), "{name}: {shares:?}");
    }
}

/// Ingests the same building as a closed surface. It then has a hole in every part, and its winding number is
/// far from whole in most places.
#[test]
fn a_capture_with_thousands_of_holes_is_as_it_was() {
    let meshes: Option<Vec<_>> =
        [0, 1, 1].into_iter().map(|frame| support::load("monastery", frame)).collect();
    let Some(meshes) = meshes else { return };
    let shares = check("monastery, closed", settings(0.08, Reach::Surface), CLOSED, &meshes);
    println!("{shares:?}");
    assert_eq!(shares[2], 1.0);
}
