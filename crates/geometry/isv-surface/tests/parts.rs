//! A surface in parts against the surface of the whole, while blocks come, change and go.

mod volumes;

use glam::DVec3;
use isv_surface::{PartChanges, SurfaceOptions, SurfaceParts, extract_surface};
use isv_volume::{BlockCoord, BlockOrigin, SparseVolume, TriangleMesh, VolumeBuilder, VoxelMask};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use volumes::{cube, grid, sample};

const WITH_NORMALS: SurfaceOptions = SurfaceOptions { normals: true };

/// Random numbers, the same for a seed.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    /// Noise of both signs, or a block of one, some of it unobserved.
    fn block(&mut self, edge: u32) -> (Vec<i16>, Option<VoxelMask>) {
        let (inside_percent, hidden_percent) =
            ([0, 5, 50, 100][self.below(4) as usize], [0, 0, 3][self.below(3) as usize]);
        let count = edge.pow(3) as usize;
        let samples = (0..count).map(|_| {
            let magnitude = 1 + self.below(900) as i16;
            if self.below(100) < inside_percent { -magnitude } else { magnitude }
        });
        let samples = samples.collect();
        let mut mask = VoxelMask::empty(grid(edge).edge);
        (0..count).filter(|_| self.below(100) < hidden_percent).for_each(|voxel| mask.insert(voxel));
        (samples, Some(mask).filter(|mask| !mask.is_empty()))
    }
}

type Blocks = BTreeMap<u64, (BlockCoord, Vec<i16>, Option<VoxelMask>)>;

/// The volume of some blocks. Those that `before` has as they are share its memory.
fn volume_of(blocks: &Blocks, edge: u32, before: &SparseVolume) -> SparseVolume {
    let index = before.index();
    let (mut fresh, mut origins, mut masks) = (Vec::new(), Vec::new(), BTreeMap::new());
    let voxels = edge.pow(3) as usize;
    for (at, (coord, samples, mask)) in blocks.values().enumerate() {
        let same = index.get(*coord).filter(|block| before.block(*block as usize) == samples);
        origins.push(same.map_or(BlockOrigin::Fresh((fresh.len() / voxels) as u32), BlockOrigin::Kept));
        if same.is_none() {
            fresh.extend_from_slice(samples);
        }
        masks.extend(mask.clone().map(|mask| (at as u32, mask)));
    }
    before.succeed(blocks.values().map(|(coord, ..)| *coord).collect(), &origins, fresh, masks)
}

/// The corners of all triangles, in order, with their normals.
fn corners<'a>(meshes: impl Iterator<Item = &'a TriangleMesh>) -> Vec<[(DVec3, DVec3); 3]> {
    let of_mesh = |mesh: &TriangleMesh| {
        let corner = |v: u32| (mesh.vertices[v as usize], mesh.normals[v as usize]);
        mesh.triangles.iter().map(|triangle| triangle.map(corner)).collect::<Vec<_>>()
    };
    meshes.flat_map(of_mesh).collect()
}

fn meshes(parts: &SurfaceParts) -> Vec<(BlockCoord, Arc<TriangleMesh>)> {
    parts.iter().map(|(corner, mesh)| (corner, Arc::clone(mesh))).collect()
}

/// Every vertex has a triangle, and no vertex is twice in a part.
fn check_part(mesh: &TriangleMesh) {
    let mut used = vec![false; mesh.vertices.len()];
    mesh.triangles.as_flattened().iter().for_each(|vertex| used[*vertex as usize] = true);
    assert!(!used.is_empty() && used.iter().all(|used| *used));
    let mut places: Vec<_> = mesh.vertices.iter().map(|v| v.to_array().map(f64::to_bits)).collect();
    places.sort_unstable();
    assert!(places.windows(2).all(|pair| pair[0] != pair[1]));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn parts_are_the_whole_surface_whatever_changes(seed: u64, edge in prop::sample::select(&[4, 8][..])) {
        let mut random = Random(seed);
        let all: Vec<_> = cube(-3..4).collect();
        let mut blocks = Blocks::new();
        let mut volume = SparseVolume::empty(grid(edge));
        let mut parts = SurfaceParts::new(WITH_NORMALS);
        for step in 0..5 {
            // Half of all at first, then a few that come, change or go.
            for _ in 0..if step == 0 { all.len() } else { random.below(6) as usize } {
                let coord = all[random.below(all.len() as u64) as usize];
                match random.below(3) {
                    0 => drop(blocks.remove(&coord.morton().0)),
                    _ => {
                        let (samples, mask) = random.block(edge);
                        blocks.insert(coord.morton().0, (coord, samples, mask));
                    }
                }
            }
            let before = meshes(&parts);
            volume = volume_of(&blocks, edge, &volume);
            let changes = parts.update(&volume);
            let whole = extract_surface(&volume, &WITH_NORMALS);
            prop_assert!(corners(parts.iter().map(|(_, mesh)| &**mesh)) == corners([&whole].into_iter()));
            parts.iter().for_each(|(_, mesh)| check_part(mesh));
            let mut anew = SurfaceParts::new(WITH_NORMALS);
            anew.update(&volume);
            prop_assert!(meshes(&parts) == meshes(&anew));
            // What is not said to have changed is what it was, in the same memory.
            let after = meshes(&parts);
            let lookup: BTreeMap<_, _> = after.iter().map(|(corner, mesh)| (corner.morton().0, mesh)).collect();
            for (corner, mesh) in &before {
                match lookup.get(&corner.morton().0) {
                    None => prop_assert!(changes.removed.contains(corner)),
                    Some(now) => prop_assert!(Arc::ptr_eq(now, mesh) != changes.changed.contains(corner)),
                }
            }
        }
        prop_assert_eq!(parts.update(&volume), Default::default());
    }
}

#[test]
fn a_surface_that_is_too_large_leaves_the_parts_as_they_were() {
    let sphere = |x: f64| sample(grid(8), 0.4, move |p| p.distance(DVec3::new(x, 0.0, 0.0)) - 0.2);
    let mut parts = SurfaceParts::new(SurfaceOptions::default());
    parts.update(&sphere(0.0));
    let before = meshes(&parts);
    let vertices: usize = before.iter().map(|(_, mesh)| mesh.vertices.len()).sum();
    let error = parts.update_within(&sphere(0.05), vertices / 2).unwrap_err();
    assert_eq!(error.limit, vertices / 2);
    assert!(meshes(&parts) == before);
    parts.update_within(&sphere(0.05), 2 * vertices).unwrap();
    assert!(meshes(&parts) != before);
}

#[test]
fn another_grid_changes_everything() {
    let block = |edge: u32, coord: [i32; 3]| {
        let mut builder = VolumeBuilder::new(grid(edge));
        let mut samples = vec![200; edge.pow(3) as usize];
        samples[grid(edge).edge.voxel_index(1, 1, 1)] = -200;
        builder.push(coord.into(), samples, None);
        builder.finish()
    };
    let mut parts = SurfaceParts::new(SurfaceOptions::default());
    parts.update(&block(8, [0, 0, 0]));
    let changes = parts.update(&block(4, [5, 0, 0]));
    assert_eq!((changes.changed, changes.removed), (vec![[4, 0, 0].into()], vec![[0, 0, 0].into()]));
    assert!(parts.part([6, 1, 2].into()).is_some() && parts.part([0, 0, 0].into()).is_none());
    let changes = parts.update(&SparseVolume::empty(grid(4)));
    assert_eq!((changes.changed, changes.removed), (vec![], vec![[4, 0, 0].into()]));
    assert_eq!(parts.iter().count(), 0);
}

#[test]
fn more_parts_than_are_extracted_at_once_are_the_whole_surface() {
    let mut builder = VolumeBuilder::new(grid(4));
    let mut random = Random(1);
    // A wall of 40 x 40 parts.
    let places = (0..160).flat_map(|y| (0..160).map(move |x| BlockCoord::from([x, y, 0])));
    let mut places: Vec<_> = places.filter(|_| random.below(3) == 0).collect();
    places.sort_unstable_by_key(|coord| coord.morton());
    for coord in places {
        let (samples, mask) = random.block(4);
        builder.push(coord, samples, mask);
    }
    let volume = builder.finish();
    let mut parts = SurfaceParts::new(WITH_NORMALS);
    let changes = parts.update(&volume);
    assert!(changes.changed.len() > 1200, "{} parts", changes.changed.len());
    let whole = extract_surface(&volume, &WITH_NORMALS);
    assert!(corners(parts.iter().map(|(_, mesh)| &**mesh)) == corners([&whole].into_iter()));
    let limit = whole.vertices.len() - 1;
    let error = SurfaceParts::new(WITH_NORMALS).update_within(&volume, limit).unwrap_err();
    assert!(error.vertices > limit && error.limit == limit, "{error}");
}

#[test]
fn parts_can_be_handed_over() {
    let sphere = |x: f64| sample(grid(8), 0.4, move |p| p.distance(DVec3::new(x, 0.0, 0.0)) - 0.2);
    let (mut kept, mut given) = [(); 2].map(|()| SurfaceParts::new(SurfaceOptions::default())).into();
    let mut theirs: BTreeMap<u64, TriangleMesh> = BTreeMap::new();
    for x in [0.0, 0.02, 0.02, 0.3] {
        let PartChanges { changed, removed } = kept.update(&sphere(x));
        let mut places = Vec::new();
        let gone = given.hand_over(&sphere(x), usize::MAX, |place, mesh| {
            places.push(place);
            theirs.insert(place.morton().0, mesh);
        });
        assert!(gone.as_ref() == Ok(&removed) && places == changed);
        removed.iter().for_each(|place| drop(theirs.remove(&place.morton().0)));
        assert!(theirs.values().eq(kept.iter().map(|(_, mesh)| &**mesh)));
        assert!(given.iter().map(|(place, _)| place).eq(kept.iter().map(|(place, _)| place)));
        assert!(given.iter().all(|(_, mesh)| mesh.triangles.is_empty()));
    }
    // Vertices that are kept elsewhere count. After an error all parts are new.
    let vertices: usize = theirs.values().map(|mesh| mesh.vertices.len()).sum();
    assert_eq!(given.hand_over(&sphere(0.3), 0, |_, _| {}), Ok(vec![]));
    assert!(given.hand_over(&sphere(0.31), vertices / 2, |_, _| {}).is_err());
    let mut count = 0;
    given.hand_over(&sphere(0.3), vertices, |_, _| count += 1).unwrap();
    assert_eq!(count, kept.iter().count());
}
