//! Samples for voxels that were not observed.

use isv_volume::{BlockEdge, VoxelMask};

/// Gives the unobserved voxels of a block values that are cheap to code. What was observed spreads, voxel by
/// voxel along the axes. Each voxel takes the mean of those neighbours that have a value already. What the
/// file says there has no meaning. Of a block that was not observed at all nothing is changed.
pub fn fill_unobserved(edge: BlockEdge, samples: &mut [i16], unobserved: &VoxelMask) {
    let n = edge.voxels();
    let mut unknown = unobserved.clone();
    let mut missing: Vec<usize> = (0..samples.len()).filter(|voxel| unknown.contains(*voxel)).collect();
    if missing.len() == samples.len() {
        return;
    }
    while !missing.is_empty() {
        let means: Vec<_> =
            missing.iter().map(|&voxel| (voxel, mean_of_known(voxel, n, samples, &unknown))).collect();
        for (voxel, mean) in means {
            if let Some(mean) = mean {
                samples[voxel] = mean;
                unknown.remove(voxel);
            }
        }
        missing.retain(|voxel| unknown.contains(*voxel));
    }
}

/// Mean of the face neighbours, inside the block, that have a value.
fn mean_of_known(voxel: usize, n: usize, samples: &[i16], unknown: &VoxelMask) -> Option<i16> {
    let (mut sum, mut count) = (0, 0);
    for stride in [1, n, n * n] {
        let place = voxel / stride % n;
        let before = (place > 0).then(|| voxel - stride);
        let after = (place + 1 < n).then(|| voxel + stride);
        for neighbour in before.into_iter().chain(after).filter(|v| !unknown.contains(*v)) {
            sum += i32::from(samples[neighbour]);
            count += 1;
        }
    }
    (count > 0).then(|| (sum / count) as i16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn observed_samples_stay_and_spread() {
        let edge = BlockEdge::E4;
        let mut samples = vec![9999; 64];
        samples[..16].fill(100);
        let mut unobserved = VoxelMask::empty(edge);
        (16..64).for_each(|voxel| unobserved.insert(voxel));
        fill_unobserved(edge, &mut samples, &unobserved);
        assert_eq!(samples, [100; 64]);
    }

    #[test]
    fn a_voxel_between_two_takes_their_mean() {
        let edge = BlockEdge::E4;
        let mut samples: Vec<i16> = (0..64).map(|voxel| 256 * (voxel % 4)).collect();
        let expected = samples.clone();
        let hole = edge.voxel_index(1, 1, 1);
        samples[hole] = -1000;
        let mut unobserved = VoxelMask::empty(edge);
        unobserved.insert(hole);
        fill_unobserved(edge, &mut samples, &unobserved);
        assert_eq!(samples, expected);
    }
}
