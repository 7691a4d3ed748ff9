//! Jobs: requests for work with a state.
//!
//! ```text
//!           submit             claim                 finish
//! (client) --------> QUEUED ----------> RUNNING -----------------> SUCCEEDED
//!                    ^   \ cancel        |  |  |  permanent error,
//!                    |    \--> CANCELLED <--/  |  attempts spent -> FAILED
//!                    +---------------------------/
//!                      retry after backoff, lease expired, drain
//! ```
//!
//! # Layout
//!
//! - [`kinds`]: each kind of job, with its request, its result, and the memory and time that it needs.
//! - `effect`: changes that a job makes besides its result. `depth_map`: pixels of image planes.
//! - `failure`: reasons why attempts fail. [`estimate`]: what the estimates of memory and time have in common.

mod depth_map;
mod effect;
pub mod estimate;
mod failure;
pub mod kinds;

pub use depth_map::{nearest_planes, pixels_of_planes, weight_in_plane};
pub use effect::JobEffect;
pub use estimate::Estimate;
pub use failure::{FailureReason, JobError};
pub use kinds::capture_photos::{CapturePhotos, CapturePhotosResult, CapturedPhoto, NamedPattern, Retaken};
pub use kinds::evaluate_kernel::{EvaluateKernel, EvaluateResult, PairLoss};
pub use kinds::learn_kernel::{LearnKernel, LearnResult, LearnedKernel};
pub use kinds::optimize_hologram::{
    Area, Fit, HologramResult, ImagePlane, JudgedBy, Judging, OptimizeHologram, PlaneResult, Subframe, WavelengthResult,
};
pub use kinds::prepare_dataset::{AlignBy, PrepareDataset, PrepareResult, PrepareStep};
pub use kinds::report_kernel::{OTHER_VERSIONS_MAX, ReportFigure, ReportKernel, ReportResult};
pub use kinds::simulate_capture::{CaptureResult, SimulateCapture};
pub use kinds::suggest_holograms::{SuggestHolograms, SuggestResult, SuggestedHologram};
pub use kinds::verify_hologram::{PlaneOpinion, VerifyHologram, VerifyResult};
pub use kinds::{JobResult, JobSpec};

use crate::ability::Labels;
use serde::{Deserialize, Serialize};

crate::words! {
    /// State of a job.
    pub enum JobState {
        /// The job waits for a worker, for its start time or for other jobs.
        Queued = "queued",
        /// A worker holds the job's lease.
        Running = "running",
        /// The job ended with a result.
        Succeeded = "succeeded",
        /// The job ended without a result. A user can put it back into the queue.
        Failed = "failed",
        /// The job ended because a user cancelled it.
        Cancelled = "cancelled",
    }
}

impl JobState {
    /// The states of jobs that have ended.
    pub const ENDED: [Self; 3] = [Self::Succeeded, Self::Failed, Self::Cancelled];

    /// Whether the job has ended. The state of an ended job changes only if a user retries the job.
    #[must_use]
    pub fn has_ended(self) -> bool {
        match self {
            Self::Queued | Self::Running => false,
            Self::Succeeded | Self::Failed | Self::Cancelled => true,
        }
    }
}

/// A job in the store.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Id: the last part of the resource name (a UUID v7).
    pub id: String,
    /// Id of the request, chosen by the submitter.
    pub request_id: String,
    /// Request.
    pub spec: JobSpec,
    /// State.
    pub state: JobState,
    /// Priority. Jobs with a lower number run first.
    pub priority: i32,
    /// Number of attempts started so far.
    pub attempt: u32,
    /// Number of failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
    /// Time when the job was submitted \[ms since 1970\].
    pub create_time_ms: i64,
    /// Start of the latest attempt \[ms since 1970\].
    pub start_time_ms: Option<i64>,
    /// Time when the job ended \[ms since 1970\].
    pub finish_time_ms: Option<i64>,
    /// Earliest time at which the job, if queued, may start \[ms since 1970\].
    pub run_time_ms: i64,
    /// What computes, or computed, the latest attempt: version of the program and kind of processor.
    pub computer: Option<String>,
    /// Progress of the latest attempt.
    pub progress: Option<Progress>,
    /// Error that ended the latest attempt.
    pub error: Option<JobError>,
    /// Result of a job that succeeded.
    pub result: Option<JobResult>,
    /// Whether a user asked to cancel the job.
    pub cancel_requested: bool,
    /// Whether the server died while it ran the job. It then runs in a process of its own.
    pub suspect: bool,
    /// Artifact digest of the latest checkpoint.
    pub checkpoint: Option<String>,
    /// Number that grows with every change.
    pub revision: u64,
    /// Owner, order and time limits.
    pub scheduling: Scheduling,
    /// Number of jobs that must succeed before this job starts, and have not succeeded yet.
    pub waiting_for: u32,
    /// Estimate of memory and time, made when the job was submitted.
    pub estimate: Estimate,
}

/// What a list shows of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobSummary {
    /// Id: the last part of the resource name.
    pub id: String,
    /// Kind: a word of [`JobSpec::KINDS`].
    pub kind: String,
    /// Id of the display.
    pub display: String,
    /// Owner; empty: unknown.
    pub owner: String,
    /// Name of the batch.
    pub batch: Option<String>,
    /// State.
    pub state: JobState,
    /// Whether a user asked to cancel the job.
    pub cancel_requested: bool,
    /// Priority. Jobs with a lower number run first.
    pub priority: i32,
    /// Number of attempts started so far.
    pub attempt: u32,
    /// Time when the job was submitted \[ms since 1970\].
    pub create_time_ms: i64,
    /// Start of the latest attempt \[ms since 1970\].
    pub start_time_ms: Option<i64>,
    /// Time when the job ended \[ms since 1970\].
    pub finish_time_ms: Option<i64>,
    /// Progress of the latest attempt.
    pub progress: Option<Progress>,
    /// Error that ended the latest attempt.
    pub error: Option<JobError>,
    /// Number that grows with every change.
    pub revision: u64,
    /// What the job is about, for people.
    pub label: Option<String>,
    /// Labels that the process must have that runs the job.
    pub needs: Labels,
    /// Estimated memory of an attempt \[bytes\]; 0: not estimated.
    pub memory_bytes: u64,
    /// Number of jobs that must succeed before this job starts, and have not succeeded yet.
    pub waiting_for: u32,
}

/// Owner, order and time limits of a job. By default the owner is unknown and the job starts as soon as possible.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scheduling {
    /// Owner of the job, for fair turns; empty: unknown.
    pub owner: String,
    /// Name of the batch. Users list and watch the jobs of a batch together.
    pub batch: Option<String>,
    /// Key that at most one queued or running job of the owner may have.
    pub unique_key: Option<String>,
    /// Earliest start \[ms since 1970\].
    pub not_before_ms: Option<i64>,
    /// Longest time of an attempt \[ms\].
    pub timeout_ms: Option<i64>,
    /// Ids of the jobs that must succeed before this job starts, ascending, each once.
    pub after: Vec<String>,
    /// What the job is about, for people, such as the file name of its target.
    pub label: Option<String>,
    /// Labels that the process must have that runs the job.
    pub needs: Labels,
}

/// A validated submission.
#[derive(Clone, Debug, PartialEq)]
pub struct NewJob {
    /// Request.
    pub spec: JobSpec,
    /// Id of the request, unique for its owner. Submitting a request again returns the same job.
    pub request_id: String,
    /// Priority. Jobs with a lower number run first.
    pub priority: i32,
    /// Number of failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
    /// Owner, order and time limits.
    pub scheduling: Scheduling,
    /// Estimate of memory and time.
    pub estimate: Estimate,
}

/// Progress of a running job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Name of the current stage, for people.
    pub stage: String,
    /// Number of steps done.
    pub step: u32,
    /// Number of all steps.
    pub steps_total: u32,
    /// Loss of the latest step; `None`: the stage has no loss.
    pub loss: Option<f64>,
    /// Estimated time left \[s\].
    pub eta_s: Option<f64>,
}

impl Progress {
    /// Share of the steps that are done, from 0 to 1.
    #[must_use]
    pub fn fraction(&self) -> f64 {
        if self.steps_total == 0 { 0.0 } else { f64::from(self.step) / f64::from(self.steps_total) }
    }
}

/// An event in the history of a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobEvent {
    /// Number of the event, growing over all jobs. Page tokens refer to it.
    pub sequence: i64,
    /// Time of the event \[ms since 1970\].
    pub time_ms: i64,
    /// Number of the attempt during which the event happened; 0 before the first attempt.
    pub attempt: u32,
    /// Text for people.
    pub message: String,
}

/// Permission of a worker to run a job for a limited time. Every write of the worker names job, attempt and lease id.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lease {
    /// Id of the job.
    pub job: String,
    /// Number of the attempt, from 1.
    pub attempt: u32,
    /// Id of the lease, unique for each claim.
    pub lease_id: String,
    /// End of the lease unless it is extended \[ms since 1970\].
    pub until_ms: i64,
}
