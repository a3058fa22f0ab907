//! OpenVDB files, read back by a parser of what the format documents, and by OpenVDB where Python has it.

use isv_io::{write_vdb, write_volume};
use isv_testkit::{Need, skip};
use isv_volume::{BlockEdge, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelMask, VoxelSize};
use std::collections::BTreeMap;
use std::process::Command;

/// A ball of 17.3 voxels around (1.5, -2, 3), in blocks of an edge; voxels below y = -12 were not observed.
fn ball(edge: u32) -> SparseVolume {
    let grid = Grid {
        voxel_size: VoxelSize::from_metres(0.01).unwrap(),
        edge: BlockEdge::from_voxels(edge).unwrap(),
        truncation: Truncation::from_voxels(3).unwrap(),
    };
    let (n, reach) = (edge as i32, 32 / edge as i32);
    let mut builder = VolumeBuilder::new(grid);
    for block in 0..(2 * reach).pow(3) {
        let coord = [0, 1, 2].map(|axis| block / (2 * reach).pow(axis) % (2 * reach) - reach);
        let mut mask = VoxelMask::empty(grid.edge);
        let mut samples = Vec::new();
        for voxel in 0..n.pow(3) {
            let at = [voxel % n, voxel / n % n, voxel / n / n];
            let p: [f64; 3] = std::array::from_fn(|a| f64::from(coord[a] * n + at[a]) + 0.5);
            let d = [p[0] - 1.5, p[1] + 2.0, p[2] - 3.0];
            let distance = d.iter().map(|v| v * v).sum::<f64>().sqrt() - 17.3;
            samples.push((256.0 * distance.clamp(-3.0, 3.0)).round() as i16);
            if p[1] < -12.0 {
                mask.insert(voxel as usize);
            }
        }
        if samples.iter().any(|s| s.abs() < 768) {
            builder.push(coord.into(), samples, Some(mask));
        }
    }
    builder.finish()
}

/// What a file holds.
struct Level {
    background: f32,
    /// Translation, scale, voxel size and the library's other numbers.
    transform: Vec<f64>,
    voxels: BTreeMap<[i32; 3], (f32, bool)>,
    /// Whether a place of 8^3 voxels without a leaf is inside, by first voxel, in the nodes of 16^3 that are there.
    tiles: BTreeMap<[i32; 3], bool>,
}

impl Level {
    fn faces_inactive_of_other_side(&self, at: [i32; 3]) -> bool {
        let value = self.voxels[&at].0;
        (0..6).any(|face| {
            let mut other = at;
            other[face / 2] += if face % 2 == 0 { -1 } else { 1 };
            self.voxels.get(&other).is_some_and(|(other, on)| !on && (*other < 0.0) != (value < 0.0))
        })
    }
}

/// The bytes that are left.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(count);
        self.0 = rest;
        taken
    }

    fn array<const N: usize>(&mut self) -> [u8; N] {
        self.take(N).try_into().unwrap()
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    fn position(&mut self) -> usize {
        u64::from_le_bytes(self.array()) as usize
    }

    fn f32(&mut self) -> f32 {
        f32::from_le_bytes(self.array())
    }

    fn text(&mut self) -> &'a str {
        let length = self.u32() as usize;
        std::str::from_utf8(self.take(length)).unwrap()
    }

    /// The places whose bits are set.
    fn mask(&mut self, places: usize) -> Vec<bool> {
        let bytes = self.take(places / 8);
        (0..places).map(|place| bytes[place / 8] >> (place % 8) & 1 != 0).collect()
    }

    /// A node's children, and which of its tiles are outside.
    fn node(&mut self, places: usize) -> (Vec<bool>, Vec<bool>) {
        let children = self.mask(places);
        assert!(!self.mask(places).contains(&true), "no active tile");
        assert_eq!(self.take(1), [3], "tiles are the background by a mask");
        (children, self.mask(places))
    }
}

/// Place number in a node of `side^3`, z fastest, to the first voxel of the child there.
fn first_voxel(origin: [i32; 3], place: usize, side: usize, child: i32) -> [i32; 3] {
    let at = [place / side / side, place / side % side, place % side];
    std::array::from_fn(|axis| origin[axis] + at[axis] as i32 * child)
}

fn set(bits: &[bool]) -> impl Iterator<Item = usize> {
    bits.iter().enumerate().filter(|(_, bit)| **bit).map(|(place, _)| place)
}

fn parse(file: &[u8]) -> Level {
    let mut bytes = Bytes(file);
    assert_eq!(bytes.take(8), b" BDV\0\0\0\0");
    assert_eq!([bytes.u32(), bytes.u32(), bytes.u32()], [224, 10, 0]);
    assert_eq!(bytes.take(1), [1]);
    assert_eq!(bytes.take(36).iter().filter(|b| **b == b'-').count(), 4);
    assert_eq!(bytes.u32(), 1, "metadata of the file");
    assert_eq!([bytes.text(), bytes.text(), bytes.text()], ["creator", "string", "made by isv"]);
    assert_eq!(bytes.u32(), 1, "grids");
    assert_eq!([bytes.text(), bytes.text(), bytes.text()], ["tsdf", "Tree_float_5_4_3", ""]);
    let [grid_at, values_at, end] = [0; 3].map(|_| bytes.position());
    assert_eq!((grid_at, end), (file.len() - bytes.0.len(), file.len()));
    assert_eq!(bytes.u32(), 2, "compression flags");
    let metadata: Vec<_> = (0..bytes.u32()).map(|_| [bytes.text(), bytes.text(), bytes.text()]).collect();
    assert!(metadata.contains(&["class", "string", "level set"]));
    assert_eq!(bytes.text(), "UniformScaleTranslateMap");
    let transform = (0..18).map(|_| f64::from_le_bytes(bytes.array())).collect();
    assert_eq!(bytes.u32(), 1, "buffers a leaf");
    let background = bytes.f32();
    assert_eq!(bytes.u32(), 0, "tiles of the root");
    let (mut leaves, mut tiles) = (Vec::new(), BTreeMap::new());
    for _ in 0..bytes.u32() {
        let upper = [0; 3].map(|_| bytes.u32() as i32);
        for lower in set(&bytes.node(1 << 15).0) {
            let lower = first_voxel(upper, lower, 32, 128);
            let (children, outside) = bytes.node(1 << 12);
            for leaf in set(&children) {
                leaves.push((first_voxel(lower, leaf, 16, 8), bytes.mask(512)));
            }
            for place in (0..1 << 12).filter(|place| !children[*place]) {
                tiles.insert(first_voxel(lower, place, 16, 8), !outside[place]);
            }
        }
    }
    assert_eq!(values_at, file.len() - bytes.0.len());
    let mut voxels = BTreeMap::new();
    for (origin, active) in leaves {
        assert_eq!(bytes.mask(512), active);
        assert_eq!(bytes.take(1), [6], "all values");
        for (voxel, active) in active.into_iter().enumerate() {
            voxels.insert(first_voxel(origin, voxel, 8, 1), (bytes.f32(), active));
        }
    }
    assert!(bytes.0.is_empty());
    Level { background, transform, voxels, tiles }
}

fn written(volume: &SparseVolume) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.vdb");
    write_vdb(&path, volume).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn every_voxel_is_where_it_was() {
    for edge in [4, 8, 16] {
        let volume = ball(edge);
        let level = parse(&written(&volume));
        assert_eq!(level.background, 0.03);
        let numbers = [0.005, 0.01, 0.01, 100.0, 10_000.0, 50.0];
        for (number, found) in numbers.iter().flat_map(|n| [n; 3]).zip(&level.transform) {
            assert!((found / number - 1.0).abs() < 1e-12);
        }
        let n = edge as usize;
        let mut active = 0;
        for (block, coord) in volume.coords().iter().enumerate() {
            for (voxel, code) in volume.block(block).iter().enumerate() {
                let local = [voxel % n, voxel / n % n, voxel / n / n];
                let at = std::array::from_fn(|a| coord.to_array()[a] * edge as i32 + local[a] as i32);
                let observed = volume.unobserved(block).is_none_or(|mask| !mask.contains(voxel));
                let (value, on) = level.voxels[&at];
                if observed && code.abs() < 768 {
                    assert_eq!(value, (f64::from(*code) / 256.0 * 0.01) as f32, "{at:?}");
                    // One that faces an inactive voxel on the other side is inactive itself, as no surface is there.
                    assert!(on || level.faces_inactive_of_other_side(at), "{at:?}");
                    active += usize::from(on);
                } else {
                    assert!(!on && value.abs() == 0.03, "{at:?}");
                    assert!(!observed || (value < 0.0) == (*code < 0), "{at:?}");
                }
            }
        }
        assert_eq!(level.voxels.values().filter(|(_, on)| *on).count(), active);
    }
}

/// A ball that is open below: an edge on which tools see surface, as one of its ends is active, has been observed at both.
#[test]
fn no_wall_stands_where_nothing_was_observed() {
    for edge in [4, 8, 16] {
        let volume = ball(edge);
        let level = parse(&written(&volume));
        let index = volume.index();
        let is_observed = |at: &[i32; 3]| {
            let side = edge as i32;
            let Some(block) = index.get(at.map(|v| v.div_euclid(side)).into()) else { return false };
            let [x, y, z] = at.map(|v| v.rem_euclid(side) as usize);
            let voxel = volume.grid().edge.voxel_index(x, y, z);
            volume.unobserved(block as usize).is_none_or(|mask| !mask.contains(voxel))
        };
        let mut surface = 0;
        for (at, (value, on)) in &level.voxels {
            for axis in 0..3 {
                let mut next = *at;
                next[axis] += 1;
                let Some((other, other_on)) = level.voxels.get(&next) else { continue };
                if (*value < 0.0) != (*other < 0.0) && (*on || *other_on) {
                    assert!(
                        is_observed(at) && is_observed(&next),
                        "{at:?}: {value} {on}, {other} {other_on}"
                    );
                    surface += 1;
                }
            }
        }
        assert!(surface > 1000, "{surface}");
    }
}

#[test]
fn places_without_blocks_are_inside_where_the_ball_is() {
    for edge in [4, 8, 16] {
        let level = parse(&written(&ball(edge)));
        let distance = |at: &[i32; 3], by: f64| {
            let centre = [1.5, -2.0, 3.0];
            let squares = (0..3).map(|a| (f64::from(at[a]) + by - centre[a]).powi(2));
            squares.sum::<f64>().sqrt() - 17.3
        };
        // Every block of 16 reaches into the band.
        assert!(edge == 16 || level.tiles.values().any(|inside| *inside));
        for (first, inside) in &level.tiles {
            assert_eq!(*inside, distance(first, 4.0) < 0.0, "{first:?}");
        }
        for (at, (value, _)) in &level.voxels {
            let distance = distance(at, 0.5);
            assert!(distance.abs() < 0.01 || (*value < 0.0) == (distance < 0.0), "{at:?}");
        }
    }
}

#[test]
fn a_volume_without_blocks_is_a_file_as_well() {
    let level = parse(&written(&SparseVolume::empty(*ball(8).grid())));
    assert!(level.voxels.is_empty() && level.tiles.is_empty());
}

/// OpenVDB reads the same values, active voxels, class and transform.
#[test]
fn openvdb_agrees() {
    let python = std::env::var_os("ISV_PYTHON_OPENVDB").unwrap_or_else(|| "python3".into());
    let has = |module| Command::new(&python).args(["-c", module]).output().is_ok_and(|o| o.status.success());
    if !has("import numpy, pyopenvdb") {
        let python = python.display();
        let why = format_args!("{python} has no numpy and pyopenvdb; ISV_PYTHON_OPENVDB names another");
        return skip(Need::OpenVdb, why);
    }
    for edge in [4, 8, 16] {
        let folder = tempfile::tempdir().unwrap();
        write_vdb(&folder.path().join("frame.vdb"), &ball(edge)).unwrap();
        write_volume(&folder.path().join("frame"), &ball(edge)).unwrap();
        let output = Command::new(&python).args(["-c", COMPARE]).current_dir(folder.path()).output().unwrap();
        print!("edge {edge}: {}", String::from_utf8_lossy(&output.stdout));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Compares `frame.vdb` with the arrays of `frame`.
const COMPARE: &str = r#"
import numpy as np, pyopenvdb as vdb
assert vdb.readMetadata("frame.vdb") == {"creator": "made by isv"}
grid = vdb.read("frame.vdb", "tsdf")
coords, tsdf, weight = (np.load(f"frame/{name}.npy") for name in ("coords", "tsdf", "weight"))
edge, truncation = tsdf.shape[1], 0.03
assert grid.gridClass == vdb.GridClass.LEVEL_SET
assert np.isclose(grid.background, truncation)
assert np.allclose(grid.transform.voxelSize(), 0.01)
assert np.allclose(grid.transform.indexToWorld((0, 0, 0)), 0.005)
assert np.allclose(grid.transform.indexToWorld((-3, 5, 7)), (-0.025, 0.055, 0.075))
values = grid.getConstAccessor()
active = 0
for block in range(len(coords)):
    for z, y, x in np.ndindex(edge, edge, edge):
        value, on = values.probeValue(tuple(int(c) for c in coords[block] * edge + (x, y, z)))
        expected = weight[block, z, y, x] > 0 and abs(tsdf[block, z, y, x]) < 1
        assert expected or not on
        assert not on or abs(value - truncation * tsdf[block, z, y, x]) < 1e-7
        active += on
assert grid.activeVoxelCount() == active
centre = (1, -2, 3)
assert grid.getConstAccessor().getValue(centre) < 0, "the middle is inside"
points, quads = grid.convertToQuads()
off = abs(np.linalg.norm(points - (0.015, -0.02, 0.03), axis=1) - 0.173)
assert off[points[:, 1] > -0.11].max() < 0.001, "OpenVDB's own surface lies where the ball is"
assert off.max() < 0.02, f"a wall {off.max()} m off, where nothing was observed"
print(f"{active} active voxels equal, OpenVDB's surface has {len(points)} vertices")
"#;
