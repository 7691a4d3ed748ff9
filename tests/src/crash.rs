use crate::material::{assert_succeeded_once, declare, events, hologram, request, target};
use crate::process::Daemon;
use lightpath::v1::{self, HologramResult, SubmitJobRequest, job::State};
use lightpath::{Client, JobChange, hologram_result};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// Moments at which the server is killed.
const KILLS: u64 = 22;
/// Jobs submitted between two kills.
const JOBS_PER_LIFE: u64 = 2;
/// Different jobs; those with the same seed must give the same bytes.
const SEEDS: u64 = 3;
/// Long enough to be interrupted often, short enough that many end.
const ITERATIONS: u32 = 150;
/// A life lasts up to this long.
const LIFE_MS_MAX: u64 = 700;
/// Saves its state about every third iteration, and gives up a dead worker's job soon.
const SETTINGS: [&str; 8] =
    ["--checkpoint-interval-s", "0.02", "--lease-s", "1", "--compute-threads", "1", "--workers", "2"];

#[tokio::test(flavor = "multi_thread")]
async fn killed_at_random_moments_every_accepted_job_is_done_once() {
    let data = TempDir::new().unwrap();
    let target = prepare(data.path()).await;
    let mut random = Random(2026);
    // What was asked for, and the job that answered; `None` while no answer came.
    let mut asked: BTreeMap<String, Option<String>> = BTreeMap::new();
    for life in 0..KILLS {
        for i in 0..JOBS_PER_LIFE {
            asked.insert(format!("{life}-{i}"), None);
        }
        let daemon = Daemon::start(data.path(), &SETTINGS).await;
        let alive = Duration::from_millis(random.below(LIFE_MS_MAX));
        // The moment is what is random here; whatever the server is doing then, it must survive it.
        let submitting = submit_open(&daemon.client, &target, &mut asked);
        drop(tokio::time::timeout(alive, async { (submitting.await, std::future::pending::<()>().await) }).await);
        daemon.kill().await;
    }

    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    submit_open(&daemon.client, &target, &mut asked).await;
    let mut results: BTreeMap<u64, HologramResult> = BTreeMap::new();
    let mut attempts = 0;
    for (request_id, job) in &asked {
        let name = job.as_ref().unwrap();
        let job = daemon.client.wait(name, |_| ()).await.unwrap();
        assert_eq!(job.state(), State::Succeeded, "{job:?} {:#?}", events(&daemon.client, name).await);
        assert_eq!(&job.request_id, request_id);
        assert_succeeded_once(&daemon.client, name).await;
        attempts += job.attempt;
        let result = hologram_result(&job).unwrap();
        let first = results.entry(seed_of(request_id)).or_insert_with(|| result.clone());
        assert_same_bytes(first, result);
    }
    let request = v1::ListJobsRequest { page_size: 1000, ..Default::default() };
    let listed = daemon.client.list_jobs(request).await.unwrap().jobs;
    assert_eq!(listed.len(), asked.len(), "each request made one job");
    assert!(attempts as usize > asked.len(), "no job was ever interrupted: {attempts} attempts");
    assert_eq!(results.len() as u64, SEEDS);
    daemon.kill().await;
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

/// Submits what has no answer yet.
async fn submit_open(client: &Client, target: &str, asked: &mut BTreeMap<String, Option<String>>) {
    for (request_id, job) in asked.iter_mut().filter(|(_, job)| job.is_none()) {
        let spec = hologram("lab", target, ITERATIONS, seed_of(request_id));
        let request = SubmitJobRequest { attempts_max: 20, ..request(spec, request_id) };
        *job = Some(client.submit(request).await.unwrap().name);
    }
}

fn seed_of(request_id: &str) -> u64 {
    request_id.bytes().map(u64::from).sum::<u64>() % SEEDS
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

fn assert_same_bytes(one: &HologramResult, other: &HologramResult) {
    assert_eq!(one.phase, other.phase);
    assert_eq!(one.phase_npy, other.phase_npy);
    assert_eq!(one.reconstruction, other.reconstruction);
}

/// SplitMix64 (Steele, Lea, Flood 2014): the same moments in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}
