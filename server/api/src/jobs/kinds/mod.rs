//! Each kind of job in messages: its request, which is checked, and its result. A kind has a file or a folder.

mod capture_photos;
mod evaluate_kernel;
mod kernel_choice;
mod learn_kernel;
mod learning_rate;
mod optimize_hologram;
mod prepare_dataset;
mod report_kernel;
mod simulate_capture;
mod suggest_holograms;
mod verify_hologram;

use crate::api::Api;
use lightpath_domain::job::{Job, JobResult, JobSpec};
use lightpath_proto::v1::{self, job_result, job_spec};
use lightpath_service::{Call, Field, Result};

/// Checks what a job shall do, looks up the named resources, and fills in defaults. Returns also the largest memory for
/// decoding one of its pictures \[bytes\]. `before` is the job of an earlier submission of the same request.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    kind: Option<job_spec::Kind>,
    before: Option<&Job>,
) -> Result<(JobSpec, u64)> {
    let field = Field::new("spec");
    let at = |name| field.at(name);
    let spec = match field.required(kind)? {
        job_spec::Kind::OptimizeHologram(message) => {
            let (spec, decoding_bytes) =
                optimize_hologram::from_wire(api, call, message, &at("optimize_hologram"), before).await?;
            return Ok((JobSpec::OptimizeHologram(Box::new(spec)), decoding_bytes));
        }
        job_spec::Kind::PrepareDataset(message) => {
            let (spec, decoding_bytes) =
                prepare_dataset::from_wire(api, call, message, &at("prepare_dataset"), before).await?;
            return Ok((JobSpec::PrepareDataset(spec), decoding_bytes));
        }
        job_spec::Kind::LearnKernel(message) => {
            JobSpec::LearnKernel(learn_kernel::from_wire(api, call, message, &at("learn_kernel")).await?)
        }
        job_spec::Kind::SimulateCapture(message) => {
            JobSpec::SimulateCapture(simulate_capture::from_wire(api, call, message, &at("simulate_capture")).await?)
        }
        job_spec::Kind::EvaluateKernel(message) => JobSpec::EvaluateKernel(
            evaluate_kernel::from_wire(api, call, message, &at("evaluate_kernel"), before).await?,
        ),
        job_spec::Kind::ReportKernel(message) => {
            JobSpec::ReportKernel(report_kernel::from_wire(api, call, message, &at("report_kernel")).await?)
        }
        job_spec::Kind::SuggestHolograms(message) => {
            JobSpec::SuggestHolograms(suggest_holograms::from_wire(api, call, message, &at("suggest_holograms")).await?)
        }
        job_spec::Kind::CapturePhotos(message) => {
            JobSpec::CapturePhotos(capture_photos::from_wire(api, call, message, &at("capture_photos")).await?)
        }
        job_spec::Kind::VerifyHologram(message) => {
            JobSpec::VerifyHologram(verify_hologram::from_wire(api, call, message, &at("verify_hologram")).await?)
        }
    };
    Ok((spec, 0))
}

/// Converts a request, with its defaults, into its message.
pub(super) fn to_wire(spec: JobSpec) -> v1::JobSpec {
    let kernels = spec.kernels();
    let kind = match spec {
        JobSpec::OptimizeHologram(spec) => {
            job_spec::Kind::OptimizeHologram(optimize_hologram::to_wire(*spec, &kernels))
        }
        JobSpec::LearnKernel(spec) => job_spec::Kind::LearnKernel(learn_kernel::to_wire(spec)),
        JobSpec::SimulateCapture(spec) => job_spec::Kind::SimulateCapture(simulate_capture::to_wire(spec)),
        JobSpec::EvaluateKernel(spec) => job_spec::Kind::EvaluateKernel(evaluate_kernel::to_wire(spec, &kernels)),
        JobSpec::PrepareDataset(spec) => job_spec::Kind::PrepareDataset(prepare_dataset::to_wire(spec)),
        JobSpec::ReportKernel(spec) => job_spec::Kind::ReportKernel(report_kernel::to_wire(spec)),
        JobSpec::SuggestHolograms(spec) => job_spec::Kind::SuggestHolograms(suggest_holograms::to_wire(spec)),
        JobSpec::CapturePhotos(spec) => job_spec::Kind::CapturePhotos(capture_photos::to_wire(spec)),
        JobSpec::VerifyHologram(spec) => job_spec::Kind::VerifyHologram(verify_hologram::to_wire(spec)),
    };
    v1::JobSpec { kind: Some(kind) }
}

/// Converts a result into its message.
pub(super) fn result(result: JobResult) -> v1::JobResult {
    let kind = match result {
        JobResult::OptimizeHologram(result) => job_result::Kind::OptimizeHologram(optimize_hologram::result(*result)),
        JobResult::LearnKernel(result) => job_result::Kind::LearnKernel(learn_kernel::result(result)),
        JobResult::SimulateCapture(result) => job_result::Kind::SimulateCapture(simulate_capture::result(result)),
        JobResult::EvaluateKernel(result) => job_result::Kind::EvaluateKernel(evaluate_kernel::result(result)),
        JobResult::PrepareDataset(result) => job_result::Kind::PrepareDataset(prepare_dataset::result(result)),
        JobResult::ReportKernel(result) => job_result::Kind::ReportKernel(report_kernel::result(result)),
        JobResult::SuggestHolograms(result) => job_result::Kind::SuggestHolograms(suggest_holograms::result(result)),
        JobResult::CapturePhotos(result) => job_result::Kind::CapturePhotos(capture_photos::result(result)),
        JobResult::VerifyHologram(result) => job_result::Kind::VerifyHologram(verify_hologram::result(result)),
    };
    v1::JobResult { kind: Some(kind) }
}
