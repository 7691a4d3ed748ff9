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
//! `spec`: what jobs are asked to do, validated. `result`: what they gave. `hologram`, `prepare`, `report`: both, of holograms,
//! datasets and reports. `effect`: what jobs change beside their result. `failure`: why attempts at them fail.

mod effect;
mod failure;
mod hologram;
mod prepare;
mod report;
mod result;
mod spec;

pub use effect::JobEffect;
pub use failure::{FailureReason, JobError};
pub use hologram::{Fit, FrameResult, HologramResult, ImagePlane, OptimizeHologram, PlaneResult, WavelengthResult};
pub use prepare::{AlignBy, PrepareDataset, PrepareResult, PrepareStep, SplitCounts};
pub use report::{ReportFigure, ReportKernel, ReportResult};
pub use result::{CaptureResult, EvaluateResult, JobResult, LearnResult, LearnedKernel, PairLoss};
pub use spec::{EvaluateKernel, JobSpec, LearnKernel, SimulateCapture};

use serde::{Deserialize, Serialize};

/// A job's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// Waits for a worker or for its time.
    Queued,
    /// A worker holds its lease.
    Running,
    /// Ended with a result.
    Succeeded,
    /// Ended without; can be queued again by hand.
    Failed,
    /// Ended because somebody asked for it.
    Cancelled,
}

impl JobState {
    /// In lower case, as people and the database write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Nothing will change any more by itself.
    #[must_use]
    pub fn has_ended(self) -> bool {
        match self {
            Self::Queued | Self::Running => false,
            Self::Succeeded | Self::Failed | Self::Cancelled => true,
        }
    }
}

/// A job as it stands in the store.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Last part of the resource name (a UUID v7).
    pub id: String,
    /// What the submitter called the request.
    pub request_id: String,
    /// What to do.
    pub spec: JobSpec,
    /// Where it stands.
    pub state: JobState,
    /// Lower runs first.
    pub priority: i32,
    /// Attempts started so far.
    pub attempt: u32,
    /// Failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
    /// \[ms since 1970\]
    pub create_time_ms: i64,
    /// Of the latest attempt \[ms since 1970\].
    pub start_time_ms: Option<i64>,
    /// \[ms since 1970\]
    pub finish_time_ms: Option<i64>,
    /// A queued job does not start before this \[ms since 1970\].
    pub run_time_ms: i64,
    /// Of the latest attempt.
    pub progress: Option<Progress>,
    /// Why the latest attempt ended without success.
    pub error: Option<JobError>,
    /// Set when the job succeeded.
    pub result: Option<JobResult>,
    /// Somebody asked for the end of the job.
    pub cancel_requested: bool,
    /// Artifact digest of the latest checkpoint.
    pub checkpoint: Option<String>,
    /// Grows with every change.
    pub revision: u64,
    /// When and for whom it runs.
    pub scheduling: Scheduling,
    /// How many of the jobs that it comes after have not succeeded yet.
    pub waiting_for: u32,
}

/// When and for whom a job runs. The default: nobody in particular, as soon as may be.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scheduling {
    /// Whose turn the job takes; empty: nobody said.
    pub owner: String,
    /// Jobs with the same name are looked at together.
    pub batch: Option<String>,
    /// At most one job with the same key waits or runs.
    pub unique_key: Option<String>,
    /// It does not start before this \[ms since 1970\].
    pub not_before_ms: Option<i64>,
    /// Longest attempt \[ms\].
    pub timeout_ms: Option<i64>,
    /// Ids of the jobs that must have succeeded first, ascending, no two equal.
    pub after: Vec<String>,
}

/// What a submit brings, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct NewJob {
    /// What to do.
    pub spec: JobSpec,
    /// Unique; the same request again is the same job.
    pub request_id: String,
    /// Lower runs first.
    pub priority: i32,
    /// Failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
    /// When and for whom it runs.
    pub scheduling: Scheduling,
}

/// How far a running job is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// What is being done, for people.
    pub stage: String,
    /// Steps done.
    pub step: u32,
    /// All steps.
    pub steps_total: u32,
    /// Of the latest step.
    pub loss: f64,
    /// Time left \[s\].
    pub eta_s: Option<f64>,
}

/// Something that happened to a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobEvent {
    /// Grows over all jobs; what pages are keyed by.
    pub sequence: i64,
    /// \[ms since 1970\]
    pub time_ms: i64,
    /// The attempt it belongs to; 0 before the first.
    pub attempt: u32,
    /// For people.
    pub message: String,
}

/// A worker's right to a job: every write of the worker names all of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease {
    /// Id of the job.
    pub job: String,
    /// Number of the attempt, from 1.
    pub attempt: u32,
    /// Unique to this claim.
    pub lease_id: String,
    /// The lease is void after this, unless extended \[ms since 1970\].
    pub until_ms: i64,
}
