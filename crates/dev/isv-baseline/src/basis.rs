//! Orthonormal transforms of whole blocks: the fixed 3-D DCT and learned ones, side by side.

use isv_kernels::scan::scan_order;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockEdge, Grid, SparseVolume};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Sums that run side by side in a dot product.
const LANES: usize = 16;

/// A mean block and an orthonormal basis of blocks, most significant vector first.
///
/// A block of samples x has the coefficients `c_k = row_k . (x - mean)`, and `mean + sum c_k row_k` over the first K is
/// its reconstruction from K of them. Everything is in codes, a voxel at `(z * edge + y) * edge + x`.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockBasis {
    edge: BlockEdge,
    mean: Vec<f64>,
    rows: Vec<f64>,
}

impl BlockBasis {
    /// The orthonormal 3-D DCT in the codec's order of coefficients ([`scan_order`]), with a mean of zero.
    #[must_use]
    pub fn dct(edge: BlockEdge) -> Self {
        let n = edge.voxels();
        let cosine = |k: usize, x: usize| {
            let scale = if k == 0 { 1.0 / n as f64 } else { 2.0 / n as f64 }.sqrt();
            scale * ((2 * x + 1) as f64 * k as f64 * PI / (2 * n) as f64).cos()
        };
        let split = |i: usize| [i % n, i / n % n, i / n / n];
        let mut rows = Vec::with_capacity(edge.block_voxels().pow(2));
        for position in scan_order(edge, usize::MAX) {
            let frequency = split(usize::from(position));
            rows.extend((0..edge.block_voxels()).map(|voxel| {
                let at = split(voxel);
                (0..3).map(|axis| cosine(frequency[axis], at[axis])).product::<f64>()
            }));
        }
        Self { edge, mean: vec![0.0; edge.block_voxels()], rows }
    }

    /// A basis of n vectors of n voxels each, one after the other.
    pub(crate) fn from_rows(edge: BlockEdge, mean: Vec<f64>, rows: Vec<f64>) -> Self {
        debug_assert_eq!((mean.len(), rows.len()), (edge.block_voxels(), edge.block_voxels().pow(2)));
        Self { edge, mean, rows }
    }

    /// Edge of the blocks.
    #[must_use]
    pub fn edge(&self) -> BlockEdge {
        self.edge
    }

    /// Mean block, in codes.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// The k-th vector.
    #[must_use]
    pub fn row(&self, k: usize) -> &[f64] {
        let voxels = self.edge.block_voxels();
        &self.rows[k * voxels..][..voxels]
    }

    /// Bytes that the mean and the first K vectors would take in a stream, in the `f32` that blocks are transformed with.
    ///
    /// No codec here sends them: Tang et al. train beforehand and have sender and receiver share the result.
    #[must_use]
    pub fn shared_bytes(&self, coefficients: usize) -> usize {
        (1 + coefficients) * self.edge.block_voxels() * size_of::<f32>()
    }

    /// Every block of a volume reconstructed from its first K coefficients, not quantized; samples are rounded and
    /// clamped to the truncation, blocks and masks stay.
    ///
    /// # Panics
    /// If the volume's blocks have another edge or K is not 1 to the voxels of a block.
    #[must_use]
    pub fn truncate(&self, volume: &SparseVolume, coefficients: usize) -> SparseVolume {
        assert_eq!(volume.grid().edge, self.edge, "blocks of one size");
        let leading = LeadingBasis::new(self, coefficients);
        let voxels = self.edge.block_voxels();
        let mut samples = vec![0; volume.sample_count()];
        samples
            .par_chunks_exact_mut(voxels)
            .zip((0..volume.block_count()).into_par_iter().map(|block| volume.block(block)))
            .for_each_init(
                || (vec![0.0; coefficients], vec![0.0; voxels]),
                |(spectrum, block), (out, samples)| {
                    leading.forward(samples, block, spectrum);
                    leading.inverse(volume.grid(), spectrum, block, out);
                },
            );
        let (coords, masks) = (volume.coords().to_vec(), volume.unobserved_masks().clone());
        SparseVolume::from_parts(*volume.grid(), coords, samples, masks)
    }
}

/// The first K vectors of a basis in `f32`: of samples up to 4096 that is exact to a few thousandths of a code.
#[derive(Clone, Debug)]
pub(crate) struct LeadingBasis {
    mean: Vec<f32>,
    rows: Vec<f32>,
}

impl LeadingBasis {
    pub(crate) fn new(basis: &BlockBasis, coefficients: usize) -> Self {
        let voxels = basis.edge.block_voxels();
        assert!(
            (1..=voxels).contains(&coefficients),
            "{coefficients} coefficients of a block of {voxels} voxels"
        );
        let single = |values: &[f64]| values.iter().map(|v| *v as f32).collect();
        Self { mean: single(&basis.mean), rows: single(&basis.rows[..coefficients * voxels]) }
    }

    /// K.
    pub(crate) fn coefficients(&self) -> usize {
        self.rows.len() / self.mean.len()
    }

    /// Coefficients of a block of samples; `block` is room for one.
    pub(crate) fn forward(&self, samples: &[i16], block: &mut [f32], spectrum: &mut [f32]) {
        vectorized(
            #[inline(always)]
            || {
                for (centred, (sample, mean)) in block.iter_mut().zip(samples.iter().zip(&self.mean)) {
                    *centred = f32::from(*sample) - mean;
                }
                for (c, row) in spectrum.iter_mut().zip(self.rows.chunks_exact(self.mean.len())) {
                    *c = dot(block, row);
                }
            },
        );
    }

    /// Samples of a block of coefficients, rounded and clamped to the truncation; `block` is room for one.
    pub(crate) fn inverse(&self, grid: &Grid, spectrum: &[f32], block: &mut [f32], samples: &mut [i16]) {
        let limit = f32::from(grid.truncation.codes());
        vectorized(
            #[inline(always)]
            || {
                block.copy_from_slice(&self.mean);
                for (c, row) in spectrum.iter().zip(self.rows.chunks_exact(self.mean.len())) {
                    if *c != 0.0 {
                        for (sum, r) in block.iter_mut().zip(row) {
                            *sum += c * r;
                        }
                    }
                }
                for (sample, sum) in samples.iter_mut().zip(block) {
                    *sample = sum.round().clamp(-limit, limit) as i16;
                }
            },
        );
    }
}

/// Sum of products, in lanes that add up at the end; blocks are whole multiples of them.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum()
}
