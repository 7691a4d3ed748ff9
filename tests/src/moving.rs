use crate::material::{declare, hologram, request, target};
use crate::process::{Daemon, lightpathd};
use crate::processes::place;
use futures::{StreamExt as _, stream};
use lightpath::v1::{GetBatchRequest, Job, OptimizeHologramResult, SubmitJobRequest, WatchJobRequest, job::State};
use lightpath::{Client, JobChange, hologram_result};
use lightpath_fixtures::postgres_database;
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;
use std::io::Write as _;
use std::time::Instant;
use tempfile::TempDir;

/// Jobs beside those that the test watches, and uploads of a mebibyte, unless `LIGHTPATH_MOVED_JOBS` and
/// `LIGHTPATH_MOVED_MIB` set other numbers.
const JOBS: u64 = 12;
const UPLOADS: u64 = 3;
/// Half of the jobs, and no more than this number, have ended before the move. The others wait for a process with a label.
const ENDED_MAX: u64 = 500;
/// Batch of those that wait.
const LATER: &str = "later";
/// Different results of the jobs.
const SEEDS: u64 = 100;
/// Calls at the same time.
const AT_ONCE: usize = 16;
/// Settings of the server, with no limit that many jobs would reach.
const SETTINGS: [&str; 6] = ["--checkpoint-interval-s", "0.2", "--queue-limit", "1000000", "--calls-per-s-max", "0"];
/// Iterations of the job that runs when the server stops: some seconds of work.
const LONG: u32 = 4_000;
/// Seed of that job.
const LONG_SEED: u64 = 77;

/// A server moves from its data folder to PostgreSQL and a bucket, while a client waits for a running job and another one
/// behind it. The client notices a pause.
#[tokio::test(flavor = "multi_thread")]
async fn client_notices_only_the_pause_of_a_move() {
    let Ok(endpoint) = std::env::var("LIGHTPATH_TEST_S3") else { return };
    let (data, url) = (TempDir::new().unwrap(), postgres_database().await);
    let folder = data.path().to_str().unwrap();
    let daemon = Daemon::start(data.path(), &SETTINGS).await;
    let (client, address) = (daemon.client.clone(), daemon.url.strip_prefix("http://").unwrap().to_owned());
    declare(&client, "lab", 128, 96).await;
    declare(&client, "small", 32, 24).await;
    let picture = client.upload_bytes(target(128, 96, 0)).await.unwrap();
    let submit = async |iterations, seed| {
        client.submit(request(hologram("lab", &picture, iterations, seed), "")).await.unwrap().name
    };
    let uploads = upload(&client, number("LIGHTPATH_MOVED_MIB", UPLOADS)).await;
    let jobs = number("LIGHTPATH_MOVED_JOBS", JOBS);
    let ended_count = (jobs / 2).min(ENDED_MAX);
    let later = submit_small(&client, jobs - ended_count, LATER, &["camera"]).await;
    let ended = submit_small(&client, ended_count, "", &[]).await;
    // They run in the order in which they were submitted.
    assert_eq!(client.wait(ended.last().expect("a job"), |_| ()).await.unwrap().state(), State::Succeeded);

    let long = submit(LONG, LONG_SEED).await;
    let behind = submit(3, 0).await;
    let waiting = tokio::spawn(wait(client.clone(), long.clone()));
    let mut watch = client.watch_job(WatchJobRequest { name: long.clone() }).await.unwrap();
    while watch.message().await.unwrap().unwrap().progress.is_none_or(|progress| progress.step < LONG / 10) {}
    let pause = Instant::now();
    daemon.stop().await;

    let bucket = format!("s3://lightpath-tests/moving-{}", url.split('?').next().unwrap().rsplit('/').next().unwrap());
    let mut settings = place(&url, &bucket, &endpoint);
    settings.push("--artifacts-allow-http".into());
    let of_bucket: Vec<&str> = settings.iter().skip(2).map(String::as_str).collect();
    let from = format!("sqlite://{folder}");
    let moving = Instant::now();
    lightpathd(&[["migrate", "--from", &from, "--to", &url].as_slice(), &of_bucket].concat()).await.ok();
    let moving = moving.elapsed();
    // The files in the folder are only copies now.
    std::fs::remove_dir_all(data.path().join("artifacts")).unwrap();
    let settings: Vec<&str> = settings.iter().map(String::as_str).chain(SETTINGS).collect();
    let daemon = Daemon::start_at(data.path(), &address, &settings).await;
    writeln!(std::io::stderr(), "a pause of {:.1?}, of which the move took {moving:.1?}", pause.elapsed()).unwrap();

    let (job, noticed) = waiting.await.unwrap();
    assert_eq!((job.state(), noticed), (State::Succeeded, vec!["lost", "reconnected"]));
    assert_eq!(client.wait(&behind, |_| ()).await.unwrap().state(), State::Succeeded);
    let again = submit(LONG, LONG_SEED).await;
    let again = client.wait(&again, |_| ()).await.unwrap();
    assert_eq!(
        phase(hologram_result(&job).unwrap()),
        phase(hologram_result(&again).unwrap()),
        "the job ended as without a move"
    );
    assert_kept(&client, &ended, &later, [uploads, vec![picture.clone()]].concat()).await;
    daemon.stop().await;
    let check = ["check", "--data-dir", folder].into_iter().chain(settings.into_iter().take(11));
    lightpathd(&check.collect::<Vec<_>>()).await.ok();
}

/// Checks that these jobs have ended, that the others wait, and that all files are there.
async fn assert_kept(client: &Client, ended: &[String], later: &[String], files: Vec<String>) {
    let mut jobs = stream::iter(ended).map(|name| client.wait(name, |_| ())).buffered(AT_ONCE);
    let mut phases = BTreeSet::new();
    while let Some(job) = jobs.next().await {
        let job = job.unwrap();
        assert_eq!(job.state(), State::Succeeded, "{job:?}");
        phases.insert(phase(hologram_result(&job).unwrap()));
    }
    let batch = client.get_batch(GetBatchRequest { batch: LATER.into() }).await.unwrap();
    assert_eq!(batch.queued, later.len() as u64);
    let mut files = stream::iter(files.iter().chain(&phases)).map(|digest| client.download(digest)).buffered(AT_ONCE);
    while let Some(bytes) = files.next().await {
        bytes.unwrap();
    }
}

/// Waits for a job. Returns it with what happened to the connection meanwhile.
async fn wait(client: Client, job: String) -> (Job, Vec<&'static str>) {
    let mut noticed = Vec::new();
    let job = client.wait(&job, |change| match change {
        JobChange::ConnectionLost(_) => noticed.push("lost"),
        JobChange::Reconnected => noticed.push("reconnected"),
        _ => {}
    });
    (job.await.unwrap(), noticed)
}

/// Uploads this number of random mebibytes, and returns their digests.
async fn upload(client: &Client, count: u64) -> Vec<String> {
    let mut random = ChaCha8Rng::seed_from_u64(19);
    let contents = (0..count).map(|_| {
        let mut bytes = vec![0; 1 << 20];
        random.fill_bytes(&mut bytes);
        bytes
    });
    let uploads = stream::iter(contents).map(|bytes| client.upload_bytes(bytes)).buffered(AT_ONCE);
    uploads.map(Result::unwrap).collect().await
}

/// Submits this number of small jobs, and returns their names.
async fn submit_small(client: &Client, count: u64, batch: &str, needs: &[&str]) -> Vec<String> {
    let picture = client.upload_bytes(target(32, 24, 0)).await.unwrap();
    let job = |n| {
        let (batch, needs) = (batch.to_owned(), needs.iter().copied().map(Into::into).collect());
        let job = request(hologram("small", &picture, 1, n % SEEDS), "");
        client.submit(SubmitJobRequest { batch, needs, ..job })
    };
    let jobs = stream::iter(0..count).map(job).buffered(AT_ONCE);
    jobs.map(|job| job.unwrap().name).collect().await
}

/// Digest of the only pattern.
fn phase(result: &OptimizeHologramResult) -> String {
    result.wavelengths[0].subframes[0].pattern.clone()
}

fn number(variable: &str, usual: u64) -> u64 {
    std::env::var(variable).map_or(usual, |text| text.parse().unwrap())
}
