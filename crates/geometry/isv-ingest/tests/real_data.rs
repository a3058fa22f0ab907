//! Ingest of real captures, against slow exact references. Prints what it measured: run with `--nocapture` to see it.

mod support;

use glam::DVec3;
use isv_ingest::{
    FaceTurner, MeshIngest, Reach, SignDecision, SignMode, decide_sign, ingest_mesh, turn_faces,
};
use isv_spatial::{Bvh, WindingNumber, exact_winding_number};
use isv_volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};
use std::borrow::Cow;
use std::time::Instant;

const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

/// Codes a sample may differ from the exact distance: rounding, and 1/1000 voxel.
const TOLERANCE_CODES: f64 = 0.5 + 0.256;

/// Blocks of a volume that are compared with the references.
const BLOCKS_CHECKED: usize = 60;

/// Voxels of a volume that are compared with all triangles one by one.
const VOXELS_CHECKED: usize = 400;

/// Ingests a frame, checks the automatic decision, and compares a sample of blocks with the references.
fn check_sequence(
    name: &str,
    frame: usize,
    voxel_m: f64,
    edge: BlockEdge,
    expected: SignDecision,
) -> Option<SparseVolume> {
    let mesh = support::load(name, frame)?;
    let settings = MeshIngest::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge,
        truncation: Truncation::DEFAULT,
    });
    let (decision, evidence) = decide_sign(&mesh, SignMode::Paper);
    assert_eq!(decision, expected, "{name}: {evidence:?}");
    let start = Instant::now();
    let volume = ingest_mesh(&mesh, &settings, decision).unwrap();
    println!(
        "{name} {frame} at {voxel_m} m: {decision}, {evidence:?}; {} blocks, {} masks, {:.1} MB, {:.0} ms",
        volume.block_count(),
        volume.unobserved_masks().len(),
        volume.sample_count() as f64 * 2e-6,
        start.elapsed().as_secs_f64() * 1e3,
    );
    check_samples(name, &mesh, &volume, decision);
    check_against_all_triangles(name, &mesh, &volume, decision);
    if edge == BlockEdge::E8 {
        let near = MeshIngest { reach: Reach::Surface, ..settings };
        let start = Instant::now();
        let near = ingest_mesh(&mesh, &near, decision).unwrap();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!("{name}: no farther than the surface, {} blocks, {ms:.0} ms", near.block_count());
        check_near(name, &near, &volume);
    }
    Some(volume)
}

/// Codes up to which samples of a volume that reaches no farther than the surface are exact.
const NEAR_CODES: u16 = 440;

/// Checks a volume that reaches no farther than the surface against one of the whole band. Near the surface
/// it has every voxel, with the same sample but for rounding.
fn check_near(name: &str, near: &SparseVolume, whole: &SparseVolume) {
    let index = near.index();
    let observed = |volume: &SparseVolume, block: usize, voxel: usize| {
        !volume.unobserved(block).is_some_and(|mask| mask.contains(voxel))
    };
    let (mut compared, mut other_side, mut torn) = (0, 0, 0);
    for (block, coord) in whole.coords().iter().enumerate() {
        let samples = whole.block(block).iter().enumerate();
        let close =
            samples.filter(|(voxel, s)| s.unsigned_abs() < NEAR_CODES && observed(whole, block, *voxel));
        for (voxel, expected) in close {
            let found = index.get(*coord).map(|found| found as usize);
            let Some(found) = found.filter(|found| observed(near, *found, voxel)) else {
                torn += 1;
                continue;
            };
            let got = near.block(found)[voxel];
            assert!(
                got.abs().abs_diff(expected.abs()) <= 1,
                "{name}: {got} for {expected} at {coord:?} {voxel}"
            );
            compared += 1;
            other_side += usize::from(got.abs() > 1 && got.signum() != expected.signum());
        }
    }
    println!("{name}: {compared} voxels near the surface, {torn} unobserved, {other_side} on the other side");
    assert_eq!(other_side, 0, "{name}: of {compared}");
    // What is as close to a rim as to a face may be either.
    assert!(torn * 10_000 <= compared, "{name}: {torn} of {compared}");
}

/// Compares every voxel of some blocks with the closest triangle found by the hierarchy. Where the surface is
/// closed, compares the sign of the winding number, too.
fn check_samples(name: &str, mesh: &TriangleMesh, volume: &SparseVolume, sign: SignDecision) {
    let (bvh, winding) = (Bvh::new(mesh), WindingNumber::new(mesh));
    let grid = volume.grid();
    let (n, limit) = (grid.edge.voxels(), f64::from(grid.truncation.codes()));
    let offset = if sign == SignDecision::Offset { 1.5 * 256.0 } else { 0.0 };
    for block in (0..volume.block_count()).step_by(volume.block_count() / BLOCKS_CHECKED + 1) {
        for (voxel, sample) in volume.block(block).iter().enumerate() {
            if volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
                continue;
            }
            let p = grid.voxel_centre_m(volume.coords()[block], [voxel % n, voxel / n % n, voxel / (n * n)]);
            let d = bvh.distance(p) / grid.voxel_size.metres() * 256.0 - offset;
            // Code 0 is outside, so what rounds to it inside is -1.
            let got = match sign {
                SignDecision::Offset => *sample,
                _ if *sample == -1 && d < 0.5 => 0,
                _ => sample.abs(),
            };
            assert!(
                (d.min(limit) - f64::from(got)).abs() < TOLERANCE_CODES,
                "{name} at {p}: {got} against {d}"
            );
            if sign != SignDecision::Offset
                && sample.abs() > 1
                && (winding.at(p).abs() > 0.5) != (*sample < 0)
            {
                // The opening of a seam too narrow to be a hole is the one place without a clear answer.
                let exact = exact_winding_number(mesh, p).abs();
                assert!((exact - 0.5).abs() < 0.1, "{name} at {p}: code {sample}, winding number {exact}");
            }
        }
    }
}

/// Distance from a point to a triangle by nothing but the definition. The closest point is the foot on the
/// plane if its barycentric coordinates are not negative. Else it is the closest point of the three segments.
fn distance_to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let segment = |from: DVec3, to: DVec3| {
        let way = to - from;
        let share = if way == DVec3::ZERO { 0.0 } else { (p - from).dot(way) / way.length_squared() };
        p.distance(from + way * share.clamp(0.0, 1.0))
    };
    let outline = segment(a, b).min(segment(b, c)).min(segment(c, a));
    let normal = (b - a).cross(c - a);
    let parts = [(b, c), (c, a), (a, b)].map(|(from, to)| (from - p).cross(to - p).dot(normal));
    if normal.length_squared() > 0.0 && parts.iter().all(|part| *part >= 0.0) {
        outline.min((p - a).dot(normal).abs() / normal.length())
    } else {
        outline
    }
}

/// Compares some voxels of a volume with sums and minima over all triangles, without any hierarchy: slow, and true.
fn check_against_all_triangles(name: &str, mesh: &TriangleMesh, volume: &SparseVolume, sign: SignDecision) {
    let grid = volume.grid();
    let (n, limit) = (grid.edge.voxels(), f64::from(grid.truncation.codes()));
    let offset = if sign == SignDecision::Offset { 1.5 * 256.0 } else { 0.0 };
    let size = grid.edge.block_voxels();
    let step = volume.sample_count() / VOXELS_CHECKED;
    let (mut worst, mut compared) = (0f64, 0);
    // An odd stride visits every place in a block.
    for at in (0..volume.sample_count()).step_by(step | 1) {
        let (block, voxel) = (at / size, at % size);
        if volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
            continue;
        }
        let sample = volume.block(block)[voxel];
        let p = grid.voxel_centre_m(volume.coords()[block], [voxel % n, voxel / n % n, voxel / (n * n)]);
        let metres = (0..mesh.triangles.len())
            .map(|face| distance_to_triangle(p, mesh.corners(face)))
            .fold(f64::INFINITY, f64::min);
        let expected = (metres / grid.voxel_size.metres() * 256.0 - offset).min(limit);
        let got = f64::from(if sign == SignDecision::Offset { sample } else { sample.abs() });
        worst = worst.max((expected - got).abs());
        compared += 1;
        if sign != SignDecision::Offset && sample.abs() > 1 {
            let exact = exact_winding_number(mesh, p).abs();
            let clear = (exact - 0.5).abs() > 0.1;
            assert!(!clear || (exact > 0.5) == (sample < 0), "{name} at {p}: {sample}, {exact}");
        }
    }
    println!("{name}: {compared} voxels within {worst:.3} codes of the brute force");
    assert!(worst < TOLERANCE_CODES && compared > VOXELS_CHECKED / 2, "{name}: {worst}");
}

/// Neighbours of different sign, both observed, that are too far from the surface to be on different sides of it.
fn unexplained_sign_changes(volume: &SparseVolume) -> usize {
    let (index, edge) = (volume.index(), volume.grid().edge);
    let n = edge.voxels();
    let observed =
        |block: usize, voxel: usize| !volume.unobserved(block).is_some_and(|mask| mask.contains(voxel));
    let mut count = 0;
    for (block, coord) in volume.coords().iter().enumerate() {
        for voxel in 0..edge.block_voxels() {
            for axis in 0..3 {
                let mut at = [voxel % n, voxel / n % n, voxel / (n * n)];
                at[axis] += 1;
                let mut step = [0; 3];
                step[axis] = (at[axis] / n) as i32;
                at[axis] %= n;
                let Some(other) = index.get(coord.offset(step)).map(|i| i as usize) else { continue };
                let neighbour = edge.voxel_index(at[0], at[1], at[2]);
                let (s, t) =
                    (i32::from(volume.block(block)[voxel]), i32::from(volume.block(other)[neighbour]));
                let apart = (s < 0) != (t < 0) && s.abs() + t.abs() > 260;
                count += usize::from(apart && observed(block, voxel) && observed(other, neighbour));
            }
        }
    }
    count
}

#[test]
fn dancer_keeps_open_soles_without_a_cap() {
    for (frame, voxel_m) in [(0, 0.005), (7, 0.005), (3, 0.01)] {
        let Some(volume) = check_sequence("dancer", frame, voxel_m, BlockEdge::E8, CLOSED) else { return };
        let (lowest, highest) =
            volume.coords().iter().fold((i32::MAX, i32::MIN), |(lo, hi), c| (lo.min(c.y), hi.max(c.y)));
        let masked = |index: &u32| volume.coords()[*index as usize].y;
        assert!(volume.unobserved_masks().len() > 20);
        assert!(
            volume.unobserved_masks().keys().all(|index| masked(index) - lowest < (highest - lowest) / 4)
        );
        assert_eq!(unexplained_sign_changes(&volume), 0);
    }
}

#[test]
fn watertight_humans_have_no_unobserved_voxel() {
    for (name, edge) in [("thomas", BlockEdge::E8), ("thomas", BlockEdge::E16), ("liam", BlockEdge::E8)] {
        let Some(volume) = check_sequence(name, 2, 0.005, edge, CLOSED) else { return };
        assert!(volume.unobserved_masks().is_empty());
        assert_eq!(unexplained_sign_changes(&volume), 0);
    }
}

#[test]
fn overlapping_parts_and_large_triangles_are_closed() {
    for (name, voxel_m) in [("xbot", 0.005), ("cesium_man", 0.005), ("collision", 0.02)] {
        let Some(volume) = check_sequence(name, 1, voxel_m, BlockEdge::E8, CLOSED) else { return };
        assert_eq!(unexplained_sign_changes(&volume), 0);
    }
}

/// Sides against the sums over all triangles, all over the band. Where a mesh is closed, however many parts
/// overlap, a voxel is inside if its winding number exceeds one half. Beside a hole that is closed it may
/// exceed it anywhere in the hole.
#[test]
fn sides_are_those_of_the_exact_winding_number() {
    for name in ["dancer", "thomas", "liam", "xbot", "cesium_man", "collision"] {
        let Some(mesh) = support::load(name, 1) else { return };
        let voxel_m = if name == "collision" { 0.02 } else { 0.005 };
        let settings = MeshIngest::new(Grid {
            voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
            edge: BlockEdge::E8,
            truncation: Truncation::DEFAULT,
        });
        let volume = ingest_mesh(&mesh, &settings, CLOSED).unwrap();
        let (mut looked_at, mut wrong) = (0, 0);
        for block in (0..volume.block_count()).step_by(volume.block_count() / 120 + 1) {
            for voxel in (block % 31..512).step_by(67) {
                let sample = volume.block(block)[voxel];
                if sample == 0 || volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
                    continue;
                }
                let centre = settings
                    .grid
                    .voxel_centre_m(volume.coords()[block], [voxel % 8, voxel / 8 % 8, voxel / 64]);
                wrong += usize::from((exact_winding_number(&mesh, centre).abs() > 0.5) != (sample < 0));
                looked_at += 1;
            }
        }
        println!("{name}: {looked_at} voxels, {wrong} on the other side");
        assert!(looked_at > 500 && wrong == 0, "{name}: {wrong} of {looked_at}");
    }
}

#[test]
fn sheets_and_buildings_become_shells() {
    check_sequence("flag", 5, 0.005, BlockEdge::E4, SignDecision::Offset);
    check_sequence("monastery", 0, 0.04, BlockEdge::E8, SignDecision::Offset);
    check_sequence("monastery", 0, 0.02, BlockEdge::E8, SignDecision::Offset);
}

#[test]
fn captures_whose_faces_agree_are_left_alone() {
    for (name, frame) in
        [("dancer", 0), ("dancer", 9), ("thomas", 3), ("liam", 5), ("xbot", 2), ("collision", 4)]
    {
        let Some(mesh) = support::load(name, frame) else { return };
        let mut turner = FaceTurner::default();
        let start = Instant::now();
        assert!(matches!(turner.turn(&mesh), Cow::Borrowed(_)), "{name} {frame}");
        let close = start.elapsed();
        let start = Instant::now();
        assert!(matches!(turner.turn(&mesh), Cow::Borrowed(_)), "{name} {frame}");
        println!("{name} {frame}: {close:.1?} at a close look, else {:.1?}", start.elapsed());
    }
}

#[test]
fn a_capture_with_turned_faces_gives_the_volume_that_it_gives_without() {
    let Some(mesh) = support::load("thomas", 0) else { return };
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.01).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    };
    let volume = |mesh: &TriangleMesh| {
        let (sign, _) = decide_sign(mesh, SignMode::Paper);
        ingest_mesh(mesh, &MeshIngest::new(grid), sign).unwrap()
    };
    let mut turned = mesh.clone();
    for triangle in turned.triangles.iter_mut().step_by(7) {
        triangle.swap(1, 2);
    }
    assert_eq!(decide_sign(&turned, SignMode::Paper).0, SignDecision::Offset);
    assert!(volume(&turn_faces(&turned)) == volume(&mesh));
}
