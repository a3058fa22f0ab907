//! Stanford PLY 1.0, after Greg Turk's description of the format (1994). A text header declares elements and
//! their properties. The rows of each element follow in the header's order, as text or binary in either byte
//! order.

mod arriving;
mod colours;
mod header;
mod read;
mod values;
mod write;

pub(crate) use arriving::Arriving;
pub(crate) use read::parse;
pub(crate) use write::{write, write_points};
