//! Checks of requests for reports on kernel versions.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::job::ReportKernel;
use lightpath_domain::kernel::KernelVersion;
use lightpath_proto::v1;
use lightpath_store::StoreError;

impl Api {
    /// Checks a request and converts it. Refuses a version that does not exist.
    pub(crate) async fn report_kernel_spec(
        &self,
        call: &Call,
        message: v1::ReportKernel,
        field: &Field,
    ) -> Result<ReportKernel, ApiError> {
        let field = field.at("kernel_version");
        let KernelVersion { key, version, .. } = self.existing_version(call, &field, &message.kernel_version).await?;
        Ok(ReportKernel { kernel: key, version })
    }

    /// The kernel version that a field names. Refuses one that does not exist.
    pub(crate) async fn existing_version(
        &self,
        call: &Call,
        field: &Field,
        name: &str,
    ) -> Result<KernelVersion, ApiError> {
        let (kernel, version) = names::kernel_version(call, field, name)?;
        match self.store.kernel_version(&kernel, version).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "name one of the kernel's versions")),
            found => found.map_err(ApiError::from),
        }
    }
}
