//! Verification jobs: holograms judged by an independent model.

use crate::api::Api;
use crate::names;
use crate::optics::to_wire::{opinions, place};
use lightpath_domain::job::{PlaneOpinion, VerifyHologram, VerifyResult};
use lightpath_optics::Detector;
use lightpath_proto::v1::{self, verify_hologram_result};
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
pub(super) fn result(result: VerifyResult) -> v1::VerifyHologramResult {
    v1::VerifyHologramResult { planes: result.planes.into_iter().map(plane).collect() }
}

fn plane(plane: PlaneOpinion) -> verify_hologram_result::PlaneOpinion {
    let (wavelength_m, place) = (plane.wavelength.m(), place(plane.distance));
    let judgements =
        Detector::ALL.into_iter().zip(plane.opinions).flat_map(|(detector, opinion)| opinions(opinion, detector));
    verify_hologram_result::PlaneOpinion { wavelength_m, place, judgements: judgements.collect() }
}
