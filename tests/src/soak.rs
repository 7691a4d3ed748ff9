use crate::material::{declare, hologram, request, target};
use crate::process::{Daemon, lightpathd};
use futures::future::try_join_all;
use lightpath::v1::{self, job::State};
use lightpath::{Client, Error, hologram_result};
use std::io::Write as _;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Duration of the test \[s\], unless `LIGHTPATH_SOAK_SECONDS` sets another.
const SECONDS: u64 = 8;
/// Clients that use the server at once.
const CLIENTS: u64 = 4;
/// Allowed growth of the server's memory between the first quarter and the end \[KiB\]. Caches fill, and logs stay in
/// memory until they are written.
const GROWTH_KIB_MAX: u64 = 16 << 10;
/// Allowed growth of the number of open files after the first quarter.
const FILES_MAX: usize = 32;

/// Duration of the test: `LIGHTPATH_SOAK_SECONDS`, or [`SECONDS`].
fn duration() -> Duration {
    Duration::from_secs(std::env::var("LIGHTPATH_SOAK_SECONDS").map_or(SECONDS, |seconds| seconds.parse().unwrap()))
}

#[tokio::test(flavor = "multi_thread")]
async fn long_use_leaks_neither_memory_nor_files() {
    let data = TempDir::new().unwrap();
    let settings = ["--checkpoint-interval-s", "0.05", "--compute-threads", "1", "--workers", "2", "--lease-s", "2"];
    let daemon = Daemon::start(data.path(), &settings).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let begin = Instant::now();
    let until = begin + duration();
    let using = try_join_all((0..CLIENTS).map(|n| {
        let client = Client::connect(&daemon.url).unwrap();
        async move { use_everything(&client, n, until).await }
    }));
    let watching = async {
        tokio::time::sleep_until((begin + duration() / 4).into()).await;
        (daemon.memory_kib(), daemon.open_files())
    };
    let (used, (memory_kib, files)) = tokio::join!(using, watching);
    let rounds: u64 = used.unwrap().into_iter().sum();
    // Measured before the long list below, because the list needs memory.
    let (memory_end_kib, files_end) = (daemon.memory_kib(), daemon.open_files());

    let request = v1::ListJobsRequest { page_size: 1000, ..Default::default() };
    let jobs = daemon.client.list_jobs(request).await.unwrap().jobs;
    assert!(jobs.iter().all(|job| matches!(job.state(), State::Succeeded | State::Cancelled)), "{jobs:?}");
    assert!(jobs.iter().all(|job| job.attempt <= 1), "no lease was lost");
    let line = format!(
        "{rounds} rounds in {:.0?}: {} MiB and {files_end} open files, after a quarter {} MiB and {files}",
        begin.elapsed(),
        memory_end_kib >> 10,
        memory_kib >> 10,
    );
    writeln!(std::io::stderr(), "{line}").unwrap();
    assert!(memory_end_kib < memory_kib + GROWTH_KIB_MAX, "{line}");
    assert!(files_end < files + FILES_MAX, "{line}");
    daemon.kill().await;
    lightpathd(&["check", "--data-dir", data.path().to_str().unwrap()]).await.ok();
}

/// Uploads, submits, lists, cancels, waits and downloads in rounds. Returns the number of rounds.
async fn use_everything(client: &Client, number: u64, until: Instant) -> Result<u64, Error> {
    let mut rounds = 0;
    while Instant::now() < until {
        let picture = client.upload_bytes(target(64, 48, (rounds % 30) as u32)).await?;
        let job = client.submit(request(hologram("lab", &picture, 20, rounds), &format!("{number}-{rounds}"))).await?;
        let long = request(hologram("lab", &picture, 10_000, rounds), &format!("long {number}-{rounds}"));
        let long = client.submit(long).await?;
        client.list_jobs(v1::ListJobsRequest::default()).await?;
        client.cancel_job(v1::CancelJobRequest { name: long.name.clone() }).await?;
        let done = client.wait(&job.name, |_| ()).await?;
        let result = hologram_result(&done)?;
        client.download(&result.wavelengths[0].subframes[0].pattern).await?;
        assert_eq!(client.wait(&long.name, |_| ()).await?.state(), State::Cancelled);
        rounds += 1;
    }
    Ok(rounds)
}
