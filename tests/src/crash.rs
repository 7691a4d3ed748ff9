use crate::ledger::{Ledger, Material, assert_same_bytes, kernel_name};
use crate::material::{DISTANCE_M, assert_succeeded_once, declare, hologram, kernel_file, request, target};
use crate::process::{Daemon, lightpathd};
use lightpath::v1::{self, SubmitJobRequest, job::State};
use lightpath::{Client, JobChange, hologram_result, names};
use lightpath_server::upkeep::check;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Moments at which the server is killed, in every run of the tests.
const CYCLES: u64 = 50;
/// Jobs submitted between two kills.
const JOBS_PER_LIFE: u64 = 2;
/// A life lasts up to this long.
const LIFE_MS_MAX: u64 = 700;
/// Times at which a worker is stopped past its lease.
const STOPS: u32 = 3;
/// Saves its state about every third iteration, and gives up a dead worker's job soon.
const SETTINGS: [&str; 8] =
    ["--checkpoint-interval-s", "0.02", "--lease-s", "1", "--compute-threads", "1", "--workers", "2"];

#[tokio::test(flavor = "multi_thread")]
async fn killed_at_random_moments_the_server_keeps_every_promise() {
    let data = TempDir::new().unwrap();
    let material = prepare_kernel(data.path()).await;
    let (cycles, mut random, mut ledger) = (cycles(), ChaCha8Rng::seed_from_u64(2026), Ledger::default());
    for life in 0..cycles {
        for i in 0..JOBS_PER_LIFE {
            ledger.ask(format!("{life}-{i}"));
        }
        let daemon = Daemon::start(data.path(), &SETTINGS).await;
        let client = daemon.client.clone();
        ledger.assert_kept(&client, &material).await;
        let alive = Duration::from_millis(random.random_range(0..LIFE_MS_MAX));
        // The moment is what is random here; whatever the server is doing then, it must survive it. Answers that were
        // on their way count.
        let death = async {
            tokio::time::sleep(alive).await;
            daemon.kill().await;
        };
        let load = async { (ledger.load(&client, &material, life).await, std::future::pending::<()>().await) };
        tokio::select! {
            () = death => {}
            _ = load => {}
        }
        let report = check(data.path()).await.unwrap();
        assert_eq!(report.problems, [], "after death {life}");
    }

    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    ledger.assert_kept(&daemon.client, &material).await;
    ledger.settle(&daemon.client, &material).await;
    daemon.kill().await;
    lightpathd(&["check", "--data-dir", data.path().to_str().unwrap()]).await.ok();
    writeln!(std::io::stderr(), "{cycles} times kill -9: {}", ledger.summary()).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn an_interrupted_job_gives_the_bytes_of_an_uninterrupted_one() {
    let (data, undisturbed) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let target = prepare(data.path()).await;
    assert_eq!(prepare(undisturbed.path()).await, target);
    let spec = || request(hologram("lab", &target, 1200, 9), "one");

    let daemon = Daemon::start(undisturbed.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let whole = daemon.client.wait(&job.name, |_| ()).await.unwrap();
    assert_eq!(whole.attempt, 1);
    daemon.kill().await;

    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let reached = until_step(&daemon.client, &job.name, 300).await;
    daemon.kill().await;
    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let mut first_step = None;
    let resumed = daemon.client.wait(&job.name, |change| {
        if let JobChange::Job(job) = change
            && job.attempt > 1
            && let Some(progress) = &job.progress
        {
            first_step.get_or_insert(progress.step);
        }
    });
    let resumed = resumed.await.unwrap();
    assert_eq!(resumed.attempt, 2);
    // From a saved state, not from the start.
    assert!(first_step.unwrap() > reached / 2, "killed at step {reached}, went on at {first_step:?}");
    assert_same_bytes(hologram_result(&whole).unwrap(), hologram_result(&resumed).unwrap());
    assert_succeeded_once(&daemon.client, &job.name).await;
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_that_was_stopped_past_its_lease_writes_nothing_stale() {
    /// Short, so that being stopped past it takes no time.
    const ZOMBIE: [&str; 8] =
        ["--checkpoint-interval-s", "0.02", "--lease-s", "0.2", "--compute-threads", "1", "--workers", "1"];
    let (data, undisturbed) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let target = prepare(data.path()).await;
    assert_eq!(prepare(undisturbed.path()).await, target);
    let spec = || SubmitJobRequest { attempts_max: 20, ..request(hologram("lab", &target, 1500, 9), "one") };
    let daemon = Daemon::start(undisturbed.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let whole = daemon.client.wait(&job.name, |_| ()).await.unwrap();
    daemon.kill().await;

    let daemon = Daemon::start(data.path(), &ZOMBIE).await;
    let client = daemon.client.clone();
    let job = client.submit(spec()).await.unwrap();
    let mut stops = 0;
    loop {
        let attempt = stops + 1;
        let running = until(&client, &job.name, |job| job.state() == State::Running && job.attempt >= attempt).await;
        if running.state() != State::Running || stops == STOPS {
            break;
        }
        daemon.signal("STOP");
        // What is tested is the passing of time: two leases and a half.
        tokio::time::sleep(Duration::from_millis(500)).await;
        daemon.signal("CONT");
        stops += 1;
    }
    let resumed = client.wait(&job.name, |_| ()).await.unwrap();
    assert_eq!(resumed.state(), State::Succeeded, "{resumed:?}");
    assert!(resumed.attempt > 1, "the lease was never lost in {stops} stops");
    assert_same_bytes(hologram_result(&whole).unwrap(), hologram_result(&resumed).unwrap());
    assert_succeeded_once(&client, &job.name).await;
    daemon.kill().await;
    assert_eq!(check(data.path()).await.unwrap().problems, []);
}

/// The job as soon as the condition holds for it, or it has ended.
async fn until(client: &Client, job: &str, wanted: impl Fn(&v1::Job) -> bool) -> v1::Job {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.to_owned() }).await.unwrap();
    let mut last = None;
    while let Some(job) = watch.message().await.unwrap() {
        if wanted(&job) {
            return job;
        }
        last = Some(job);
    }
    last.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wait_survives_a_restart_and_says_so_once() {
    let data = TempDir::new().unwrap();
    let target = prepare(data.path()).await;
    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let (client, address) = (daemon.client.clone(), daemon.url.trim_start_matches("http://").to_owned());
    let job = client.submit(request(hologram("lab", &target, 1500, 4), "")).await.unwrap();
    let (mut lost, mut back) = (0, 0);
    let watched = tokio::sync::Notify::new();
    let waiting = client.wait(&job.name, |change| match change {
        JobChange::Job(_) => watched.notify_one(),
        JobChange::ConnectionLost(_) => lost += 1,
        JobChange::Reconnected => back += 1,
        _ => {}
    });
    let restart = async {
        watched.notified().await;
        daemon.kill().await;
        Daemon::start_at(data.path(), &address, &SETTINGS).await
    };
    let (done, daemon) = tokio::join!(waiting, restart);
    assert_eq!(done.unwrap().state(), State::Succeeded);
    assert_eq!((lost, back), (1, 1));
    daemon.kill().await;
}

/// A display and a target in a fresh data folder; the target's digest.
async fn prepare(data_dir: &Path) -> String {
    let daemon = Daemon::start(data_dir, &SETTINGS).await;
    declare(&daemon.client, "lab", 128, 96).await;
    let digest = daemon.client.upload_bytes(target(128, 96, 1)).await.unwrap();
    daemon.kill().await;
    digest
}

/// The same, and a kernel with two versions to promote in turn.
async fn prepare_kernel(data_dir: &Path) -> Material {
    let target = prepare(data_dir).await;
    let daemon = Daemon::start(data_dir, &SETTINGS).await;
    for tilt in [0.1, 0.2] {
        let artifact = daemon.client.upload_bytes(kernel_file(128, 96, tilt)).await.unwrap();
        let request = v1::ImportKernelRequest {
            display: names::display("lab"),
            distance_m: DISTANCE_M,
            artifact,
            ..Default::default()
        };
        daemon.client.import_kernel(request).await.unwrap();
    }
    daemon.kill().await;
    Material { target, kernel: kernel_name() }
}

/// How often the server is killed: [`CYCLES`], or as often as `LIGHTPATH_KILL_CYCLES` says.
fn cycles() -> u64 {
    std::env::var("LIGHTPATH_KILL_CYCLES").map_or(CYCLES, |cycles| cycles.parse().unwrap())
}

/// Waits until a job has done this many steps; the step it was seen at.
async fn until_step(client: &Client, job: &str, step: u32) -> u32 {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.to_owned() }).await.unwrap();
    loop {
        let job = watch.message().await.unwrap().expect("the watch ends with the job");
        if let Some(progress) = job.progress.filter(|progress| progress.step >= step) {
            return progress.step;
        }
    }
}
