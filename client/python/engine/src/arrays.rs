//! Arrays of NumPy as planes of the engine, and back.

use crate::error::Refused;
use lightpath_optics::Plane;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// Copies an array \[y\]\[x\] into a plane.
pub(crate) fn plane<T: Element + Copy>(
    name: &'static str,
    array: &PyReadonlyArray2<'_, T>,
) -> Result<Plane<T>, Refused> {
    let [height_px, width_px] = [array.shape()[0], array.shape()[1]];
    Ok(Plane::try_from_vec(height_px, width_px, contiguous(name, array.as_slice().ok())?.to_vec())?)
}

/// Copies the planes of an array \[index\]\[y\]\[x\].
pub(crate) fn planes<T: Element + Copy>(
    name: &'static str,
    array: &PyReadonlyArray3<'_, T>,
) -> Result<Vec<Plane<T>>, Refused> {
    let [height_px, width_px] = [array.shape()[1], array.shape()[2]];
    let values = contiguous(name, array.as_slice().ok())?;
    let planes = values.chunks_exact((height_px * width_px).max(1));
    Ok(planes.map(|values| Plane::try_from_vec(height_px, width_px, values.to_vec())).collect::<Result<_, _>>()?)
}

/// Copies the planes of an array \[index\]\[y\]\[x\] into one plane, one below the other.
pub(crate) fn frames_of<T: Element + Copy>(
    name: &'static str,
    array: &PyReadonlyArray3<'_, T>,
) -> Result<Plane<T>, Refused> {
    let [frames, height_px, width_px] = [array.shape()[0], array.shape()[1], array.shape()[2]];
    let values = contiguous(name, array.as_slice().ok())?.to_vec();
    Ok(Plane::try_from_vec(frames * height_px, width_px, values)?)
}

/// Hands planes of one size, at least one, to Python as an array \[index\]\[y\]\[x\].
pub(crate) fn stack<T: Element + Copy>(py: Python<'_>, planes: Vec<Plane<T>>) -> PyResult<Bound<'_, PyArray3<T>>> {
    let sides = [planes.len(), planes[0].height_px(), planes[0].width_px()];
    PyArray1::from_vec(py, planes.into_iter().flat_map(Plane::into_vec).collect()).reshape(sides)
}

/// Hands a plane to Python without a copy.
pub(crate) fn array<T: Element + Copy>(py: Python<'_>, plane: Plane<T>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let sides = [plane.height_px(), plane.width_px()];
    PyArray1::from_vec(py, plane.into_vec()).reshape(sides)
}

fn contiguous<'a, T>(name: &'static str, values: Option<&'a [T]>) -> Result<&'a [T], Refused> {
    values.ok_or_else(|| Refused::new(name, "NOT_CONTIGUOUS", format!("{name} must be C-contiguous")))
}
