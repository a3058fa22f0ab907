//! Failures as Python exceptions.

use isv::ErrorKind;
use isv::raw::take::StreamError;
use isv::raw::take::stream::EditError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::{create_exception, intern};
use std::fmt::Display;

create_exception!(
    isv,
    IsvError,
    PyValueError,
    "Failure of a job, with what can be done about it in its attribute `kind`."
);

/// Makes an exception of an error of the library.
pub(crate) fn of_library(py: Python<'_>, error: isv::Error) -> PyErr {
    with_kind(py, kind_name(error.kind()), error)
}

/// Makes an exception of an error in a stream.
pub(crate) fn of_stream(py: Python<'_>, error: StreamError) -> PyErr {
    of_library(py, error.into())
}

/// Makes an exception of an error in a copy of streams.
pub(crate) fn of_edit(py: Python<'_>, error: EditError) -> PyErr {
    match error {
        EditError::Stream(error) => of_stream(py, error),
        error => with_kind(py, "output", error),
    }
}

/// Makes an exception of a kind.
pub(crate) fn with_kind(py: Python<'_>, kind: &str, why: impl Display) -> PyErr {
    let error = IsvError::new_err(why.to_string());
    match error.value(py).setattr(intern!(py, "kind"), kind) {
        Ok(()) => error,
        Err(error) => error,
    }
}

fn kind_name(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::Options => "options",
        ErrorKind::Input => "input",
        ErrorKind::Frame => "frame",
        ErrorKind::Stream => "stream",
        ErrorKind::Memory => "memory",
        ErrorKind::Device => "device",
        ErrorKind::Output => "output",
        ErrorKind::Cancelled => "cancelled",
        _ => "other",
    }
}
