//! Versions.

use std::ffi::c_char;

/// Major version of this header.
pub const ISV_VERSION_MAJOR: u32 = 0;
/// Minor version of this header. Below version 1.0, programs must be compiled anew for each.
pub const ISV_VERSION_MINOR: u32 = 1;
/// Patch version of this header.
pub const ISV_VERSION_PATCH: u32 = 0;

/// Returns the version of the library that the program runs with: major * 65536 + minor * 256 + patch.
#[unsafe(no_mangle)]
pub extern "C" fn isv_version() -> u32 {
    ISV_VERSION_MAJOR << 16 | ISV_VERSION_MINOR << 8 | ISV_VERSION_PATCH
}

/// Returns the version of the library as text, such as "0.1.0". The library owns the text, for good.
#[unsafe(no_mangle)]
pub extern "C" fn isv_version_text() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ffi::CStr;

    #[test]
    fn the_header_states_the_version_of_the_package() {
        let header = format!("{ISV_VERSION_MAJOR}.{ISV_VERSION_MINOR}.{ISV_VERSION_PATCH}");
        assert_eq!(header, env!("CARGO_PKG_VERSION"));
        assert_eq!(isv_version(), 0x00_01_00);
        // SAFETY: the text ends with a 0 and is never freed.
        let text = unsafe { CStr::from_ptr(isv_version_text()) };
        assert_eq!(text.to_str().unwrap(), header);
    }
}
