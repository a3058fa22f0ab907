//! Entropy-coded syntax that both profiles have: the models of each kind of symbol and the reading side. `isv-encode` has the writing
//! side of each file under the same name.

pub mod block_set;
pub mod masks;

use isv_entropy::RangeDecoder;

/// Symbols that no encoder writes; what is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyntaxError(pub &'static str);

/// Fails if a segment's bytes ended before its symbols did.
pub(crate) fn check_overrun(decoder: &RangeDecoder, what: &'static str) -> Result<(), SyntaxError> {
    if decoder.overran() { Err(SyntaxError(what)) } else { Ok(()) }
}
