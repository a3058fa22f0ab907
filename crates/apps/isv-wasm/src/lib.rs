//! The decoder as WebAssembly: packets of a stream in, meshes out, for `player/`.
//!
//! ```text
//! player/src/wasm.js ─ bytes ─> exports ─> Session: isv-format, isv-decode, isv-surface ─> lists that the page copies
//! ```
//!
//! One instance is one decoder. `session` is all of it, in safe Rust and tested on any machine; `exports` gives its calls plain
//! numbers and addresses. WebAssembly has no threads here: the loops that are parallel elsewhere run one after the other.
//!
//! `cargo xtask player` builds it into `player/src/isv.wasm`.

mod error;
mod exports;
mod session;
