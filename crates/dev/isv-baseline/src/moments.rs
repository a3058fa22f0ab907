//! What blocks have in common: exact sums of their samples and of the products of any two.

use crate::BlockBasis;
use isv_kernels::simd::vectorized;
use isv_volume::{BlockEdge, Grid, SparseVolume};
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;
use thiserror::Error;

/// Blocks whose products are summed at a time: a sum of 64 products of samples up to 4096 stays within 31 bits.
const CHUNK: usize = 64;

/// A transform that cannot be learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum TrainingError {
    /// Nothing to learn from.
    #[error("a transform cannot be learned from no blocks")]
    NoBlocks,
    /// 4096 x 4096 covariances take minutes, and Tang et al. use 8.
    #[error("a transform of blocks of 16 voxels is too large to learn: 8 or 4 is the most")]
    BlockTooLarge,
}

/// First and second moments of the blocks of some volumes. A Karhunen-Loève transform is learned from them, and the
/// energy compaction of any transform is measured on them.
///
/// Sums are exact integers, so neither the order of volumes nor the number of threads matters. Memory is `8 * n * n`
/// bytes for n voxels a block (2 MiB at an edge of 8), whatever is added. Samples of unobserved voxels count as the codec's
/// own transform sees them: with the values that ingest has put there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockMoments {
    edge: BlockEdge,
    blocks: u64,
    sums: Vec<i64>,
    /// `products[i][j]` for `j <= i`.
    products: Vec<Vec<i64>>,
}

impl BlockMoments {
    /// Moments of no blocks yet.
    ///
    /// # Errors
    /// [`TrainingError::BlockTooLarge`] for blocks of 16 voxels.
    pub fn new(grid: &Grid) -> Result<Self, TrainingError> {
        if grid.edge == BlockEdge::E16 {
            return Err(TrainingError::BlockTooLarge);
        }
        let voxels = grid.edge.block_voxels();
        Ok(Self {
            edge: grid.edge,
            blocks: 0,
            sums: vec![0; voxels],
            products: (1..=voxels).map(|n| vec![0; n]).collect(),
        })
    }

    /// Adds all blocks of a volume.
    ///
    /// # Panics
    /// If its blocks have another edge.
    pub fn add(&mut self, volume: &SparseVolume) {
        assert_eq!(volume.grid().edge, self.edge, "blocks of one size");
        let voxels = self.edge.block_voxels();
        let mut by_voxel = vec![[0; CHUNK]; voxels];
        for first in (0..volume.block_count()).step_by(CHUNK) {
            by_voxel.fill([0; CHUNK]);
            for block in first..volume.block_count().min(first + CHUNK) {
                for (row, sample) in by_voxel.iter_mut().zip(volume.block(block)) {
                    row[block - first] = *sample;
                }
            }
            for (sum, row) in self.sums.iter_mut().zip(&by_voxel) {
                *sum += row.iter().map(|s| i64::from(*s)).sum::<i64>();
            }
            self.products
                .par_iter_mut()
                .enumerate()
                .with_min_len(32)
                .for_each(|(i, products)| vectorized(|| add_products(products, &by_voxel[i], &by_voxel)));
        }
        self.blocks += volume.block_count() as u64;
    }

    /// Adds the blocks that other moments were taken of.
    ///
    /// # Panics
    /// If those blocks have another edge.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(other.edge, self.edge, "blocks of one size");
        self.blocks += other.blocks;
        let ours = self.sums.iter_mut().chain(self.products.iter_mut().flatten());
        let theirs = other.sums.iter().chain(other.products.iter().flatten());
        ours.zip(theirs).for_each(|(a, b)| *a += b);
    }

    /// How many blocks these are the moments of.
    #[must_use]
    pub fn blocks(&self) -> u64 {
        self.blocks
    }

    /// The Karhunen-Loève transform of these blocks: their mean and the eigenvectors of their covariance.
    ///
    /// # Errors
    /// [`TrainingError::NoBlocks`].
    pub fn klt(&self) -> Result<BlockBasis, TrainingError> {
        if self.blocks == 0 {
            return Err(TrainingError::NoBlocks);
        }
        let eigen = SymmetricEigen::new(self.covariance());
        let mut order: Vec<usize> = (0..self.sums.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let rows =
            order.into_iter().flat_map(|k| eigen.eigenvectors.column(k).iter().copied().collect::<Vec<_>>());
        Ok(BlockBasis::from_rows(self.edge, self.mean(), rows.collect()))
    }

    /// Share of the blocks' energy that a transform recovers from its first K coefficients. There are n + 1 numbers up to
    /// 1, for K from 0 to all n.
    ///
    /// The energy is that about these blocks' own mean. The part that is not recovered is the squared error of a
    /// reconstruction from K coefficients without quantization. So the share is `1 - sum |x - x_K|^2 / sum |x - m|^2`. All
    /// transforms are held against the same energy, whatever mean they carry. The fixed DCT has none and spends
    /// coefficients on it. A mean learned from other scenes costs something if it does not fit these blocks. A KLT of these
    /// very blocks is the best there is at every K. The share can be negative at K = 0. Of blocks that are all the same, 1
    /// is returned throughout.
    ///
    /// # Errors
    /// [`TrainingError::NoBlocks`].
    ///
    /// # Panics
    /// If the transform is of blocks of another edge.
    pub fn energy_shares(&self, basis: &BlockBasis) -> Result<Vec<f64>, TrainingError> {
        assert_eq!(basis.edge(), self.edge, "blocks of one size");
        if self.blocks == 0 {
            return Err(TrainingError::NoBlocks);
        }
        let (covariance, mean) = (self.covariance(), self.mean());
        let total = covariance.trace();
        // E |x - b|^2 is the variance about the mean m and the squared distance from m to the basis's own b.
        let away: Vec<f64> = mean.iter().zip(basis.mean()).map(|(m, b)| m - b).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let energies: Vec<f64> = (0..mean.len())
            .into_par_iter()
            .map(|k| {
                let row = basis.row(k);
                let variance: f64 = covariance
                    .column_iter()
                    .zip(row)
                    .map(|(column, r)| r * dot(column.as_slice(), row))
                    .sum();
                variance + dot(row, &away).powi(2)
            })
            .collect();
        let mut error = total + dot(&away, &away);
        let share = |error: f64| if total > 0.0 { 1.0 - error / total } else { 1.0 };
        let mut shares = vec![share(error)];
        for energy in energies {
            error -= energy;
            shares.push(share(error.max(0.0)));
        }
        Ok(shares)
    }

    /// Mean block, in codes.
    fn mean(&self) -> Vec<f64> {
        self.sums.iter().map(|sum| *sum as f64 / self.blocks as f64).collect()
    }

    /// Covariance of any two voxels, in squared codes; computed from whole numbers up to the last division.
    fn covariance(&self) -> DMatrix<f64> {
        let blocks = self.blocks as f64;
        DMatrix::from_fn(self.sums.len(), self.sums.len(), |i, j| {
            let product = self.products[i.max(j)][i.min(j)];
            let scaled = i128::from(product) * i128::from(self.blocks)
                - i128::from(self.sums[i]) * i128::from(self.sums[j]);
            scaled as f64 / blocks / blocks
        })
    }
}

/// Adds the products of one voxel's samples with those of each voxel up to it.
#[inline(always)]
fn add_products(sums: &mut [i64], row: &[i16; CHUNK], by_voxel: &[[i16; CHUNK]]) {
    for (sum, other) in sums.iter_mut().zip(by_voxel) {
        let mut chunk = 0;
        for i in 0..CHUNK {
            chunk += i32::from(row[i]) * i32::from(other[i]);
        }
        *sum += i64::from(chunk);
    }
}
