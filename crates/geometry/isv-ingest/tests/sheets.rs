//! Open surfaces as single sheets ([`SignDecision::Sheet`]), by the surface that is made of their volumes.

mod support;

use glam::DVec3;
use isv_ingest::{MeshIngest, MeshIngester, Reach, SignDecision, SignMode, decide_sign, ingest_mesh};
use isv_spatial::Bvh;
use isv_surface::{SurfaceOptions, extract_surface};
use isv_testkit::{Random, sheet, sphere};
use isv_volume::{BlockEdge, Grid, SparseVolume, TriangleMesh, Truncation, VoxelSize};

/// Edge of a voxel (m).
const VOXEL_M: f64 = 0.01;

fn settings(reach: Reach) -> MeshIngest {
    let voxel_size = VoxelSize::from_metres(VOXEL_M).unwrap();
    let grid = Grid { voxel_size, edge: BlockEdge::E8, truncation: Truncation::DEFAULT };
    MeshIngest { reach, ..MeshIngest::new(grid) }
}

fn volume_of(mesh: &TriangleMesh) -> SparseVolume {
    ingest_mesh(mesh, &settings(Reach::Surface), SignDecision::Sheet).unwrap()
}

fn surface_of(mesh: &TriangleMesh) -> TriangleMesh {
    extract_surface(&volume_of(mesh), &SurfaceOptions { normals: false })
}

/// A square of 2 x 2 x `half` that lies along no axis, moved.
fn tilted(half: f64, by: DVec3) -> TriangleMesh {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.31, 0.47, 0.83);
    let mut mesh = sheet(half);
    mesh.vertices.iter_mut().for_each(|vertex| *vertex = turn * (*vertex + by));
    mesh
}

/// Both meshes as one.
fn together(a: &TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let mut mesh = a.clone();
    let first = a.vertices.len() as u32;
    mesh.vertices.extend(&b.vertices);
    mesh.triangles.extend(b.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
    mesh
}

/// The longest way from a vertex of a surface to a mesh, in voxels.
fn farthest(surface: &TriangleMesh, mesh: &TriangleMesh) -> f64 {
    let bvh = Bvh::new(mesh);
    surface.vertices.iter().map(|vertex| bvh.distance(*vertex) / VOXEL_M).fold(0.0, f64::max)
}

#[test]
fn a_sheet_comes_back_once_where_it_was_and_as_large() {
    let mesh = tilted(0.4, DVec3::ZERO);
    let surface = surface_of(&mesh);
    let share = surface.area() / mesh.area();
    assert!((0.97..1.03).contains(&share), "{share} of the area");
    assert!(farthest(&surface, &mesh) < 0.8, "{} voxels", farthest(&surface, &mesh));
}

#[test]
fn faces_may_be_doubled_turned_or_split() {
    let mesh = tilted(0.4, DVec3::ZERO);
    let expected = surface_of(&mesh).area();
    let mut doubled = mesh.clone();
    doubled.triangles.extend(mesh.triangles.iter().map(|[a, b, c]| [*a, *c, *b]));
    assert_eq!(surface_of(&doubled).area(), expected);
    let mut turned = mesh.clone();
    turned.triangles[1].swap(0, 1);
    assert!((surface_of(&turned).area() / expected - 1.0).abs() < 0.01);
    let mut split = mesh.clone();
    split.vertices = (0..2).flat_map(|face| mesh.corners(face)).collect();
    split.triangles = vec![[0, 1, 2], [3, 4, 5]];
    assert_eq!(surface_of(&split).area(), expected);
}

#[test]
fn a_body_beside_a_sheet_is_as_without_it() {
    let body = sphere(0.2, 24);
    let mesh = together(&body, &tilted(0.3, DVec3::new(0.0, 0.0, 0.35)));
    let closed = SignDecision::Closed { flipped: false };
    let alone = ingest_mesh(&body, &settings(Reach::Surface), closed).unwrap();
    let both = volume_of(&mesh);
    let surface = extract_surface(&alone, &SurfaceOptions { normals: false });
    let all = extract_surface(&both, &SurfaceOptions { normals: false });
    let close = |v: &&DVec3| v.length() < 0.22;
    let [expected, found] = [&surface, &all].map(|mesh| mesh.vertices.iter().filter(close).count());
    assert_eq!(found, expected);
    let share = (all.area() - surface.area()) / tilted(0.3, DVec3::ZERO).area();
    assert!((0.96..1.04).contains(&share), "{share} of the sheet");
}

#[test]
fn nothing_is_made_up_between_sheets_that_face_one_another() {
    for gap in [4.0, 5.0, 7.0, 12.0] {
        let mut other = tilted(0.3, DVec3::new(0.0, 0.0, gap * VOXEL_M));
        let mesh = together(&tilted(0.3, DVec3::ZERO), &other);
        let surface = surface_of(&mesh);
        assert!(farthest(&surface, &mesh) < 0.9, "{gap} voxels apart: {}", farthest(&surface, &mesh));
        assert!((0.96..1.04).contains(&(surface.area() / mesh.area())), "{gap} voxels apart");
        // Facing away from one another as well.
        other.triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        let mesh = together(&tilted(0.3, DVec3::ZERO), &other);
        let surface = surface_of(&mesh);
        assert!(farthest(&surface, &mesh) < 0.9, "{gap} voxels, contrary: {}", farthest(&surface, &mesh));
    }
}

#[test]
fn the_whole_band_holds_the_same_surface() {
    let mesh = tilted(0.2, DVec3::ZERO);
    let whole = ingest_mesh(&mesh, &settings(Reach::Band), SignDecision::Sheet).unwrap();
    let surface = extract_surface(&whole, &SurfaceOptions { normals: false });
    assert!((surface.area() / surface_of(&mesh).area() - 1.0).abs() < 0.01);
    assert!(whole.block_count() > volume_of(&mesh).block_count());
}

#[test]
fn closed_surfaces_are_as_by_winding_number() {
    let mesh = sphere(0.3, 24);
    let closed = SignDecision::Closed { flipped: false };
    assert_eq!(volume_of(&mesh), ingest_mesh(&mesh, &settings(Reach::Surface), closed).unwrap());
}

/// Slivers, doubles, fans and triangles of several sizes, in sequences of which some stays: the first frame is as by itself, or an error.
#[test]
fn any_triangles_make_a_volume() {
    let mut random = Random::new(77);
    for round in 0..24 {
        let mut mesh = TriangleMesh::default();
        let scale = 10f64.powi(round % 4 - 4);
        for _ in 0..30 {
            let place = random.point();
            mesh.vertices.push(if round % 3 == 0 { (place * 4.0).round() / 20.0 } else { scale * place });
        }
        for _ in 0..40 {
            mesh.triangles.push(std::array::from_fn(|_| (random.signed().abs() * 30.0) as u32 % 30));
        }
        for reach in [Reach::Surface, Reach::Band] {
            let mut ingester = MeshIngester::new(settings(reach));
            for frame in 0..3 {
                let volume = ingester.ingest(&mesh, SignDecision::Sheet);
                let alone = ingest_mesh(&mesh, &settings(reach), SignDecision::Sheet);
                if frame == 0 {
                    assert_eq!(volume.is_ok(), alone.is_ok(), "{round}");
                }
                if let (Ok(volume), Ok(alone)) = (&volume, &alone) {
                    assert!(frame > 0 || volume == alone, "{round}");
                    assert!(volume.unobserved_masks().values().all(|mask| !mask.is_empty()));
                }
                mesh.vertices[frame] *= 1.01;
            }
        }
    }
}

#[test]
fn flags_and_buildings_come_back_as_sheets() {
    for (name, voxel_m, most, area) in
        [("flag", 0.005, 0.1, 0.97..1.02), ("monastery", 0.05, 0.3, 0.85..1.05)]
    {
        let Some(mesh) = support::load(name, 0) else { return };
        let voxel_size = VoxelSize::from_metres(voxel_m).unwrap();
        let grid = Grid { voxel_size, ..settings(Reach::Surface).grid };
        let settings = MeshIngest { reach: Reach::Surface, ..MeshIngest::new(grid) };
        let (decision, _) = decide_sign(&mesh, SignMode::Sheet);
        let volume = ingest_mesh(&mesh, &settings, decision).unwrap();
        let surface = extract_surface(&volume, &SurfaceOptions { normals: false });
        let bvh = Bvh::new(&surface);
        let middles = (0..mesh.triangles.len()).map(|face| mesh.corners(face).iter().sum::<DVec3>() / 3.0);
        let apart: Vec<f64> = middles.map(|middle| bvh.distance(middle) / voxel_m).collect();
        let mean = apart.iter().sum::<f64>() / apart.len() as f64;
        let share = surface.area() / mesh.area();
        println!("{name}: {mean:.3} voxels from the middles of faces, {share:.3} of the area");
        assert!(mean < most && area.contains(&share), "{name}: {mean} voxels, {share} of the area");
    }
}
