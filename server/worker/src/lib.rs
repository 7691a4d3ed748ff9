//! Workers claim jobs, run them on the optics engine, and record the results in the store.
//!
//! ```text
//!  async runtime                                    compute thread (one an attempt)
//!  claim loop ── claim ──> attempt ── starts ─────> Task::run, inside a rayon pool of its own
//!                            ├ heartbeats            │ once an iteration: JobContext::step
//!                            ├ progress  <── watch ──┤   reports progress,
//!                            ├ cancels   ── flag ──> │   saves a checkpoint when one is due or the server drains;
//!                            ├ drain     ── flag ──> │ the flag interrupts the engine within an iteration, too
//!                            └ finish, fail, release <── outcome
//! ```
//!
//! Heartbeats never wait for computations, and computations never run on the threads of the async runtime.
//!
//! # Layout
//!
//! - `attempt`: one job from claim to end. `context`: interface of a task to the server. `stop`: the shared stop flag.
//! - `job_process`: a process of its own for a job during which a server died.
//! - `job_memory`: the memory that running jobs share. `speed`: the speed of this machine.
//! - `claiming`: the loops that claim jobs. `config`: the settings. `checkpoint`: the envelope of saved states. `computer`: what may resume them. `backoff`: pauses
//!   before retries. `clock`: the time of day.
//! - `kinds`: runs each kind of job by its own function, in a file of its own. They share `display_setup` (a display at a
//!   wavelength and distance), `pairs`, `losses` and `state_bytes`. `live_picture`: what a hologram job shows while it
//!   runs. `hologram_setup` reads its input, `hologram_notes` says what its figures leave out, and `captured` measures learned kernels. `version_model`, `learned_from`: the
//!   model of a version, and what it was learned from.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod attempt;
mod backoff;
mod captured;
mod checkpoint;
mod claiming;
mod clock;
mod computer;
mod config;
mod context;
mod display_setup;
mod hologram_judgement;
mod hologram_notes;
mod hologram_setup;
mod job_memory;
mod job_process;
mod kinds;
mod learned_from;
mod live_picture;
mod losses;
mod pairs;
mod speed;
mod state_bytes;
mod stop;
#[cfg(test)]
mod tests;
mod version_model;

pub use backoff::Backoff;
pub use clock::Clock;
pub use config::{Timeouts, WorkerConfig};
pub use context::{JobContext, TaskError, TaskOutput};
pub use job_memory::{cache_bytes_max, jobs_bytes_max};
pub use job_process::{JobInput, JobProgram};
pub use kinds::OpticsTask;
pub use speed::measured_work_per_s;
pub use stop::StopReason;

use job_memory::JobMemory;
use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_domain::job::Job;
use lightpath_gpu::Device;
use lightpath_media::live_pictures::LivePictures;
use lightpath_metrics::{self as metrics, LeaseLoss};
use lightpath_optics::EngineCache;
use lightpath_rigs::Rigs;
use lightpath_store::{Store, StoreError};
use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

/// Pause of a claim loop after an error of the store, or while the disk is full.
const PAUSE: Duration = Duration::from_secs(1);
/// Scheduling priority of the compute threads, as of the command `nice`. Threads that answer calls get a core at once.
#[cfg(target_os = "linux")]
const COMPUTE_NICENESS: i32 = 10;
/// A process that has not checked the leases for longer than this, as a part of a lease's time, was suspended. It takes no
/// lease back before heartbeats had time to arrive. Checks come twice in the time of a lease, and a lease without
/// heartbeats lives for at least two thirds of that time.
const ABSENCE_MIN: f64 = 0.6;
/// After the database's clock was set, no lease is taken back for the time of a lease and this pause. Each process notices
/// the new time within a few seconds, so by then every living worker has sent a heartbeat.
const HEARTBEATS_WAIT: Duration = Duration::from_secs(10);
/// Longest lease that can be set \[ms\]. One that ends later was given before the database's clock was set back.
const LEASE_MS_MAX: i64 = 3_600_000;

/// The work of a job. It runs on a compute thread, inside a rayon pool.
pub trait Task: Send + Sync + 'static {
    /// Does the job's work and returns its output. An implementation calls [`JobContext::step`] once an iteration. The
    /// work is [interrupted](lightpath_optics::interrupt) where it uses the engine or calls `interrupt::check`.
    ///
    /// # Errors
    ///
    /// [`TaskError::Stopped`] as soon as the context returns it, and [`TaskError::Failed`] if the work fails.
    fn run(&self, job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError>;
}

impl<F> Task for F
where
    F: Fn(&Job, &JobContext) -> Result<TaskOutput, TaskError> + Send + Sync + 'static,
{
    fn run(&self, job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
        self(job, context)
    }
}

/// Lowers the priority of the calling thread, so that calls are answered while jobs compute.
fn yield_to_other_threads() {
    // On other systems the priority belongs to the whole process.
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(None, COMPUTE_NICENESS) {
        tracing::warn!(error = %error, "the priority of a compute thread could not be lowered; calls may be slower");
    }
}

/// Reason why the workers could not start; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum WorkerError {
    #[error("the compute threads could not be started")]
    Threads(#[from] ThreadPoolBuildError),
    #[error("the thread that listens to the server could not be started")]
    Listening(#[source] std::io::Error),
    #[error("the queue could not be recovered")]
    Store(#[from] StoreError),
    #[error("old checkpoints could not be removed")]
    Artifacts(#[from] ArtifactError),
}

/// Workers that share one store and one folder of artifacts.
pub struct Worker {
    store: Store,
    artifacts: Artifacts,
    engines: Arc<EngineCache>,
    device: Arc<Device>,
    memory: JobMemory,
    config: WorkerConfig,
    task: Arc<dyn Task>,
    clock: Clock,
    live_pictures: LivePictures,
    job_program: Option<JobProgram>,
    rigs: Rigs,
}

impl std::fmt::Debug for Worker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Worker").field("config", &self.config).finish_non_exhaustive()
    }
}

impl Worker {
    /// Creates workers that run `task` for jobs of all kinds.
    #[must_use]
    pub fn new(store: Store, artifacts: Artifacts, config: WorkerConfig, task: Arc<dyn Task>) -> Self {
        let engines = Arc::new(EngineCache::new(cache_bytes_max(config.memory_bytes) as usize));
        let memory = JobMemory::new(config.memory_bytes);
        let (clock, live_pictures) = (Clock::of(&store), LivePictures::default());
        let device = Arc::new(Device::processor());
        let (job_program, rigs) = (None, Rigs::default());
        Self { store, artifacts, engines, device, memory, config, task, clock, live_pictures, job_program, rigs }
    }

    /// Computes holograms on `device`. Without it the processor computes everything.
    #[must_use]
    pub fn computing_on(mut self, device: Arc<Device>) -> Self {
        self.device = device;
        self
    }

    /// Runs jobs during which a server died with `program`, in a process of its own each. Without it, they run in this
    /// process like all others.
    #[must_use]
    pub fn isolating(mut self, program: Option<JobProgram>) -> Self {
        self.job_program = program;
        self
    }

    /// Runs also the jobs that need one of `rigs`, beside all others: they wait for benches more than they compute.
    #[must_use]
    pub fn at_benches(mut self, rigs: Rigs) -> Self {
        self.rigs = rigs;
        self
    }

    /// Shows the pictures of running jobs in `pictures`.
    #[must_use]
    pub fn showing(mut self, pictures: LivePictures) -> Self {
        self.live_pictures = pictures;
        self
    }

    /// The clock that decides when leases end.
    #[must_use]
    pub fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// Recovers the queue after an earlier process, then works until `drain` is cancelled. At the end, running jobs
    /// save their state and return to the queue.
    ///
    /// Jobs that this process is said to run at the start are treated as orphans; without an id of the process, all
    /// running jobs.
    ///
    /// # Errors
    ///
    /// [`WorkerError`] if the recovery fails, before any job is claimed.
    pub async fn run(self, drain: CancellationToken) -> Result<(), WorkerError> {
        self.recover().await?;
        self.work(drain).await
    }

    async fn work(self, drain: CancellationToken) -> Result<(), WorkerError> {
        let pools: Vec<ThreadPool> = (0..self.config.workers.max(1)).map(|_| self.pool()).collect::<Result<_, _>>()?;
        let bench_pool = Arc::new(self.pool()?);
        let worker = Arc::new(self);
        let mut loops = JoinSet::new();
        loops.spawn({
            let (worker, drain) = (Arc::clone(&worker), drain.clone());
            async move { worker.bench_loop(bench_pool, drain).await }
        });
        for (index, pool) in pools.into_iter().enumerate() {
            let (worker, drain) = (Arc::clone(&worker), drain.clone());
            loops.spawn(async move { worker.claim_loop(index, Arc::new(pool), drain).await });
        }
        loops.spawn({
            let (worker, drain) = (Arc::clone(&worker), drain.clone());
            async move { worker.expire_loop(drain).await }
        });
        loops.join_all().await;
        Ok(())
    }

    /// A thread pool for one claim loop. In a shared pool, a thread that waits for a part of its own job could pick up
    /// another whole job and return only after that has ended.
    fn pool(&self) -> Result<ThreadPool, ThreadPoolBuildError> {
        ThreadPoolBuilder::new()
            .num_threads(self.config.compute_threads)
            .thread_name(|index| format!("compute-{index}"))
            .start_handler(|_| yield_to_other_threads())
            .build()
    }

    /// Requeues the jobs of dead workers and removes checkpoints to which no job refers.
    async fn recover(&self) -> Result<(), WorkerError> {
        loop {
            let orphans = self.store.recover_orphans(self.config.process.as_deref(), self.clock.now_ms()).await?;
            if orphans.is_empty() {
                break;
            }
            for job in orphans {
                metrics::lease_lost(LeaseLoss::ServerDied, &job);
                tracing::warn!(job = job.id, state = job.state.as_str(), "took the job back from a dead worker");
            }
        }
        self.pull_forward().await?;
        let live: HashSet<String> = self.store.live_checkpoints().await?.into_iter().collect();
        for digest in self.artifacts.checkpoints().await? {
            if !live.contains(&digest) {
                self.artifacts.delete_checkpoint(&digest).await?;
            }
        }
        Ok(())
    }

    /// Takes jobs from workers that lost their leases without ending the attempt, for example because its end could not
    /// be stored.
    async fn expire_loop(&self, drain: CancellationToken) {
        let mut ticks = tokio::time::interval(self.config.lease / 2);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let started = Instant::now();
        let mut checked = started;
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = drain.cancelled() => return,
            }
            // The other processes may have been cut off from the database before this one started, or its clock was set:
            // their heartbeats must be able to arrive first.
            let (lease, jumped) = (self.config.lease, self.store.since_time_jump());
            let comes_late = started.elapsed() < lease || jumped.is_some_and(|since| since < lease + HEARTBEATS_WAIT);
            if self.store.is_shared() && comes_late {
                checked = Instant::now();
                if jumped.is_some()
                    && let Err(error) = self.pull_forward().await
                {
                    let error: &dyn std::error::Error = &error;
                    tracing::error!(error, "jobs from a time when the clock was ahead could not be made due");
                }
                continue;
            }
            if checked.elapsed() > self.config.lease.mul_f64(ABSENCE_MIN) {
                // This process was suspended, or it could not write. Its heartbeats could not be stored either, so they
                // come first now.
                tracing::warn!(
                    absent_s = checked.elapsed().as_secs_f64(),
                    "the server was suspended or could not write"
                );
                checked = Instant::now();
                continue;
            }
            if let Err(error) = self.follow_system_clock().await {
                tracing::error!(
                    error = &error as &dyn std::error::Error,
                    "leases could not be moved to the new system time"
                );
                continue;
            }
            match self.take_expired().await {
                Ok(jobs) => {
                    checked = Instant::now();
                    for job in jobs {
                        metrics::lease_lost(LeaseLoss::Expired, &job);
                        tracing::warn!(job = job.id, state = job.state.as_str(), "the job's lease ran out");
                    }
                }
                Err(error) => {
                    tracing::error!(error = &error as &dyn std::error::Error, "leases could not be checked");
                }
            }
        }
    }

    /// Takes back the jobs whose leases have ended.
    async fn take_expired(&self) -> Result<Vec<Job>, StoreError> {
        let now_ms = self.clock.now_ms();
        if self.store.is_shared() {
            self.store.cap_leases(now_ms + LEASE_MS_MAX).await?;
        }
        self.store.expire_leases(now_ms).await
    }

    /// Moves all leases after the system's clock was set, so that none expires early or lasts too long.
    async fn follow_system_clock(&self) -> Result<(), StoreError> {
        let Some(ahead_ms) = self.clock.jump() else { return Ok(()) };
        tracing::warn!(ahead_s = ahead_ms as f64 / 1e3, "the system's clock was set");
        // The later time is set first, so that no lease seems expired in between. A heartbeat never shortens a lease.
        if ahead_ms > 0 {
            self.store.shift_leases(ahead_ms).await?;
            self.clock.adjust(ahead_ms);
        } else {
            self.clock.adjust(ahead_ms);
            self.store.shift_leases(ahead_ms).await?;
            self.pull_forward().await?;
        }
        Ok(())
    }

    /// Makes the jobs due that were queued while the system's clock was ahead.
    async fn pull_forward(&self) -> Result<(), StoreError> {
        let pause_max_ms = i64::try_from(self.config.backoff.max.as_millis()).unwrap_or(i64::MAX / 2);
        let jobs = self.store.pull_forward(self.clock.now_ms(), pause_max_ms).await?;
        if jobs > 0 {
            tracing::warn!(jobs, "jobs were queued while the system's clock was ahead; they are due now");
        }
        Ok(())
    }

    fn lease_ms(&self) -> i64 {
        i64::try_from(self.config.lease.as_millis()).unwrap_or(i64::MAX / 2)
    }
}
