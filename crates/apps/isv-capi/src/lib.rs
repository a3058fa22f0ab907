//! The C library: plain functions, structs and numbers over the crate [`isv`]. `include/isv.h` is made of this source.
//!
//! ```text
//! isv.h ─ function ─> call: no panic leaves ─> handle: number to object ─> memory: pointers to slices ─> isv
//! ```
//!
//! A handle is a number that is given out once, not an address. So a null, freed or foreign handle is an error, whatever it is.
//! Only `memory` and `callback` follow pointers of the caller.

#![allow(non_camel_case_types, reason = "types have the names of isv.h")]
#![allow(clippy::missing_safety_doc, reason = "isv.h says for each call what pointers must be")]

mod call;
mod callback;
mod decode_options;
mod encode_options;
mod frame;
mod handle;
mod memory;
mod reader;
mod status;
mod take;
mod types;
mod version;
mod writer;

pub use callback::*;
pub use decode_options::*;
pub use encode_options::*;
pub use frame::*;
pub use handle::isv_live_handles;
pub use reader::*;
pub use status::*;
pub use take::*;
pub use types::*;
pub use version::*;
pub use writer::*;
