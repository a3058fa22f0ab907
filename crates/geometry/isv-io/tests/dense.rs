//! Dense fields as `.npy` and `.npz`: against the sphere that they are of.

use isv_io::{DenseAxes, DenseOptions, SampleAt, VolumeError, VolumeSequence};
use isv_testfiles::npy::{archive as npz, bytes_of, file};
use isv_volume::{CODES_PER_VOXEL, SparseVolume, Truncation, VoxelSize};
use std::io::Write;
use std::path::{Path, PathBuf};

const VOXEL: f64 = 0.02;
/// In voxels.
const TRUNCATION: f64 = 4.0;
const EXTENTS: [usize; 3] = [26, 22, 18];
const CENTRE: [f64; 3] = [12.3, 10.1, 8.6];
const RADIUS: f64 = 5.4;

/// Distance of a place to the ball, all in voxels.
fn ball(at: [f64; 3]) -> f64 {
    (0..3).map(|a| (at[a] - CENTRE[a]).powi(2)).sum::<f64>().sqrt() - RADIUS
}

/// Distances in voxels, cut off; `order`: which axis of x, y, z runs fastest, next, slowest. `offset`: of sample 0 in voxels.
fn samples(order: [usize; 3], offset: f64) -> Vec<f64> {
    let [fast, middle, slow] = order;
    let mut values = Vec::new();
    for k in 0..EXTENTS[slow] {
        for j in 0..EXTENTS[middle] {
            for i in 0..EXTENTS[fast] {
                let mut at = [0.0; 3];
                (at[fast], at[middle], at[slow]) = (i as f64, j as f64, k as f64);
                values.push(ball(at.map(|c| c + offset)).clamp(-TRUNCATION, TRUNCATION));
            }
        }
    }
    values
}

const XYZ_FASTEST_FIRST: [usize; 3] = [0, 1, 2];
const ZYX_SHAPE: &str = "(18, 22, 26)";

/// `field[z, y, x]`.
fn zyx(descr: &str, to_bytes: impl Fn(f64) -> Vec<u8>) -> Vec<u8> {
    file(
        descr,
        ZYX_SHAPE,
        &samples(XYZ_FASTEST_FIRST, 0.5).into_iter().flat_map(to_bytes).collect::<Vec<_>>(),
    )
}

/// In truncation distances, as `float32`.
fn normalised() -> Vec<u8> {
    zyx("<f4", |voxels| ((voxels / TRUNCATION) as f32).to_le_bytes().to_vec())
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (name, bytes) in files {
            std::fs::write(folder.path(name), bytes).unwrap();
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
}

fn voxel() -> VoxelSize {
    VoxelSize::from_metres(VOXEL).unwrap()
}

fn read_with(path: &Path, options: DenseOptions) -> Result<SparseVolume, VolumeError> {
    let sequence = VolumeSequence::open_with(path, options)?;
    let grid = match sequence.grid(0, None, None) {
        Err(VolumeError::NoVoxelSize { .. }) => sequence.grid(0, Some(voxel()), None)?,
        grid => grid?,
    };
    sequence.read(0, &grid)
}

fn read(bytes: &[u8]) -> Result<SparseVolume, VolumeError> {
    read_with(&Folder::new(&[("map.npy", bytes)]).path("map.npy"), DenseOptions::default())
}

/// The largest difference from the ball in voxels, over observed samples within three voxels of it, and how many there are.
fn error(volume: &SparseVolume, moved: [f64; 3]) -> (f64, usize) {
    let (mut worst, mut count) = (0.0_f64, 0);
    for (block, coord) in volume.coords().iter().enumerate() {
        for (voxel, code) in volume.block(block).iter().enumerate() {
            if volume.unobserved(block).is_some_and(|mask| mask.contains(voxel)) {
                continue;
            }
            let local = [voxel % 8, voxel / 8 % 8, voxel / 64];
            let at = std::array::from_fn(|a| {
                f64::from(coord.to_array()[a] * 8) + local[a] as f64 + 0.5 - moved[a]
            });
            let expected = ball(at);
            if expected.abs() < 3.0 {
                worst = worst.max((f64::from(*code) / f64::from(CODES_PER_VOXEL) - expected).abs());
                count += 1;
            }
        }
    }
    (worst, count)
}

/// Holds a volume to the ball.
fn is_ball(volume: &SparseVolume, tolerance: f64, what: &str) {
    let (worst, count) = error(volume, [0.0; 3]);
    assert!(worst <= tolerance && count > 1500, "{what}: {worst} voxels off in {count}");
}

#[test]
fn every_type_byte_order_and_unit_is_the_ball() {
    type ToBytes = fn(f64) -> Vec<u8>;
    let kinds: [(&str, ToBytes, f64); 10] = [
        ("<f4", |v| ((v / TRUNCATION) as f32).to_le_bytes().to_vec(), 0.01),
        (">f4", |v| ((v / TRUNCATION) as f32).to_be_bytes().to_vec(), 0.01),
        ("<f8", |v| (v / TRUNCATION).to_le_bytes().to_vec(), 0.01),
        // Metres and voxels.
        ("<f8", |v| (v * VOXEL).to_le_bytes().to_vec(), 0.01),
        ("<f4", |v| ((v * VOXEL) as f32).to_le_bytes().to_vec(), 0.01),
        (">f8", |v| v.to_be_bytes().to_vec(), 0.01),
        ("|i1", |v| vec![(v / TRUNCATION * 127.0).round() as i8 as u8], 0.03),
        ("<i2", |v| ((v / TRUNCATION * 32767.0).round() as i16).to_le_bytes().to_vec(), 0.01),
        (">i2", |v| ((v / TRUNCATION * 32767.0).round() as i16).to_be_bytes().to_vec(), 0.01),
        // Halves of the values in truncation distances, rounded.
        ("<f2", |v| half(v / TRUNCATION).to_le_bytes().to_vec(), 0.02),
    ];
    for (descr, to_bytes, tolerance) in kinds {
        let volume = read(&zyx(descr, to_bytes)).unwrap();
        assert_eq!(volume.grid().truncation, Truncation::from_voxels(4).unwrap(), "{descr}");
        is_ball(&volume, tolerance, descr);
    }
}

/// An IEEE 754 half, of a number in -1..1, rounded down.
fn half(value: f64) -> u16 {
    let bits = (value as f32).to_bits();
    let (sign, exponent) = ((bits >> 16) as u16 & 0x8000, (bits >> 23 & 0xff) as i32 - 112);
    if exponent <= 0 { sign } else { sign | (exponent as u16) << 10 | (bits >> 13) as u16 & 0x3ff }
}

#[test]
fn axes_come_in_any_order() {
    let bytes =
        |order| bytes_of(samples(order, 0.5).into_iter().map(|v| (v / TRUNCATION) as f32), f32::to_le_bytes);
    let xyz = DenseOptions { axes: DenseAxes::Xyz, ..DenseOptions::default() };
    let z_fastest = file("<f4", "(26, 22, 18)", &bytes([2, 1, 0]));
    let fortran = |bytes: &[u8]| {
        let text = String::from_utf8_lossy(&bytes[10..200]).into_owned();
        let at = 10 + text.find("False").unwrap();
        // The header stays as long as it was.
        [&bytes[..at], b"True ", &bytes[at + 5..]].concat()
    };
    let x_fastest_by_fortran = fortran(&file("<f4", "(26, 22, 18)", &bytes(XYZ_FASTEST_FIRST)));
    let z_fastest_by_fortran = fortran(&file("<f4", ZYX_SHAPE, &bytes([2, 1, 0])));
    for (bytes, options) in [
        (z_fastest, xyz),
        (x_fastest_by_fortran, xyz),
        (z_fastest_by_fortran, DenseOptions::default()),
        (file("<f4", "(18, 22, 26, 1)", &bytes(XYZ_FASTEST_FIRST)), DenseOptions::default()),
    ] {
        let folder = Folder::new(&[("map.npy", &bytes)]);
        is_ball(&read_with(&folder.path("map.npy"), options).unwrap(), 0.01, &format!("{options:?}"));
    }
}

#[test]
fn samples_at_corners_are_half_a_voxel_lower() {
    let values = samples(XYZ_FASTEST_FIRST, 0.0).into_iter().map(|v| (v / TRUNCATION) as f32);
    let bytes = file("<f4", ZYX_SHAPE, &bytes_of(values, f32::to_le_bytes));
    let folder = Folder::new(&[("map.npy", &bytes)]);
    let corner = DenseOptions { sample_at: SampleAt::Corner, ..DenseOptions::default() };
    // Interpolation between eight samples rounds the ball a little.
    is_ball(&read_with(&folder.path("map.npy"), corner).unwrap(), 0.15, "corner");
    let (worst, _) = error(&read_with(&folder.path("map.npy"), DenseOptions::default()).unwrap(), [0.0; 3]);
    assert!(worst > 0.7, "{worst}");
}

#[test]
fn an_archive_says_voxel_size_place_and_truncation() {
    let number = |value: f64| file("<f8", "()", &value.to_le_bytes());
    let origin = file("<f4", "(3,)", &bytes_of([-0.4_f32, 0.12, 0.2], f32::to_le_bytes));
    let metres = zyx("<f4", |v| ((v * VOXEL) as f32).to_le_bytes().to_vec());
    let moved = [-20.0, 6.0, 10.0];
    for packed in [false, true] {
        for (field, size, truncation, bytes) in [
            ("tsdf", "voxel_size", "sdf_trunc", &normalised()),
            ("TSDF_volume", "voxel_length", "trunc_margin", &metres),
            // The only array of three axes.
            ("arr_0", "voxel_size_m", "truncation", &normalised()),
        ] {
            let archive = npz(
                &[
                    ("origin", &origin),
                    (field, bytes),
                    (size, &file("<f4", "(1,)", &0.02_f32.to_le_bytes())),
                    (truncation, &number(TRUNCATION * VOXEL)),
                ],
                packed,
            );
            let folder = Folder::new(&[("map.npz", &archive)]);
            let volume = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap();
            assert_eq!(volume.grid().voxel_size, voxel());
            let (worst, count) = error(&volume, moved);
            assert!(worst < 0.01 && count > 1500, "{field}: {worst} in {count}");
        }
    }
}

#[test]
fn a_place_between_voxels_is_kept_by_interpolation() {
    let origin = file("<f8", "(3,)", &bytes_of([0.005, 0.0, -0.013], f64::to_le_bytes));
    let archive = npz(&[("tsdf", &normalised()), ("origin", &origin)], false);
    let folder = Folder::new(&[("map.npz", &archive)]);
    let volume = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap();
    let (worst, count) = error(&volume, [0.25, 0.0, -0.65]);
    assert!(worst < 0.15 && count > 1500, "{worst} in {count}");
}

/// Whether a voxel by its place counts as observed.
fn is_observed(volume: &SparseVolume, at: [i32; 3]) -> bool {
    let block = volume.index().get(at.map(|c| c.div_euclid(8)).into());
    block.is_some_and(|block| {
        let [x, y, z] = at.map(|c| c.rem_euclid(8) as usize);
        let voxel = volume.grid().edge.voxel_index(x, y, z);
        volume.unobserved(block as usize).is_none_or(|mask| !mask.contains(voxel))
    })
}

#[test]
fn weights_say_what_was_observed() {
    let weights: Vec<f32> = (0..18 * 22 * 26)
        .map(|i| match i % 26 {
            3 => 0.0,
            4 => f32::NAN,
            5 => -1.0,
            _ => 0.5,
        })
        .collect();
    let weights = file("<f4", ZYX_SHAPE, &bytes_of(weights, f32::to_le_bytes));
    let archive = npz(&[("tsdf", &normalised()), ("weights", &weights)], false);
    for (files, name) in [
        (&[("map.npy", &normalised()[..]), ("map_weights.npy", &weights)][..], "map.npy"),
        (&[("map.npy", &normalised()[..]), ("map_weight.npy", &weights)], ""),
        (&[("tsdf.npy", &normalised()[..]), ("weight.npy", &weights)], ""),
        (&[("map.npz", &archive[..])], "map.npz"),
    ] {
        let volume = read_with(&Folder::new(files).path(name), DenseOptions::default()).unwrap();
        is_ball(&volume, 0.01, name);
        for x in 0..26 {
            // Free space too: somebody looked.
            for (y, z) in [(0, 0), (10, 8), (21, 17)] {
                assert_eq!(is_observed(&volume, [x, y, z]), !(3..=5).contains(&x), "{name} {x} {y} {z}");
            }
        }
    }
}

#[test]
fn without_weights_nan_and_walls_behind_the_surface_are_unobserved() {
    // As fusion without weights leaves it: whatever is deeper than the truncation still has its first value.
    let behind = zyx("<f4", |v| {
        (if v <= -TRUNCATION { 1.0_f32 } else { (v / TRUNCATION) as f32 }).to_le_bytes().to_vec()
    });
    let volume = read(&behind).unwrap();
    is_ball(&volume, 0.01, "behind");
    // The centre of the ball has value 1, and voxels at the rim of what was seen are unobserved.
    let rim: Vec<_> = (0..26).filter(|x| ball([f64::from(*x) + 0.5, 10.5, 8.5]) <= -TRUNCATION).collect();
    assert!(!rim.is_empty());
    for x in [rim[0], rim[rim.len() - 1]] {
        assert!(!is_observed(&volume, [x, 10, 8]), "{x}");
    }
    let holes = zyx("<f4", |v| {
        (if (1.0..2.0).contains(&v) { f32::NAN } else { (v / TRUNCATION) as f32 }).to_le_bytes().to_vec()
    });
    let volume = read(&holes).unwrap();
    for x in 0..26 {
        let distance = ball([f64::from(x) + 0.5, 10.5, 8.5]);
        if distance.abs() < TRUNCATION {
            assert_eq!(is_observed(&volume, [x, 10, 8]), !(1.0..2.0).contains(&distance), "{x}");
        }
    }
}

#[test]
fn infinite_distances_are_beyond_the_truncation() {
    let infinite = zyx("<f8", |v| {
        let metres = if v.abs() >= TRUNCATION { f64::INFINITY.copysign(v) } else { v * VOXEL };
        metres.to_le_bytes().to_vec()
    });
    is_ball(&read(&infinite).unwrap(), 0.01, "infinite");
}

#[test]
fn a_scale_that_is_told_holds() {
    let folder = Folder::new(&[("map.npy", &normalised())]);
    let told = DenseOptions { scale_m: Some(2.0 * TRUNCATION * VOXEL), ..DenseOptions::default() };
    let volume = read_with(&folder.path("map.npy"), told).unwrap();
    let (worst, _) = error(&volume, [0.0; 3]);
    assert!((2.5..3.1).contains(&worst), "distances are twice as long: {worst}");
}

#[test]
fn a_folder_or_a_pattern_is_a_sequence() {
    let field = normalised();
    let weights = file("|u1", ZYX_SHAPE, &[1; 18 * 22 * 26]);
    let folder = Folder::new(&[
        ("map_10.npy", &field),
        ("map_2.npy", &field),
        ("map_2_weights.npy", &weights),
        ("notes.txt", b"none"),
    ]);
    for input in [folder.path(""), folder.path("map_*.npy")] {
        let sequence = VolumeSequence::open(&input).unwrap();
        let names: Vec<_> =
            sequence.paths().iter().map(|path| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["map_2.npy", "map_10.npy"]);
        assert!(sequence.is_dense());
        let grid = sequence.grid(0, Some(voxel()), None).unwrap();
        let notes = sequence.notes(1, &grid).unwrap();
        assert!(notes.len() == 2 && notes[0].contains("--tsdf-scale"), "{notes:?}");
        is_ball(&sequence.read(1, &grid).unwrap(), 0.01, "second");
    }
}

#[test]
fn what_is_no_field_is_refused_by_name() {
    let floats = |shape: &str, count: usize| file("<f4", shape, &vec![0; 4 * count]);
    let sentence = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    for (bytes, said) in [
        (floats("(4, 3)", 12), "shape (4, 3) is not a dense field"),
        (floats("(4, 3)", 12), "points belong in a .ply"),
        (file("|O", "(4, 3)", &[0; 96]), "shape (4, 3) is not a dense field"),
        (floats("(2, 8, 8, 8)", 1024), "with a coords.npy"),
        (floats("(2, 3, 4, 5)", 120), "shape (2, 3, 4, 5) is not a dense field"),
        (floats("(7,)", 7), "shape (7,) is not a dense field"),
        (floats("()", 1), "shape () is not a dense field"),
        (floats("(1, 8, 8)", 64), "shape (1, 8, 8) is not a dense field"),
        (floats("(0, 8, 8)", 0), "shape (0, 8, 8) is not a dense field"),
        (file("|b1", "(2, 2, 2)", &[0; 8]), "elements of type `|b1`"),
        (file("|u1", "(2, 2, 2)", &[0; 8]), "distances have two signs"),
        (file("<c8", "(2, 2, 2)", &[0; 64]), "elements of type `<c8`"),
        (floats("(2, 2, 2)", 7), "the shape takes 32 bytes"),
        (b"\x93NUMPY\x01".to_vec(), "ends inside its header"),
        (b"P6 2 2".to_vec(), "not a NumPy file"),
    ] {
        let found = sentence(&bytes);
        assert!(found.contains("map.npy: ") && found.contains(said), "{found}");
    }
}

#[test]
fn archives_are_refused_by_what_is_wrong_in_them() {
    let points = file("<f4", "(4, 3)", &[0; 48]);
    let field = normalised();
    let weights = file("|u1", "(2, 2, 2)", &[1; 8]);
    let zero = file("<f8", "()", &0_f64.to_le_bytes());
    for (arrays, said) in [
        (&[("points", &points[..])][..], "`points` of shape (4, 3) is not a dense field"),
        (&[("tsdf", &points[..])], "`tsdf` of shape (4, 3) is not a dense field"),
        (
            &[("xyz", &points[..]), ("rgb", &points)],
            "no array of distances here: save it as `tsdf`; there are `xyz` [4, 3]",
        ),
        (&[("a", &field[..]), ("b", &field)], "save it as `tsdf`"),
        (&[][..], "there are none"),
        (&[("tsdf", &field[..]), ("weight", &weights)], "`weight`: the shape is [2, 2, 2]"),
        (
            &[("tsdf", &field[..]), ("voxel_size", &zero)],
            "`voxel_size` is [0.0], it must be one length above 0",
        ),
        (&[("tsdf", &field[..]), ("origin", &zero)], "`origin` is [0.0], it must be three numbers"),
    ] {
        let folder = Folder::new(&[("map.npz", &npz(arrays, false))]);
        let found = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap_err().to_string();
        assert!(found.contains("map.npz: ") && found.contains(said), "{found}");
    }
    let folder = Folder::new(&[("map.npz", b"\x93NUMPY")]);
    let found = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap_err().to_string();
    assert!(found.contains("not an archive of NumPy arrays"), "{found}");
}

#[test]
fn an_archive_that_unpacks_to_far_more_is_refused() {
    // 300 MB of zeros in 300 KB, of which no more than 256 MiB are unpacked.
    let header = file("<f4", "(4096, 4096, 20)", &[]);
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file("tsdf.npy", options).unwrap();
    archive.write_all(&header).unwrap();
    let zeros = vec![0; 1 << 20];
    (0..300).for_each(|_| archive.write_all(&zeros).unwrap());
    let bytes = archive.finish().unwrap().into_inner();
    assert!(bytes.len() < 1 << 20);
    let folder = Folder::new(&[("map.npz", &bytes)]);
    let found = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap_err().to_string();
    assert!(found.contains("unpacks to more than 256 times the file"), "{found}");
}

#[test]
fn a_field_too_far_away_is_refused() {
    for far in [1e6, -1e300] {
        let origin = file("<f8", "(3,)", &bytes_of([far, 0.0, 0.0], f64::to_le_bytes));
        let archive = npz(&[("tsdf", &normalised()), ("origin", &origin)], false);
        let folder = Folder::new(&[("map.npz", &archive)]);
        let found = read_with(&folder.path("map.npz"), DenseOptions::default()).unwrap_err();
        assert!(matches!(found, VolumeError::OutOfRange { .. }), "{found}");
    }
}

#[test]
fn damaged_files_are_read_or_refused() {
    let small =
        file("<f4", "(4, 3, 2)", &bytes_of((0..24).map(|i| (i - 11) as f32 / 11.0), f32::to_le_bytes));
    let huge = file("<f8", "(9223372036854775808, 4, 0)", &[]);
    let number = file("<f8", "()", &0.02_f64.to_le_bytes());
    let archive = npz(&[("tsdf", &small), ("voxel_size", &number), ("weight", &small)], true);
    let mut state = 7_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for (name, sound) in [
        ("map.npy", &small),
        ("map.npz", &archive),
        ("map.npz", &npz(&[("tsdf", &small), ("origin", &huge)], true)),
        ("map.npz", &npz(&[("tsdf", &huge)], true)),
    ] {
        for _ in 0..400 {
            let mut bytes = sound.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                bytes[at] = random(256) as u8;
            }
            bytes.truncate(bytes.len() - random(4));
            let folder = Folder::new(&[(name, &bytes)]);
            if let Ok(volume) = read_with(&folder.path(name), DenseOptions::default()) {
                assert!(volume.block_count() <= 8);
            }
        }
    }
}
