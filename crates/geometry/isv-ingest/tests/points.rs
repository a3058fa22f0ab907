//! Points of real captures: rates and errors beside those of the mesh path. Prints what it measured: run with `--nocapture`
//! to see it. `ISV_TEST_OUT` names a folder to write surfaces to.

mod support;

use glam::{DVec2, DVec3};
use isv_encode::{Encoder, EncoderSettings, MotionMode};
use isv_format::{FrameRate, PaperParameters, Prediction, Profile, StreamHeader};
use isv_ingest::{
    MeshIngest, NormalSides, PointIngest, PointSign, SignMode, decide_point_sign, decide_sign,
    estimate_normals, estimate_normals_seen_from, ingest_mesh, ingest_points,
};
use isv_metrics::{CompareOptions, compare, distances_to_surface, sample_surface};
use isv_spatial::{Bvh, PointTree};
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{Random, capture, look_at, render_depth, street};
use isv_volume::{
    BlockEdge, Grid, Intrinsics, PointCloud, ScanPlace, SparseVolume, TriangleMesh, Truncation, VoxelMask,
    VoxelSize,
};

fn grid(voxel_m: f64) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(voxel_m).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::DEFAULT,
    }
}

/// One point with the normal of its triangle a square of 3 mm, drawn at random.
fn points_of(mesh: &TriangleMesh) -> PointCloud {
    let samples = sample_surface(mesh, 0.003, 7);
    PointCloud {
        positions: samples.iter().map(|s| s.point).collect(),
        normals: samples.iter().map(|s| s.normal).collect(),
        viewpoint: None,
        scans: Vec::new(),
        colours: Vec::new(),
    }
}

fn surface(volume: &SparseVolume) -> TriangleMesh {
    extract_surface(volume, &SurfaceOptions { normals: false })
}

/// Writes a surface for looking at, if asked to.
fn keep(name: &str, mesh: &TriangleMesh) {
    if let Some(folder) = std::env::var_os("ISV_TEST_OUT") {
        let path = std::path::Path::new(&folder).join(name).with_extension("ply");
        isv_io::write_mesh(&path, mesh, isv_io::Format::Ply).unwrap();
    }
}

/// How far the surface of a volume is from a mesh.
#[derive(Debug)]
struct SurfaceError {
    p2s_mean_mm: f64,
    hausdorff_mm: f64,
    area_ratio: f64,
}

/// Error against the source, without coding.
fn error(mesh: &TriangleMesh, volume: &SparseVolume) -> SurfaceError {
    let error = compare(mesh, &surface(volume), &CompareOptions { spacing_m: 0.005, seed: 1 }).unwrap();
    SurfaceError {
        p2s_mean_mm: error.p2s_mean_mm.unwrap(),
        hausdorff_mm: error.hausdorff_mm.unwrap(),
        area_ratio: error.area_ratio.unwrap(),
    }
}

fn unobserved(volume: &SparseVolume) -> usize {
    volume.unobserved_masks().values().map(VoxelMask::count).sum()
}

/// Bytes of all frames coded with the paper's profile and 3-DoF motion, and the mean error of what is decoded.
fn code(meshes: &[TriangleMesh], volumes: &[SparseVolume]) -> (usize, f64) {
    let header = StreamHeader::new(
        Profile::Paper(PaperParameters { coefficients: 64, dc_step: 819, ac_step: 8192 }),
        *volumes[0].grid(),
        FrameRate::DEFAULT,
    );
    let settings = EncoderSettings { motion: MotionMode::Fixed(Prediction::ThreeDof), ..Default::default() };
    let mut encoder = Encoder::new(&header, settings);
    let (mut bytes, mut error_mm) = (0, 0.0);
    for (mesh, volume) in meshes.iter().zip(volumes) {
        let frame = encoder.encode(volume);
        bytes += frame.bytes_blocks() + frame.bytes_modes() + frame.bytes_coefficients();
        error_mm += error(mesh, encoder.reconstruction().unwrap()).p2s_mean_mm / meshes.len() as f64;
    }
    (bytes, error_mm)
}

/// Prints how far the samples of two volumes are apart by distance from the surface. Returns the mean over
/// the band, and the number of voxels more than half a voxel from the surface that lie on different sides.
/// Only voxels that both observed count.
fn compare_samples(reference: &SparseVolume, volume: &SparseVolume) -> (f64, usize) {
    let index = volume.index();
    let (mut bins, mut wrong) = ([(0usize, 0.0f64, 0.0f64); 9], 0);
    for (block, coord) in reference.coords().iter().enumerate() {
        let Some(other) = index.get(*coord).map(|i| i as usize) else { continue };
        let hidden = |v: usize| {
            [reference.unobserved(block), volume.unobserved(other)].iter().flatten().any(|m| m.contains(v))
        };
        let pairs = reference.block(block).iter().zip(volume.block(other)).enumerate();
        for (_, (s, t)) in pairs.filter(|(v, _)| !hidden(*v)) {
            let (s, t) = (f64::from(*s) / 256.0, f64::from(*t) / 256.0);
            let bin = &mut bins[s.abs() as usize];
            *bin = (bin.0 + 1, bin.1 + (s - t).abs(), bin.2.max((s - t).abs()));
            wrong += usize::from(s.abs() > 0.5 && (s < 0.0) != (t < 0.0));
        }
    }
    for (distance, (count, sum, most)) in bins.iter().enumerate() {
        println!("  {distance} voxels: mean {:.3}, largest {most:.2} voxels", sum / *count as f64);
    }
    let (count, sum) = bins[..8].iter().fold((0, 0.0), |total, bin| (total.0 + bin.0, total.1 + bin.1));
    (sum / count as f64, wrong)
}

#[test]
fn points_code_like_the_mesh_that_they_are_from() {
    let (mut meshes, mut from_mesh, mut from_points) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..3 {
        let Some(mesh) = support::load("thomas", frame) else { return };
        let cloud = points_of(&mesh);
        let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
        println!("thomas {frame}: {} points, {sign} ({evidence})", cloud.positions.len());
        assert_eq!(sign, PointSign::Oriented);
        let settings = MeshIngest::new(grid(0.005));
        from_mesh.push(ingest_mesh(&mesh, &settings, decide_sign(&mesh, SignMode::Auto).0).unwrap());
        from_points.push(ingest_points(&cloud, &PointIngest::new(grid(0.005)), sign).unwrap());
        let (apart, wrong) = compare_samples(&from_mesh[frame], &from_points[frame]);
        assert!(apart < 0.04 && wrong < 50, "samples {apart:.3} voxels apart, {wrong} on the wrong side");
        assert!(unobserved(&from_points[frame]) < 50);
        let (mesh_mm, points_mm) = (error(&mesh, &from_mesh[frame]), error(&mesh, &from_points[frame]));
        println!(
            "  before coding: mesh {:.3} mm (largest {:.1}), points {:.3} mm (largest {:.1})",
            mesh_mm.p2s_mean_mm, mesh_mm.hausdorff_mm, points_mm.p2s_mean_mm, points_mm.hausdorff_mm
        );
        assert!(points_mm.hausdorff_mm < 20.0, "specks or pits: {points_mm:?}");
        meshes.push(mesh);
    }
    let ((mesh_bytes, mesh_mm), (bytes, mm)) = (code(&meshes, &from_mesh), code(&meshes, &from_points));
    keep("thomas_points", &surface(&from_points[0]));
    println!("coded: mesh {mesh_bytes} bytes, {mesh_mm:.3} mm; points {bytes} bytes, {mm:.3} mm");
    assert!((bytes as f64) < 1.25 * mesh_bytes as f64);
    assert!((mm - mesh_mm).abs() < 0.2);
}

#[test]
fn open_soles_of_dancer_stay_open() {
    for frame in [0, 7] {
        let Some(mesh) = support::load("dancer", frame) else { return };
        let volume =
            ingest_points(&points_of(&mesh), &PointIngest::new(grid(0.005)), PointSign::Oriented).unwrap();
        let error = error(&mesh, &volume);
        let (lo, hi) = mesh.bounds().unwrap();
        let height = |block: &u32| f64::from(volume.coords()[*block as usize].y) * 0.04;
        let low = volume.unobserved_masks().iter().filter(|(b, _)| height(b) < lo.y + 0.25 * (hi.y - lo.y));
        let low: usize = low.map(|(_, mask)| mask.count()).sum();
        println!(
            "dancer {frame}: {:.3} mm, largest {:.1} mm; {} unobserved voxels, {low} at the feet",
            error.p2s_mean_mm,
            error.hausdorff_mm,
            unobserved(&volume)
        );
        assert!(error.p2s_mean_mm < 0.2 && error.hausdorff_mm < 20.0, "{error:?}");
        assert!(low > 10_000);
    }
}

#[test]
fn an_open_sheet_of_oriented_points_is_one_sheet() {
    let Some(mesh) = support::load("flag", 5) else { return };
    let cloud = points_of(&mesh);
    let volume = ingest_points(&cloud, &PointIngest::new(grid(0.01)), PointSign::Oriented).unwrap();
    let error = error(&mesh, &volume);
    println!(
        "flag 5: {:.3} mm, largest {:.1} mm, area {:.3} of the source",
        error.p2s_mean_mm, error.hausdorff_mm, error.area_ratio
    );
    assert!(error.p2s_mean_mm < 0.4 && error.hausdorff_mm < 40.0);
    assert!((0.95..1.03).contains(&error.area_ratio));
}

#[test]
fn tilted_normals_are_used_and_reversed_ones_are_not() {
    let Some(mesh) = support::load("thomas", 0) else { return };
    let mut random = Random::new(3);
    let mut cloud = points_of(&mesh);
    for normal in &mut cloud.normals {
        let across = random.point().cross(*normal).normalize();
        *normal = *normal * 20f64.to_radians().cos() + across * 20f64.to_radians().sin();
    }
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    assert_eq!(sign, PointSign::Oriented, "{evidence}");
    let settings = PointIngest::new(grid(0.005));
    let tilted = error(&mesh, &ingest_points(&cloud, &settings, sign).unwrap());
    cloud.normals.iter_mut().for_each(|n| *n = if random.signed() < -0.8 { -*n } else { *n });
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    println!("one in ten reversed: {sign} ({evidence})");
    assert_eq!(sign, PointSign::Offset);
    let reversed = error(&mesh, &ingest_points(&cloud, &settings, PointSign::Oriented).unwrap());
    for (name, error) in [("tilted by 20 degrees", &tilted), ("one in ten reversed as well", &reversed)] {
        println!("{name}: {:.3} mm, largest {:.1} mm", error.p2s_mean_mm, error.hausdorff_mm);
    }
    assert!(tilted.p2s_mean_mm < 0.2 && tilted.hausdorff_mm < 20.0);
    assert!(reversed.p2s_mean_mm < 1.0);
}

#[test]
fn estimated_normals_are_those_of_the_surface() {
    let Some(mesh) = support::load("thomas", 0) else { return };
    let given = points_of(&mesh);
    let cloud = PointCloud { normals: Vec::new(), ..given.clone() };
    let estimated = estimate_normals(&cloud).unwrap();
    let cosines = || estimated.normals.iter().zip(&given.normals).map(|(n, m)| n.dot(*m));
    let outward = cosines().filter(|c| *c > 0.0).count() as f64 / given.normals.len() as f64;
    let mean = cosines().map(f64::abs).sum::<f64>() / given.normals.len() as f64;
    let volume = ingest_points(&estimated, &PointIngest::new(grid(0.005)), PointSign::Oriented).unwrap();
    let error = error(&mesh, &volume);
    println!(
        "thomas 0: {:.2} % outward, mean cosine {mean:.4}, {:.3} mm, largest {:.1} mm",
        100.0 * outward,
        error.p2s_mean_mm,
        error.hausdorff_mm
    );
    assert!(outward > 0.999 && mean > 0.98);
    assert!(error.p2s_mean_mm < 0.2 && error.hausdorff_mm < 20.0);
}

/// A sweep of `street_lidar`: binary little-endian, four floats a point; the sensor is at the origin.
fn sweep(frame: usize) -> Option<PointCloud> {
    let path = capture(&format!("street_lidar/frame_{frame:04}.ply"))?;
    let bytes = std::fs::read(path).expect("a file that can be read");
    let body = bytes.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let axis = |p: &[u8], i: usize| f64::from(f32::from_le_bytes(p[4 * i..4 * i + 4].try_into().unwrap()));
    let positions =
        bytes[body..].chunks_exact(16).map(|p| DVec3::new(axis(p, 0), axis(p, 1), axis(p, 2))).collect();
    Some(PointCloud {
        positions,
        normals: Vec::new(),
        viewpoint: Some(DVec3::ZERO),
        scans: Vec::new(),
        colours: Vec::new(),
    })
}

/// Share of the points within a distance of the surface's vertices, and of the vertices within it of a point.
fn coverage(cloud: &PointCloud, surface: &TriangleMesh, within_m: f64) -> [f64; 2] {
    let share = |from: &[DVec3], to: &[DVec3]| {
        let tree = PointTree::new(to.to_vec());
        let near = from.iter().filter(|p| tree.nearest_sq(**p) <= within_m * within_m).count();
        near as f64 / from.len() as f64
    };
    [share(&cloud.positions, &surface.vertices), share(&surface.vertices, &cloud.positions)]
}

#[test]
fn a_lidar_sweep_is_a_shell_or_with_estimated_normals_a_surface() {
    let Some(cloud) = sweep(0) else { return };
    let (sign, evidence) = decide_point_sign(&cloud, SignMode::Auto);
    println!("street_lidar 0: {} points, {sign} ({evidence})", cloud.positions.len());
    assert_eq!(sign, PointSign::Offset);
    for voxel_m in [0.1, 0.2] {
        let shell = ingest_points(&cloud, &PointIngest::new(grid(voxel_m)), sign).unwrap();
        let surface = surface(&shell);
        let [points, vertices] = coverage(&cloud, &surface, 2.5 * voxel_m);
        println!(
            "  shell at {voxel_m} m: {} blocks, {} triangles; {:.1} % of points near it, {:.1} % of it near points",
            shell.block_count(),
            surface.triangles.len(),
            100.0 * points,
            100.0 * vertices
        );
        assert!(points > 0.999 && vertices > 0.999);
    }
    let estimated = estimate_normals(&cloud).unwrap();
    let (sign, evidence) = decide_point_sign(&estimated, SignMode::Auto);
    println!("with normals estimated: {sign} ({evidence})");
    for voxel_m in [0.1, 0.2] {
        let volume =
            ingest_points(&estimated, &PointIngest::new(grid(voxel_m)), PointSign::Oriented).unwrap();
        let surface = surface(&volume);
        let [points, _] = coverage(&cloud, &surface, 1.5 * voxel_m);
        let [_, vertices] = coverage(&cloud, &surface, 3.0 * voxel_m);
        println!(
            "  surface at {voxel_m} m: {} blocks, {} triangles; {:.1} % of points within 1.5 voxels of it, {:.1} % \
             of it within 3 voxels of a point",
            volume.block_count(),
            surface.triangles.len(),
            100.0 * points,
            100.0 * vertices
        );
        keep(&format!("lidar_{}cm", 100.0 * voxel_m), &surface);
        assert!(points > 0.9 && vertices > 0.9);
    }
}

/// A lens of 75 by 75 degrees.
const LENS: Intrinsics =
    Intrinsics { width: 120, height: 120, focal: DVec2::splat(78.0), principal: DVec2::splat(59.5) };

/// The testkit's street with y up.
fn upright_street() -> TriangleMesh {
    let mut mesh = street(75.0, 0.0);
    for v in &mut mesh.vertices {
        *v = DVec3::new(v.x, v.z, -v.y);
    }
    mesh
}

/// What a scanner sees around a place, with the normals of the faces it met; ranges are noisy by a centimetre.
fn scan(mesh: &TriangleMesh, place: DVec3) -> PointCloud {
    let (mut random, bvh) = (Random::new(4), Bvh::new(mesh));
    let mut cloud = PointCloud { viewpoint: Some(place), ..PointCloud::default() };
    for turn in 0..5 {
        let towards = DVec3::new((f64::from(turn) * 1.2566).cos(), 0.0, (f64::from(turn) * 1.2566).sin());
        let image = render_depth(mesh, &LENS, &look_at(place, place + towards));
        for (pixel, depth) in
            image.depths_m().iter().enumerate().filter(|(_, depth)| **depth > 0.0 && **depth < 40.0)
        {
            let at = DVec2::new((pixel % 120) as f64, (pixel / 120) as f64);
            let p = image.pose().to_world(LENS.unproject(at, f64::from(*depth)));
            let face = bvh.closest_point(p).triangle;
            let normal = mesh.area_vector(face as usize).normalize();
            let noise = 0.01 * (0..12).map(|_| random.signed() / 2.0).sum::<f64>();
            cloud.positions.push(p + noise * (p - place).normalize());
            cloud.normals.push(if normal.dot(place - p) < 0.0 { -normal } else { normal });
        }
    }
    cloud
}

/// Share of the points whose normal is known and on the side of the given one.
fn right_sides(found: &PointCloud, given: &PointCloud) -> f64 {
    let pairs = || found.normals.iter().zip(&given.normals).filter(|(n, _)| **n != DVec3::ZERO);
    pairs().filter(|(n, m)| n.dot(**m) > 0.0).count() as f64 / pairs().count() as f64
}

/// Mean distance from points to the surface of a volume made of them, and from that surface to the scene, in metres.
fn scan_error(cloud: &PointCloud, seen: &[DVec3], scene: &Bvh) -> [f64; 2] {
    let volume = ingest_points(cloud, &PointIngest::new(grid(0.1)), PointSign::Oriented).unwrap();
    let surface = surface(&volume);
    let back: Vec<DVec3> = sample_surface(&surface, 0.1, 2).iter().map(|s| s.point).collect();
    let mean = |d: Vec<f64>| d.iter().sum::<f64>() / d.len() as f64;
    [mean(distances_to_surface(seen, &Bvh::new(&surface))), mean(distances_to_surface(&back, scene))]
}

#[test]
fn sides_of_a_scan_follow_from_the_scanners_place() {
    let mesh = upright_street();
    let (place, scene) = (DVec3::new(0.4, 1.9, 0.7), Bvh::new(&mesh));
    let given = scan(&mesh, place);
    let bare = PointCloud { normals: Vec::new(), ..given.clone() };
    let (seen, evidence) = estimate_normals_seen_from(&bare, None).unwrap();
    let share = right_sides(&seen, &given);
    println!("{} points, {:.3} % right: {evidence}", bare.positions.len(), 100.0 * share);
    // Point by point, what is seen at a grazing angle goes either way.
    let towards = |(n, p): (&DVec3, &DVec3)| if n.dot(place - p) < 0.0 { -*n } else { *n };
    let normals = seen.normals.iter().zip(&seen.positions).map(towards).collect();
    let by_point = right_sides(&PointCloud { normals, ..seen.clone() }, &given);
    println!("point by point {:.3} % right", 100.0 * by_point);
    assert!(share > by_point);
    assert!(share > 0.99 && evidence.basis == NormalSides::Viewpoint && evidence.seen > 0.99, "{evidence:?}");
    let [errors, errors_given] = [&seen, &given].map(|cloud| scan_error(cloud, &bare.positions, &scene));
    println!("errors in m, estimated {errors:?}, given {errors_given:?}");
    for (found, wanted) in errors.into_iter().zip(errors_given) {
        assert!(found < 1.25 * wanted + 0.005, "{found} m, with given normals {wanted} m");
    }
    let nowhere = PointCloud { viewpoint: None, ..bare.clone() };
    let (guessed, evidence) = estimate_normals_seen_from(&nowhere, None).unwrap();
    println!("without a place {:.1} % right: {evidence}", 100.0 * right_sides(&guessed, &given));
    assert!(!evidence.is_usable() && evidence.patches > 5 && evidence.guessed > 0.2, "{evidence:?}");
    assert!(evidence.to_string().contains("a guess for"), "{evidence}");
    // The pattern tells the place, and that another one is not it.
    let (_, evidence) = estimate_normals_seen_from(&nowhere, Some(place)).unwrap();
    assert_eq!(evidence.basis, NormalSides::Guessed(place));
    for wrong in [DVec3::new(8.0, 0.0, 8.0), DVec3::new(300.0, 0.0, 0.0)] {
        let (_, evidence) = estimate_normals_seen_from(&nowhere, Some(place + wrong)).unwrap();
        assert_eq!(evidence.basis, NormalSides::Outward, "{wrong}");
    }
}

#[test]
fn points_of_joined_scans_face_their_own_scanner() {
    let mesh = upright_street();
    let scans = [DVec3::new(0.4, 1.9, 0.7), DVec3::new(12.3, 1.9, 0.2)].map(|place| scan(&mesh, place));
    let (mut given, mut first) = (PointCloud::default(), 0);
    for scan in &scans {
        given.positions.extend(&scan.positions);
        given.normals.extend(&scan.normals);
        let end = first + scan.positions.len();
        given.scans.push(ScanPlace { points: first..end, viewpoint: scan.viewpoint.unwrap() });
        first = end;
    }
    let share = |cloud: &PointCloud| {
        let (found, evidence) = estimate_normals_seen_from(cloud, None).unwrap();
        println!("{:.3} % right: {evidence}", 100.0 * right_sides(&found, &given));
        right_sides(&found, &given)
    };
    assert!(share(&given) > 0.98);
    // One place for all is wrong for what only the other scanner saw.
    let one = PointCloud { viewpoint: scans[0].viewpoint, scans: Vec::new(), ..given.clone() };
    assert!(share(&one) < 0.95);
    // Where one of them is not known, its points go the way of those beside them.
    let half = PointCloud { scans: given.scans[..1].to_vec(), ..given.clone() };
    assert!(share(&half) > 0.8);
}

#[test]
fn bodies_and_evenly_spaced_points_are_not_taken_for_scans() {
    let Some(mesh) = support::load("thomas", 0) else { return };
    let cloud = PointCloud { normals: Vec::new(), ..points_of(&mesh) };
    let (low, high) = mesh.bounds().unwrap();
    for place in [DVec3::ZERO, (low + high) / 2.0, high + 1.0] {
        let (_, evidence) = estimate_normals_seen_from(&cloud, Some(place)).unwrap();
        assert_eq!(evidence.basis, NormalSides::Outward, "{place}");
        assert!(evidence.is_usable() && evidence.guessed < 0.01, "{evidence:?}");
    }
}

#[test]
fn a_lidar_sweep_looks_scanned_from_its_origin() {
    let Some(cloud) = sweep(0) else { return };
    let (known, evidence) = estimate_normals_seen_from(&cloud, None).unwrap();
    println!("street_lidar 0: {evidence}");
    assert!(evidence.seen > 0.99 && evidence.patches == 0, "{evidence:?}");
    let nowhere = PointCloud { viewpoint: None, ..cloud };
    let (found, evidence) = estimate_normals_seen_from(&nowhere, Some(DVec3::ZERO)).unwrap();
    assert_eq!(evidence.basis, NormalSides::Guessed(DVec3::ZERO));
    assert_eq!(found.normals, known.normals);
    let (_, evidence) = estimate_normals_seen_from(&nowhere, None).unwrap();
    println!("without a place: {evidence}");
    assert!(!evidence.is_usable(), "{evidence:?}");
}
