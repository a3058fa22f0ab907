//! Counts on the command line.

use std::str::FromStr;

/// Parses a count, which is a [`std::num::NonZero`], for clap.
pub(crate) fn parse<N: FromStr>(text: &str) -> Result<N, &'static str> {
    text.parse().map_err(|_| "it is a whole number above 0")
}
