//! A display's modulator, as the optics know it.

use crate::display::Display;
use lightpath_optics::Result;
use lightpath_optics::phase_response::PhaseResponse;

/// What the grey levels do to the phase.
///
/// # Errors
///
/// [`lightpath_optics::Error`] for a response that is not possible; a stored one always is.
pub fn response(display: &Display) -> Result<PhaseResponse> {
    match &display.phase_response_rad {
        Some(phase_rad) => PhaseResponse::measured(phase_rad.clone()),
        None => PhaseResponse::linear(display.bit_depth),
    }
}
