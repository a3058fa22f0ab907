//! Python's files and sockets as Rust's.

use crate::errors;
use pyo3::exceptions::{PyBlockingIOError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// The first exception that a Python object raised in a call from Rust: errors of the library keep its text alone.
#[derive(Clone, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// The exception, if there is one, or else that of an error of the library.
    pub(crate) fn or(&self, py: Python<'_>, error: isv::Error) -> PyErr {
        self.take().unwrap_or_else(|| errors::of_library(py, error))
    }

    pub(crate) fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn keep(&self, error: PyErr) -> io::Error {
        let text = error.to_string();
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        io::Error::other(text)
    }
}

/// A Python object with a method that gives bytes: `recv`, `read1` or `read`.
pub(crate) struct PySource {
    object: Py<PyAny>,
    method: &'static str,
    raised: Raised,
}

impl PySource {
    /// The source, by the method that returns what is there and does not wait for more.
    pub(crate) fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let mut methods = ["recv", "read1", "read"].into_iter();
        let method = methods.find(|method| object.hasattr(*method).unwrap_or(false)).unwrap_or("read");
        object.getattr(method)?;
        Ok(Self { object: object.clone().unbind(), method, raised: raised.clone() })
    }
}

impl Read for PySource {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        Python::attach(|py| {
            let bytes = self.object.call_method1(py, self.method, (into.len(),));
            let bytes = bytes.and_then(|bytes| Ok(bytes.extract::<Py<PyBytes>>(py)?));
            let bytes = bytes.map_err(|error| self.raised.keep(error))?;
            let bytes = bytes.as_bytes(py);
            let Some(into) = into.get_mut(..bytes.len()) else {
                return Err(io::Error::other(format!("{}() gave more than was asked for", self.method)));
            };
            into.copy_from_slice(bytes);
            Ok(bytes.len())
        })
    }
}

impl Seek for PySource {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        Python::attach(|py| {
            let place = match to {
                SeekFrom::Start(at) => (i128::from(at), 0),
                SeekFrom::Current(by) => (i128::from(by), 1),
                SeekFrom::End(by) => (i128::from(by), 2),
            };
            let at = self.object.call_method1(py, "seek", place).and_then(|at| at.extract(py));
            at.map_err(|error| self.raised.keep(error))
        })
    }
}

/// A Python object with a method that takes bytes: `sendall` or `write`.
pub(crate) struct PySink {
    object: Py<PyAny>,
    method: &'static str,
    /// Whether it is one of Python's raw files: that they take nothing, they say by `None`.
    is_raw: bool,
    raised: Raised,
}

impl PySink {
    pub(crate) fn new(object: &Bound<'_, PyAny>, raised: &Raised) -> PyResult<Self> {
        let method = if object.hasattr("sendall")? { "sendall" } else { "write" };
        object.getattr(method)?;
        let is_raw = object.is_instance(&object.py().import("io")?.getattr("RawIOBase")?)?;
        Ok(Self { object: object.clone().unbind(), method, is_raw, raised: raised.clone() })
    }
}

impl Write for PySink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Python::attach(|py| {
            let written = self.object.call_method1(py, self.method, (PyBytes::new(py, bytes),));
            let written = written.and_then(|written| written.extract::<Option<usize>>(py));
            match written.map_err(|error| self.raised.keep(error))? {
                Some(count) if count <= bytes.len() => Ok(count),
                Some(count) => {
                    let why = format!("write says that it took {count} of {} bytes", bytes.len());
                    Err(self.raised.keep(PyValueError::new_err(why)))
                }
                None if self.is_raw => {
                    Err(self.raised.keep(PyBlockingIOError::new_err("write returned None: it took nothing")))
                }
                None => Ok(bytes.len()),
            }
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        Python::attach(|py| match self.object.getattr(py, "flush") {
            Ok(flush) => flush.call0(py).map(drop).map_err(|error| self.raised.keep(error)),
            // Sockets have none.
            Err(_) => Ok(()),
        })
    }
}
