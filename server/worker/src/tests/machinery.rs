//! Tests of the job machinery. A task that counts to 20 ends in all ways in which a job can end.

use super::super::*;
use super::bench::{Bench, now_ms};
use lightpath_domain::job::{Estimate, FailureReason, JobEffect, JobState, NewJob, Progress};
use lightpath_fixtures::{capture_job, capture_result, display};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

const STEPS: u8 = 20;

async fn bench() -> Bench {
    Bench::new(display("lab")).await
}

/// Submits a job for a task that ignores the job's specification.
async fn submit(bench: &Bench, request_id: &str, attempts_max: u32) -> String {
    bench.submit(request_id, capture_job(request_id, "", 1).spec, attempts_max).await
}

fn config() -> WorkerConfig {
    WorkerConfig {
        compute_threads: 2,
        backoff: Backoff::uniform(Duration::from_millis(2), Duration::from_millis(10)),
        ..WorkerConfig::default()
    }
}

fn progress(step: u8) -> Progress {
    let (step, steps_total) = (u32::from(step), u32::from(STEPS));
    Progress { stage: "count".to_owned(), step, steps_total, loss: Some(0.5), eta_s: None }
}

fn output(photo: impl AsRef<str>) -> TaskOutput {
    TaskOutput { result: capture_result(photo.as_ref()), effect: JobEffect::None }
}

/// Counts to [`STEPS`], starting from a saved state if there is one, and calls `each` with every step.
fn count(context: &JobContext, each: impl Fn(u8)) -> Result<TaskOutput, TaskError> {
    let first = context.take_saved_state().map_or(0, |state| state[0]);
    for step in first..STEPS {
        each(step);
        context.step(progress(step + 1), || vec![step + 1])?;
    }
    Ok(output(format!("from {first}")))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn each_job_runs_once_and_drained_worker_stops() {
    let bench = bench().await;
    let runs = Arc::new(AtomicU32::new(0));
    let counted = Arc::clone(&runs);
    let task = move |_: &Job, context: &JobContext| {
        counted.fetch_add(1, Ordering::Relaxed);
        assert_eq!(rayon::current_num_threads(), 2);
        count(context, |_| {})
    };
    let mut ids = Vec::new();
    for n in 0..5 {
        ids.push(submit(&bench, &format!("early{n}"), 3).await);
    }
    let working = bench.start(WorkerConfig { workers: 2, ..config() }, task);
    for n in 0..25 {
        ids.push(submit(&bench, &format!("late{n}"), 3).await);
    }
    for id in ids {
        let job = bench.ended(&id).await;
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1));
        assert_eq!(job.progress, Some(progress(STEPS)));
    }
    working.stop().await;
    assert_eq!(runs.load(Ordering::Relaxed), 30);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn panic_ends_attempt_as_failed() {
    let bench = bench().await;
    let id = submit(&bench, "r", 2).await;
    let working = bench.start(config(), |_: &Job, _: &JobContext| panic!("a bug"));
    let job = bench.ended(&id).await;
    let error = job.error.unwrap();
    assert_eq!((job.state, job.attempt), (JobState::Failed, 2));
    assert_eq!((error.reason.as_str(), error.message.as_str(), error.retryable), ("PANIC", "a bug", false));
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn transient_error_is_retried_and_bad_input_is_not() {
    let bench = bench().await;
    let passing = submit(&bench, "passing", 3).await;
    let bad = submit(&bench, "bad", 3).await;
    let task = |job: &Job, context: &JobContext| match (job.request_id.as_str(), job.attempt) {
        ("passing", 1) => Err(TaskError::transient(FailureReason::Io, "the disk failed")),
        ("passing", _) => count(context, |_| {}),
        _ => Err(TaskError::permanent(FailureReason::InvalidPicture, "the file is not a picture")),
    };
    let working = bench.start(config(), task);
    let job = bench.ended(&passing).await;
    assert_eq!((job.state, job.attempt, job.error), (JobState::Succeeded, 2, None));
    let job = bench.ended(&bad).await;
    assert_eq!((job.state, job.attempt), (JobState::Failed, 1));
    assert_eq!(job.error.unwrap().reason, FailureReason::InvalidPicture);
    working.stop().await;
}

/// However long it takes until there is room on the disk, or until the bucket answers again: the job does not fail.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn failing_storage_is_no_failure_of_the_job() {
    let bench = bench().await;
    let id = submit(&bench, "patient", 1).await;
    let task = |job: &Job, context: &JobContext| match job.attempt {
        1 | 2 => Err(TaskError::transient(FailureReason::DiskFull, "no room")),
        3 | 4 => Err(TaskError::transient(FailureReason::Remote, "no answer")),
        _ => count(context, |_| {}),
    };
    let working = bench.start(config(), task);
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.attempt, job.error), (JobState::Succeeded, 5, None));
    working.stop().await;
}

/// Counts to 7, then waits until it must stop.
fn count_to_7(_: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
    count(context, |step| {
        while step == 7 && context.should_stop().is_none() {
            std::thread::yield_now();
        }
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelled_job_ends_at_next_step_and_leaves_no_checkpoint() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..config() };
    let working = bench.start(every_step, count_to_7);
    bench.until(&id, |job| job.checkpoint.is_some()).await;
    bench.store.cancel(&id, now_ms()).await.unwrap();
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.checkpoint), (JobState::Cancelled, None));
    working.stop().await;
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}

/// Saving a large state takes long, so the next checkpoint comes much later, also if one is due at every step.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn large_states_are_saved_rarely() {
    for (state_bytes, expected_saves) in [(1 << 10, u32::from(STEPS)), (17 << 20, 1)] {
        let bench = bench().await;
        let saves = Arc::new(AtomicU32::new(0));
        let counted = Arc::clone(&saves);
        let task = move |_: &Job, context: &JobContext| {
            for step in 1..=STEPS {
                context.step(progress(step), || {
                    counted.fetch_add(1, Ordering::Relaxed);
                    vec![step; state_bytes]
                })?;
            }
            Ok(output("done"))
        };
        let id = submit(&bench, "r", 3).await;
        let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..config() };
        let working = bench.start(every_step, task);
        assert_eq!(bench.ended(&id).await.state, JobState::Succeeded);
        working.stop().await;
        assert_eq!(saves.load(Ordering::Relaxed), expected_saves, "a state of {state_bytes} bytes");
    }
}

/// Counts to 7 and then computes without end inside one step.
fn endless_step(_: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
    count(context, |step| {
        if step == 7 {
            loop {
                (0..64).into_par_iter().for_each(|_| lightpath_optics::interrupt::check());
            }
        }
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelled_job_ends_within_a_step() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let working = bench.start(config(), endless_step);
    bench.until(&id, |job| job.progress == Some(progress(7))).await;
    bench.store.cancel(&id, now_ms()).await.unwrap();
    assert_eq!(bench.ended(&id).await.state, JobState::Cancelled);
    // The pool is free for the next job.
    let next = submit(&bench, "next", 3).await;
    bench.until(&next, |job| job.progress == Some(progress(7))).await;
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelled_job_does_not_wait_for_its_artifact() {
    let bench = bench().await;
    // While this lives, no artifact is stored.
    let collecting = bench.artifacts.collecting().await.unwrap();
    let id = submit(&bench, "r", 3).await;
    let working = bench.start(config(), |_: &Job, context: &JobContext| {
        context.report(progress(1))?;
        Ok(output(context.put_artifact(b"photo".to_vec())?))
    });
    bench.until(&id, |job| job.progress == Some(progress(1))).await;
    bench.store.cancel(&id, now_ms()).await.unwrap();
    let ended = tokio::time::timeout(Duration::from_secs(10), bench.ended(&id)).await.expect("the job has ended");
    assert_eq!(ended.state, JobState::Cancelled);
    drop(collecting);
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn drained_job_is_interrupted_within_a_step_and_resumes_from_its_checkpoint() {
    let bench = bench().await;
    let id = submit(&bench, "r", 1).await;
    let every_step = WorkerConfig { checkpoint_interval: Duration::ZERO, ..config() };
    let working = bench.start(every_step, endless_step);
    bench.until(&id, |job| job.progress == Some(progress(7))).await;
    let started = std::time::Instant::now();
    working.stop().await;
    assert!(started.elapsed() < Duration::from_secs(1), "{:?}", started.elapsed());
    assert_eq!(bench.store.job(&id).await.unwrap().state, JobState::Queued);
    let working = bench.start(config(), |_: &Job, context: &JobContext| count(context, |_| {}));
    assert_eq!(bench.ended(&id).await.result, Some(output("from 7").result));
    working.stop().await;
}

/// Submits a job that is estimated to need this much memory.
async fn submit_with_memory(bench: &Bench, request_id: &str, memory_bytes: u64) -> String {
    let estimate = Estimate { memory_bytes, time_s: 1.0 };
    let new = NewJob { estimate, ..capture_job(request_id, "", 1) };
    bench.store.submit(&new, now_ms(), 1000).await.unwrap().0.id
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_wait_until_their_memory_is_free() {
    const MIB: u64 = 1 << 20;
    let bench = bench().await;
    // An eighth is for the cache: 700 MiB are for jobs.
    let memory_bytes = 800 * MIB;
    let first = submit_with_memory(&bench, "first", 500 * MIB).await;
    let second = submit_with_memory(&bench, "second", 300 * MIB).await;
    let too_large = submit_with_memory(&bench, "too large", 5000 * MIB).await;
    let finish_first = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let finish = Arc::clone(&finish_first);
    let running = Arc::new(AtomicU32::new(0));
    let task = move |job: &Job, context: &JobContext| {
        assert_eq!(running.fetch_add(1, Ordering::SeqCst), 0, "{} runs beside another job", job.request_id);
        while job.request_id == "first" && !finish.load(Ordering::SeqCst) {
            std::thread::yield_now();
        }
        running.fetch_sub(1, Ordering::SeqCst);
        count(context, |_| {})
    };
    let working = bench.start(WorkerConfig { workers: 2, memory_bytes, ..config() }, task);
    let waiting = bench.until(&second, |job| job.progress.is_some()).await;
    let stage = waiting.progress.unwrap().stage;
    assert_eq!(stage, "wait for memory: 300 MiB needed, 200 of 700 MiB free");
    assert_eq!(waiting.state, JobState::Running, "the job keeps its lease");
    finish_first.store(true, Ordering::SeqCst);
    for id in [first, second, too_large] {
        assert_eq!(bench.ended(&id).await.state, JobState::Succeeded);
    }
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn small_jobs_pass_a_long_one_but_none_that_waits_for_memory() {
    const MIB: u64 = 1 << 20;
    let bench = bench().await;
    let long = submit_with_memory(&bench, "long", 500 * MIB).await;
    let small = submit_with_memory(&bench, "small", 100 * MIB).await;
    let finish_long = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let finish = Arc::clone(&finish_long);
    let task = move |job: &Job, context: &JobContext| {
        while job.request_id == "long" && !finish.load(Ordering::SeqCst) {
            std::thread::yield_now();
        }
        count(context, |_| {})
    };
    let working = bench.start(WorkerConfig { workers: 3, memory_bytes: 800 * MIB, ..config() }, task);
    assert_eq!(bench.ended(&small).await.state, JobState::Succeeded);
    assert_eq!(bench.store.job(&long).await.unwrap().state, JobState::Running);

    let large = submit_with_memory(&bench, "large", 300 * MIB).await;
    bench.until(&large, |job| job.progress.is_some()).await;
    // 200 MiB are free. They are kept for the large job, which could otherwise wait for ever.
    let late = submit_with_memory(&bench, "late", 100 * MIB).await;
    let waiting = bench.until(&late, |job| job.progress.is_some()).await;
    assert_eq!(waiting.progress.unwrap().stage, "wait for memory: 100 MiB needed, 0 of 700 MiB free");
    finish_long.store(true, Ordering::SeqCst);
    for id in [long, large, late] {
        assert_eq!(bench.ended(&id).await.state, JobState::Succeeded);
    }
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn job_that_waits_for_memory_can_be_cancelled() {
    let bench = bench().await;
    let first = submit_with_memory(&bench, "first", 1 << 40).await;
    let second = submit_with_memory(&bench, "second", 1 << 40).await;
    let working = bench.start(WorkerConfig { workers: 2, ..config() }, count_to_7);
    bench.until(&second, |job| job.progress.is_some()).await;
    bench.store.cancel(&second, now_ms()).await.unwrap();
    assert_eq!(bench.ended(&second).await.state, JobState::Cancelled);
    assert_eq!(bench.store.job(&first).await.unwrap().state, JobState::Running);
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn drained_job_resumes_from_its_checkpoint() {
    let bench = bench().await;
    let id = submit(&bench, "r", 1).await;
    let working = bench.start(config(), count_to_7);
    bench.until(&id, |job| job.progress == Some(progress(7))).await;
    working.stop().await;
    let job = bench.store.job(&id).await.unwrap();
    assert_eq!((job.state, job.error), (JobState::Queued, None));
    assert!(job.checkpoint.is_some());
    assert_eq!(bench.artifacts.checkpoints().await.unwrap().len(), 1);

    let working = bench.start(config(), |_: &Job, context: &JobContext| count(context, |_| {}));
    let job = bench.ended(&id).await;
    assert_eq!((job.attempt, job.result), (2, Some(output("from 8").result)));
    working.stop().await;
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn worker_without_lease_stops_and_job_runs_again() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let lease = Duration::from_millis(300);
    let task = |job: &Job, context: &JobContext| {
        if job.attempt == 1 {
            // Waits until a heartbeat notices that the lease is lost.
            while context.should_stop().is_none() {
                std::thread::yield_now();
            }
            assert_eq!(context.should_stop(), Some(StopReason::LeaseLost));
            // The store must refuse this output.
            return Ok(output("stale"));
        }
        Ok(output("fresh"))
    };
    let working = bench.start(WorkerConfig { lease, ..config() }, task);
    bench.until(&id, |job| job.state == JobState::Running).await;
    bench.store.recover_orphans(None, now_ms()).await.unwrap();
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.attempt, job.result), (JobState::Succeeded, 2, Some(output("fresh").result)));
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn heartbeats_do_not_wait_for_computations() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let lease = Duration::from_millis(300);
    // One step that takes as long as four leases: the test needs the time to pass.
    let task = move |_: &Job, context: &JobContext| {
        std::thread::sleep(4 * lease);
        count(context, |_| {})
    };
    let working = bench.start(WorkerConfig { lease, ..config() }, task);
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1));
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn next_start_resumes_job_of_dead_worker() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let orphan = bench.store.claim(now_ms(), 3_600_000, "dead").await.unwrap().unwrap().1;
    let state = checkpoint::seal(&orphan, vec![15]).unwrap();
    let saved = bench.artifacts.put_checkpoint(state).await.unwrap();
    bench.store.checkpoint(&orphan, &saved).await.unwrap();
    bench.artifacts.put_checkpoint(b"unreferenced".to_vec()).await.unwrap();

    let working = bench.start(config(), |_: &Job, context: &JobContext| count(context, |_| {}));
    let job = bench.ended(&id).await;
    assert_eq!(
        job.result,
        Some(output("from 15").result),
        "the job continues from the checkpoint, without waiting for the end of the lease"
    );
    working.stop().await;
    assert!(bench.artifacts.checkpoints().await.unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn attempt_fails_at_its_time_limit() {
    let bench = bench().await;
    let id = submit(&bench, "r", 3).await;
    let timeouts = Timeouts::from_iter([("simulate_capture", Some(Duration::from_millis(50)))]);
    let working = bench.start(WorkerConfig { timeouts, ..config() }, count_to_7);
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.attempt, job.error.unwrap().reason.as_str()), (JobState::Failed, 1, "TIMEOUT"));
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn setting_system_clock_expires_no_lease() {
    let bench = bench().await;
    let id = submit(&bench, "r", 1).await;
    let lease = Duration::from_millis(400);
    let worker = Worker::new(
        bench.store.clone(),
        bench.artifacts.clone(),
        WorkerConfig { lease, ..config() },
        Arc::new(move |_: &Job, context: &JobContext| {
            // As long as eight leases; the clock is set four times in that time.
            std::thread::sleep(8 * lease);
            count(context, |_| {})
        }),
    );
    let clock = worker.clock();
    let working = bench.start_worker(worker);
    bench.until(&id, |job| job.state == JobState::Running).await;
    let day_ms = 24 * 3600 * 1000;
    for by_ms in [day_ms, -2 * day_ms, 5000, day_ms] {
        clock.set_system_clock(by_ms);
        tokio::time::sleep(lease).await;
        let followed = async {
            while clock.jump().is_some() {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        tokio::time::timeout(Duration::from_secs(60), followed).await.expect("the clock follows");
    }
    let job = bench.ended(&id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1), "{job:?}");
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_queued_while_the_clock_was_ahead_run_when_it_is_set_right() {
    let bench = bench().await;
    let day_ms = 24 * 3600 * 1000;
    let ahead = |request_id: &str| {
        let new = capture_job(request_id, "", 1);
        let store = bench.store.clone();
        async move { store.submit(&new, now_ms() + day_ms, 1000).await.unwrap().0.id }
    };
    // The server died while the clock was ahead: one job ran, one waited. Another one is queued before the clock is set
    // back.
    let (orphan, before) = (ahead("orphan").await, ahead("before").await);
    let claimed = bench.store.claim(now_ms() + day_ms, 30_000, "dead").await.unwrap().unwrap().0;
    assert_eq!(claimed.id, orphan);
    let lease = Duration::from_millis(300);
    let worker = Worker::new(
        bench.store.clone(),
        bench.artifacts.clone(),
        WorkerConfig { lease, ..config() },
        Arc::new(|_: &Job, context: &JobContext| count(context, |_| {})),
    );
    let clock = worker.clock();
    let working = bench.start_worker(worker);
    for id in [before, orphan] {
        assert_eq!(bench.ended(&id).await.state, JobState::Succeeded);
    }
    clock.set_system_clock(day_ms);
    let followed = async || {
        while clock.jump().is_some() {
            tokio::time::sleep(lease / 10).await;
        }
    };
    followed().await;
    bench.store.pause(None, "", now_ms()).await.unwrap();
    let stranded = ahead("stranded").await;
    clock.set_system_clock(-day_ms);
    followed().await;
    bench.store.resume(None).await.unwrap();
    assert_eq!(bench.ended(&stranded).await.state, JobState::Succeeded);
    working.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn job_of_dead_worker_runs_again_within_two_leases() {
    let bench = bench().await;
    let id = submit(&bench, "r", 2).await;
    let lease = Duration::from_millis(500);
    // The worker that claims the job dies at once. The server that expires leases keeps running.
    bench.store.claim(now_ms(), 500, "dead").await.unwrap().unwrap();
    let started = std::time::Instant::now();
    let working =
        bench.start_unrecovered(WorkerConfig { lease, ..config() }, move |job: &Job, context: &JobContext| {
            assert_eq!(job.attempt, 2);
            count(context, |_| {})
        });
    bench.until(&id, |job| job.attempt == 2).await;
    assert!(started.elapsed() < 2 * lease, "{:?}", started.elapsed());
    assert_eq!(bench.ended(&id).await.state, JobState::Succeeded);
    working.stop().await;
}
