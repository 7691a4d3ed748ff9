//! Pictures: the same readers and writers as the server's.

use crate::arrays::{array, plane};
use crate::error::Refused;
use crate::threads;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::Fit;
use lightpath_media::pictures::{self, Channel, Placement, Rectangle};
use lightpath_optics::Plane;
use lightpath_optics::display::phase_response::PhaseResponse;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Reads a target picture: linear light of a display's size. `colour` is 0 for the red of the picture, 1 for its green, 2
/// for its blue; `None`: the mean of its colours. The picture fills `area`, x, y, width and height \[px\], or the whole
/// display.
#[pyfunction]
#[pyo3(signature = (content, encoding_and_fit, colour, shape, area=None))]
pub(crate) fn target<'py>(
    py: Python<'py>,
    content: &[u8],
    encoding_and_fit: (&str, &str),
    colour: Option<usize>,
    shape: (usize, usize),
    area: Option<(usize, usize, usize, usize)>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let ((encoding, fit), (height_px, width_px)) = (encoding_and_fit, shape);
    let read = || -> Result<_, Refused> {
        let encoding: Encoding = serde_json::from_value(encoding.into())?;
        let fit: Fit = serde_json::from_value(fit.into())?;
        let channel = colour.map_or(Channel::Mean, |colour| Channel::Colour(colour.min(2)));
        let area = area.map(|(x_px, y_px, width_px, height_px)| Rectangle { x_px, y_px, width_px, height_px });
        Ok(pictures::target_channel(content, encoding, channel, &Placement { fit, area, height_px, width_px })?)
    };
    array(py, threads::compute(py, read)??)
}

/// Combines three grey PNGs to one in colour.
#[pyfunction]
pub(crate) fn colour<'py>(py: Python<'py>, red: &[u8], green: &[u8], blue: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &pictures::colour_png([red, green, blue]).map_err(Refused::from)?))
}

/// The grey levels of a phase \[rad\] as a PNG for a display of `bit_depth` bits.
#[pyfunction]
pub(crate) fn levels<'py>(
    py: Python<'py>,
    phase: PyReadonlyArray2<'py, f32>,
    bit_depth: u32,
) -> PyResult<Bound<'py, PyBytes>> {
    let phase = plane("phase", &phase)?;
    let encode = || levels_png(&PhaseResponse::linear(bit_depth)?.quantize(&phase)?, bit_depth);
    Ok(PyBytes::new(py, &threads::compute(py, encode)??))
}

pub(crate) fn levels_png(levels: &Plane<u16>, bit_depth: u32) -> Result<Vec<u8>, Refused> {
    Ok(pictures::levels_png(levels, bit_depth)?)
}
