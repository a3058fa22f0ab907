//! Amounts of memory: `500MB`, `2GiB`.

use std::fmt;
use std::str::FromStr;

/// An amount of memory above 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemorySize(u64);

impl MemorySize {
    /// In bytes.
    #[must_use]
    pub fn bytes(self) -> u64 {
        self.0
    }
}

/// Names of units and their bytes; longer names come before those that they end with.
const UNITS: [(&str, u64); 7] = [
    ("GiB", 1 << 30),
    ("MiB", 1 << 20),
    ("KiB", 1 << 10),
    ("GB", 1_000_000_000),
    ("MB", 1_000_000),
    ("KB", 1000),
    ("kB", 1000),
];

/// Text as a command line takes it.
impl fmt::Display for MemorySize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fits = |(_, unit): &&(&str, u64)| self.0.is_multiple_of(*unit);
        match UNITS.iter().filter(fits).max_by_key(|(_, unit)| *unit) {
            Some((name, unit)) => write!(f, "{}{name}", self.0 / unit),
            None => write!(f, "{} bytes", self.0),
        }
    }
}

impl FromStr for MemorySize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = UNITS.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit)));
        let bytes = found.and_then(|(number, unit)| {
            let number: f64 = number.trim_end().parse().ok()?;
            (number > 0.0 && number <= 1e9).then_some((number * unit as f64) as u64)
        });
        let bytes = bytes.filter(|bytes| *bytes > 0);
        bytes.map(Self).ok_or_else(|| {
            "an amount of memory is a number above 0 with its unit, as in 500MB or 2GiB".to_owned()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_need_a_unit() {
        for (text, bytes) in [
            ("500MB", 500_000_000),
            ("2GiB", 2 << 30),
            ("0.5 GB", 500_000_000),
            ("64 KiB", 1 << 16),
            ("1KB", 1000),
        ] {
            assert_eq!(text.parse::<MemorySize>().unwrap(), MemorySize(bytes), "{text}");
        }
        for wrong in ["2", "GB", "-2GB", "0MB", "2gb", "", "infGB", "1e10GiB", "nanMB", "0.0001kB"] {
            assert!(wrong.parse::<MemorySize>().is_err(), "{wrong}");
        }
        for text in ["2GiB", "500MB", "3kB"] {
            assert_eq!(text.parse::<MemorySize>().unwrap().to_string(), text);
        }
    }
}
