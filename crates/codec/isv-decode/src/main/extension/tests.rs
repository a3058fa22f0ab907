use super::*;
use isv_testkit::Random;
use isv_volume::{BlockSet, COORD_LIMIT, Grid, Truncation, VolumeBuilder, VoxelSize};

const EDGE: i32 = 8;

fn grid(truncation: u32) -> Grid {
    Grid {
        voxel_size: VoxelSize::from_metres(0.005).unwrap(),
        edge: BlockEdge::E8,
        truncation: Truncation::from_voxels(truncation).unwrap(),
    }
}

/// Position of a voxel of a block.
fn position(voxel: usize) -> [i32; 3] {
    [voxel % 8, voxel / 8 % 8, voxel / 64].map(|c| c as i32)
}

/// A volume of some blocks, whose samples follow from the voxel's position in the world.
fn volume(coords: &[[i32; 3]], sample: impl Fn([i32; 3]) -> i32) -> SparseVolume {
    let mut builder = VolumeBuilder::new(grid(16));
    for coord in coords {
        let samples = (0..SAMPLES).map(|voxel| {
            let local = position(voxel);
            sample([0, 1, 2].map(|a| coord[a] * EDGE + local[a])).clamp(-4096, 4096) as i16
        });
        builder.push(BlockCoord::from(*coord), samples.collect(), None);
    }
    builder.finish()
}

/// Random blocks in a cube of five blocks a side: smooth fields, steps and noise, some with masks.
fn random_volume(seed: u64, truncation: u32) -> SparseVolume {
    let mut random = Random::new(seed);
    let limit = f64::from(truncation * 256);
    let mut builder = VolumeBuilder::new(grid(truncation));
    let density = random.signed() * 0.5 - 0.5;
    for block in 0..125 {
        if random.signed() > density {
            continue;
        }
        let (slope, base, noise) = (random.point() * 300.0, random.signed() * 500.0, random.signed());
        let noise = noise.powi(3).abs() * 2.0 * limit;
        let samples = (0..SAMPLES).map(|voxel| {
            let [x, y, z] = position(voxel).map(f64::from);
            let value = base + slope.x * x + slope.y * y + slope.z * z + noise * random.signed();
            value.clamp(-limit, limit).round() as i16
        });
        let samples = samples.collect();
        let mut mask = VoxelMask::empty(BlockEdge::E8);
        mask.insert(((random.signed() + 1.0) * 255.0) as usize);
        builder.push([block % 5, block / 5 % 5, block / 25].into(), samples, Some(mask));
    }
    builder.finish()
}

/// The extension as the format document has it, voxel by voxel.
mod plain {
    use super::*;

    pub(super) type Field = BTreeMap<[i32; 3], (Vec<i32>, bool, Vec<usize>)>;

    fn offsets() -> impl Iterator<Item = [i32; 3]> {
        (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]).filter(|d| *d != [0; 3])
    }

    /// The nearest voxel of the neighbour at an offset to a voxel of the middle block, in the middle block's coordinates.
    fn nearest(x: [i32; 3], d: [i32; 3]) -> [i32; 3] {
        [0, 1, 2].map(|a| x[a].clamp(d[a] * EDGE, d[a] * EDGE + EDGE - 1))
    }

    fn sample(block: &[i16], y: [i32; 3]) -> i32 {
        let [x, y, z] = y.map(|c| c.rem_euclid(EDGE) as usize);
        block[(z * 8 + y) * 8 + x].into()
    }

    fn l1(x: [i32; 3], y: [i32; 3]) -> i32 {
        (0..3).map(|a| (x[a] - y[a]).abs()).sum()
    }

    fn is_inside(around: &[([i32; 3], &[i16])]) -> bool {
        let has_faces = around.iter().any(|(d, _)| l1(*d, [0; 3]) == 1);
        let mut sum = 0;
        for (d, block) in around {
            for x in (0..SAMPLES).map(position) {
                let y = nearest(x, *d);
                if !has_faces || l1(x, y) == 1 {
                    sum += sample(block, y).clamp(-256, 256);
                }
            }
        }
        sum < 0
    }

    fn magnitude(x: [i32; 3], around: &[([i32; 3], &[i16])], inside: bool, limit: i32) -> i32 {
        let candidates = around.iter().map(|(d, block)| {
            let y = nearest(x, *d);
            let mut value = sample(block, y);
            for a in 0..3 {
                let mut behind = y;
                behind[a] -= (x[a] - y[a]).signum();
                let slope = (sample(block, y) - sample(block, behind)).clamp(-256, 256);
                value += slope * (x[a] - y[a]).abs();
            }
            (l1(x, y), (if inside { -value } else { value }).clamp(5, limit))
        });
        candidates.min().unwrap().1
    }

    pub(super) fn extend(coded: &SparseVolume) -> Field {
        let limit = i32::from(coded.grid().truncation.codes());
        let index = coded.index();
        let mut field = Field::new();
        for (block, coord) in coded.coords().iter().enumerate() {
            let mask = (0..SAMPLES).filter(|v| coded.unobserved(block).is_some_and(|m| m.contains(*v)));
            let samples = coded.block(block).iter().map(|s| i32::from(*s)).collect();
            field.insert(coord.to_array(), (samples, true, mask.collect()));
            for beside in offsets().map(|d| coord.offset(d)).filter(|c| c.in_range()) {
                if index.get(beside).is_none() {
                    let around = offsets().filter_map(|d| Some((d, index.get(beside.offset(d))?)));
                    let around: Vec<_> = around.map(|(d, b)| (d, coded.block(b as usize))).collect();
                    let inside = is_inside(&around);
                    let sign = if inside { -1 } else { 1 };
                    let samples = (0..SAMPLES)
                        .map(|voxel| sign * magnitude(position(voxel), &around, inside, limit))
                        .collect();
                    field.insert(beside.to_array(), (samples, false, Vec::new()));
                }
            }
        }
        mask_conflicts(&mut field);
        field
    }

    fn mask_conflicts(field: &mut Field) {
        let extrapolated =
            |block: [i32; 3], field: &Field| field.get(&block).is_some_and(|(_, coded, _)| !coded);
        let coords: Vec<_> = field.keys().copied().filter(|c| extrapolated(*c, field)).collect();
        for coord in coords {
            let conflicting = |voxel: &usize| {
                let x = position(*voxel);
                offsets().filter(|d| l1(*d, [0; 3]) == 1).any(|d| {
                    let y = [0, 1, 2].map(|a| x[a] + d[a]);
                    let block = [0, 1, 2].map(|a| coord[a] + y[a].div_euclid(EDGE));
                    let [i, j, k] = y.map(|c| c.rem_euclid(EDGE) as usize);
                    block != coord
                        && extrapolated(block, field)
                        && (field[&block].0[(k * 8 + j) * 8 + i] < 0) != (field[&coord].0[*voxel] < 0)
                })
            };
            let mask = (0..SAMPLES).filter(conflicting).collect();
            field.get_mut(&coord).unwrap().2 = mask;
        }
    }
}

/// Whether each block of a frame was coded.
fn coded_flags(extended: &DecodedBlocks) -> Vec<bool> {
    extended.sets().coded.marks_in(&extended.sets().all)
}

/// Asserts that a volume's extension is that of the plain reference; how many masks it has.
fn check(coded: &SparseVolume) -> usize {
    let extended = DecodedBlocks::from_coded(coded);
    let (volume, flags) = (extended.volume(), coded_flags(&extended));
    let expected = plain::extend(coded);
    assert_eq!(volume.block_count(), expected.len());
    assert_eq!(FrameBlocks::new(coded.coords(), None).all.coords(), volume.coords());
    assert!(volume.coords().windows(2).all(|pair| pair[0].morton() < pair[1].morton()));
    for (block, coord) in volume.coords().iter().enumerate() {
        let (samples, was_coded, mask) = &expected[&coord.to_array()];
        let got: Vec<i32> = volume.block(block).iter().map(|s| i32::from(*s)).collect();
        assert_eq!(&got, samples, "{coord:?}");
        assert_eq!(flags[block], *was_coded, "{coord:?}");
        let unobserved = volume.unobserved(block);
        let got: Vec<usize> = (0..SAMPLES).filter(|v| unobserved.is_some_and(|m| m.contains(*v))).collect();
        assert_eq!(&got, mask, "{coord:?}");
    }
    volume.unobserved_masks().len()
}

#[test]
fn random_blocks_are_extended_as_the_plain_reference_does() {
    // A machine that is emulated takes fifteen times longer.
    let volumes = if cfg!(any(target_arch = "x86_64", target_arch = "x86")) { 24 } else { 6 };
    let mut conflicts = 0;
    for seed in 0..volumes {
        let coded = random_volume(seed, [2, 8, 16][seed as usize % 3]);
        conflicts += check(&coded) - coded.block_count();
    }
    assert!(conflicts > 4 * volumes as usize, "{conflicts} extrapolated blocks with masks");
}

#[test]
fn a_plane_through_a_row_of_blocks_goes_on_as_a_plane() {
    // Slopes within one voxel a voxel, and a plane that passes through the row alone.
    let plane = |[x, y, z]: [i32; 3]| 250 * y - 1000 + 3 * x - 2 * z;
    let row: Vec<[i32; 3]> = (-2..2).map(|x| [x, 0, 0]).collect();
    let extended = DecodedBlocks::from_coded(&volume(&row, plane));
    let (volume, coded) = (extended.volume(), coded_flags(&extended));
    assert_eq!(volume.block_count(), 6 * 9);
    assert_eq!(coded.iter().filter(|coded| **coded).count(), 4);
    for (block, coord) in volume.coords().iter().enumerate() {
        // Beside the row the plane goes on through blocks that hold one sign: there only one half can follow it.
        if coord.y == 0 && !coded[block] {
            continue;
        }
        for (voxel, sample) in volume.block(block).iter().enumerate() {
            let local = position(voxel);
            let expected = plane([0, 1, 2].map(|a| coord.to_array()[a] * EDGE + local[a])).clamp(-4096, 4096);
            assert_eq!(i32::from(*sample), expected, "voxel {voxel} of {coord:?}");
        }
    }
}

#[test]
fn an_extrapolated_block_has_one_sign() {
    for seed in 100..110 {
        let extended = DecodedBlocks::from_coded(&random_volume(seed, 8));
        let (volume, coded) = (extended.volume(), coded_flags(&extended));
        for block in (0..volume.block_count()).filter(|block| !coded[*block]) {
            let samples = volume.block(block);
            assert!(samples.iter().all(|s| s.signum() == samples[0].signum() && s.abs() >= 5));
        }
    }
}

#[test]
fn both_sides_of_a_face_between_signs_are_unobserved() {
    // Two blocks apart by two blocks, one wholly inside and one wholly outside.
    let coded = volume(&[[0, 0, 0], [3, 0, 0]], |[x, ..]| if x < 16 { -700 } else { 700 });
    let extended = DecodedBlocks::from_coded(&coded);
    let volume = extended.volume();
    for (block, coord) in volume.coords().iter().enumerate() {
        let layer = match coord.x {
            1 => Some(7),
            2 => Some(0),
            _ => None,
        };
        let got = volume
            .unobserved(block)
            .map(|mask| (0..SAMPLES).filter(|voxel| mask.contains(*voxel)).collect::<Vec<_>>());
        let expected = layer.map(|layer| (0..SAMPLES).filter(|voxel| voxel % 8 == layer).collect());
        assert_eq!(got, expected, "{coord:?}");
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let coded = random_volume(7, 8);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| DecodedBlocks::from_coded(&coded))
    };
    let alone = on(1);
    for threads in [2, 3, 8] {
        let together = on(threads);
        assert!(alone.volume() == together.volume() && alone.sets() == together.sets(), "{threads} threads");
    }
}

#[test]
fn nothing_extends_to_nothing() {
    let extended = DecodedBlocks::from_coded(&SparseVolume::empty(grid(8)));
    assert_eq!((extended.volume().block_count(), extended.sets()), (0, &FrameBlocks::default()));
}

#[test]
fn blocks_beyond_the_limit_of_coordinates_are_left_out() {
    let (first, last) = (-COORD_LIMIT, COORD_LIMIT - 1);
    let corners = [[first; 3], [last; 3], [first, 0, last]];
    let coded = volume(&corners, |[x, y, z]| (x ^ y ^ z) % 500);
    assert_eq!(FrameBlocks::new(coded.coords(), None).all.count(), 8 + 8 + 12);
    check(&coded);
}

/// Four random volumes in a row along x.
fn long_random_volume(seed: u64) -> SparseVolume {
    let mut builder = VolumeBuilder::new(grid(8));
    for part in 0..4 {
        let volume = random_volume(10 * seed + part, 8);
        for (block, coord) in volume.coords().iter().enumerate() {
            builder.push(coord.offset([5 * part as i32, 0, 0]), volume.block(block).to_vec(), None);
        }
    }
    builder.finish()
}

/// What a frame keeps of another one is what it would have become: the same as the extension of all that is coded.
#[test]
fn what_is_kept_is_what_it_would_become() {
    let (mut kept_blocks, mut masks) = (0, 0);
    for seed in 200..208 {
        // Each is 20 blocks long; the first two cells of the first one stay, and another on their far side.
        let [before, other] = [seed, seed + 1000].map(long_random_volume);
        let stays = |coord: &BlockCoord| coord.x < 8 || (coord.x < 12 && coord.y < 4 && coord.z >= 4);
        let mut builder = VolumeBuilder::new(*before.grid());
        let mut now = Vec::new();
        for (volume, from_before) in [(&before, true), (&other, false)] {
            for (block, coord) in volume.coords().iter().enumerate().filter(|(_, c)| stays(c) == from_before)
            {
                builder.push(*coord, volume.block(block).to_vec(), None);
                now.extend((!from_before).then_some(*coord));
            }
        }
        let before = DecodedBlocks::from_coded(&before);
        let skipped: Vec<_> = before.volume().coords().iter().copied().filter(stays).collect();
        let skipped = BlockSet::from_coords(&skipped);
        let kept = Some(Kept { before: before.sets(), skipped: &skipped });
        let plan = ExtensionPlan::new(FrameBlocks::new(&now, kept), &now, kept);
        let mut samples = plan.samples(Vec::new());
        for (coord, place) in now.iter().zip(plan.places()) {
            let block = other.index().get(*coord).unwrap() as usize;
            samples[*place as usize * SAMPLES..][..SAMPLES].copy_from_slice(other.block(block));
        }
        let found = plan.extend(*other.grid(), samples, Some(&before));
        let expected = DecodedBlocks::from_coded(&builder.finish());
        // Masks of coded blocks are not the extension's.
        let of_made = |extended: &DecodedBlocks| -> Vec<(u32, VoxelMask)> {
            let coded = coded_flags(extended);
            let masks = extended.volume().unobserved_masks().iter();
            masks.filter(|(block, _)| !coded[**block as usize]).map(|(b, m)| (*b, m.clone())).collect()
        };
        assert_eq!(found.sets().all, expected.sets().all);
        assert_eq!(found.sets().coded, expected.sets().coded);
        assert_eq!(of_made(&found), of_made(&expected));
        for block in 0..expected.volume().block_count() {
            assert_eq!(found.volume().block(block), expected.volume().block(block));
        }
        kept_blocks += found.sets().all.difference(&found.sets().unsettled).count();
        masks += found.volume().unobserved_masks().len();
    }
    assert!(kept_blocks > 100 && masks > 100, "{kept_blocks} blocks kept as they were, {masks} masks");
}
