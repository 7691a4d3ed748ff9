//! Each kind of job as the service sees it: what its request needs to exist, how much memory and time it takes, and what
//! would make it smaller.

mod capture_photos;
mod evaluate_kernel;
mod learn_kernel;
mod optimize_hologram;
mod prepare_dataset;
mod report_kernel;
mod simulate_capture;
mod suggest_holograms;
mod verify_hologram;

use super::Jobs;
use crate::error::Result;
use lightpath_domain::job::JobSpec;
use lightpath_domain::job::estimate::Need;

/// A kind of job.
trait Kind {
    /// What makes a job of this kind smaller.
    const ADVICE: &'static str;

    /// Memory and work of the job. `decoding_bytes` is the largest memory for decoding one of its pictures.
    async fn need(&self, jobs: &Jobs, decoding_bytes: u64) -> Result<Need>;

    fn advice(&self) -> &'static str {
        Self::ADVICE
    }
}

/// What `$value` is for the request in a specification.
macro_rules! of_kind {
    ($spec:expr, $request:ident => $value:expr) => {
        match $spec {
            JobSpec::OptimizeHologram($request) => $value,
            JobSpec::LearnKernel($request) => $value,
            JobSpec::SimulateCapture($request) => $value,
            JobSpec::EvaluateKernel($request) => $value,
            JobSpec::PrepareDataset($request) => $value,
            JobSpec::ReportKernel($request) => $value,
            JobSpec::VerifyHologram($request) => $value,
            JobSpec::SuggestHolograms($request) => $value,
            JobSpec::CapturePhotos($request) => $value,
        }
    };
}

/// Memory and work of a job.
pub(super) async fn need(jobs: &Jobs, spec: &JobSpec, decoding_bytes: u64) -> Result<Need> {
    of_kind!(spec, request => request.need(jobs, decoding_bytes).await)
}

/// What makes a job of this kind smaller.
pub(super) fn advice(spec: &JobSpec) -> &'static str {
    of_kind!(spec, request => request.advice())
}
