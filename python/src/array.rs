//! Numpy arrays in and out, as bytes: the package needs no headers of numpy at compile time, and numpy itself handles
//! strides, alignment and writability.

use crate::errors::argument;
use opsr::image::Buffer;
use opsr::math::Rgb;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes};

/// A new array of type float32.
pub(crate) fn floats<'py>(
    py: Python<'py>,
    shape: &[usize],
    values: impl IntoIterator<Item = f32>,
) -> PyResult<Bound<'py, PyAny>> {
    array(py, shape, "<f4", values.into_iter().map(f32::to_le_bytes))
}

/// A new array of this type, from the little-endian bytes of its elements, last axis fastest.
pub(crate) fn array<'py, const N: usize>(
    py: Python<'py>,
    shape: &[usize],
    dtype: &str,
    elements: impl Iterator<Item = [u8; N]>,
) -> PyResult<Bound<'py, PyAny>> {
    let length = N * shape.iter().product::<usize>();
    let bytes = PyByteArray::new_with(py, length, |bytes| {
        let (places, _) = bytes.as_chunks_mut::<N>();
        places.iter_mut().zip(elements).for_each(|(p, e)| *p = e);
        Ok(())
    })?;
    let flat = py
        .import("numpy")?
        .call_method1("frombuffer", (bytes, dtype))?;
    flat.call_method1("reshape", (shape.to_vec(),))
}

/// A picture as an array of height x width x 3.
pub(crate) fn picture<'py>(py: Python<'py>, picture: &Buffer) -> PyResult<Bound<'py, PyAny>> {
    let values = picture.pixels.iter().flat_map(|p| p.to_array());
    floats(py, &[picture.height, picture.width, 3], values)
}

/// The picture of an array of height x width x 3, float32; another type is refused, since its numbers may be no radiance.
pub(crate) fn to_picture(name: &str, array: &Bound<'_, PyAny>) -> PyResult<Buffer> {
    let numpy = array.py().import("numpy")?;
    if !array.is_instance(&numpy.getattr("ndarray")?)? {
        let what = array.get_type().name()?;
        let what = format!("{name}: expected a numpy array, a Film or a file, got {what}");
        return Err(PyTypeError::new_err(what));
    }
    let dtype = array.getattr("dtype")?;
    if !dtype.eq(numpy.getattr("float32")?)? {
        let what = format!("{name}: expected an array of float32, got {dtype}");
        return Err(PyTypeError::new_err(what));
    }
    let (shape, values) = elements(array)?;
    let [height, width, 3] = shape[..] else {
        let what = format!("expected an array of height x width x 3, got shape {shape:?}");
        return Err(argument(name, what));
    };
    let (pixels, _) = values.as_chunks::<3>();
    Ok(Buffer {
        width,
        height,
        pixels: pixels.iter().map(|&p| Rgb::from_array(p)).collect(),
    })
}

/// Shape and values of anything that numpy converts to a float32 array, last axis fastest.
pub(crate) fn to_floats(array: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f32>)> {
    let numpy = array.py().import("numpy")?;
    elements(&numpy.call_method1("asarray", (array, "<f4"))?)
}

fn elements(array: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f32>)> {
    let shape = array.getattr("shape")?.extract()?;
    let bytes = array.call_method0("tobytes")?.cast_into::<PyBytes>()?;
    let (numbers, _) = bytes.as_bytes().as_chunks::<4>();
    let numbers = numbers.iter().map(|&b| f32::from_le_bytes(b));
    Ok((shape, numbers.collect()))
}
