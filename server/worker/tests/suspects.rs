//! Jobs that kill the process that runs them, among jobs that do no harm, while somebody kills the worker again and again.
//!
//! The program is three: the test, the worker that it starts and kills, and the process of a job that the worker starts.
//! So it has a `main` of its own. `LIGHTPATH_WORKER_KILLS=1000 cargo test --release -p lightpath-worker --test suspects`
//! kills a thousand times.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr)]

use lightpath_artifacts::{Artifacts, SpaceLimits};
use lightpath_domain::job::{FailureReason, Job, JobEffect, JobState, NewJob, Progress, Scheduling};
use lightpath_fixtures::{capture_job, capture_result, display};
use lightpath_store::Store;
use lightpath_worker::{Backoff, JobContext, JobInput, JobProgram, Task, TaskError, TaskOutput, Worker, WorkerConfig};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::process::{Child, Command};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

const NAME: &str = "bad_jobs_fail_with_their_reason_and_all_others_succeed";
/// Number of kills, unless `LIGHTPATH_WORKER_KILLS` sets another.
const KILLS: u32 = 12;
/// Longest time between two kills \[ms\].
const LIFE_MS_MAX: u64 = 600;
/// Jobs that do no harm, for each kill.
const GOOD_PER_KILL: u32 = 3;
/// Time limit of an attempt at the job that never ends \[ms\].
const ENDLESS_MS: i64 = 1500;
/// Longest time in which the bad jobs fail after the last kill.
const BAD_MAX: Duration = Duration::from_secs(60);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |argument: &str| arguments.iter().any(|given| given == argument);
    match arguments.first().map(String::as_str) {
        Some("worker") => in_runtime(work(Path::new(&arguments[1]))),
        Some("job") => in_runtime(run_job()),
        // What test runners ask.
        _ if has("--list") && has("--ignored") => {}
        _ if has("--list") => println!("{NAME}: test"),
        _ => in_runtime(bad_jobs_fail_and_others_succeed()),
    }
}

fn in_runtime(future: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    runtime.block_on(future);
    runtime.shutdown_background();
}

fn config() -> WorkerConfig {
    WorkerConfig {
        workers: 3,
        compute_threads: 1,
        lease: Duration::from_secs(2),
        backoff: Backoff::uniform(Duration::from_millis(2), Duration::from_millis(10)),
        memory_bytes: 64 << 20,
        ..WorkerConfig::default()
    }
}

/// The process that the test kills.
async fn work(folder: &Path) {
    let store = Store::open(&folder.join("lightpath.db")).await.unwrap();
    let artifacts = Artifacts::open(folder).unwrap();
    let (file, settings) = (std::env::current_exe().unwrap(), folder.to_str().unwrap().to_owned());
    let program = JobProgram { file, arguments: vec!["job".into()], settings };
    let worker = Worker::new(store, artifacts, config(), Arc::new(Work { is_alone: false }));
    worker.isolating(Some(program)).run(CancellationToken::new()).await.unwrap();
}

/// The process of one job.
async fn run_job() {
    let input = JobInput::read().unwrap();
    let folder = Path::new(&input.settings).to_owned();
    let store = Store::open_shared(&folder.join("lightpath.db")).await.unwrap();
    let artifacts = Artifacts::open_beside(&folder, SpaceLimits::default(), None).unwrap();
    let worker = Worker::new(store, artifacts, config(), Arc::new(Work { is_alone: true }));
    input.run(worker).await.unwrap();
}

/// Work that does what the label of its job says.
struct Work {
    /// Whether this is the process of one job.
    is_alone: bool,
}

impl Task for Work {
    fn run(&self, job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
        let steps = match job.scheduling.label.as_deref() {
            Some("abort") => std::process::abort(),
            Some("memory") if self.is_alone => hoard(),
            // The system kills a process that takes all memory.
            Some("memory") => std::process::abort(),
            Some("endless") => u32::MAX,
            _ => 4,
        };
        for step in 0..steps {
            std::thread::sleep(Duration::from_millis(20));
            let progress = Progress { stage: "wait".into(), step, steps_total: steps, loss: Some(0.5), eta_s: None };
            context.step(progress, Vec::new)?;
        }
        Ok(TaskOutput { result: capture_result("done"), effect: JobEffect::None })
    }
}

/// Takes memory until there is no more.
fn hoard() -> ! {
    let mut hoarded = Vec::new();
    loop {
        hoarded.push(vec![1_u8; 16 << 20]);
    }
}

/// A job with this label.
fn job(label: &str) -> NewJob {
    let new = capture_job(label, "", 1);
    let timeout_ms = (label == "endless").then_some(ENDLESS_MS);
    let scheduling = Scheduling { label: Some(label.to_owned()), timeout_ms, ..new.scheduling };
    NewJob { attempts_max: 3, scheduling, ..new }
}

fn start(folder: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap()).arg("worker").arg(folder).spawn().unwrap()
}

async fn bad_jobs_fail_and_others_succeed() {
    let kills = std::env::var("LIGHTPATH_WORKER_KILLS").map_or(KILLS, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("lightpath.db")).await.unwrap();
    store.create_display(&display("lab"), 1).await.unwrap();
    let mut bad = Vec::new();
    for label in ["abort", "memory", "endless"] {
        bad.push(submit(&store, label).await);
    }
    let good = kill_again_and_again(&store, folder.path(), kills).await;
    let (mut worker, mut deaths) = (start(folder.path()), 0);
    let quiet = Instant::now();
    let bad = ended(&store, &bad, folder.path(), &mut worker, &mut deaths).await;
    assert!(quiet.elapsed() < BAD_MAX, "{:?}", quiet.elapsed());
    let good = ended(&store, &good, folder.path(), &mut worker, &mut deaths).await;
    worker.kill().unwrap();
    worker.wait().unwrap();
    assert!(deaths <= bad.len(), "{deaths}");
    assert_reasons(&bad);
    for job in &good {
        assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    }
    eprintln!(
        "{kills} kills: {} good jobs succeeded, {} of them in processes of their own; bad jobs killed the worker {deaths} \
         times after the last kill",
        good.len(),
        good.iter().filter(|job| job.suspect).count(),
    );
}

async fn submit(store: &Store, label: &str) -> String {
    store.submit(&job(label), store.now_ms(), 1_000_000).await.unwrap().0.id
}

/// Starts the worker `kills` times, kills it at random times, and returns the ids of jobs that do no harm.
async fn kill_again_and_again(store: &Store, folder: &Path, kills: u32) -> Vec<String> {
    let (mut good, mut random) = (Vec::new(), ChaCha8Rng::seed_from_u64(7));
    for kill in 0..kills {
        for n in 0..GOOD_PER_KILL {
            good.push(submit(store, &format!("good-{kill}-{n}")).await);
        }
        let mut worker = start(folder);
        tokio::time::sleep(Duration::from_millis(random.random_range(0..LIFE_MS_MAX))).await;
        worker.kill().unwrap();
        worker.wait().unwrap();
    }
    good
}

/// The jobs when they have ended. A worker that a bad job has killed, which it can do once, is started again.
async fn ended(store: &Store, ids: &[String], folder: &Path, worker: &mut Child, deaths: &mut usize) -> Vec<Job> {
    let (began, mut jobs) = (Instant::now(), Vec::new());
    while let Some(id) = ids.get(jobs.len()) {
        if worker.try_wait().unwrap().is_some() {
            *deaths += 1;
            *worker = start(folder);
        }
        let job = store.job(id).await.unwrap();
        if job.state.has_ended() {
            jobs.push(job);
            continue;
        }
        assert!(began.elapsed() < BAD_MAX * 20, "{job:?}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    jobs
}

fn assert_reasons(bad: &[Job]) {
    let errors: Vec<_> = bad.iter().map(|job| job.error.clone().unwrap()).collect();
    for (job, error) in bad.iter().zip(&errors) {
        eprintln!("{}: {}", error.reason, error.message);
        assert_eq!(job.state, JobState::Failed);
    }
    let says = |at: usize, texts: &[&str]| texts.iter().all(|text| errors[at].message.contains(text));
    let reasons = [FailureReason::ProcessDied, FailureReason::ProcessDied, FailureReason::Timeout];
    assert_eq!(errors.iter().map(|error| error.reason).collect::<Vec<_>>(), reasons);
    assert!(says(0, &["died 3 times", "signal 6 (SIGABRT"]));
    assert!(says(1, &["died 3 times", "MiB of memory", "memory allocation of"]));
}
