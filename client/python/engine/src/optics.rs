//! The optical setup of a call.

use crate::error::Refused;
use crate::threads;
use lightpath_optics::propagation::{assess, assess_regardless};
use lightpath_optics::{
    ConvolutionMethod, Grid, OpticalSetup, PropagationMethod, RegionOfInterest, ValidityReport, plan as planned,
};
use pyo3::prelude::*;
use serde::Deserialize;

/// Optical setup and propagation method, as JSON.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Optics {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pixel_pitch_m: f64,
    wavelength_m: f64,
    distance_m: f64,
    /// `None`: the planner chooses.
    #[serde(default)]
    method: Option<PropagationMethod>,
    /// Whether to use the method even where it is not valid.
    #[serde(default)]
    pub(crate) regardless: bool,
}

impl Optics {
    pub(crate) fn parse(json: &str) -> Result<Self, Refused> {
        Ok(serde_json::from_str(json)?)
    }

    /// The setup, without its method.
    pub(crate) fn setup(&self) -> Result<OpticalSetup, Refused> {
        let grid = Grid::try_new(self.height_px, self.width_px, self.pixel_pitch_m)?;
        Ok(OpticalSetup::try_new(grid, self.wavelength_m, self.distance_m)?)
    }

    /// What the planner says: about the method of its choice, or about the given one.
    pub(crate) fn validity(&self) -> Result<ValidityReport, Refused> {
        let setup = self.setup()?;
        Ok(match self.method {
            None => planned(&setup)?,
            Some(method) if self.regardless => assess_regardless(&setup, method),
            Some(method) => assess(&setup, method)?,
        })
    }

    /// The setup with its method, which must be a convolution, for a display model.
    pub(crate) fn convolution(&self) -> Result<(OpticalSetup, ValidityReport), Refused> {
        let validity = self.validity()?;
        let method = ConvolutionMethod::try_from(validity.method)?;
        Ok((self.setup()?.with_method_regardless(method), validity))
    }
}

/// The region x, y, width, height \[px\], or the middle 80 % of each axis.
pub(crate) fn region(grid: Grid, given: Option<[usize; 4]>) -> Result<RegionOfInterest, Refused> {
    match given {
        None => Ok(RegionOfInterest::middle(&grid)),
        Some([x_px, y_px, width_px, height_px]) => {
            Ok(RegionOfInterest::try_new(&grid, x_px, y_px, width_px, height_px)?)
        }
    }
}

/// The planner's report, as JSON.
#[pyfunction]
pub(crate) fn plan(py: Python<'_>, optics: &str) -> PyResult<String> {
    let report = threads::compute(py, || Optics::parse(optics)?.validity())??;
    Ok(json(&report)?)
}

pub(crate) fn json(value: &impl serde::Serialize) -> Result<String, Refused> {
    Ok(serde_json::to_string(value)?)
}
