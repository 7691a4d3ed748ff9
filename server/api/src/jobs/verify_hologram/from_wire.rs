//! Checks of requests to verify holograms.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::job::{JobResult, VerifyHologram};
use lightpath_proto::v1;

impl Api {
    /// Checks a request and converts it. Refuses a job that has no holograms.
    pub(crate) async fn verify_hologram_spec(
        &self,
        call: &Call,
        message: v1::VerifyHologram,
        field: &Field,
    ) -> Result<VerifyHologram, ApiError> {
        let field = field.at("job");
        let job = self.visible_job(call, &names::job_id(&field, &message.job)?).await?;
        match job.result {
            Some(JobResult::Hologram(_)) => Ok(VerifyHologram { job: job.id, display: job.spec.display().to_owned() }),
            _ => Err(field.invalid("has no holograms; name a job that optimized holograms and has succeeded")),
        }
    }
}
