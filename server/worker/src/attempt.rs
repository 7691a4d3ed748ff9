//! One attempt at a job, from claim to end.

use super::context::saved_state;
use super::job_process::End;
use super::live_picture::LivePicture;
use super::stop::{StopFlag, StopReason};
use super::{Clock, JobContext, PAUSE, Task, TaskError, TaskOutput, Worker};
use lightpath_domain::job::{FailureReason, Job, JobError, Lease, Progress};
use lightpath_domain::reason::PreconditionReason;
use lightpath_metrics as metrics;
use lightpath_store::{AbortReason, Store, StoreError};
use rayon::ThreadPool;
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{oneshot, watch};
use tokio::task::JoinSet;
use tokio::time::{interval, sleep, sleep_until};
use tokio_util::sync::CancellationToken;

/// Shortest time between two progress reports of a job: short enough for people, long enough to spare the store.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);

/// Heartbeats in the time of one lease. Two may fail before the lease expires.
const HEARTBEATS_PER_LEASE: u32 = 3;

/// Time that a draining attempt has for the rest of its step, after which it saves its state. A longer step is
/// interrupted, and the job continues from its last checkpoint. The server's stop must reach every job within a second.
const DRAIN_STEP_MAX: Duration = Duration::from_millis(300);

type Outcome = Result<TaskOutput, TaskError>;

impl Worker {
    /// Runs a claimed job until its attempt ends.
    pub(super) async fn attempt(&self, job: Job, lease: Lease, pool: &Arc<ThreadPool>, drain: &CancellationToken) {
        tracing::info!(job = job.id, attempt = lease.attempt, "attempt started");
        let stop = Arc::new(StopFlag::default());
        let (progress, reports) = watch::channel(None);
        let mut helpers = self.helpers(&lease, &stop, &reports, drain);
        let wait = self.memory.share(&job, |waiting| _ = progress.send_replace(Some(waiting)));
        let Some(share) = stop.unless_stopped(wait).await.flatten() else {
            return self.end_and_log(&lease, Err(TaskError::Stopped), &stop, None).await;
        };
        // The wait for memory does not count.
        if let Some(timeout) = self.config.timeouts.of(&job) {
            let stop = Arc::clone(&stop);
            helpers.spawn(async move {
                sleep(timeout).await;
                stop.raise(StopReason::Timeout);
            });
        }
        if job.suspect
            && let Some(program) = &self.job_program
        {
            let end = program.run(&self.store, &lease, job.estimate.memory_bytes, &stop).await;
            drop(share);
            return self.end_alone(&lease, end, &stop).await;
        }
        let saved = match stop.unless_interrupted(saved_state(&self.artifacts, &job)).await {
            Some(Err(error)) => return self.end_and_log(&lease, Err(error), &stop, None).await,
            Some(Ok(saved)) => saved,
            None => None,
        };
        let context = JobContext {
            lease: lease.clone(),
            owner: job.scheduling.owner.clone(),
            store: self.store.clone(),
            artifacts: self.artifacts.clone(),
            engines: Arc::clone(&self.engines),
            device: Arc::clone(&self.device),
            clock: self.clock.clone(),
            runtime: Handle::current(),
            stop: Arc::clone(&stop),
            progress,
            checkpoint_interval: self.config.checkpoint_interval,
            rigs: self.rigs.clone(),
            live_picture: LivePicture::new(self.live_pictures.clone(), lease.job.clone()),
            last_checkpoint: Cell::new(Instant::now()),
            last_save_took: Cell::new(Duration::ZERO),
            saved: RefCell::new(saved),
        };
        let outcome = compute(Arc::clone(&self.task), job, context, Arc::clone(pool)).await;
        drop(share);
        let last_report = reports.borrow().clone();
        self.end_and_log(&lease, outcome, &stop, last_report).await;
    }

    /// Starts the tasks that run beside an attempt. They are aborted when the set is dropped at its end.
    fn helpers(
        &self,
        lease: &Lease,
        stop: &Arc<StopFlag>,
        reports: &watch::Receiver<Option<Progress>>,
        drain: &CancellationToken,
    ) -> JoinSet<()> {
        let mut helpers = JoinSet::new();
        // Subscribe first: the first heartbeat sees an earlier cancellation, and this channel receives a later one.
        let cancels = self.store.subscribe_cancels();
        helpers.spawn(watch_for_stop(cancels, lease.job.clone(), drain.clone(), Arc::clone(stop)));
        let (store, clock) = (self.store.clone(), self.clock.clone());
        helpers.spawn(send_heartbeats(
            store.clone(),
            clock.clone(),
            lease.clone(),
            self.config.lease,
            Arc::clone(stop),
        ));
        helpers.spawn(store_progress(store, lease.clone(), reports.clone()));
        helpers
    }

    /// Records in the store how the process of the job ended, unless it has done so itself.
    async fn end_alone(&self, lease: &Lease, end: End, stop: &StopFlag) {
        let error = match end {
            End::Stored => {
                if let Ok(job) = self.store.job(&lease.job).await {
                    self.note_end(lease, &job, None).await;
                }
                return;
            }
            End::Stopped => TaskError::Stopped,
            End::NotStarted(message) => TaskError::transient(FailureReason::NotStarted, message),
            End::Died(death) => TaskError::transient(FailureReason::ProcessDied, death),
        };
        self.end_and_log(lease, Err(error), stop, None).await;
    }

    /// Records in the store how the attempt ended.
    async fn end_and_log(&self, lease: &Lease, outcome: Outcome, stop: &StopFlag, last_report: Option<Progress>) {
        // Saved state of the job before its end, which refers to none any more.
        let mut checkpoint = None;
        loop {
            let ended = async {
                checkpoint = self.store.job(&lease.job).await?.checkpoint.or(checkpoint.take());
                self.end(lease, outcome.clone(), stop.reason(), last_report.clone()).await
            };
            let error = match ended.await {
                Ok(job) => return self.note_end(lease, &job, checkpoint).await,
                Err(error) => error,
            };
            match error {
                // The work is done. If the lease is lost meanwhile, it is not valid when the database is back.
                StoreError::Unreachable(_) | StoreError::Busy => {
                    let error: &dyn std::error::Error = &error;
                    tracing::warn!(job = lease.job, error, "the end of the attempt is not stored yet; trying again");
                }
                StoreError::LeaseLost => match self.stored_end(lease).await {
                    Ok(Some(job)) => return self.note_end(lease, &job, checkpoint).await,
                    Ok(None) => {
                        tracing::warn!(
                            job = lease.job,
                            "the lease is not valid any more: the end of the attempt was stored before, or the lease was \
                             taken back"
                        );
                        return;
                    }
                    Err(_) => {}
                },
                _ => {
                    // The lease will expire, and the job then returns to the queue.
                    let error: &dyn std::error::Error = &error;
                    tracing::error!(job = lease.job, error, "the end of the attempt could not be stored");
                    return;
                }
            }
            sleep(PAUSE).await;
        }
    }

    /// The job, if it has ended with this lease: nobody else can have stored that.
    async fn stored_end(&self, lease: &Lease) -> Result<Option<Job>, StoreError> {
        let job = self.store.job(&lease.job).await?;
        Ok(Some(job).filter(|job| job.state.has_ended() && job.attempt == lease.attempt))
    }

    /// Logs and counts an end that is stored, and removes the job's last saved state.
    async fn note_end(&self, lease: &Lease, job: &Job, checkpoint: Option<String>) {
        tracing::info!(job = job.id, attempt = lease.attempt, state = job.state.as_str(), "attempt ended");
        if job.state.has_ended() {
            metrics::job_ended(job);
        }
        if job.checkpoint.is_none()
            && let Some(digest) = checkpoint
            && let Err(error) = self.artifacts.delete_checkpoint(&digest).await
        {
            // The file does no harm: no job refers to it, and the next start removes it.
            tracing::warn!(error = &error as &dyn std::error::Error, "a checkpoint could not be removed");
        }
    }

    /// Stores the end of the attempt.
    async fn end(
        &self,
        lease: &Lease,
        outcome: Outcome,
        stop: Option<StopReason>,
        last_report: Option<Progress>,
    ) -> Result<Job, StoreError> {
        match (outcome, stop) {
            (Ok(output), _) => {
                if let Some(progress) = last_report {
                    self.store.progress(lease, &progress).await?;
                }
                self.finish(lease, output).await
            }
            (Err(TaskError::Stopped), Some(StopReason::Cancel)) => {
                self.store.end_cancelled(lease, self.clock.now_ms()).await
            }
            (Err(TaskError::Stopped), Some(StopReason::Drain)) => self.store.release(lease, self.clock.now_ms()).await,
            (Err(TaskError::Stopped), Some(StopReason::Timeout)) => {
                let message = "the attempt exceeded its time limit; raise the job's timeout".to_owned();
                let error = JobError { reason: FailureReason::Timeout, message, retryable: false };
                self.store.fail(lease, error, None, self.clock.now_ms()).await
            }
            (Err(TaskError::Stopped), Some(StopReason::LeaseLost) | None) => Err(StoreError::LeaseLost),
            (Err(TaskError::Failed(error)), _) => {
                tracing::warn!(
                    job = lease.job,
                    reason = error.reason.as_str(),
                    message = error.message,
                    "attempt failed"
                );
                let now_ms = self.clock.now_ms();
                let delay = self.config.backoff.delay(error.reason, lease.attempt).as_millis() as i64;
                if error.reason == FailureReason::ProcessDied {
                    self.store.end_dead(lease, &error.message, now_ms + delay, now_ms).await
                } else if error.is_of_the_machine() {
                    self.store.postpone(lease, error, now_ms + delay, now_ms).await
                } else {
                    let retry_at_ms = error.retryable.then_some(now_ms + delay);
                    self.store.fail(lease, error, retry_at_ms, now_ms).await
                }
            }
        }
    }
}

impl Worker {
    /// Ends the job with its result, or with an error if the store refuses the changes that belong to the result.
    async fn finish(&self, lease: &Lease, output: TaskOutput) -> Result<Job, StoreError> {
        let now_ms = self.clock.now_ms();
        let error = match self.store.finish(lease, output.result, output.effect, now_ms).await {
            Err(error @ (StoreError::Aborted { .. } | StoreError::Precondition { .. })) => error,
            finished => return finished,
        };
        tracing::warn!(
            job = lease.job,
            error = &error as &dyn std::error::Error,
            "the store refused the job's changes"
        );
        let error = JobError { reason: refusal(&error), message: error.to_string(), retryable: false };
        self.store.fail(lease, error, None, now_ms).await
    }
}

/// Failure reason of a job whose changes the store refused.
fn refusal(error: &StoreError) -> FailureReason {
    match error {
        StoreError::Aborted { reason: AbortReason::DatasetChanged, .. } => FailureReason::DatasetChanged,
        StoreError::Precondition { reason: PreconditionReason::DatasetFinalized, .. } => {
            FailureReason::DatasetFinalized
        }
        StoreError::Precondition { reason: PreconditionReason::DatasetSplitEmpty, .. } => {
            FailureReason::DatasetSplitEmpty
        }
        StoreError::Precondition { reason: PreconditionReason::KernelFull, .. } => FailureReason::KernelFull,
        _ => FailureReason::Store,
    }
}

/// Runs the task on a thread of its own.
async fn compute(task: Arc<dyn Task>, job: Job, context: JobContext, pool: Arc<ThreadPool>) -> Outcome {
    let (done, outcome) = oneshot::channel();
    let run = move || {
        let outcome = catch_unwind(AssertUnwindSafe(|| run_inside(&pool, task.as_ref(), &job, context)));
        // The attempt waits for this value. The send fails only when the process is ending.
        drop(done.send(outcome.unwrap_or_else(|panic| Err(panicked(panic.as_ref())))));
    };
    if let Err(error) = std::thread::Builder::new().name("compute".to_owned()).spawn(run) {
        return Err(TaskError::transient(
            FailureReason::NotStarted,
            format!("the compute thread could not be started: {error}"),
        ));
    }
    outcome.await.unwrap_or_else(|_| {
        Err(TaskError::transient(FailureReason::Thread, "the compute thread ended without a result"))
    })
}

/// Runs the task in the thread pool, until it ends or the stop flag interrupts it. The context moves there because only
/// one thread at a time may use its cells.
fn run_inside(pool: &ThreadPool, task: &dyn Task, job: &Job, context: JobContext) -> Outcome {
    let stop = Arc::clone(&context.stop);
    let run = move || stop.interrupt().run(|| task.run(job, &context));
    pool.install(run).unwrap_or(Err(TaskError::Stopped))
}

fn panicked(panic: &(dyn Any + Send)) -> TaskError {
    let message = match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(text), _) => (*text).to_owned(),
        (None, Some(text)) => text.clone(),
        (None, None) => "no message".to_owned(),
    };
    TaskError::Failed(JobError { reason: FailureReason::Panic, message, retryable: true })
}

/// Extends the lease. Raises the stop flag if the lease is lost or the job must be cancelled. While the store does not
/// accept heartbeats, it cannot take the lease back either.
async fn send_heartbeats(store: Store, clock: Clock, lease: Lease, duration: Duration, stop: Arc<StopFlag>) {
    let lease_ms = i64::try_from(duration.as_millis()).unwrap_or(i64::MAX / 2);
    let mut ticks = interval(duration / HEARTBEATS_PER_LEASE);
    loop {
        ticks.tick().await;
        match store.heartbeat(&lease, clock.now_ms(), lease_ms).await {
            Ok(beat) if beat.cancel_requested => stop.raise(StopReason::Cancel),
            Ok(_) => {}
            Err(StoreError::LeaseLost) => return stop.raise(StopReason::LeaseLost),
            Err(error) => {
                tracing::error!(job = lease.job, error = &error as &dyn std::error::Error, "a heartbeat failed");
            }
        }
    }
}

/// Raises the stop flag when the server drains or a user cancels the job. If it misses a cancellation, the next
/// heartbeat sees it.
async fn watch_for_stop(mut cancels: Receiver<String>, job: String, drain: CancellationToken, stop: Arc<StopFlag>) {
    // End of the step of a draining attempt.
    let mut step_end = None;
    loop {
        let interrupt_at = step_end.filter(|_| !stop.interrupt().is_raised());
        tokio::select! {
            () = drain.cancelled(), if step_end.is_none() => {
                step_end = Some(tokio::time::Instant::now() + DRAIN_STEP_MAX);
                stop.raise(StopReason::Drain);
            }
            () = sleep_until(interrupt_at.unwrap_or_else(tokio::time::Instant::now)), if interrupt_at.is_some() => {
                stop.interrupt().raise();
            }
            cancelled = cancels.recv() => match cancelled {
                Ok(id) if id == job => return stop.raise(StopReason::Cancel),
                Ok(_) | Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            }
        }
    }
}

/// Stores progress reports, at most a few a second.
async fn store_progress(store: Store, lease: Lease, mut reports: watch::Receiver<Option<Progress>>) {
    while reports.changed().await.is_ok() {
        let report = reports.borrow_and_update().clone();
        if let Some(progress) = report
            && let Err(error) = store.progress(&lease, &progress).await
        {
            tracing::debug!(job = lease.job, error = &error as &dyn std::error::Error, "progress was not recorded");
        }
        sleep(PROGRESS_INTERVAL).await;
    }
}
