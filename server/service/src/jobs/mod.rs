//! Jobs: submitting, seeing, cancelling and retrying them, and the queue that they wait in.
//!
//! # Layout
//!
//! - `submit`: how a job comes into the queue. `kinds`: what each kind of job needs for that.
//! - `limits`: those on the memory and time of a job. `estimate`: sizes from which these are estimated.
//!   `checked_targets`: pictures that need not be decoded again.
//! - `seen_by`: what a caller sees of a job; `lists`: of many. `queue`: pauses.
//! - `waiting`: what a queued job waits for, and when it starts; `waits_for`: why no process can run it.

mod checked_targets;
mod estimate;
mod kinds;
mod limits;
mod lists;
mod queue;
mod seen_by;
mod submit;
mod waiting;
mod waits_for;

pub use limits::JobLimits;
pub use queue::QueueState;
pub use submit::{CheckedJob, Submission};
pub use waiting::{Outlook, WaitReason, Waiting};

use crate::call::Call;
use crate::datasets::Datasets;
use crate::error::Result;
use crate::files::Files;
use crate::kernels::Kernels;
use checked_targets::CheckedTargets;
use lightpath_artifacts::Artifacts;
use lightpath_domain::job::Job;
use lightpath_metrics as metrics;
use lightpath_store::{QueueLimits, Store};
use waiting::LastForecast;

/// Jobs. Clones share the memory of checked pictures.
#[derive(Clone, Debug)]
pub struct Jobs {
    store: Store,
    artifacts: Artifacts,
    files: Files,
    datasets: Datasets,
    kernels: Kernels,
    limits: JobLimits,
    queue_limits: QueueLimits,
    checked_targets: CheckedTargets,
    last_forecast: LastForecast,
}

impl Jobs {
    pub(crate) fn new(
        store: Store,
        artifacts: Artifacts,
        (files, datasets, kernels): (Files, Datasets, Kernels),
        (limits, queue_limits): (JobLimits, QueueLimits),
    ) -> Self {
        let (checked_targets, last_forecast) = Default::default();
        Self { store, artifacts, files, datasets, kernels, limits, queue_limits, checked_targets, last_forecast }
    }

    /// Cancels a job, or records the wish if it runs.
    pub async fn cancel(&self, call: &Call, id: &str) -> Result<Job> {
        self.visible(call, id).await?;
        let job = self.store.cancel(id, self.store.now_ms()).await?;
        // A running job ends when its worker stops it, and the worker counts it then.
        if job.state.has_ended() {
            metrics::job_ended(&job);
        }
        self.seen_by(&call.caller, job).await
    }

    /// Puts a job that failed or was cancelled back into the queue.
    pub async fn retry(&self, call: &Call, id: &str) -> Result<Job> {
        self.visible(call, id).await?;
        match self.store.retry(id, self.store.now_ms()).await {
            Ok(job) => self.seen_by(&call.caller, job).await,
            Err(error) => Err(self.error_for(&call.caller, error).await),
        }
    }
}
