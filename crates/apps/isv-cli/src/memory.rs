//! `--max-memory`: how much a frame of a stream may ask for.

use anyhow::{Result, anyhow};
use isv::decode::Limits;
use isv::surface::{SurfaceExtractor, SurfaceOptions};
use isv::volume::{BlockSet, SparseVolume, TriangleMesh};
use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

/// Bytes that decoding takes at its peak for each voxel of a frame, rounded up: two samples of two bytes, of the frame and of the one
/// before, and as much for levels, tables and what is made of the volume (`docs/design/031-hostile-files.md`).
const BYTES_PER_VOXEL: u64 = 8;

static CHOSEN: OnceLock<MemorySize> = OnceLock::new();

/// Decides for the whole program; once.
pub(crate) fn choose(size: MemorySize) {
    // Nobody chooses twice.
    let _ = CHOSEN.set(size);
}

/// What was decided, if anything.
pub(crate) fn chosen() -> Option<MemorySize> {
    CHOSEN.get().copied()
}

/// Bounds on what a stream may ask of its decoder. Who says how much memory there is trusts the stream to use it.
pub(crate) fn limits() -> Limits {
    chosen().map_or_else(Limits::default, |MemorySize(bytes)| Limits {
        frame_voxels: usize::try_from(bytes / BYTES_PER_VOXEL).unwrap_or(usize::MAX),
        voxels_per_byte: usize::MAX,
    })
}

/// The surface of a volume of a stream, of as many vertices as there is memory for: each takes, with its normal and its triangles, what
/// eight voxels do.
pub(crate) fn surface(volume: &SparseVolume, options: SurfaceOptions) -> Result<TriangleMesh> {
    let limit = (limits().frame_voxels / 8).min(u32::MAX as usize);
    let mut extractor = SurfaceExtractor::new(options);
    match extractor.extract_within(volume, limit) {
        Ok(_) => Ok(extractor.into_mesh()),
        Err(error) => Err(match chosen() {
            Some(size) => anyhow!("{error}: that is what --max-memory {size} has room for"),
            None => anyhow!("{error}: --max-memory with a larger amount allows it"),
        }),
    }
}

/// Refuses a volume whose decoded frame would be refused. `extended`: whether decoders make up the blocks around it, as they do in
/// profile `main`.
pub(crate) fn check_frame(volume: &SparseVolume, extended: bool) -> Result<()> {
    let limit = limits().frame_voxels / volume.grid().edge.block_voxels();
    let with_neighbours = || BlockSet::of(volume.coords()).dilated().count();
    let blocks = match extended {
        // Mostly there is room for all neighbours that so many blocks can have.
        true if volume.block_count() > limit / 27 => with_neighbours(),
        _ => volume.block_count(),
    };
    if blocks <= limit {
        return Ok(());
    }
    let why = format!("the decoded frame would have {blocks} blocks, above the limit of {limit}");
    Err(match chosen() {
        Some(size) => {
            anyhow!("{why}: that is what --max-memory {size} has room for; larger voxels need less")
        }
        None => anyhow!(
            "{why} that decoders have: try larger voxels, or --max-memory with a larger amount, which then decoders need too"
        ),
    })
}

/// Largest payload of a packet worth reading: a frame that is larger than its samples was not compressed.
pub(crate) fn largest_payload() -> u32 {
    let bytes = chosen().map_or(u64::MAX, |MemorySize(bytes)| bytes / 4);
    u32::try_from(bytes).unwrap_or(u32::MAX)
}

impl MemorySize {
    /// In bytes.
    pub(crate) fn bytes(self) -> u64 {
        self.0
    }
}

/// An amount of memory above 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MemorySize(u64);

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

/// As it may be given on a command line.
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

    fn from_str(text: &str) -> std::result::Result<Self, String> {
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
