//! The settings of a stream of profile `paper`, made ready for use.

use isv_format::PaperParameters;
use isv_kernels::dct::BlockTransform;
use isv_kernels::quant::{Quantizer, StepSize};
use isv_kernels::scan::scan_order;
use isv_volume::Grid;

/// Transform, quantizers and scan of a stream of profile `paper`.
#[derive(Clone, Debug)]
pub struct CodingParameters {
    /// The grid of every frame.
    pub grid: Grid,
    /// 3-D DCT.
    pub transform: BlockTransform,
    /// Quantizer of coefficient 0.
    pub dc: Quantizer,
    /// Quantizer of all others.
    pub ac: Quantizer,
    /// Position in the block of each coded coefficient, lowest frequency first; K of them.
    pub scan: Vec<u16>,
}

impl CodingParameters {
    /// Parameters of a checked header: its grid and those of its profile.
    ///
    /// # Panics
    /// If the steps are out of range; [`isv_format::StreamHeader::parse`] lets none through that is.
    #[must_use]
    pub fn new(grid: Grid, paper: &PaperParameters) -> Self {
        let transform = BlockTransform::new(grid.edge, grid.truncation);
        let quantizer = |step| {
            let step = StepSize::new(step).expect("the header's steps are in range");
            Quantizer::new(step, transform.coefficient_exponent())
        };
        Self {
            grid,
            transform,
            dc: quantizer(paper.dc_step),
            ac: quantizer(paper.ac_step),
            scan: scan_order(grid.edge, usize::from(paper.coefficients)),
        }
    }

    /// How many coefficients of a block are coded: K.
    #[must_use]
    pub fn coefficients(&self) -> usize {
        self.scan.len()
    }

    /// Quantizer of the k-th coefficient in scan order.
    #[must_use]
    pub fn quantizer(&self, k: usize) -> &Quantizer {
        if k == 0 { &self.dc } else { &self.ac }
    }
}
