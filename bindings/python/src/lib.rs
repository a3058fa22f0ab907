//! The extension module of the Python package `isv`: arrays of NumPy to calls of the library, and back.
//!
//! What users see is in `python/isv`. Here is only what cannot be written in Python; its functions are documented in
//! `python/isv/_isv.pyi`.

mod arrays;
mod errors;
mod exclusive;
mod files;
mod jobs;
mod options;
mod pictures;
mod reader;
mod threads;
mod writer;

use pyo3::prelude::*;

#[pymodule]
fn _isv(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // Before any thread could be building them while the process is forked.
    isv::raw::decode::main::syntax::block_set::build_table();
    isv::raw::surface::build_tables();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("IsvError", module.py().get_type::<errors::IsvError>())?;
    module.add_class::<reader::Reader>()?;
    module.add_class::<reader::Frame>()?;
    module.add_class::<reader::SurfaceParts>()?;
    module.add_class::<writer::Writer>()?;
    module.add_function(wrap_pyfunction!(jobs::encode, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::info, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::repair, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::mux, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::demux, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::join, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::cut, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::frame_files, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::settle_options, module)?)?;
    module.add_function(wrap_pyfunction!(jobs::verify, module)?)?;
    module.add_function(wrap_pyfunction!(pictures::draw, module)?)?;
    module.add_function(wrap_pyfunction!(threads::set_threads, module)?)?;
    Ok(())
}
