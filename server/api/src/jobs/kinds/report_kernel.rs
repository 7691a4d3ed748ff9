//! Report jobs: the report of a kernel version.

use crate::api::Api;
use crate::names;
use lightpath_domain::job::{ReportKernel, ReportResult};
use lightpath_domain::kernel::KernelVersion;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result};

/// Checks a request and converts it. Refuses a version that does not exist.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::ReportKernel,
    field: &Field,
) -> Result<ReportKernel> {
    let field = field.at("kernel_version");
    let (key, version) = names::kernel_version(call, &field, &message.kernel_version)?;
    let KernelVersion { key, version, .. } = api.service.kernels.existing_version(&field, &key, version).await?;
    Ok(ReportKernel { kernel: key, version })
}

/// Converts the request into its message.
pub(super) fn to_wire(spec: ReportKernel) -> v1::ReportKernel {
    v1::ReportKernel { kernel_version: format!("{}/versions/{}", spec.kernel, spec.version) }
}

/// Converts the result into its message.
pub(super) fn result(result: ReportResult) -> v1::ReportKernelResult {
    let figures = result.figures.into_iter().map(|figure| v1::report_kernel_result::Figure {
        name: figure.name,
        title: figure.title,
        artifact: figure.artifact,
    });
    v1::ReportKernelResult { html: result.html, arrays: result.arrays, figures: figures.collect() }
}
