//! Verification jobs: holograms judged by an independent model.

use crate::api::Api;
use crate::names;
use crate::optics::to_wire::second_opinion;
use lightpath_domain::job::{PlaneOpinion, VerifyHologram, VerifyResult};
use lightpath_proto::v1::{self, verify_result};
use lightpath_service::{Call, Field, Result};

/// Checks a request and converts it. Refuses a job that has no holograms.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::VerifyHologram,
    field: &Field,
) -> Result<VerifyHologram> {
    let field = field.at("job");
    api.service.jobs.verification_of(call, &field, &names::job_id(&field, &message.job)?).await
}

/// Converts the request into its message.
pub(super) fn to_wire(spec: VerifyHologram) -> v1::VerifyHologram {
    v1::VerifyHologram { job: format!("jobs/{}", spec.job) }
}

/// Converts the result into its message.
pub(super) fn result(result: VerifyResult) -> v1::VerifyResult {
    v1::VerifyResult { planes: result.planes.into_iter().map(plane).collect() }
}

fn plane(plane: PlaneOpinion) -> verify_result::PlaneOpinion {
    let [point, pixel, supersampled] = plane.opinions.map(|opinion| Some(second_opinion(opinion)));
    let (wavelength_m, distance_m) = (plane.wavelength.m(), plane.distance.m());
    verify_result::PlaneOpinion { wavelength_m, distance_m, point, pixel, supersampled }
}
