//! Conversion of the requests and results of verification jobs into messages.

use crate::optics::to_wire::second_opinion;
use lightpath_domain::job::{PlaneOpinion, VerifyHologram, VerifyResult};
use lightpath_proto::v1::{self, verify_result};

/// Converts the request into its message.
pub(crate) fn spec(spec: VerifyHologram) -> v1::VerifyHologram {
    v1::VerifyHologram { job: format!("jobs/{}", spec.job) }
}

/// Converts the result into its message.
pub(crate) fn result(result: VerifyResult) -> v1::VerifyResult {
    v1::VerifyResult { planes: result.planes.into_iter().map(plane).collect() }
}

fn plane(plane: PlaneOpinion) -> verify_result::PlaneOpinion {
    let [point, pixel, supersampled] = plane.opinions.map(|opinion| Some(second_opinion(opinion)));
    let (wavelength_m, distance_m) = (plane.wavelength.m(), plane.distance.m());
    verify_result::PlaneOpinion { wavelength_m, distance_m, point, pixel, supersampled }
}
