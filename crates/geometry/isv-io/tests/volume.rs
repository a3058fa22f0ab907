//! Volumes as NumPy arrays: against bytes written here, against NumPy itself, and there and back.

use isv_io::{
    ArrayFlaw, VolumeError, VolumeSequence, is_volume_folder, read_volume, volume_grid, write_volume,
};
use isv_testfiles::npy::{self, bytes_of, coords, ramp, tsdf};
use isv_testkit::{Need, skip};
use isv_volume::{
    BlockCoord, BlockEdge, Grid, SparseVolume, Truncation, VolumeBuilder, VoxelMask, VoxelSize,
};
use std::path::{Path, PathBuf};
use std::process::Command;

fn grid(edge: u32, truncation: u32) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::from_voxels(edge).unwrap(),
        truncation: Truncation::from_voxels(truncation).unwrap(),
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        files.iter().for_each(|(name, bytes)| folder.write(name, bytes));
        folder
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path().join(name), bytes).unwrap();
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn flaw(&self) -> ArrayFlaw {
        match read_volume(self.path(), &grid(4, 8)) {
            Err(VolumeError::Array { why, .. }) => why,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn bytes_become_codes_in_morton_order_with_x_fastest() {
    let (far, near) = ([1, 0, 0], [-1, 2, 5]);
    let folder = Folder::new(&[("coords.npy", &coords(&[far, near])), ("tsdf.npy", &tsdf(&ramp(2)))]);
    let volume = read_volume(folder.path(), &grid(4, 8)).unwrap();
    assert_eq!(volume.coords(), [near, far].map(BlockCoord::from));
    // The second row of the file: -1/2 and up in steps of 1/128 of eight voxels.
    let expected: Vec<i16> = (0..64).map(|i| -1024 + 16 * i).collect();
    assert_eq!(volume.block(0), expected);
    assert_eq!(volume.block(0)[volume.grid().edge.voxel_index(1, 0, 0)], -1024 + 16);
    assert_eq!(volume.block(1)[0], -2048);
    assert!(volume.unobserved_masks().is_empty());
}

#[test]
fn units_truncations_and_types_mean_the_same_distances() {
    let one_block = coords(&[[0, 0, 0]]);
    let read = |descr: &str, data: Vec<u8>, json: &str, truncation| {
        let data = npy::file(descr, "(1, 4, 4, 4, 1)", &data);
        let folder =
            Folder::new(&[("coords.npy", &one_block), ("tsdf.npy", &data), ("grid.json", json.as_bytes())]);
        read_volume(folder.path(), &grid(4, truncation)).unwrap().block(0).to_vec()
    };
    // Distances of -1 voxel to 1 voxel.
    let voxels: Vec<f64> = (0..64).map(|i| f64::from(i - 32) / 32.0).collect();
    let scaled = |scale: f64| voxels.iter().map(move |v| v * scale);
    let expected: Vec<i16> = (0..64).map(|i| 8 * (i - 32)).collect();
    let metres = bytes_of(scaled(0.005), f64::to_le_bytes);
    assert_eq!(read("<f8", metres, r#"{"tsdf_unit": "m", "voxel_size_m": 0.005}"#, 8), expected);
    let big_endian = bytes_of(scaled(1.0).map(|v| v as f32), f32::to_be_bytes);
    assert_eq!(read(">f4", big_endian, r#"{"tsdf_unit": "voxel", "comment": [1]}"#, 4), expected);
    let of_four = bytes_of(scaled(0.25), f64::to_le_bytes);
    assert_eq!(read("<f8", of_four, r#"{"truncation_m": 0.02}"#, 16), expected);
    // Without a file the truncation is the grid's; half a voxel is 0x3c00 / 16 there.
    let halves = bytes_of(std::iter::repeat_n(0x2c00u16, 64), u16::to_le_bytes);
    assert_eq!(read("<f2", halves, "{}", 8), [128; 64]);
    let beyond = bytes_of(std::iter::repeat_n(f32::NEG_INFINITY, 64), f32::to_le_bytes);
    assert_eq!(read("<f4", beyond, "{}", 8), [-2048; 64], "what is beyond the truncation is clamped");
}

#[test]
fn weights_of_zero_and_nan_are_unobserved() {
    let mut values = ramp(3);
    values[7] = f32::NAN;
    values[128..].fill(f32::NAN);
    let mut weights = vec![1u8; 192];
    weights[64 + 9] = 0;
    let folder = Folder::new(&[
        ("coords.npy", &coords(&[[0, 0, 0], [1, 0, 0], [2, 0, 0]])),
        ("tsdf.npy", &tsdf(&values)),
        ("weight.npy", &npy::file("|u1", "(3, 4, 4, 4)", &weights)),
    ]);
    let volume = read_volume(folder.path(), &grid(4, 8)).unwrap();
    assert_eq!(volume.block_count(), 2, "the block that nobody saw is left out");
    for (block, voxel) in [(0, 7), (1, 9)] {
        let mask = volume.unobserved(block).unwrap();
        assert!(mask.contains(voxel) && mask.count() == 1);
        let neighbours = [voxel - 4, voxel + 4, voxel + 16].map(|v| volume.block(block)[v]);
        let filled = volume.block(block)[voxel];
        assert!(filled >= *neighbours.iter().min().unwrap() && filled <= *neighbours.iter().max().unwrap());
    }
}

#[test]
fn a_volume_comes_back_from_its_files() {
    for edge in [4, 8, 16] {
        let grid = grid(edge, 7);
        let mut builder = VolumeBuilder::new(grid);
        for (i, coord) in [[3, -2, 0], [0, 0, 0], [-5, 1, 9]].into_iter().enumerate() {
            let samples = (0..grid.edge.block_voxels()).map(|v| (v * (i + 3)) as i16 % 1793).collect();
            let mut mask = VoxelMask::empty(grid.edge);
            (0..i).for_each(|voxel| mask.insert(13 * voxel));
            builder.push(coord.into(), samples, Some(mask));
        }
        let volume = builder.finish();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frame_0");
        write_volume(&path, &volume).unwrap();
        assert_eq!(volume_grid(&path, None, None).unwrap(), grid);
        assert_same_where_observed(&read_volume(&path, &grid).unwrap(), &volume);
    }
}

fn assert_same_where_observed(a: &SparseVolume, b: &SparseVolume) {
    assert_eq!((a.grid(), a.coords()), (b.grid(), b.coords()));
    assert_eq!(a.unobserved_masks(), b.unobserved_masks());
    for block in 0..a.block_count() {
        for (voxel, pair) in a.block(block).iter().zip(b.block(block)).enumerate() {
            assert!(pair.0 == pair.1 || a.unobserved(block).is_some_and(|mask| mask.contains(voxel)));
        }
    }
}

#[test]
fn grids_come_from_the_file_or_the_caller() {
    let folder = Folder::new(&[("coords.npy", &coords(&[[0, 0, 0]])), ("tsdf.npy", &tsdf(&ramp(1)))]);
    let missing = volume_grid(folder.path(), None, None).unwrap_err();
    assert!(matches!(missing, VolumeError::NoVoxelSize { .. }), "{missing}");
    let size = VoxelSize::from_metres(0.005).unwrap();
    assert_eq!(volume_grid(folder.path(), Some(size), None).unwrap(), grid(4, 8));
    folder.write("grid.json", br#"{"voxel_size_m": 0.005, "truncation_m": 0.0301}"#);
    assert_eq!(volume_grid(folder.path(), None, None).unwrap(), grid(4, 7), "rounded up");
    assert_eq!(volume_grid(folder.path(), None, Truncation::from_voxels(3).ok()).unwrap(), grid(4, 3));
    folder.write("grid.json", br#"{"voxel_size_m": 0.004}"#);
    let other = read_volume(folder.path(), &grid(4, 8)).unwrap_err();
    assert!(
        other.to_string().contains("the voxel size is 0.004 m, but the grid asked for has 0.005 m"),
        "{other}"
    );
    let other = read_volume(folder.path(), &grid(8, 8)).unwrap_err();
    assert!(other.to_string().contains("the block edge is 4, but the grid asked for has 8"), "{other}");
}

#[test]
fn what_does_not_fit_is_one_sentence() {
    let good = (coords(&[[0, 0, 0], [1, 0, 0]]), tsdf(&ramp(2)));
    let folder = Folder::new(&[("coords.npy", &good.0), ("tsdf.npy", &good.1)]);
    let message = || read_volume(folder.path(), &grid(4, 8)).unwrap_err().to_string();

    folder.write("coords.npy", &coords(&[[7, -1, 2], [7, -1, 2]]));
    assert!(message().ends_with("coords.npy: blocks 0 and 1 both lie at [7, -1, 2]"), "{}", message());
    folder.write("coords.npy", &coords(&[[0, 0, 0], [0, 1 << 20, 0]]));
    assert!(message().contains("block 1 lies at [0, 1048576, 0]"), "{}", message());
    folder.write(
        "coords.npy",
        &npy::file("<i8", "(2, 3)", &bytes_of([0, 0, 0, i64::MIN, 1, 1], i64::to_le_bytes)),
    );
    assert!(message().contains("block 1 lies at"), "{}", message());
    folder.write("coords.npy", &coords(&[[0, 0, 0]]));
    assert!(matches!(folder.flaw(), ArrayFlaw::Shape { .. }), "{}", message());
    folder.write("coords.npy", &good.0);

    folder.write("tsdf.npy", &npy::file("<f4", "(1, 4, 4, 8)", &[0; 512]));
    assert!(
        message().contains("the shape is [1, 4, 4, 8], it must be (n, edge, edge, edge)"),
        "{}",
        message()
    );
    folder.write("tsdf.npy", &npy::file("<f4", "(1000000000000, 4, 4, 4)", &[0; 512]));
    assert!(matches!(folder.flaw(), ArrayFlaw::Length { found: 512, .. }), "{}", message());
    folder.write("tsdf.npy", &npy::file("<i4", "(2, 4, 4, 4)", &[0; 512]));
    assert!(message().contains("elements of type `<i4` cannot be used here"), "{}", message());
    folder.write("tsdf.npy", &good.1);

    folder.write("weight.npy", &npy::file("|b1", "(1, 4, 4, 4)", &[1; 64]));
    assert!(
        message().contains("the shape is [1, 4, 4, 4], it must be that of tsdf.npy, [2, 4, 4, 4]"),
        "{}",
        message()
    );
    folder.write("weight.npy", &npy::file("|b1", "(2, 4, 4, 4)", &[1; 128]));
    folder.write("grid.json", br#"{"tsdf_unit": "mm"}"#);
    assert!(message().contains("grid.json: unknown variant `mm`"), "{}", message());
    folder.write("grid.json", br#"{"truncation_m": -1}"#);
    assert!(message().contains("\"truncation_m\" is -1, it must be above 0"), "{}", message());
    folder.write("grid.json", b"{}");
    read_volume(folder.path(), &grid(4, 8)).unwrap();
}

#[test]
fn sequences_are_folders_in_natural_order() {
    let root = tempfile::tempdir().unwrap();
    let empty = VolumeSequence::open(root.path()).unwrap_err();
    assert!(matches!(empty, VolumeError::NoVolumes { .. }), "{empty}");
    for frame in [10, 2, 1] {
        let mut builder = VolumeBuilder::new(grid(4, 8));
        builder.push([frame, 0, 0].into(), vec![5; 64], None);
        write_volume(&root.path().join(format!("frame_{frame}")), &builder.finish()).unwrap();
    }
    std::fs::create_dir(root.path().join("notes")).unwrap();
    assert!(!is_volume_folder(root.path()));
    let sequence = VolumeSequence::open(root.path()).unwrap();
    let grid = sequence.grid(0, None, None).unwrap();
    let order: Vec<i32> =
        (0..sequence.len()).map(|i| sequence.read(i, &grid).unwrap().coords()[0].x).collect();
    assert_eq!(order, [1, 2, 10]);
    assert_eq!(sequence.select(1..3).unwrap().paths(), &sequence.paths()[1..]);
    assert!(sequence.select(1..4).is_none() && sequence.select(1..1).is_none());
    let one = VolumeSequence::open(&sequence.paths()[2]).unwrap();
    assert_eq!(one.len(), 1);
}

/// The example of the format's page, run by a Python that has NumPy, and volumes going both ways.
#[test]
fn the_documented_example_agrees_with_numpy() {
    let python = std::env::var_os("ISV_PYTHON").unwrap_or_else(|| "python3".into());
    if !Command::new(&python).args(["-c", "import numpy"]).output().is_ok_and(|o| o.status.success()) {
        let why = format_args!("{} has no numpy; ISV_PYTHON names another", python.display());
        return skip(Need::Python, why);
    }
    let page = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../docs/formats/volume.md");
    let page = std::fs::read_to_string(page).unwrap();
    let script = page.split("```python\n").nth(1).unwrap().split("```").next().unwrap();
    let root = tempfile::tempdir().unwrap();
    let run = |folder: &Path| {
        let output = Command::new(&python).args(["-c", script]).arg(folder).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        print!("{}", String::from_utf8_lossy(&output.stdout));
    };
    let folder = root.path().join("ball");
    run(&folder);
    let volume = read_volume(&folder, &volume_grid(&folder, None, None).unwrap()).unwrap();
    assert_eq!(*volume.grid(), grid(8, 8));
    let (mut seen, mut hidden) = (0, 0);
    for (block, coord) in volume.coords().iter().enumerate() {
        for (voxel, code) in volume.block(block).iter().enumerate() {
            let position = volume.grid().voxel_centre_m(*coord, [voxel % 8, voxel / 8 % 8, voxel / 64]);
            let observed = volume.unobserved(block).is_none_or(|mask| !mask.contains(voxel));
            assert_eq!(observed, position.y >= -0.07);
            if observed {
                let codes = ((position.length() - 0.1) / 0.005 * 256.0).clamp(-2048.0, 2048.0);
                assert!((f64::from(*code) - codes).abs() <= 0.51, "{code} for {codes}");
                seen += 1;
            } else {
                hidden += 1;
            }
        }
    }
    assert!(seen > 100_000 && hidden > 5_000, "{seen} seen, {hidden} hidden");
    let back = root.path().join("back");
    write_volume(&back, &volume).unwrap();
    run(&back);
}
