//! What a task sees of the outside.

use super::stop::{StopFlag, StopReason};
use super::{Clock, checkpoint};
use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_domain::causes::with_causes;
use lightpath_domain::job::{FailureReason, Job, JobError, JobResult, Lease, Progress};
use lightpath_domain::kernel::{KernelKey, NewKernelVersion};
use lightpath_optics::EngineCache;
use lightpath_store::{Store, StoreError};
use std::cell::{Cell, RefCell};
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::watch;

/// What a job gave.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskOutput {
    /// For the job.
    pub result: JobResult,
    /// For the registry, of a learning job: a version for each distance.
    pub learned: Vec<(KernelKey, NewKernelVersion)>,
}

/// Why a task ended without output.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TaskError {
    /// It was told to.
    #[error("the task was told to stop")]
    Stopped,
    /// It failed; `retryable` in the error says whether another attempt may help.
    #[error("{}: {}", .0.reason, .0.message)]
    Failed(JobError),
}

impl TaskError {
    /// A failure that another attempt would only repeat.
    #[must_use]
    pub fn permanent(reason: FailureReason, message: impl std::fmt::Display) -> Self {
        Self::Failed(JobError { reason, message: message.to_string(), retryable: false })
    }

    /// A failure that may pass.
    #[must_use]
    pub fn transient(reason: FailureReason, message: impl std::fmt::Display) -> Self {
        Self::Failed(JobError { reason, message: message.to_string(), retryable: true })
    }
}

impl From<ArtifactError> for TaskError {
    fn from(error: ArtifactError) -> Self {
        let reason = match &error {
            ArtifactError::DiskFull => FailureReason::DiskFull,
            ArtifactError::NotFound { .. } => FailureReason::ArtifactNotFound,
            ArtifactError::DataLoss { .. } => FailureReason::DataLoss,
            _ => FailureReason::Io,
        };
        let retryable = error.is_transient();
        Self::Failed(JobError { reason, message: with_causes(&error), retryable })
    }
}

impl From<StoreError> for TaskError {
    fn from(error: StoreError) -> Self {
        let reason = match &error {
            StoreError::LeaseLost => return Self::Stopped,
            StoreError::DiskFull => FailureReason::DiskFull,
            StoreError::NotFound { .. } => FailureReason::NotFound,
            _ => FailureReason::Store,
        };
        let retryable = error.is_transient();
        Self::Failed(JobError { reason, message: with_causes(&error), retryable })
    }
}

/// How long is left, judged by the steps of this attempt alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eta {
    first_step: u32,
    started: Instant,
}

impl Eta {
    /// Starts the clock at `step`.
    pub(super) fn from(step: u32) -> Self {
        Self { first_step: step, started: Instant::now() }
    }

    /// \[s\]; `None` until there is a step to judge by.
    pub(super) fn left_s(self, step: u32, steps_total: u32) -> Option<f64> {
        let done = step.checked_sub(self.first_step).filter(|done| *done > 0)?;
        Some(self.started.elapsed().as_secs_f64() / f64::from(done) * f64::from(steps_total.saturating_sub(step)))
    }
}

/// The link between a task on its compute thread and the rest of the server.
#[derive(Debug)]
pub struct JobContext {
    pub(super) lease: Lease,
    /// Whose the job is, and with it what it makes.
    pub(super) owner: String,
    pub(super) store: Store,
    pub(super) artifacts: Artifacts,
    pub(super) engines: Arc<EngineCache>,
    pub(super) clock: Clock,
    pub(super) runtime: Handle,
    pub(super) stop: Arc<StopFlag>,
    pub(super) progress: watch::Sender<Option<Progress>>,
    pub(super) checkpoint_interval: Duration,
    pub(super) last_checkpoint: Cell<Instant>,
    /// State that an earlier attempt saved.
    pub(super) saved: RefCell<Option<Vec<u8>>>,
}

impl JobContext {
    /// To be called once an iteration, with how far the task is and, should it be wanted, its state: everything that
    /// a later attempt needs to end with the same bytes. Reports the progress, saves the state when that is due, and
    /// says whether to go on.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`]: return it at once. [`TaskError::Failed`] where the state could not be saved.
    pub fn step(&self, progress: Progress, state: impl FnOnce() -> Vec<u8>) -> Result<(), TaskError> {
        self.progress.send_replace(Some(progress));
        match self.stop.reason() {
            Some(StopReason::Drain) => {
                self.save(state())?;
                Err(TaskError::Stopped)
            }
            Some(StopReason::Timeout | StopReason::Cancel | StopReason::LeaseLost) => Err(TaskError::Stopped),
            None if self.last_checkpoint.get().elapsed() >= self.checkpoint_interval => self.save_in_passing(state()),
            None => Ok(()),
        }
    }

    /// Reports progress where there is no state worth saving.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`]: return it at once.
    pub fn report(&self, progress: Progress) -> Result<(), TaskError> {
        self.progress.send_replace(Some(progress));
        match self.should_stop() {
            Some(_) => Err(TaskError::Stopped),
            None => Ok(()),
        }
    }

    /// Whether, and why, the task has to stop.
    #[must_use]
    pub fn should_stop(&self) -> Option<StopReason> {
        self.stop.reason()
    }

    /// The state that an earlier attempt saved, once.
    #[must_use]
    pub fn take_saved_state(&self) -> Option<Vec<u8>> {
        self.saved.borrow_mut().take()
    }

    /// Engines, with the parts that this server's jobs have in common made once.
    pub(super) fn engines(&self) -> &EngineCache {
        &self.engines
    }

    /// An artifact's bytes, checked.
    ///
    /// # Errors
    ///
    /// [`TaskError::Failed`].
    pub fn read_artifact(&self, digest: &str) -> Result<Vec<u8>, TaskError> {
        Ok(self.wait(self.artifacts.read_all(digest))?)
    }

    /// Stores and records an artifact and returns its digest.
    ///
    /// # Errors
    ///
    /// [`TaskError::Failed`].
    pub fn put_artifact(&self, bytes: Vec<u8>) -> Result<String, TaskError> {
        let size_bytes = bytes.len() as u64;
        self.wait(async {
            let _publishing = self.artifacts.publishing().await;
            let digest = self.artifacts.put_bytes(bytes).await?;
            self.store.record_artifact(&digest, size_bytes, &self.owner, self.clock.now_ms()).await?;
            Ok(digest)
        })
    }

    /// The store, for reading what the job is about.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Waits, on the compute thread, for something asynchronous.
    pub fn wait<F: Future>(&self, future: F) -> F::Output {
        self.runtime.block_on(future)
    }

    /// Saves the state because it is time to. Nothing is lost without it but time: where the disk is full, the job goes on
    /// and tries again later.
    fn save_in_passing(&self, state: Vec<u8>) -> Result<(), TaskError> {
        match self.save(state) {
            Err(TaskError::Failed(error)) if error.reason == FailureReason::DiskFull => {
                tracing::warn!(job = self.lease.job, "the disk is full: no checkpoint; the job goes on");
                self.last_checkpoint.set(Instant::now());
                Ok(())
            }
            saved => saved,
        }
    }

    /// Saves the state: file first, then the row that names it, then the file before goes.
    fn save(&self, state: Vec<u8>) -> Result<(), TaskError> {
        let sealed = checkpoint::seal(&self.lease, state)
            .map_err(|error| TaskError::permanent(FailureReason::Checkpoint, error))?;
        self.wait(self.save_sealed(sealed))?;
        self.last_checkpoint.set(Instant::now());
        Ok(())
    }

    async fn save_sealed(&self, sealed: Vec<u8>) -> Result<(), TaskError> {
        let digest = self.artifacts.put_checkpoint(sealed).await?;
        let before = match self.store.checkpoint(&self.lease, &digest, self.clock.now_ms()).await {
            Ok(before) => before,
            Err(error) => {
                // Nothing names the file. Where this fails too, the next start removes it.
                drop(self.artifacts.delete_checkpoint(&digest).await);
                return Err(error.into());
            }
        };
        if let Some(before) = before {
            self.artifacts.delete_checkpoint(&before).await?;
        }
        Ok(())
    }
}

/// The state that an earlier attempt of the job saved; none where it is gone or of another version.
pub(super) async fn saved_state(artifacts: &Artifacts, job: &Job) -> Option<Vec<u8>> {
    let digest = job.checkpoint.as_deref()?;
    match artifacts.read_checkpoint(digest).await {
        Ok(bytes) => checkpoint::unseal(job, bytes),
        Err(error) => {
            let error: &dyn std::error::Error = &error;
            tracing::warn!(job = job.id, error, "the checkpoint cannot be read; the job starts over");
            None
        }
    }
}
