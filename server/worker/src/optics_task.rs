//! The task of the server: it runs each kind of job by its own function.

use super::{
    JobContext, Task, TaskError, TaskOutput, evaluate, learn, optimize, prepare, report, simulate, suggest, verify,
};
use lightpath_domain::job::{Job, JobSpec};

/// Runs jobs on the optics engine.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpticsTask;

impl Task for OpticsTask {
    fn run(&self, job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
        match &job.spec {
            JobSpec::OptimizeHologram(spec) => optimize::run(context, spec),
            JobSpec::LearnKernel(spec) => learn::run(context, job, spec),
            JobSpec::SimulateCapture(spec) => simulate::run(context, spec),
            JobSpec::EvaluateKernel(spec) => evaluate::run(context, spec),
            JobSpec::PrepareDataset(spec) => prepare::run(context, spec),
            JobSpec::ReportKernel(spec) => report::run(context, spec),
            JobSpec::SuggestHolograms(spec) => suggest::run(context, spec),
            JobSpec::VerifyHologram(spec) => verify::run(context, spec),
        }
    }
}
