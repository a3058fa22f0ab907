//! Entropy coding: a binary range coder, the adaptive models that drive it, and binarizations of integers.
//!
//! Range coding is Martin 1979 (the paper's Sec. 3.3) with the carry handled as in LZMA. Models adapt as symbols are
//! coded, the same way on both sides, so no tables are sent (Sec. 3.4, "Adaptive probability models").
//!
//! ```
//! use isv_entropy::{IntegerModel, RangeDecoder, RangeEncoder};
//!
//! let mut encoder = RangeEncoder::new();
//! let mut model = IntegerModel::default();
//! for value in [0, 0, -3, 1200] {
//!     model.encode(&mut encoder, value);
//! }
//! let bytes = encoder.finish();
//!
//! let mut decoder = RangeDecoder::new(&bytes);
//! let mut model = IntegerModel::default();
//! assert_eq!([0; 4].map(|_| model.decode(&mut decoder)), [0, 0, -3, 1200]);
//! assert!(!decoder.overran());
//! ```

mod binarization;
mod decision_sink;
mod model;
mod range_coder;

pub use binarization::{IntegerModel, MAGNITUDE_LIMIT};
pub use decision_sink::{BitCount, DecisionSink};
pub use model::BitModel;
pub use range_coder::{RangeDecoder, RangeEncoder};
