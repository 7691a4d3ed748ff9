//! The task of the server: it runs each kind of job by the function in the file of its kind.

mod capture_photos;
mod evaluate_kernel;
mod learn_kernel;
mod optimize_hologram;
mod prepare_dataset;
mod report_kernel;
mod simulate_capture;
mod suggest_holograms;
mod verify_hologram;

use crate::{JobContext, Task, TaskError, TaskOutput};
use lightpath_domain::job::{Job, JobSpec};

/// Runs jobs on the optics engine.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpticsTask;

impl Task for OpticsTask {
    fn run(&self, job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
        match &job.spec {
            JobSpec::OptimizeHologram(spec) => optimize_hologram::run(context, spec),
            JobSpec::LearnKernel(spec) => learn_kernel::run(context, job, spec),
            JobSpec::SimulateCapture(spec) => simulate_capture::run(context, spec),
            JobSpec::CapturePhotos(spec) => capture_photos::run(context, spec),
            JobSpec::EvaluateKernel(spec) => evaluate_kernel::run(context, spec),
            JobSpec::PrepareDataset(spec) => prepare_dataset::run(context, spec),
            JobSpec::ReportKernel(spec) => report_kernel::run(context, spec),
            JobSpec::SuggestHolograms(spec) => suggest_holograms::run(context, spec),
            JobSpec::VerifyHologram(spec) => verify_hologram::run(context, spec),
        }
    }
}
