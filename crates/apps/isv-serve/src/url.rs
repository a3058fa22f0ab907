//! Addresses within the server, as they stand in a link.

use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};

/// What is written as it is in a segment of a path.
const SEGMENT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');
/// Characters to escape in a value of a query, where slashes need no escape either.
const QUERY: &AsciiSet = &SEGMENT.remove(b'/');

/// A name as one segment of a path.
pub(crate) fn segment(name: &str) -> String {
    utf8_percent_encode(name, SEGMENT).to_string()
}

/// An address as a value of a query.
pub(crate) fn query_value(address: &str) -> String {
    utf8_percent_encode(address, QUERY).to_string()
}
