//! Simulation jobs: photographs of a simulated display.

use crate::api::Api;
use crate::optics::from_wire::distance;
use crate::optics::to_wire::{place, validity_report};
use lightpath_domain::job::{CaptureResult, SimulateCapture};
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result};

/// Limit on the time since the bench was set up \[s\]: ten years.
const ELAPSED_S_MAX: f64 = 10.0 * 365.25 * 86_400.0;

/// Checks a request, looks up the named resources, fills in defaults, and converts the request.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::SimulateCapture,
    field: &Field,
) -> Result<SimulateCapture> {
    let at = |name| field.at(name);
    let display = api.display_named(call, &at("display"), &message.display).await?;
    api.service.jobs.require_simulated(&at("display"), &display)?;
    let spec = SimulateCapture {
        wavelength: at("wavelength_m").wavelength_of(message.wavelength_m, &display)?,
        distance: distance(&at("place"), message.place.as_ref())?,
        pattern: at("pattern").digest(&message.pattern)?,
        seed: message.seed,
        elapsed_s: at("elapsed_s").number(message.elapsed_s, 0.0..=ELAPSED_S_MAX)?,
        display: display.id.clone(),
    };
    api.service.jobs.require_capturable(call, field, &spec, &display).await?;
    Ok(spec)
}

/// Converts the request, with its defaults, into its message.
pub(super) fn to_wire(spec: SimulateCapture) -> v1::SimulateCapture {
    v1::SimulateCapture {
        display: format!("displays/{}", spec.display),
        wavelength_m: Some(spec.wavelength.m()),
        place: place(spec.distance),
        pattern: spec.pattern,
        seed: spec.seed,
        elapsed_s: spec.elapsed_s,
    }
}

/// Converts the result into its message.
pub(super) fn result(result: CaptureResult) -> v1::SimulateCaptureResult {
    v1::SimulateCaptureResult { photo: result.photo, propagation: Some(validity_report(result.propagation)) }
}
