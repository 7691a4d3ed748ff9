//! Pictures: the same readers and writers as the server's.

use crate::arrays::{array, plane};
use crate::error::Refused;
use crate::optics;
use crate::threads;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::{Area, Fit};
use lightpath_media::pictures::{self, Channel, Placement};
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::{Grid, Plane};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Reads a target picture: linear light of a display's size. `colour` is 0 for the red of the picture, 1 for its green, 2
/// for its blue; `None`: the mean of its colours. `area` is `region` or `display`; `None`: as a server chooses. `region` is
/// x, y, width and height \[px\]; `None`: the middle 80 % of each axis.
#[pyfunction]
pub(crate) fn target<'py>(
    py: Python<'py>,
    content: &[u8],
    encoding: &str,
    placement: (&str, Option<&str>, Option<[usize; 4]>),
    colour: Option<usize>,
    shape: (usize, usize),
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let ((fit, area, region), (height_px, width_px)) = (placement, shape);
    let read = || -> Result<_, Refused> {
        let encoding: Encoding = serde_json::from_value(encoding.into())?;
        let fit: Fit = serde_json::from_value(fit.into())?;
        let channel = colour.map_or(Channel::Mean, |colour| Channel::Colour(colour.min(2)));
        let area = area.map(|area| serde_json::from_value(area.into())).transpose()?;
        let area = match area.unwrap_or(Area::recommended(fit)) {
            // The pitch does not matter.
            Area::Region => Some(optics::region(Grid::try_new(height_px, width_px, 1e-6)?, region)?.into()),
            Area::Display => None,
        };
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
