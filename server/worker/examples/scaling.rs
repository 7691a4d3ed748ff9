//! How the throughput grows with the number of workers, where computing costs nothing: each task sleeps for a second, and
//! reports progress ten times, as an optimization does. The workers are in up to eight processes, each with connections and a
//! data folder of its own, on one PostgreSQL server.
//!
//!     scripts/with-postgres cargo run --release -p lightpath-worker --example scaling
//!
//! Each line is the time from the first claim to the last end, beside the time that the tasks sleep. Arguments are numbers
//! of workers, by default 1, 2, 4, … 64.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use lightpath_artifacts::Artifacts;
use lightpath_domain::job::{Job, JobEffect, Progress};
use lightpath_fixtures::{capture_job, capture_result, display, postgres_database};
use lightpath_store::{QueueLimits, Store};
use lightpath_worker::{JobContext, TaskOutput, Worker, WorkerConfig};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Jobs for each worker. At the end, some workers have no job while the last ones run; with more jobs this counts less.
const JOBS_PER_WORKER: usize = 30;
/// Processes at most.
const PROCESSES_MAX: usize = 8;
/// Owners of the jobs, who take turns.
const OWNERS: usize = 7;
const STEPS: u32 = 10;
const STEP: Duration = Duration::from_millis(100);

#[tokio::main]
async fn main() {
    let given: Vec<usize> = std::env::args().skip(1).map(|text| text.parse().unwrap()).collect();
    let counts = if given.is_empty() { vec![1, 2, 4, 8, 16, 32, 64] } else { given };
    println!("workers   jobs    ideal [s]   measured [s]   part of linear");
    for workers in counts {
        let took = measure(workers).await;
        let ideal = Duration::from_secs(JOBS_PER_WORKER as u64);
        let part = ideal.as_secs_f64() / took.as_secs_f64();
        let jobs = JOBS_PER_WORKER * workers;
        println!("{workers:7} {jobs:6} {:12.1} {:14.2} {part:16.3}", ideal.as_secs_f64(), took.as_secs_f64());
    }
}

/// Time in which so many workers do [`JOBS_PER_WORKER`] jobs each.
async fn measure(workers: usize) -> Duration {
    let url = postgres_database().await;
    let store = Store::connect(&url).await.unwrap();
    store.create_display(&display("lab"), 1).await.unwrap();
    store.pause(None, "until all workers wait", 1).await.unwrap();
    let jobs = JOBS_PER_WORKER * workers;
    for n in 0..jobs {
        let mut new = capture_job(&format!("r{n}"), "", n as u64);
        new.scheduling.owner = format!("owner {}", n % OWNERS);
        store.submit(&new, store.now_ms(), QueueLimits::from(jobs as u32)).await.unwrap();
    }
    let (stopping, mut running, mut folders) = (CancellationToken::new(), JoinSet::new(), Vec::new());
    let processes = workers.min(PROCESSES_MAX);
    for index in 0..processes {
        let folder = TempDir::new().unwrap();
        let artifacts = Artifacts::open(folder.path()).unwrap();
        folders.push(folder);
        let share = workers / processes + usize::from(index < workers % processes);
        let config = WorkerConfig {
            workers: share,
            compute_threads: 1,
            process: Some(artifacts.folder_identity().await.unwrap()),
            ..WorkerConfig::default()
        };
        let worker = Worker::new(Store::connect(&url).await.unwrap(), artifacts, config, Arc::new(sleep));
        running.spawn(worker.run(stopping.clone()));
    }
    tokio::time::sleep(Duration::from_secs(1)).await;
    let mut changes = store.subscribe_job_changes();
    let started = Instant::now();
    store.resume(None).await.unwrap();
    while (store.queue_counts().await.unwrap().succeeded as usize) < jobs {
        // A change that was missed only delays the look.
        drop(tokio::time::timeout(Duration::from_millis(50), changes.recv()).await);
    }
    let took = started.elapsed();
    stopping.cancel();
    while let Some(ended) = running.join_next().await {
        ended.unwrap().unwrap();
    }
    took
}

/// A task without computation.
fn sleep(_: &Job, context: &JobContext) -> Result<TaskOutput, lightpath_worker::TaskError> {
    for step in 1..=STEPS {
        std::thread::sleep(STEP);
        let progress = Progress { stage: "sleep".into(), step, steps_total: STEPS, loss: None, eta_s: None };
        context.step(progress, Vec::new)?;
    }
    Ok(TaskOutput { result: capture_result("sha256-photo"), effect: JobEffect::None })
}
