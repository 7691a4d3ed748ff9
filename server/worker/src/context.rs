//! The interface between a task and the rest of the server.

use super::live_picture::LivePicture;
use super::stop::{StopFlag, StopReason};
use super::{Clock, checkpoint};
use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_domain::causes::with_causes;
use lightpath_domain::job::{FailureReason, Job, JobEffect, JobError, JobResult, Lease, Progress};
use lightpath_gpu::Device;
use lightpath_optics::EngineCache;
use lightpath_optics::interrupt::Interrupt;
use lightpath_rigs::Rigs;
use lightpath_store::{Store, StoreError};
use std::cell::{Cell, RefCell};
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::watch;

/// Pause after a checkpoint, in units of the time that it took: saving takes at most a twentieth of a job's time.
const SAVES_PER_PAUSE: u32 = 20;
/// Largest state that needs no such pause \[bytes\]: saving it takes a tenth of a second.
const SMALL_STATE_BYTES: usize = 16 << 20;
/// Longest time for saving a state when the server stops, which must reach every job within seconds.
const DRAIN_SAVE_MAX: Duration = Duration::from_secs(2);
/// Largest state that is saved when the server stops \[bytes\]: a disk writes it within [`DRAIN_SAVE_MAX`].
const DRAIN_STATE_BYTES_MAX: usize = 512 << 20;

/// The output of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskOutput {
    /// Result of the job.
    pub result: JobResult,
    /// Further changes that the store makes when the job ends.
    pub effect: JobEffect,
}

/// Reason why a task ended without output.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TaskError {
    /// The context stopped the task.
    #[error("the task was stopped")]
    Stopped,
    /// The task failed. `retryable` in the error says whether another attempt may succeed.
    #[error("{}: {}", .0.reason, .0.message)]
    Failed(JobError),
}

impl TaskError {
    /// An error that another attempt would repeat.
    #[must_use]
    pub fn permanent(reason: FailureReason, message: impl std::fmt::Display) -> Self {
        Self::Failed(JobError { reason, message: message.to_string(), retryable: false })
    }

    /// An error that may not occur in another attempt.
    #[must_use]
    pub fn transient(reason: FailureReason, message: impl std::fmt::Display) -> Self {
        Self::Failed(JobError { reason, message: message.to_string(), retryable: true })
    }
}

impl From<ArtifactError> for TaskError {
    fn from(error: ArtifactError) -> Self {
        let reason = match &error {
            ArtifactError::DiskFull | ArtifactError::DiskLow { .. } => FailureReason::DiskFull,
            ArtifactError::NotFound { .. } => FailureReason::ArtifactNotFound,
            ArtifactError::DataLoss { .. } => FailureReason::DataLoss,
            ArtifactError::Remote { .. } => FailureReason::Remote,
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
            StoreError::Unreachable(_) | StoreError::Busy => FailureReason::Remote,
            _ => FailureReason::Store,
        };
        let retryable = error.is_transient();
        Self::Failed(JobError { reason, message: with_causes(&error), retryable })
    }
}

/// Estimate of the remaining time, from the steps of this attempt alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eta {
    first_step: u32,
    started: Instant,
}

impl Eta {
    /// Starts the measurement at `step`.
    pub(super) fn from(step: u32) -> Self {
        Self { first_step: step, started: Instant::now() }
    }

    /// Remaining time \[s\]; `None` before the first step has ended.
    pub(super) fn left_s(self, step: u32, steps_total: u32) -> Option<f64> {
        let done = step.checked_sub(self.first_step).filter(|done| *done > 0)?;
        Some(self.started.elapsed().as_secs_f64() / f64::from(done) * f64::from(steps_total.saturating_sub(step)))
    }
}

/// The link between a task on its compute thread and the rest of the server.
#[derive(Debug)]
pub struct JobContext {
    pub(super) lease: Lease,
    /// Owner of the job and of the artifacts it makes.
    pub(super) owner: String,
    pub(super) store: Store,
    pub(super) artifacts: Artifacts,
    pub(super) engines: Arc<EngineCache>,
    pub(super) device: Arc<Device>,
    pub(super) clock: Clock,
    pub(super) runtime: Handle,
    pub(super) stop: Arc<StopFlag>,
    pub(super) progress: watch::Sender<Option<Progress>>,
    pub(super) live_picture: LivePicture,
    pub(super) rigs: Rigs,
    pub(super) checkpoint_interval: Duration,
    pub(super) last_checkpoint: Cell<Instant>,
    /// Time that the last save of a large state took.
    pub(super) last_save_took: Cell<Duration>,
    /// State that an earlier attempt saved.
    pub(super) saved: RefCell<Option<Vec<u8>>>,
}

impl JobContext {
    /// Call this once an iteration, with the progress and a function that returns the state. The state is everything
    /// that a later attempt needs to produce the same bytes. Reports the progress, saves the state when a checkpoint is
    /// due, and checks whether the task must stop.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`]: the task must return it at once. [`TaskError::Failed`] if the state could not be saved.
    pub fn step(&self, progress: Progress, state: impl FnOnce() -> Vec<u8>) -> Result<(), TaskError> {
        self.progress.send_replace(Some(progress));
        match self.stop.reason() {
            Some(StopReason::Drain) => {
                self.save_at_drain(state)?;
                Err(TaskError::Stopped)
            }
            Some(StopReason::Timeout | StopReason::Cancel | StopReason::LeaseLost) => Err(TaskError::Stopped),
            None if self.is_checkpoint_due() => self.save_in_passing(state()),
            None => Ok(()),
        }
    }

    /// Does the same as [`Self::step`], and saves the state, however recent the last checkpoint is: for what cannot be done
    /// again at will.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::step`].
    pub fn step_to_keep(&self, progress: Progress, state: impl FnOnce() -> Vec<u8>) -> Result<(), TaskError> {
        if self.stop.reason().is_none() {
            self.save_in_passing(state())?;
            return self.report(progress);
        }
        self.step(progress, state)
    }

    /// Shows the PNG that `draw` makes of what the job has reached, every few seconds. `None`: there is nothing to show.
    pub(super) fn show(&self, draw: impl FnOnce() -> Option<Vec<u8>>) {
        self.live_picture.show(draw);
    }

    /// Reports progress of a part that has no state to save.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`]: the task must return it at once.
    pub fn report(&self, progress: Progress) -> Result<(), TaskError> {
        self.progress.send_replace(Some(progress));
        match self.should_stop() {
            Some(_) => Err(TaskError::Stopped),
            None => Ok(()),
        }
    }

    /// The reason why the task must stop; `None`: continue.
    #[must_use]
    pub fn should_stop(&self) -> Option<StopReason> {
        self.stop.reason()
    }

    /// Returns the state that an earlier attempt saved. Only the first call returns it.
    #[must_use]
    pub fn take_saved_state(&self) -> Option<Vec<u8>> {
        self.saved.borrow_mut().take()
    }

    /// Cache of engines and of the parts that the jobs of this server share.
    pub(super) fn engines(&self) -> &Arc<EngineCache> {
        &self.engines
    }

    /// What computes the holograms of this server.
    pub(super) fn device(&self) -> &Device {
        &self.device
    }

    /// Reads an artifact and checks it against its digest.
    ///
    /// # Errors
    ///
    /// [`TaskError::Failed`] if the artifact cannot be read or does not match its digest, [`TaskError::Stopped`] if the
    /// task must stop at once.
    pub fn read_artifact(&self, digest: &str) -> Result<Vec<u8>, TaskError> {
        let read = self.stop.unless_interrupted(self.artifacts.read_all(digest));
        Ok(self.wait(read).ok_or(TaskError::Stopped)??)
    }

    /// Stores and records an artifact and returns its digest. If the computation is interrupted first, the artifact is
    /// stored nevertheless. No job refers to it then, and a later collection removes it.
    ///
    /// # Errors
    ///
    /// [`TaskError::Failed`] if the artifact cannot be written or recorded, [`TaskError::Stopped`] if the task must
    /// stop at once.
    pub fn put_artifact(&self, bytes: Vec<u8>) -> Result<String, TaskError> {
        let (artifacts, store, owner) = (self.artifacts.clone(), self.store.clone(), self.owner.clone());
        let (size_bytes, now_ms) = (bytes.len() as u64, self.clock.now_ms());
        let put = self.runtime.spawn(async move {
            let record = |digest: String, seen: Option<String>| {
                let (store, owner) = (store.clone(), owner.clone());
                async move {
                    let recorded = store.record_artifact(&digest, size_bytes, &owner, seen.as_deref(), now_ms).await?;
                    Ok(recorded.map(|record| record.digest))
                }
            };
            artifacts.publish(bytes, record).await
        });
        self.wait(self.stop.unless_interrupted(put))
            .ok_or(TaskError::Stopped)?
            .map_err(|error| TaskError::transient(FailureReason::Io, error))?
    }

    /// The store, for reading the records to which the job refers.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Id of the job.
    #[must_use]
    pub fn job_id(&self) -> &str {
        &self.lease.job
    }

    /// The rigs that are connected to this server.
    pub(super) fn rigs(&self) -> &Rigs {
        &self.rigs
    }

    /// Waits on the compute thread for an asynchronous operation, until the task must stop.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`].
    pub(super) fn wait_unless_stopped<F: Future>(&self, future: F) -> Result<F::Output, TaskError> {
        self.wait(self.stop.unless_stopped(future)).ok_or(TaskError::Stopped)
    }

    /// Waits on the compute thread for an asynchronous operation.
    pub fn wait<F: Future>(&self, future: F) -> F::Output {
        self.runtime.block_on(future)
    }

    /// Whether a checkpoint is due. Large states are saved less often, so that saving takes little of the job's time.
    fn is_checkpoint_due(&self) -> bool {
        let pause = SAVES_PER_PAUSE * self.last_save_took.get();
        self.last_checkpoint.get().elapsed() >= self.checkpoint_interval.max(pause)
    }

    /// Saves the state when the server stops. If the state is too large for the time that is left, the job continues
    /// from its last checkpoint.
    fn save_at_drain(&self, state: impl FnOnce() -> Vec<u8>) -> Result<(), TaskError> {
        if self.last_save_took.get() > DRAIN_SAVE_MAX {
            return Ok(());
        }
        // The end of the draining attempt's step must not interrupt the writing of its state.
        let Ok(state) = Interrupt::default().run(state) else { return Ok(()) };
        if state.len() > DRAIN_STATE_BYTES_MAX {
            return Ok(());
        }
        self.save(state)
    }

    /// Saves the state at a regular interval. If the disk is full, or the bucket does not answer, the job continues and
    /// tries again later.
    fn save_in_passing(&self, state: Vec<u8>) -> Result<(), TaskError> {
        match self.save(state) {
            Err(TaskError::Failed(error)) if error.is_of_the_machine() => {
                tracing::warn!(
                    job = self.lease.job,
                    error = error.message,
                    "the checkpoint cannot be stored: it is skipped, and the job continues"
                );
                self.last_checkpoint.set(Instant::now());
                Ok(())
            }
            saved => saved,
        }
    }

    /// Saves the state: writes the file, records it in the job's row, and removes the previous file.
    fn save(&self, state: Vec<u8>) -> Result<(), TaskError> {
        let (started, is_large) = (Instant::now(), state.len() > SMALL_STATE_BYTES);
        let sealed = checkpoint::seal(&self.lease, state)
            .map_err(|error| TaskError::permanent(FailureReason::Checkpoint, error))?;
        self.artifacts.space().room_for_checkpoint(sealed.len() as u64)?;
        self.wait(self.save_sealed(sealed))?;
        let took = if is_large { started.elapsed() } else { Duration::ZERO };
        self.last_save_took.set(took);
        self.last_checkpoint.set(Instant::now());
        Ok(())
    }

    /// Writes a checkpoint. If the computation is interrupted first, the file is written and removed by another task. A
    /// save at a drain is not interrupted.
    async fn put_checkpoint(&self, sealed: Vec<u8>) -> Result<String, TaskError> {
        let artifacts = self.artifacts.clone();
        if self.stop.reason().is_some() {
            return Ok(artifacts.put_checkpoint(sealed).await?);
        }
        let mut put = tokio::spawn(async move { (artifacts.put_checkpoint(sealed).await, artifacts) });
        match self.stop.unless_interrupted(&mut put).await {
            Some(Ok((digest, _))) => Ok(digest?),
            Some(Err(error)) => Err(TaskError::transient(FailureReason::Checkpoint, error)),
            None => {
                tokio::spawn(async move {
                    if let Ok((Ok(digest), artifacts)) = put.await {
                        // If the removal fails, the next start removes the file.
                        drop(artifacts.delete_checkpoint(&digest).await);
                    }
                });
                Err(TaskError::Stopped)
            }
        }
    }

    async fn save_sealed(&self, sealed: Vec<u8>) -> Result<(), TaskError> {
        let digest = self.put_checkpoint(sealed).await?;
        let before = match self.store.checkpoint(&self.lease, &digest).await {
            Ok(before) => before,
            Err(error) => {
                // Another error may hide that the job refers to the file now.
                if matches!(error, StoreError::LeaseLost) {
                    // If the removal fails, the next start or a collection removes the file.
                    drop(self.artifacts.delete_checkpoint(&digest).await);
                }
                return Err(error.into());
            }
        };
        if let Some(before) = before
            && let Err(error) = self.artifacts.delete_checkpoint(&before).await
        {
            // It does no harm: no job refers to it, and the next start or collection removes it.
            tracing::warn!(error = &error as &dyn std::error::Error, "a checkpoint could not be removed");
        }
        Ok(())
    }
}

/// The state that an earlier attempt of the job saved; `None` if it is missing or was saved by another version.
///
/// # Errors
///
/// [`TaskError::Failed`] if the bucket with the state does not answer.
pub(super) async fn saved_state(artifacts: &Artifacts, job: &Job) -> Result<Option<Vec<u8>>, TaskError> {
    let Some(digest) = job.checkpoint.as_deref() else { return Ok(None) };
    match artifacts.read_checkpoint(digest).await {
        Ok(bytes) => Ok(checkpoint::unseal(&job.id, bytes)),
        Err(error @ ArtifactError::Remote { .. }) => Err(error.into()),
        Err(error) => {
            let error: &dyn std::error::Error = &error;
            tracing::warn!(job = job.id, error, "the checkpoint cannot be read; the job starts over");
            Ok(None)
        }
    }
}
