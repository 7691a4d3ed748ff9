//! Conversion of the requests and results of simulation jobs into messages.

use crate::optics::to_wire::validity_report;
use lightpath_domain::job::{CaptureResult, SimulateCapture};
use lightpath_proto::v1;

/// Converts the request, with its defaults, into its message.
pub(crate) fn spec(spec: SimulateCapture) -> v1::SimulateCapture {
    v1::SimulateCapture {
        display: format!("displays/{}", spec.display),
        wavelength_m: spec.wavelength.m(),
        distance_m: spec.distance.m(),
        phase: spec.phase,
        seed: spec.seed,
        elapsed_s: spec.elapsed_s,
    }
}

/// Converts the result into its message.
pub(crate) fn result(result: CaptureResult) -> v1::CaptureResult {
    v1::CaptureResult { photo: result.photo, propagation: Some(validity_report(result.propagation)) }
}
