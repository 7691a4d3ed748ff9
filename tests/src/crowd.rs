use crate::material::{assert_succeeded_once, declare, hologram, request, target};
use crate::server::TestServer;
use futures::{StreamExt as _, TryStreamExt as _};
use lightpath::Client;
use lightpath::v1::{self, job::State};
use std::collections::HashSet;
use std::io::Write as _;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// Jobs of each of the two clients.
const JOBS_PER_CLIENT: u64 = 250;
/// Largest median time of a list while the jobs run. A single list may take longer on a busy machine.
const LIST_MEDIAN_MAX: Duration = Duration::from_millis(100);
/// Calls that one client makes at once.
const AT_ONCE: usize = 16;

#[tokio::test(flavor = "multi_thread")]
async fn each_of_500_jobs_of_two_clients_runs_once() {
    let server = TestServer::with(|config| config.workers = 2).await;
    declare(&server.client, "lab", 16, 16).await;
    let target = server.client.upload_bytes(target(16, 16, 0)).await.unwrap();
    let (ended, listening) = watch::channel(());
    let lister = tokio::spawn(list_until(Client::connect(server.url()).unwrap(), listening));

    let started = Instant::now();
    let (first, second) = tokio::join!(run_jobs(server.url(), &target, 1), run_jobs(server.url(), &target, 2));
    let took = started.elapsed();
    drop(ended);
    let mut latencies = lister.await.unwrap();
    latencies.sort();

    let names: HashSet<String> = first.into_iter().chain(second).collect();
    assert_eq!(names.len() as u64, 2 * JOBS_PER_CLIENT);
    let request = v1::ListJobsRequest { page_size: 1000, ..Default::default() };
    let listed = server.client.list_jobs(request).await.unwrap().jobs;
    assert_eq!(listed.len(), names.len());
    assert!(listed.iter().all(|job| job.state() == State::Succeeded && job.attempt == 1));
    for name in &names {
        assert_succeeded_once(&server.client, name).await;
    }
    let (median, slowest) = (latencies[latencies.len() / 2], latencies[latencies.len() - 1]);
    assert!(median < LIST_MEDIAN_MAX, "a list took {median:.1?}, the median of {}", latencies.len());
    let lists = latencies.len();
    let line = format!("500 jobs in {took:.1?}; {lists} lists meanwhile, median {median:.1?}, slowest {slowest:.1?}");
    writeln!(std::io::stderr(), "{line}").unwrap();
    server.stop().await;
}

/// Submits the jobs of one client and waits until all have succeeded. Returns their names.
async fn run_jobs(url: &str, target: &str, client_number: u64) -> Vec<String> {
    let client = &Client::connect(url).unwrap();
    let jobs = (0..JOBS_PER_CLIENT).map(async |i| {
        let mut spec = hologram("lab", target, 1, client_number * JOBS_PER_CLIENT + i);
        // At the usual distance the light of so few pixels spreads far, and judging it takes most of a job's time.
        spec.planes[0].place = Some(v1::Place::at_m(0.001));
        client.submit(request(spec, &format!("{client_number}-{i}"))).await
    });
    let jobs: Vec<v1::Job> = futures::stream::iter(jobs).buffer_unordered(AT_ONCE).try_collect().await.unwrap();
    let ends = jobs.iter().map(async |job| client.wait(&job.name, |_| ()).await);
    let ended: Vec<v1::Job> = futures::stream::iter(ends).buffer_unordered(AT_ONCE).try_collect().await.unwrap();
    for job in &ended {
        assert_eq!(job.state(), State::Succeeded, "{job:?}");
    }
    ended.into_iter().map(|job| job.name).collect()
}

/// Lists jobs every 50 ms, as a dashboard does, until `listening` closes. Returns the time of each list.
async fn list_until(client: Client, mut listening: watch::Receiver<()>) -> Vec<Duration> {
    let mut ticks = tokio::time::interval(Duration::from_millis(50));
    let mut latencies = Vec::new();
    loop {
        tokio::select! {
            _ = listening.changed() => return latencies,
            _ = ticks.tick() => {
                let started = Instant::now();
                client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
                latencies.push(started.elapsed());
            }
        }
    }
}
