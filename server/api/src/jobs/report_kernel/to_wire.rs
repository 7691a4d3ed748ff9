//! Conversion of the requests and results of report jobs into messages.

use lightpath_domain::job::{ReportKernel, ReportResult};
use lightpath_proto::v1;

/// Converts the request into its message.
pub(crate) fn spec(spec: ReportKernel) -> v1::ReportKernel {
    v1::ReportKernel { kernel_version: format!("{}/versions/{}", spec.kernel, spec.version) }
}

/// Converts the result into its message.
pub(crate) fn result(result: ReportResult) -> v1::ReportResult {
    let figures = result.figures.into_iter().map(|figure| v1::report_result::Figure {
        name: figure.name,
        title: figure.title,
        artifact: figure.artifact,
    });
    v1::ReportResult { html: result.html, arrays: result.arrays, figures: figures.collect() }
}
