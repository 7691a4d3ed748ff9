use crate::ledger::{Ledger, Material, assert_same_bytes, kernel_name};
use crate::material::{DISTANCE_M, assert_succeeded_once, declare, hologram, kernel_file, request, target};
use crate::process::{Daemon, lightpathd};
use lightpath::v1::{self, SubmitJobRequest, job::State};
use lightpath::{Client, JobChange, hologram_result, names};
use lightpath_fixtures::postgres_database;
use lightpath_server::upkeep::check;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Number of kills, unless `LIGHTPATH_KILL_CYCLES` sets another.
const CYCLES: u64 = 12;
/// Jobs submitted between two kills.
const JOBS_PER_LIFE: u64 = 2;
/// Longest time between a start and a kill \[ms\].
const LIFE_MS_MAX: u64 = 700;
/// Number of times that a server is suspended until its leases have ended.
const STOPS: u32 = 3;
/// Settings of the server: a checkpoint about every third iteration, and a short lease, so that the job of a dead
/// worker is soon given to another.
const SETTINGS: [&str; 8] =
    ["--checkpoint-interval-s", "0.02", "--lease-s", "1", "--compute-threads", "1", "--workers", "2"];

#[tokio::test(flavor = "multi_thread")]
async fn server_killed_at_random_moments_keeps_every_promise() {
    let summary = kill_at_random_moments(cycles(), &SETTINGS, &[]).await;
    writeln!(std::io::stderr(), "{summary}").unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn server_on_postgresql_killed_at_random_moments_keeps_every_promise() {
    let url = postgres_database().await;
    let database = ["--database-url", &url];
    let settings = [SETTINGS.as_slice(), &database].concat();
    let summary = kill_at_random_moments(cycles().div_ceil(2), &settings, &database).await;
    writeln!(std::io::stderr(), "PostgreSQL: {summary}").unwrap();
}

/// Kills a server with these `settings` again and again, and says what it kept. `database` are the settings that say where
/// the database is.
async fn kill_at_random_moments(cycles: u64, settings: &[&str], database: &[&str]) -> String {
    let data = TempDir::new().unwrap();
    let check_arguments = [["check", "--data-dir", data.path().to_str().unwrap()].as_slice(), database].concat();
    let material = prepare_kernel(data.path(), settings).await;
    let (mut random, mut ledger) = (ChaCha8Rng::seed_from_u64(2026), Ledger::default());
    for life in 0..cycles {
        for i in 0..JOBS_PER_LIFE {
            ledger.ask(format!("{life}-{i}"));
        }
        let daemon = Daemon::start(data.path(), settings).await;
        let client = daemon.client.clone();
        ledger.assert_kept(&client, &material).await;
        let alive = Duration::from_millis(random.random_range(0..LIFE_MS_MAX));
        // The kill comes at a random moment, and the server must survive it in every state. Answers that arrive before
        // the kill are recorded.
        let kill = async {
            tokio::time::sleep(alive).await;
            daemon.kill().await;
        };
        let load = async { (ledger.load(&client, &material, life).await, std::future::pending::<()>().await) };
        tokio::select! {
            () = kill => {}
            _ = load => {}
        }
        lightpathd(&check_arguments).await.ok();
    }

    let daemon = Daemon::start(data.path(), settings).await;
    ledger.assert_kept(&daemon.client, &material).await;
    ledger.settle(&daemon.client, &material).await;
    daemon.kill().await;
    lightpathd(&check_arguments).await.ok();
    format!("{cycles} times kill -9: {}", ledger.summary())
}

#[tokio::test(flavor = "multi_thread")]
async fn interrupted_job_gives_the_same_bytes_as_uninterrupted_job() {
    let (data, undisturbed) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let target = prepare(data.path(), &SETTINGS).await;
    assert_eq!(prepare(undisturbed.path(), &SETTINGS).await, target);
    let spec = || request(hologram("lab", &target, 1200, 9), "one");

    let daemon = Daemon::start(undisturbed.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let whole = daemon.client.wait(&job.name, |_| ()).await.unwrap();
    assert_eq!(whole.attempt, 1);
    daemon.kill().await;

    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let reached = wait_for_step(&daemon.client, &job.name, 300).await;
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
    // The job resumed from a checkpoint, not from the start.
    assert!(first_step.unwrap() > reached / 2, "killed at step {reached}, resumed at {first_step:?}");
    assert_same_bytes(hologram_result(&whole).unwrap(), hologram_result(&resumed).unwrap());
    assert_succeeded_once(&daemon.client, &job.name).await;
    daemon.kill().await;
}

/// The process that is suspended longer than its leases is still the only one that runs its jobs, and no server died.
#[tokio::test(flavor = "multi_thread")]
async fn suspended_server_continues_its_jobs() {
    /// Settings with a short lease, so that it ends soon, and no checkpoints, so that nothing clears a counted failure.
    const SHORT_LEASE: [&str; 8] =
        ["--checkpoint-interval-s", "3600", "--lease-s", "0.5", "--compute-threads", "1", "--workers", "1"];
    let (data, undisturbed) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let target = prepare(data.path(), &SETTINGS).await;
    assert_eq!(prepare(undisturbed.path(), &SETTINGS).await, target);
    let spec = || SubmitJobRequest { attempts_max: Some(1), ..request(hologram("lab", &target, 1500, 9), "one") };
    let daemon = Daemon::start(undisturbed.path(), &SETTINGS).await;
    let job = daemon.client.submit(spec()).await.unwrap();
    let whole = daemon.client.wait(&job.name, |_| ()).await.unwrap();
    daemon.kill().await;

    let daemon = Daemon::start(data.path(), &SHORT_LEASE).await;
    let client = daemon.client.clone();
    let job = client.submit(spec()).await.unwrap();
    for stop in 1..=STOPS {
        wait_for_step(&client, &job.name, 300 * stop).await;
        daemon.signal("STOP");
        // Wait for three leases. No event marks the end of the lease of a stopped process.
        tokio::time::sleep(Duration::from_millis(1500)).await;
        daemon.signal("CONT");
    }
    let resumed = client.wait(&job.name, |_| ()).await.unwrap();
    assert_eq!((resumed.state(), resumed.attempt), (State::Succeeded, 1), "{resumed:?}");
    assert_same_bytes(hologram_result(&whole).unwrap(), hologram_result(&resumed).unwrap());
    assert_succeeded_once(&client, &job.name).await;
    daemon.kill().await;
    assert_eq!(check(data.path()).await.unwrap().problems, []);
}

/// The deadline for stopping ends before an iteration of the job. That is a clean stop, however often it happens.
#[tokio::test(flavor = "multi_thread")]
async fn stops_that_do_not_wait_for_the_job_are_no_deaths_of_the_server() {
    /// No time for stopping, and no checkpoints, so that nothing clears what was counted.
    const IMPATIENT: [&str; 6] =
        ["--drain-deadline-s", "0", "--checkpoint-interval-s", "3600", "--compute-threads", "1"];
    let data = TempDir::new().unwrap();
    let target = prepare(data.path(), &SETTINGS).await;
    let daemon = Daemon::start(data.path(), &IMPATIENT).await;
    let job = daemon.client.submit(request(hologram("lab", &target, 10_000, 9), "one")).await.unwrap();
    daemon.stop().await;
    for _ in 0..4 {
        let daemon = Daemon::start(data.path(), &IMPATIENT).await;
        let mut watch = daemon.client.watch_job(v1::WatchJobRequest { name: job.name.clone() }).await.unwrap();
        while watch.message().await.unwrap().expect("the job has not ended").state() != State::Running {}
        daemon.stop().await;
    }
    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let request = v1::ListJobEventsRequest { name: job.name.clone(), page_size: 1000, ..Default::default() };
    let events = daemon.client.list_job_events(request).await.unwrap().events;
    let count = |text: &str| events.iter().filter(|event| event.message.contains(text)).count();
    assert_eq!((count("died"), count("the server stopped; queued again") >= 4), (0, true), "{events:?}");
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn wait_survives_restart_and_reports_it_once() {
    let data = TempDir::new().unwrap();
    let target = prepare(data.path(), &SETTINGS).await;
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

/// Declares a display and uploads a target in a fresh data folder. Returns the target's digest.
async fn prepare(data_dir: &Path, settings: &[&str]) -> String {
    let daemon = Daemon::start(data_dir, settings).await;
    declare(&daemon.client, "lab", 128, 96).await;
    let digest = daemon.client.upload_bytes(target(128, 96, 1)).await.unwrap();
    daemon.kill().await;
    digest
}

/// Like [`prepare`], and imports a kernel with two versions to promote in turn.
async fn prepare_kernel(data_dir: &Path, settings: &[&str]) -> Material {
    let target = prepare(data_dir, settings).await;
    let daemon = Daemon::start(data_dir, settings).await;
    let material = import_two_versions(&daemon.client, target).await;
    daemon.kill().await;
    material
}

/// Imports a kernel with two versions to promote in turn.
pub(crate) async fn import_two_versions(client: &Client, target: String) -> Material {
    for tilt in [0.1, 0.2] {
        let artifact = client.upload_bytes(kernel_file(128, 96, tilt)).await.unwrap();
        let display = names::display("lab");
        let request = v1::ImportKernelRequest {
            display,
            place: Some(v1::Place::at_m(DISTANCE_M)),
            artifact,
            ..Default::default()
        };
        client.import_kernel(request).await.unwrap();
    }
    Material { target, kernel: kernel_name() }
}

/// Number of kills: `LIGHTPATH_KILL_CYCLES`, or [`CYCLES`].
fn cycles() -> u64 {
    std::env::var("LIGHTPATH_KILL_CYCLES").map_or(CYCLES, |cycles| cycles.parse().unwrap())
}

/// Waits until a job has done at least `step` steps. Returns the number of steps.
async fn wait_for_step(client: &Client, job: &str, step: u32) -> u32 {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.to_owned() }).await.unwrap();
    loop {
        let job = watch.message().await.unwrap().expect("the watch ends with the job");
        if let Some(progress) = job.progress.filter(|progress| progress.step >= step) {
            return progress.step;
        }
    }
}
