//! Refusal of propagation that cannot give a correct image.

use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_domain::display::Display;
use lightpath_domain::planning;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_optics::{ConvolutionMethod, Error, PropagationMethod};

/// Refuses a distance at which no method gives a correct image of the display.
pub fn check_distance(field: &Field, display: &Display, wavelength: Wavelength, distance: Distance) -> Result<()> {
    let planned = planning::setup(display, wavelength, distance).and_then(|setup| planning::planned(setup, None));
    planned.map(|_| ()).map_err(|error| distance_refusal(field, distance, &error))
}

/// Refuses a method that cannot give a correct image.
pub fn check_method(
    field: &Field,
    display: &Display,
    wavelength: Wavelength,
    distance: Distance,
    method: ConvolutionMethod,
) -> Result<()> {
    let setup = planning::setup(display, wavelength, distance);
    let planned = setup.and_then(|setup| planning::planned(setup, Some(method)));
    planned.map(|_| ()).map_err(|error| method_refusal(field, &error))
}

/// The error for a method or window that is not possible.
pub fn method_refusal(field: &Field, error: &Error) -> ServiceError {
    field.invalid(format!("cannot be used: {error}"), "leave it out, and the planner chooses one that can")
}

/// The error for a distance at which no method is valid.
pub fn distance_refusal(field: &Field, distance: Distance, error: &Error) -> ServiceError {
    field.invalid(format!("is {}: {error}", distance.m()), "give another distance")
}

/// Converts a method into one with which holograms can be optimized; `None` if that is not possible. The shifted
/// angular spectrum is not possible, because it needs a window beside the axis, and a job has no field for a window.
pub fn optimizable(method: PropagationMethod) -> Option<ConvolutionMethod> {
    ConvolutionMethod::try_from(method).ok().filter(|method| *method != ConvolutionMethod::Shifted)
}
