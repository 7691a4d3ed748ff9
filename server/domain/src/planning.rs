//! Conversion of displays into optical setups, and of the planner's reports into domain types.

use crate::display::Display;
use crate::units::{Distance, Wavelength};
use lightpath_optics::propagation::{ConvolutionMethod, assess, assess_regardless};
use lightpath_optics::{Grid, OpticalSetup, Result, ValidityReport};

/// The optical setup of a display at a wavelength and distance.
///
/// # Errors
///
/// [`lightpath_optics::Error`] if the properties are not possible. Stored displays are always possible.
pub fn setup(display: &Display, wavelength: Wavelength, distance: Distance) -> Result<OpticalSetup> {
    let grid = Grid::try_new(display.height_px as usize, display.width_px as usize, display.pixel_pitch_m)?;
    let setup = OpticalSetup::try_new(grid, wavelength.m(), distance.m())?.with_orders(display.orders)?;
    setup.with_camera_fill_factor(display.camera_fill_factor)
}

/// The setup with the given method, or with the method that the planner chooses, and the validity of that method.
///
/// # Errors
///
/// [`lightpath_optics::Error::Unsuitable`], with numbers, if the given method is not valid for the setup, or if no
/// method is.
pub fn planned(setup: OpticalSetup, method: Option<ConvolutionMethod>) -> Result<(OpticalSetup, ValidityReport)> {
    match method {
        None => setup.planned(),
        Some(method) => Ok((setup.with_method(method)?, assess(&setup, method.into())?)),
    }
}

/// The validity of the setup's own method, which may be invalid.
pub fn assessed(setup: &OpticalSetup, explanation: &str) -> ValidityReport {
    let explanation = explanation.to_owned();
    ValidityReport { explanation, ..assess_regardless(setup, setup.method().into()) }
}
