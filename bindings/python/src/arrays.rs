//! Arrays of NumPy from and to the library's vectors.

use numpy::ndarray::{Array2, Array4, ArrayView2};
use numpy::{Element, IntoPyArray, PyArray2, PyArray4, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Makes an array of N rows, which owns the vector's memory.
pub(crate) fn rows<'py, T: Element, const N: usize>(
    py: Python<'py>,
    rows: Vec<[T; N]>,
) -> Bound<'py, PyArray2<T>> {
    let shape = (rows.len(), N);
    let array = Array2::from_shape_vec(shape, rows.into_flattened()).expect("each row has N elements");
    array.into_pyarray(py)
}

/// Makes an array of N rows, or `None` of no rows.
pub(crate) fn some_rows<'py, T: Element, const N: usize>(
    py: Python<'py>,
    vector: Vec<[T; N]>,
) -> Option<Bound<'py, PyArray2<T>>> {
    (!vector.is_empty()).then(|| rows(py, vector))
}

/// Makes an array of cubes, which owns the vector's memory.
pub(crate) fn cubes<'py>(py: Python<'py>, edge: usize, samples: Vec<f32>) -> Bound<'py, PyArray4<f32>> {
    let shape = (samples.len() / edge.pow(3).max(1), edge, edge, edge);
    Array4::from_shape_vec(shape, samples).expect("each cube has all its samples").into_pyarray(py)
}

/// Copies an array of N columns. `name` is its name in errors.
///
/// # Errors
/// `ValueError` for another number of columns.
pub(crate) fn to_rows<T: Element + Copy, const N: usize>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
) -> PyResult<Vec<[T; N]>> {
    if array.shape()[1] != N {
        return Err(PyValueError::new_err(format!(
            "{name} have {} columns in place of {N}",
            array.shape()[1]
        )));
    }
    let view: ArrayView2<'_, T> = array.as_array();
    if let Some(elements) = view.as_slice() {
        return Ok(elements.as_chunks::<N>().0.to_vec());
    }
    Ok(view.outer_iter().map(|row| std::array::from_fn(|column| row[column])).collect())
}
