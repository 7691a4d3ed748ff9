//! The machinery, with toy tasks: a task that counts to 20, in all ways in which a job can end.

use super::*;
use crate::display::Display;
use crate::job::{CaptureResult, JobResult, JobSpec, JobState, NewJob, Progress, SimulateCapture};
use crate::units::{Distance, Wavelength};
use std::sync::atomic::{AtomicU32, Ordering};
use tempfile::TempDir;

const STEPS: u8 = 20;

struct Bench {
    store: Store,
    artifacts: Artifacts,
    _folder: TempDir,
}

impl Bench {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("lightpath.db")).await.unwrap();
        let artifacts = Artifacts::open(folder.path()).unwrap();
        let display = Display {
            id: "lab".to_owned(),
            width_px: 64,
            height_px: 64,
            pixel_pitch_m: 8e-6,
            bit_depth: 8,
            wavelengths: vec![Wavelength { pm: 515_000 }],
            phase_response_rad: None,
            carrier: None,
            notes: String::new(),
            simulated_bench: None,
        };
        store.create_display(&display, 1).await.unwrap();
        Self { store, artifacts, _folder: folder }
    }

    async fn submit(&self, request_id: &str, attempts_max: u32) -> String {
        let spec = JobSpec::SimulateCapture(SimulateCapture {
            display: "lab".to_owned(),
            wavelength: Wavelength { pm: 515_000 },
            distance: Distance { nm: 150_000_000 },
            phase: String::new(),
            seed: 1,
        });
        let new = NewJob { spec, request_id: request_id.to_owned(), priority: 0, attempts_max };
        self.store.submit(&new, clock::now_ms(), 1000).await.unwrap().0.id
    }

    /// Starts workers; they drain when the token is cancelled.
    fn start(&self, config: WorkerConfig, task: impl Task) -> (CancellationToken, tokio::task::JoinHandle<()>) {
        let drain = CancellationToken::new();
        let worker = Worker::new(self.store.clone(), self.artifacts.clone(), config, Arc::new(task));
        let run = worker.run(drain.clone());
        (drain, tokio::spawn(async move { run.await.unwrap() }))
    }

    async fn until(&self, id: &str, condition: impl Fn(&Job) -> bool) -> Job {
        let mut changes = self.store.subscribe_job_changes();
        loop {
            let job = self.store.job(id).await.unwrap();
            if condition(&job) {
                return job;
            }
            drop(changes.recv().await);
        }
    }
}

fn config() -> WorkerConfig {
    WorkerConfig {
        compute_threads: 2,
        backoff: Backoff { first: Duration::from_millis(2), max: Duration::from_millis(10) },
        ..WorkerConfig::default()
    }
}

fn progress(step: u8) -> Progress {
    let (step, steps_total) = (u32::from(step), u32::from(STEPS));
    Progress { stage: "count".to_owned(), step, steps_total, loss: 0.5, eta_s: None }
}

fn output(photo: impl Into<String>) -> TaskOutput {
    TaskOutput { result: JobResult::Capture(CaptureResult { photo: photo.into() }), learned: None }
}

/// Counts to [`STEPS`], goes on from a saved state, and tells each step to `each`.
fn count(context: &JobContext, each: impl Fn(u8)) -> Result<TaskOutput, TaskError> {
    let first = context.take_saved_state().map_or(0, |state| state[0]);
    for step in first..STEPS {
        each(step);
        context.step(progress(step + 1), || vec![step + 1])?;
    }
    Ok(output(format!("from {first}")))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_run_once_each_and_a_drained_worker_stops() {
    let bench = Bench::new().await;
    let runs = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&runs);
    let task = move |_: &Job, context: &JobContext| {
        counted.fetch_add(1, Ordering::Relaxed);
        assert_eq!(rayon::current_num_threads(), 2);
        count(context, |_| {})
    };
    let mut ids = Vec::new();
    for n in 0..5 {
        ids.push(bench.submit(&format!("early{n}"), 3).await);
    }
    let (drain, running) = bench.start(WorkerConfig { workers: 2, ..config() }, task);
    for n in 0..25 {
        ids.push(bench.submit(&format!("late{n}"), 3).await);
    }
    for id in ids {
        let job = bench.until(&id, |job| job.state.has_ended()).await;
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1));
        assert_eq!(job.progress, Some(progress(STEPS)));
    }
    drain.cancel();
    running.await.unwrap();
    assert_eq!(runs.load(Ordering::Relaxed), 30);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_is_a_failed_attempt() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 2).await;
    let (drain, running) = bench.start(config(), |_: &Job, _: &JobContext| panic!("a bug"));
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    let error = job.error.unwrap();
    assert_eq!((job.state, job.attempt), (JobState::Failed, 2));
    assert_eq!((error.reason.as_str(), error.message.as_str(), error.retryable), ("PANIC", "a bug", false));
    drain.cancel();
    running.await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn trouble_that_passes_is_retried_and_bad_input_is_not() {
    let bench = Bench::new().await;
    let passing = bench.submit("passing", 3).await;
    let bad = bench.submit("bad", 3).await;
    let task = |job: &Job, context: &JobContext| match (job.request_id.as_str(), job.attempt) {
        ("passing", 1) => Err(TaskError::transient("IO", "the disk sighed")),
        ("passing", _) => count(context, |_| {}),
        _ => Err(TaskError::permanent("BAD_PICTURE", "that is no picture")),
    };
    let (drain, running) = bench.start(config(), task);
    let job = bench.until(&passing, |job| job.state.has_ended()).await;
    assert_eq!((job.state, job.attempt, job.error), (JobState::Succeeded, 2, None));
    let job = bench.until(&bad, |job| job.state.has_ended()).await;
    assert_eq!((job.state, job.attempt), (JobState::Failed, 1));
    assert_eq!(job.error.unwrap().reason, "BAD_PICTURE");
    drain.cancel();
    running.await.unwrap();
}

/// Counts to 7, then waits until it is told to stop.
fn count_to_7(_: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
    count(context, |step| {
        while step == 7 && context.should_stop().is_none() {
            std::thread::yield_now();
        }
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_cancelled_job_ends_at_its_next_step_and_leaves_no_checkpoint() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 3).await;
    let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..config() };
    let (drain, running) = bench.start(every_step, count_to_7);
    bench.until(&id, |job| job.checkpoint.is_some()).await;
    bench.store.cancel(&id, clock::now_ms()).await.unwrap();
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    assert_eq!((job.state, job.checkpoint), (JobState::Cancelled, None));
    drain.cancel();
    running.await.unwrap();
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drained_job_goes_on_where_it_was() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 1).await;
    let (drain, running) = bench.start(config(), count_to_7);
    bench.until(&id, |job| job.progress == Some(progress(7))).await;
    drain.cancel();
    running.await.unwrap();
    let job = bench.store.job(&id).await.unwrap();
    assert_eq!((job.state, job.error), (JobState::Queued, None));
    assert!(job.checkpoint.is_some());
    assert_eq!(bench.artifacts.checkpoints().await.unwrap().len(), 1);

    let (drain, running) = bench.start(config(), |_: &Job, context: &JobContext| count(context, |_| {}));
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    assert_eq!((job.attempt, job.result), (2, Some(output("from 8").result)));
    drain.cancel();
    running.await.unwrap();
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_lost_its_lease_stops_and_the_job_runs_again() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 3).await;
    let lease = Duration::from_millis(300);
    let task = |job: &Job, context: &JobContext| {
        if job.attempt == 1 {
            // Until the heartbeat notices that the lease is gone.
            while context.should_stop().is_none() {
                std::thread::yield_now();
            }
            assert_eq!(context.should_stop(), Some(StopReason::LeaseLost));
            // Work that must not count.
            return Ok(output("stale"));
        }
        Ok(output("fresh"))
    };
    let (drain, running) = bench.start(WorkerConfig { lease, ..config() }, task);
    bench.until(&id, |job| job.state == JobState::Running).await;
    bench.store.recover_orphans(clock::now_ms()).await.unwrap();
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    assert_eq!((job.state, job.attempt, job.result), (JobState::Succeeded, 2, Some(output("fresh").result)));
    drain.cancel();
    running.await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn heartbeats_do_not_wait_for_compute() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 3).await;
    let lease = Duration::from_millis(300);
    // One step that takes four leases: the passing of time is what is tested.
    let task = move |_: &Job, context: &JobContext| {
        std::thread::sleep(4 * lease);
        count(context, |_| {})
    };
    let (drain, running) = bench.start(WorkerConfig { lease, ..config() }, task);
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1));
    drain.cancel();
    running.await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_dead_worker_job_is_taken_back_at_the_next_start() {
    let bench = Bench::new().await;
    let id = bench.submit("r", 3).await;
    let orphan = bench.store.claim(clock::now_ms(), 3_600_000, "dead").await.unwrap().unwrap().1;
    let state = checkpoint::seal(&orphan, &[15]).unwrap();
    let saved = bench.artifacts.put_checkpoint(state).await.unwrap();
    bench.store.checkpoint(&orphan, &saved, clock::now_ms()).await.unwrap();
    bench.artifacts.put_checkpoint(b"nobody's".to_vec()).await.unwrap();

    let (drain, running) = bench.start(config(), |_: &Job, context: &JobContext| count(context, |_| {}));
    let job = bench.until(&id, |job| job.state.has_ended()).await;
    assert_eq!(
        job.result,
        Some(output("from 15").result),
        "goes on from the checkpoint, without waiting for the lease"
    );
    drain.cancel();
    running.await.unwrap();
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}
