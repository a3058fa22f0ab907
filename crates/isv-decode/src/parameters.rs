//! The stream header's settings, made ready for use.

use isv_format::StreamHeader;
use isv_kernels::dct::BlockTransform;
use isv_kernels::quant::{Quantizer, StepSize};
use isv_kernels::scan::scan_order;
use isv_volume::Grid;

/// Transform, quantizers and scan of a stream.
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
    /// Parameters of a checked header.
    ///
    /// # Panics
    /// If the header's steps are out of range; [`StreamHeader::parse`] lets none through that is.
    #[must_use]
    pub fn new(header: &StreamHeader) -> Self {
        let transform = BlockTransform::new(header.grid.edge, header.grid.truncation);
        let quantizer = |step| {
            let step = StepSize::new(step).expect("the header's steps are in range");
            Quantizer::new(step, transform.coefficient_exponent())
        };
        Self {
            grid: header.grid,
            transform,
            dc: quantizer(header.dc_step),
            ac: quantizer(header.ac_step),
            scan: scan_order(header.grid.edge, usize::from(header.coefficients)),
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
