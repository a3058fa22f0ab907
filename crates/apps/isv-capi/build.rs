//! Names the shared library for the loader: programs ask for `libisv.so.0.1`, whatever file name Cargo gives it.

use std::env::var;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let major = var("CARGO_PKG_VERSION_MAJOR").expect("Cargo sets it");
    let minor = var("CARGO_PKG_VERSION_MINOR").expect("Cargo sets it");
    // Minor versions below 1.0 may break the interface.
    let abi = if major == "0" { format!("0.{minor}") } else { major };
    match var("CARGO_CFG_TARGET_OS").expect("Cargo sets it").as_str() {
        "linux" | "android" | "freebsd" | "netbsd" | "openbsd" => {
            println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libisv.so.{abi}");
        }
        "macos" | "ios" => {
            println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libisv.{abi}.dylib");
        }
        _ => {}
    }
}
