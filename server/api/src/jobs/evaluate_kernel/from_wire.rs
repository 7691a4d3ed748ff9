//! Checks of requests to evaluate kernels.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::optics::from_wire::region;
use crate::optics::propagation_checks::check_distance;
use lightpath_domain::job::{EvaluateKernel, Job, JobSpec};
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1;

impl Api {
    /// Checks a request, looks up the named resources, fills in defaults, and converts the request. `before` is the job
    /// of an earlier submission of the same request.
    pub(crate) async fn evaluate_kernel_spec(
        &self,
        call: &Call,
        message: v1::EvaluateKernel,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<EvaluateKernel, ApiError> {
        let at = |name| field.at(name);
        let (dataset, display) = self.finalized_dataset(call, &at("dataset"), &message.dataset).await?;
        check_distance(&at("dataset"), &display, dataset.wavelength, dataset.distance)?;
        let region_of_interest = region(&at("region_of_interest"), message.region_of_interest, &display)?;
        let key = KernelKey { display: display.id, wavelength: dataset.wavelength, distance: dataset.distance };
        let kernel_version = match before.map(|job| &job.spec) {
            // A repeated request has the same version as the first time, even if `active` has moved.
            Some(JobSpec::EvaluateKernel(job)) if ["", "active"].contains(&message.kernel.as_str()) => {
                job.kernel_version
            }
            _ => self.kernel_version_for(&at("kernel"), &message.kernel, &key, true).await?,
        };
        Ok(EvaluateKernel { dataset: dataset.id, display: key.display, kernel_version, region_of_interest })
    }
}
