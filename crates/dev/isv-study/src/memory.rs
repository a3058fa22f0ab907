//! Peak memory of this process, as Linux counts it.

use std::fs;

/// The most memory that was resident since the process began or was counted anew, in bytes; `None` where the
/// system does not say.
#[must_use]
pub fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Starts counting anew (proc(5): writing 5 to `clear_refs` sets the peak to what is resident now). False where that is not
/// possible, so that what [`peak_bytes`] says is the peak of everything so far.
pub(crate) fn reset_peak() -> bool {
    fs::write("/proc/self/clear_refs", "5").is_ok()
}
