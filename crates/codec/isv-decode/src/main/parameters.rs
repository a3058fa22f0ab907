//! What holds for every frame of a stream in profile `main`.

use isv_entropy::MAGNITUDE_LIMIT;
use isv_format::MainFrameHeader;
use isv_kernels::dct::BlockTransform;
use isv_kernels::deblock::FaceFilter;
use isv_kernels::quant::{Quantizer, StepSize};
use isv_kernels::scan::scan_order;
use isv_volume::{BlockEdge, Grid};

// What the container lets through is what kernels and models can do.
const _: () = assert!(MainFrameHeader::MAX_FILTER == FaceFilter::MAX_STRENGTH);
const _: () = assert!(MainFrameHeader::MAX_STEP == *StepSize::RANGE.end());
const _: () = assert!(MAGNITUDE_LIMIT == Quantizer::LARGEST_LEVEL as u32);

/// Coefficients of a block that can be coded: those of index sum 8 or less.
pub const COEFFICIENTS: usize = 162;

/// Grid, transform and scan of a stream.
#[derive(Clone, Debug)]
pub struct MainParameters {
    /// The grid of every frame; the block edge is 8.
    pub grid: Grid,
    /// 3-D DCT.
    pub transform: BlockTransform,
    /// Position in the block of each coefficient, lowest frequency first; [`COEFFICIENTS`] of them.
    pub scan: Vec<u16>,
    /// For each place in scan order, the places of the frequencies one lower along x, y and z.
    pub lower: Vec<[Option<u8>; 3]>,
}

impl MainParameters {
    /// Parameters of the grid of a checked header.
    ///
    /// # Panics
    /// If the block edge is not 8; [`isv_format::StreamHeader::parse`] lets no other through in this profile.
    #[must_use]
    pub fn new(grid: Grid) -> Self {
        assert_eq!(grid.edge, BlockEdge::E8, "profile main has blocks of 8 voxels");
        let scan = scan_order(grid.edge, COEFFICIENTS);
        let place = |position: usize| scan.iter().position(|p| usize::from(*p) == position).map(|k| k as u8);
        let lower = scan.iter().map(|&position| {
            let position = usize::from(position);
            [1, 8, 64].map(|stride| if position / stride % 8 > 0 { place(position - stride) } else { None })
        });
        let lower = lower.collect();
        Self { grid, transform: BlockTransform::new(grid.edge, grid.truncation), scan, lower }
    }

    /// The quantizer of a frame's step, in sixteenths of a code.
    ///
    /// # Panics
    /// If the step is out of range; the frame header's parser lets none through that is.
    #[must_use]
    pub fn quantizer(&self, step: u32) -> Quantizer {
        let step = StepSize::new(step).expect("the frame header's step is in range");
        Quantizer::new(step, self.transform.coefficient_exponent())
    }

    /// Index sum `u + v + w` of the coefficient at a place in scan order.
    #[must_use]
    pub fn index_sum(&self, k: usize) -> usize {
        let position = usize::from(self.scan[k]);
        position % 8 + position / 8 % 8 + position / 64
    }
}
