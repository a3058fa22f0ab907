//! Fuzz targets: what each does with bytes. None of it may panic, hang, or take memory that the bytes do not justify.
//!
//! Targets of the codec take whole `.isv` streams, `range_decoder`, `encoder` and `colour` excepted. So what one of them finds is a
//! seed for the others, and what crashes one is a file that any decoder can be given.
//!
//! libFuzzer runs these targets (folder `fuzz`). The test `fuzz_targets` of `xtask` runs them on what campaigns kept.

mod colour;
mod container;
mod differential;
mod encoder;
mod library;
mod live;
mod loss;
mod mp4;
mod mutators;
mod range_decoder;
mod readers;
mod sealing;
mod stream;
mod targets;

pub use mutators::{Change, Mutator};
pub use targets::{TARGETS, Target, target};

/// Has all parallel loops of the process run on the thread that calls this. What is done for an input then
/// does not depend on what other threads happen to do, and no input waits for them. To be called once, first.
///
/// # Panics
/// If something has run in parallel before.
pub fn on_one_thread() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("nothing has run in parallel yet");
}
