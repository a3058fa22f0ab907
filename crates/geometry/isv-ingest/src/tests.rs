//! Ingest of shapes whose distance field is known.

use crate::{IngestError, MeshIngest, Reach, SignDecision, ingest_mesh};
use glam::{DQuat, DVec3};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{cube, open_box, sheet, sphere};
use isv_volume::{
    BlockCoord, BlockEdge, FitError, Grid, MeshError, SparseVolume, TriangleMesh, Truncation, VoxelSize,
};

const CLOSED: SignDecision = SignDecision::Closed { flipped: false };

fn settings(voxel_m: f64, edge: BlockEdge) -> MeshIngest {
    MeshIngest::new(Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge,
        truncation: Truncation::DEFAULT,
    })
}

/// Calls `check` with centre (voxels), sample (voxels) and whether it is observed, for every voxel of the volume.
fn for_each_voxel(volume: &SparseVolume, mut check: impl FnMut(DVec3, f64, bool)) {
    let (grid, n) = (volume.grid(), volume.grid().edge.voxels());
    for (block, coord) in volume.coords().iter().enumerate() {
        for (voxel, sample) in volume.block(block).iter().enumerate() {
            let at = grid.voxel_centre_m(*coord, [voxel % n, voxel / n % n, voxel / (n * n)]);
            let observed = !volume.unobserved(block).is_some_and(|mask| mask.contains(voxel));
            check(at / grid.voxel_size.metres(), f64::from(*sample) / 256.0, observed);
        }
    }
}

/// Signed distance to the cube `-half..half`.
fn cube_distance(p: DVec3, half: f64) -> f64 {
    let q = p.abs() - half;
    q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
}

#[test]
fn a_cube_is_sampled_exactly_at_every_block_edge() {
    for edge in [BlockEdge::E4, BlockEdge::E8, BlockEdge::E16] {
        let volume = ingest_mesh(&cube(0.213), &settings(0.01, edge), CLOSED).unwrap();
        let mut in_band = 0;
        for_each_voxel(&volume, |p, s, observed| {
            let expected = cube_distance(p, 21.3).clamp(-8.0, 8.0);
            assert!((s - expected).abs() < 0.503 / 256.0 && observed, "{p}: {s} against {expected}");
            in_band += usize::from(expected.abs() < 8.0);
        });
        // Counted over the whole neighbourhood, no voxel of the band is missing.
        let all = (-31..31).flat_map(|x| (-31..31).flat_map(move |y| (-31..31).map(move |z| [x, y, z])));
        let expected = all
            .filter(|v| cube_distance(DVec3::from_array(v.map(f64::from)) + 0.5, 21.3).abs() < 8.0)
            .count();
        assert_eq!(in_band, expected);
    }
}

/// By how much samples beyond 1.75 voxels may be too small, and are too large on average, in voxels. Where the surface is closest in
/// another block, they are far too large.
const TOO_SMALL: f64 = 0.3;
const MEAN_ERROR: f64 = 1.0;

/// Checks a volume that reaches no farther than the surface against one of the whole band.
fn check_near(name: &str, near: &SparseVolume, whole: &SparseVolume) {
    let index = near.index();
    let (mut too_small, mut sum, mut far, mut kept) = (0f64, 0.0, 0, 0);
    let (mut unobserved, mut torn) = (0, 0);
    for (block, coord) in whole.coords().iter().enumerate() {
        let code = |sample: i16| f64::from(sample) / 256.0;
        let observed = |volume: &SparseVolume, block: usize, v: usize| {
            !volume.unobserved(block).is_some_and(|m| m.contains(v))
        };
        let has_near =
            (0..512).any(|v| code(whole.block(block)[v]).abs() < 1.74 && observed(whole, block, v));
        let Some(found) = index.get(*coord) else {
            assert!(!has_near, "{name}: {coord:?} is missing");
            continue;
        };
        kept += 1;
        for (v, (a, b)) in near.block(found as usize).iter().zip(whole.block(block)).enumerate() {
            let (got, exact) = (code(*a), code(*b));
            let are_observed = [observed(near, found as usize, v), observed(whole, block, v)];
            if are_observed != [true; 2] {
                unobserved += usize::from(!are_observed[1]);
                // Which part is closest is known near the surface only, and there what is as close to a rim as to a face may be
                // either; and what closes a hole may pass between a block and one that only the band has.
                let seen = if are_observed[0] { got } else { exact };
                torn += usize::from(are_observed != [false; 2] && seen.abs() < 1.7);
                continue;
            }
            assert!(got.signum() == exact.signum() || exact.abs() < 2.0 / 256.0, "{name}: {got} for {exact}");
            if exact.abs() < 1.7 {
                assert!((got - exact).abs() < 1.5 / 256.0, "{name}: {got} for {exact} at {coord:?} {v}");
            }
            if exact.abs() >= 1.75 {
                too_small = too_small.max(exact.abs() - got.abs());
                sum += (got - exact).abs();
                far += 1;
            }
        }
    }
    assert_eq!(kept, near.block_count(), "{name}: blocks that the whole band does not have");
    let mean = sum / f64::from(far);
    println!("{name}: {kept} of {} blocks, {too_small:.3} too small, {mean:.3} off", whole.block_count());
    println!("{torn} voxels near the surface are unobserved in one only, of {unobserved}");
    assert!(torn * 500 <= unobserved, "{name}: {torn} of {unobserved}");
    assert!(too_small < TOO_SMALL && mean < MEAN_ERROR, "{name}: {too_small}, {mean}");
}

#[test]
fn reaching_no_farther_than_the_surface_agrees_with_the_band_near_it() {
    let meshes = [
        ("cube", cube(0.213), CLOSED),
        ("sphere", sphere(0.3, 30), CLOSED),
        ("fine sphere", sphere(0.3, 120), CLOSED),
        ("open box", open_box(0.2), CLOSED),
        ("sheet", sheet(0.3), SignDecision::Offset),
    ];
    for (name, mesh, sign) in meshes {
        let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.7);
        let vertices = mesh.vertices.iter().map(|v| turned * *v + DVec3::new(-0.4, 0.013, 7.0)).collect();
        let mesh = TriangleMesh { vertices, ..mesh };
        let whole = settings(0.01, BlockEdge::E8);
        let near = MeshIngest { reach: Reach::Surface, ..whole };
        let [near, whole] = [near, whole].map(|settings| ingest_mesh(&mesh, &settings, sign).unwrap());
        assert!(near.block_count() < whole.block_count());
        check_near(name, &near, &whole);
    }
}

#[test]
fn every_block_has_a_voxel_in_the_band() {
    let volume = ingest_mesh(&sphere(0.3, 30), &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
    for block in 0..volume.block_count() {
        assert!(volume.block(block).iter().any(|s| s.abs() < 2048));
    }
}

#[test]
fn a_sphere_is_negative_inside_even_inside_out() {
    let mut mesh = sphere(0.3, 60);
    let volume = ingest_mesh(&mesh, &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
    for_each_voxel(&volume, |p, s, _| {
        let expected = (p.length() - 30.0).clamp(-8.0, 8.0);
        // The facets cut in by up to 30 (1 - cos(pi / 120)) / cos(...) voxels.
        assert!((s - expected).abs() < 0.06, "{p}: {s} against {expected}");
    });
    mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let flipped = SignDecision::Closed { flipped: true };
    assert_eq!(ingest_mesh(&mesh, &settings(0.01, BlockEdge::E8), flipped).unwrap(), volume);
}

#[test]
fn overlapping_parts_are_one_inside() {
    let mut mesh = cube(0.1);
    let shift = mesh.vertices.len() as u32;
    mesh.vertices.extend(cube(0.1).vertices.iter().map(|v| *v + DVec3::new(0.1, 0.0, 0.0)));
    mesh.triangles.extend(cube(0.1).triangles.iter().map(|t| t.map(|v| v + shift)));
    let volume = ingest_mesh(&mesh, &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
    for_each_voxel(&volume, |p, s, _| {
        let inside = cube_distance(p, 10.0) < 0.0 || cube_distance(p - DVec3::X * 10.0, 10.0) < 0.0;
        assert_eq!(s < 0.0, inside, "{p}: {s}");
    });
}

#[test]
fn a_surface_inside_another_leaves_no_speck_where_it_passes_through_voxels() {
    let (mut mesh, within) = (cube(0.1), cube(0.045));
    let shift = mesh.vertices.len() as u32;
    mesh.vertices.extend(&within.vertices);
    mesh.triangles.extend(within.triangles.iter().map(|t| t.map(|v| v + shift)));
    for reach in [Reach::Band, Reach::Surface] {
        let settings = MeshIngest { reach, ..settings(0.01, BlockEdge::E8) };
        let volume = ingest_mesh(&mesh, &settings, CLOSED).unwrap();
        let mut on_it = 0;
        for_each_voxel(&volume, |p, s, _| {
            if cube_distance(p, 10.0) < -0.01 {
                on_it += u32::from(s > -0.01);
                assert!(s < 0.0, "{p}: {s}");
            }
        });
        assert!(on_it > 100, "{on_it}");
    }
}

#[test]
fn a_wide_hole_stays_open_and_a_narrow_one_is_closed() {
    let volume = ingest_mesh(&open_box(0.2), &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
    let mut unobserved = 0;
    for_each_voxel(&volume, |p, s, observed| {
        let inside = p.abs().max_element() < 20.0;
        unobserved += usize::from(!observed);
        if observed && s.abs() < 8.0 {
            assert_eq!(s < 0.0, inside, "{p}: {s}");
        }
        // Above the rim, and nowhere else, the closest point is on the rim; the rim itself is trimmed.
        let above = p.z > 20.0;
        let at_rim = (p.z - 20.0).abs() < 2.0;
        assert!(s.abs() >= 8.0 || at_rim || observed != above, "{p}: {s} observed {observed}");
    });
    assert!(unobserved > 1000);
    // At 20 cm a voxel the opening is two voxels wide.
    let volume = ingest_mesh(&open_box(0.2), &settings(0.2, BlockEdge::E8), CLOSED).unwrap();
    assert!(volume.unobserved_masks().is_empty());
}

#[test]
fn a_slanted_rim_ends_without_teeth_and_specks() {
    for tilt in [0.1, 0.25, 0.4] {
        let mut mesh = open_box(0.2);
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, tilt, 0.7 * tilt, 0.0);
        mesh.vertices.iter_mut().for_each(|v| *v = turn * *v);
        let volume = ingest_mesh(&mesh, &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
        let surface = extract_surface(&volume, &SurfaceOptions { normals: false });
        let (components, rim) = components_and_rim(&surface);
        assert_eq!(components, 1, "tilt {tilt}");
        // Four edges of 40 voxels, stepping along two axes at most; teeth double it.
        let per_rim = rim / (4.0 * 0.4);
        println!("tilt {tilt}: the surface's border is {per_rim:.2} times the rim");
        assert!(per_rim < 1.35, "tilt {tilt}: {per_rim}");
    }
}

#[test]
fn trimming_a_rim_leaves_the_rest_of_a_curved_surface_alone() {
    let mut mesh = sphere(0.3, 40);
    let heights: Vec<f64> =
        (0..mesh.triangles.len()).map(|f| mesh.corners(f).iter().map(|c| c.z).sum()).collect();
    let mut heights = heights.into_iter();
    mesh.triangles.retain(|_| heights.next().unwrap() < 3.0 * 0.15);
    for edge in [BlockEdge::E4, BlockEdge::E8] {
        let volume = ingest_mesh(&mesh, &settings(0.01, edge), CLOSED).unwrap();
        assert!(!volume.unobserved_masks().is_empty());
        for_each_voxel(&volume, |p, s, observed| {
            let far_below = p.z < 15.0 - 4.0 && p.length() > 25.0;
            assert!(observed || !far_below, "{p}: {s}");
        });
    }
}

/// Connected components of a mesh, and the length of its border.
fn components_and_rim(mesh: &TriangleMesh) -> (usize, f64) {
    let mut parents: Vec<usize> = (0..mesh.vertices.len()).collect();
    fn root(parents: &[usize], mut v: usize) -> usize {
        while parents[v] != v {
            v = parents[v];
        }
        v
    }
    let mut edges = std::collections::BTreeMap::new();
    for triangle in &mesh.triangles {
        for i in 0..3 {
            let (a, b) = (triangle[i] as usize, triangle[(i + 1) % 3] as usize);
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            let (a, b) = (root(&parents, a), root(&parents, b));
            parents[a.max(b)] = a.min(b);
        }
    }
    let border = edges.iter().filter(|(_, faces)| **faces == 1);
    let length = border.map(|((a, b), _)| mesh.vertices[*a].distance(mesh.vertices[*b])).sum();
    ((0..parents.len()).filter(|v| parents[*v] == *v).count(), length)
}

#[test]
fn a_seam_is_closed() {
    let mut mesh = sphere(0.3, 30);
    // A slit a tenth of a voxel wide along one meridian: its inner vertices are doubled for the faces on one side.
    let shift = mesh.vertices.len() as u32;
    mesh.vertices.extend_from_within(..);
    mesh.vertices[shift as usize..].iter_mut().for_each(|v| v.y += 0.001);
    for triangle in mesh.triangles.iter_mut().filter(|t| t.iter().any(|v| v % 60 == 1)) {
        for vertex in triangle.iter_mut().filter(|v| **v % 60 == 0 && (60..1800).contains(*v)) {
            *vertex += shift;
        }
    }
    let volume = ingest_mesh(&mesh, &settings(0.01, BlockEdge::E8), CLOSED).unwrap();
    assert!(volume.unobserved_masks().is_empty());
    for_each_voxel(&volume, |p, s, _| {
        let expected = p.length() - 30.0;
        assert!(expected.abs() < 0.3 || (s < 0.0) == (expected < 0.0), "{p}: {s}");
    });
}

#[test]
fn a_sheet_becomes_a_shell() {
    let volume = ingest_mesh(&sheet(0.2), &settings(0.01, BlockEdge::E8), SignDecision::Offset).unwrap();
    let mut in_band = 0;
    for_each_voxel(&volume, |p, s, observed| {
        let outside = (p.abs() - DVec3::new(20.0, 20.0, 0.0)).max(DVec3::ZERO);
        let expected = (outside.length() - 1.5).min(8.0);
        assert!((s - expected).abs() < 0.503 / 256.0 && observed, "{p}: {s} against {expected}");
        in_band += usize::from(expected < 8.0);
    });
    assert!(in_band > 40 * 40 * 18);
}

#[test]
fn moving_by_whole_tiles_moves_the_samples_unchanged_and_by_blocks_within_a_code() {
    // A voxel of 2^-7 m and vertices on a lattice of 2^-20 m, so that moving is exact.
    let settings = settings(0.007_812_5, BlockEdge::E8);
    let mut mesh = sphere(0.2, 12);
    mesh.vertices.iter_mut().for_each(|v| *v = (*v * 1_048_576.0).round() / 1_048_576.0);
    let here = ingest_mesh(&mesh, &settings, CLOSED).unwrap();
    // Heights are rounded to `f32` at the centres of tiles of 4 blocks.
    for (shift, codes) in
        [([4, -8, 12], 0), ([-100_000, 70_004, -4], 0), ([1, -2, 3], 1), ([-100_003, 70_001, -5], 1)]
    {
        let mut moved = mesh.clone();
        let metres = DVec3::from_array(shift.map(|s| f64::from(s) * 8.0 * 0.007_812_5));
        moved.vertices.iter_mut().for_each(|v| *v += metres);
        let there = ingest_mesh(&moved, &settings, CLOSED).unwrap();
        assert_eq!(there.block_count(), here.block_count());
        let index = there.index();
        for (block, coord) in here.coords().iter().enumerate() {
            let other =
                index.get(BlockCoord::offset(*coord, shift)).expect("the block has moved along") as usize;
            for (a, b) in here.block(block).iter().zip(there.block(other)) {
                assert!(a.abs_diff(*b) <= codes, "{coord:?} moved by {shift:?}: {a} then {b}");
            }
        }
    }
}

#[test]
fn a_huge_thin_triangle_costs_by_its_area_and_is_exact() {
    let mesh = TriangleMesh {
        vertices: vec![
            [-300.0, -200.0, -250.0].into(),
            [300.0, 210.0, 240.0].into(),
            [300.0, 210.01, 240.0].into(),
        ],
        normals: Vec::new(),
        triangles: vec![[0, 1, 2], [0, 0, 0]],
        appearance: None,
    };
    let settings = settings(0.1, BlockEdge::E8);
    let volume = ingest_mesh(&mesh, &settings, SignDecision::Offset).unwrap();
    assert!(volume.block_count() < 40_000);
    let bvh = isv_spatial::Bvh::new(&mesh);
    let mut voxel = 0;
    for_each_voxel(&volume, |p, s, _| {
        voxel += 1;
        if voxel % 101 == 0 {
            let expected = (bvh.distance(p * 0.1) * 10.0 - 1.5).min(8.0);
            assert!((s - expected).abs() < 0.503 / 256.0 + 1e-3, "{p}: {s} against {expected}");
        }
    });
}

#[test]
fn threads_do_not_change_the_result() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ingest_mesh(&open_box(0.3), &settings(0.01, BlockEdge::E8), CLOSED).unwrap())
    };
    assert_eq!(with(1), with(2));
    assert_eq!(with(1), with(5));
}

#[test]
fn too_many_blocks_are_refused_with_a_voxel_that_fits() {
    let mut small = settings(0.001, BlockEdge::E8);
    small.max_blocks = 5000;
    let error = ingest_mesh(&sphere(0.5, 40), &small, CLOSED).unwrap_err();
    let IngestError::Fit(FitError::TooManyBlocks { blocks, limit: 5000, voxel_that_fits_m, .. }) = error
    else {
        panic!("{error}");
    };
    // A sphere of half a metre at 1 mm: pi square metres by 3 blocks of 64 square millimetres.
    assert!((100_000..300_000).contains(&blocks), "{blocks}");
    let coarse = MeshIngest { max_blocks: 5000, ..settings(voxel_that_fits_m, BlockEdge::E8) };
    let volume = ingest_mesh(&sphere(0.5, 40), &coarse, CLOSED).unwrap();
    assert!((2000..=5000).contains(&volume.block_count()), "{} blocks", volume.block_count());
    assert!(error.to_string().contains("the limit is 5000; voxels of 0.0"), "{error}");
}

#[test]
fn huge_triangles_over_one_another_are_refused_with_a_voxel_that_fits() {
    // Few blocks, each with all of the triangles: the work is that of hundreds of surfaces.
    let mesh = TriangleMesh {
        vertices: vec![DVec3::ZERO, DVec3::X * 5.0, DVec3::Y * 5.0],
        normals: Vec::new(),
        triangles: vec![[0, 1, 2]; 2_000],
        appearance: None,
    };
    let settings = MeshIngest { max_blocks: 50_000, ..settings(0.005, BlockEdge::E8) };
    let one = TriangleMesh { triangles: mesh.triangles[..1].to_vec(), ..mesh.clone() };
    assert!(ingest_mesh(&one, &settings, SignDecision::Offset).is_ok());
    for reach in [Reach::Band, Reach::Surface] {
        let error = ingest_mesh(&mesh, &MeshIngest { reach, ..settings }, SignDecision::Offset).unwrap_err();
        let IngestError::Fit(FitError::TooManyBlocks { limit: 50_000, voxel_that_fits_m, .. }) = error else {
            panic!("{error}")
        };
        assert!((0.005..0.2).contains(&voxel_that_fits_m), "{voxel_that_fits_m}");
    }
}

#[test]
fn a_hoop_too_wide_to_close_is_refused_with_a_voxel_that_fits() {
    // A band 10 cm high around a circle of 300 m.
    let corner = |i: u32, z: f64| {
        let (y, x) = (f64::from(i % 1000) * std::f64::consts::TAU / 1000.0).sin_cos();
        DVec3::new(300.0 * x, 300.0 * y, z)
    };
    let quad =
        |i: u32| [[2 * i, (2 * i + 2) % 2000, (2 * i + 3) % 2000], [2 * i, (2 * i + 3) % 2000, 2 * i + 1]];
    let hoop = TriangleMesh {
        vertices: (0..1000).flat_map(|i| [corner(i, 0.0), corner(i, 0.1)]).collect(),
        normals: Vec::new(),
        triangles: (0..1000).flat_map(quad).collect(),
        appearance: None,
    };
    let limited = |voxel_m| MeshIngest {
        max_blocks: 200_000,
        reach: Reach::Surface,
        ..settings(voxel_m, BlockEdge::E8)
    };
    ingest_mesh(&hoop, &limited(0.1), SignDecision::Offset).unwrap();
    let error = ingest_mesh(&hoop, &limited(0.1), CLOSED).unwrap_err();
    let IngestError::Fit(FitError::TooManyBlocks { voxel_that_fits_m, .. }) = error else {
        panic!("{error}")
    };
    ingest_mesh(&hoop, &limited(voxel_that_fits_m), CLOSED).unwrap();
}

#[test]
fn a_wrong_unit_is_refused_quickly() {
    let mut mesh = sphere(0.5, 40);
    mesh.vertices.iter_mut().for_each(|v| *v *= 1000.0);
    let limited = MeshIngest { max_blocks: 100_000, ..settings(0.005, BlockEdge::E8) };
    let error = ingest_mesh(&mesh, &limited, CLOSED).unwrap_err();
    assert!(matches!(error, IngestError::Fit(FitError::TooManyBlocks { .. })), "{error}");
}

#[test]
fn coordinates_out_of_range_are_refused_with_a_voxel_that_fits() {
    let mut mesh = cube(0.1);
    mesh.vertices.iter_mut().for_each(|v| v.x += 50_000.0);
    let error = ingest_mesh(&mesh, &settings(0.005, BlockEdge::E8), CLOSED).unwrap_err();
    let IngestError::Fit(FitError::OutOfRange { voxel_that_fits_m, .. }) = error else { panic!("{error}") };
    ingest_mesh(&mesh, &settings(voxel_that_fits_m, BlockEdge::E8), CLOSED).unwrap();
}

#[test]
fn broken_meshes_and_offsets_are_refused() {
    let good = settings(0.01, BlockEdge::E8);
    let empty = ingest_mesh(&TriangleMesh::default(), &good, CLOSED);
    assert_eq!(empty, Err(IngestError::Mesh(MeshError::NoFaces)));
    for offset_voxels in [-0.1, 8.1, f64::NAN] {
        let wrong = MeshIngest { offset_voxels, ..good };
        let error = ingest_mesh(&sheet(0.1), &wrong, SignDecision::Offset).unwrap_err();
        assert!(matches!(error, IngestError::Offset { truncation: 8, .. }), "{error}");
    }
}
