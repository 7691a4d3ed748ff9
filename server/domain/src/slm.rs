//! Conversion of a display's modulator into the types of the optics engine.

use crate::display::Display;
use lightpath_optics::Result;
use lightpath_optics::display::phase_response::PhaseResponse;

/// The phase response: the phase of each grey level.
///
/// # Errors
///
/// [`lightpath_optics::Error`] if the response is not possible. Responses of stored displays are always possible.
pub fn response(display: &Display) -> Result<PhaseResponse> {
    match &display.phase_response_rad {
        Some(phase_rad) => PhaseResponse::measured(phase_rad.clone()),
        None => PhaseResponse::linear(display.bit_depth),
    }
}
