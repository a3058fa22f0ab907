//! Quantized coefficients: one stream an index (Sec. 3.3), each with adaptive models of its own (Sec. 3.4).

use crate::shared::BitTally;
use crate::shared::syntax::{SyntaxError, check_overrun};
use isv_entropy::{IntegerModel, RangeDecoder};

/// One model an index, for blocks predicted by zero and for blocks predicted from the reference: their residuals have
/// nothing in common.
#[derive(Clone, Debug)]
pub struct CoefficientModels {
    /// `models[predicted][k]`.
    pub models: [Vec<IntegerModel>; 2],
}

impl CoefficientModels {
    /// Fresh models for K indices.
    #[must_use]
    pub fn new(coefficients: usize) -> Self {
        let models = vec![IntegerModel::default(); coefficients];
        Self { models: [models.clone(), models] }
    }

    /// Reads a slice: for each index in scan order, its level in each block. Returns K levels a block, block after block.
    ///
    /// `references`: for each block of the slice, whether and from where it is predicted. `tally`: of these blocks.
    ///
    /// # Errors
    /// Bytes that end too early.
    pub fn read(
        &mut self,
        bytes: &[u8],
        references: &[Option<u32>],
        tally: &mut BitTally,
    ) -> Result<Vec<i32>, SyntaxError> {
        let mut decoder = RangeDecoder::new(bytes);
        tally.begin(&decoder);
        let count = self.models[0].len();
        let mut levels = vec![0; references.len() * count];
        for k in 0..count {
            for (block, reference) in references.iter().enumerate() {
                let model = &mut self.models[usize::from(reference.is_some())][k];
                levels[block * count + k] = model.decode(&mut decoder);
                tally.charge(block, &decoder);
            }
            check_overrun(&decoder, "the coefficients end too early")?;
        }
        Ok(levels)
    }
}
