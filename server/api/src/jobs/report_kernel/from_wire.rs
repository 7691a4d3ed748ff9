//! Checking requests to report on a kernel version.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::access::Caller;
use lightpath_domain::job::ReportKernel;
use lightpath_proto::v1;
use lightpath_store::StoreError;

impl Api {
    /// The job that a request asks for, of a version that is there.
    pub(crate) async fn report_kernel_spec(
        &self,
        caller: &Caller,
        message: v1::ReportKernel,
        field: &Field,
    ) -> Result<ReportKernel, ApiError> {
        let field = field.at("kernel_version");
        let (kernel, version) = names::kernel_version(caller, &field, &message.kernel_version)?;
        match self.store.kernel_version(&kernel, version).await {
            Err(StoreError::NotFound { what }) => Err(field.missing(what, "name one of the kernel's versions")),
            found => found.map(|_| ReportKernel { kernel, version }).map_err(ApiError::from),
        }
    }
}
