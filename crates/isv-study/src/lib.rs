//! Rate-distortion studies: several codecs over their operating points on one take, measured in one way.
//!
//! ```text
//! Take ─ Codec, OperatingPoint ─ measure ─> Record ─┬─ delta (Bjontegaard)
//!                                                   ├─ write_csv
//!                                                   └─ charts, pictures ─> page
//! ```
//!
//! [`measure`] encodes a take, decodes its bytes, compares every frame with what went in, and says what it cost: a
//! [`Record`]. [`Report`] turns records into tables, charts and one HTML page. Which codecs there are and at which points
//! they are measured is in [`Codec`].
//!
//! This crate runs no programs but those of the opponents and reads no captures: a [`Take`] gives it meshes.

mod bjontegaard;
mod chart;
mod codec;
mod error;
mod measure;
mod memory;
mod metric;
mod page;
mod picture;
mod record;
mod report;
mod session;
mod table;

pub use bjontegaard::{Delta, MeanDifference, RatePoint, delta, useful_points};
pub use chart::{Axis, Chart, Series};
pub use codec::{Codec, OperatingPoint, Scale, Training, UnknownCodec};
pub use error::StudyError;
pub use measure::{Measured, Prepared, StudySettings, Take, TakeError, TakeFrames, measure};
pub use metric::Metric;
pub use picture::{Exhibit, Exhibition, View};
pub use record::{BytesByKind, Record, Timing};
pub use report::{DeltaRow, Report};
