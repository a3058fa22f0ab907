//! Rate-distortion studies: several codecs over their operating points on one take, measured in one way.
//!
//! ```text
//! Take ─┐
//! Codec ┴─> Subject ─ OperatingPoint ─> Record ─┬─> Delta (Bjontegaard)
//!                                               ├─> Chart ──┬─> page
//!                                               └─> tables ─┘
//! ```
//!
//! [`Subject::measure`] encodes a take, decodes its bytes, compares every frame with what went in, and says what it cost: a
//! [`Record`]. [`Report`] turns records into tables, charts and one HTML page. Which codecs there are and at which points
//! they are measured is in [`Codec`].
//!
//! ```
//! use isv_study::{RatePoint, delta};
//!
//! let anchor = [(1.0, 30.0), (2.0, 33.0), (4.0, 36.0)].map(|(rate, quality_db)| RatePoint { rate, quality_db });
//! let at_half_the_rate = anchor.map(|point| RatePoint { rate: point.rate / 2.0, ..point });
//! let saved = delta(&anchor, &at_half_the_rate).rate_percent.unwrap();
//! assert!((saved.mean + 50.0).abs() < 1e-9);
//! ```
//!
//! Each point of each codec runs in a process of its own ([`worker`]). Its peak memory is its own, and a failure stops no other point.
//! Measurements lie in a folder ([`Store`]). An interrupted study continues where it stopped.

mod bjontegaard;
mod captured_take;
mod chart;
mod codec;
mod cubes;
mod error;
mod figure_take;
mod measure;
mod memory;
mod metric;
mod page;
mod picture;
mod record;
mod report;
mod session;
mod sheet;
mod stages;
mod store;
mod table;
pub mod worker;

pub use bjontegaard::{Delta, MeanDifference, RatePoint, delta, useful_points};
pub use captured_take::CapturedTake;
pub use chart::{Axis, Chart, Series};
pub use codec::{Codec, OperatingPoint, PointGeometry, Scale, Training, UnknownCodec};
pub use cubes::drawable;
pub use error::StudyError;
pub use figure_take::{CodedFigure, DecodedFigure, FigureCoder, FigureFrame, FigureTake};
pub use isv_baseline::{Tools, UnusableTool};
pub use measure::{Measured, StudySettings, Subject, Take, TakeError, TakeFrames};
pub use memory::peak_bytes;
pub use metric::Metric;
pub use picture::{CodecPicture, CodecPictures, View};
pub use record::{BytesByKind, ProgramUse, Record, Timing};
pub use report::{Alike, DeltaRow, Peers, Report, SheetFile};
pub use sheet::{Sheet, SheetStream};
pub use stages::Stages;
pub use store::Store;
