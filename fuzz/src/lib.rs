//! What the fuzz targets do with bytes. None of it may panic, hang, or take memory that the bytes do not justify.
//!
//! Targets of the codec take whole `.isv` streams, `range_decoder`, `encoder` and `colour` excepted. So what one of them finds is a
//! seed for the others, and what crashes one is a file that any decoder can be given.

pub mod colour;
pub mod container;
pub mod differential;
pub mod encoder;
pub mod library;
pub mod live;
pub mod loss;
pub mod mp4;
pub mod mutators;
pub mod range_decoder;
pub mod stream;

mod readers;
mod sealing;

pub use readers::{
    ingest, play_animation, read_arrays, read_dense, read_depth, read_depth_image, read_geometry, read_image,
    read_materials, read_pipe, read_scans, split,
};

/// Has all parallel loops of the process run on the thread that calls this. What is done for an input then
/// does not depend on what other threads happen to do, and no input waits for them. To be called once, first.
pub fn on_one_thread() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("nothing has run in parallel yet");
}
