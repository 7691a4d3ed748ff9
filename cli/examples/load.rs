//! Measures a server's response times under load, and prints a table in Markdown.
//!
//! ```sh
//! lightpathd serve --data-dir /tmp/load --queue-limit 1000000 --calls-per-s-max 0 &
//! cargo run --release -p lightpath-cli --example load
//! ```
//!
//! A long job keeps the server's cores busy during all measurements. The example submits many jobs, lists pages of
//! jobs, follows up to 500 jobs at once and uploads large artifacts in parallel. For each followed job it measures the
//! delay between the cancellation and the message to the follower. With TLS, use `--server https://localhost:7070
//! --ca-file cert.pem --token-file ada.token`. A client cannot measure how long a worker takes to claim a job among a
//! million: the test with `LIGHTPATH_SCALE_JOBS` does (CONTRIBUTING.md).

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use clap::Parser;
use futures::stream::{self, StreamExt as _};
use lightpath::v1::{self, OptimizeHologram, SubmitJobRequest, job::State, job_spec, optimize_hologram::ImagePlane};
use lightpath::{Client, Credentials, job_spec as spec_of, names};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use test_pattern::png;
use tokio::sync::Mutex;

/// Watch streams on one connection. The server allows some more.
const WATCHERS_PER_CONNECTION: usize = 200;

#[derive(Parser)]
struct Options {
    /// Set the address of the server
    #[arg(long, default_value = "http://127.0.0.1:7070")]
    server: String,
    /// Read the access token from this file
    #[arg(long)]
    token_file: Option<PathBuf>,
    /// Trust the certificate authority in this PEM file
    #[arg(long)]
    ca_file: Option<PathBuf>,
    /// Submit this many jobs
    #[arg(long, default_value_t = 3000)]
    submits: usize,
    /// Submit this many jobs at a time
    #[arg(long, default_value_t = 8)]
    at_once: usize,
    /// List this many pages of 50 jobs
    #[arg(long, default_value_t = 300)]
    pages: usize,
    /// Follow this many of the submitted jobs at once, at most 500
    #[arg(long, default_value_t = 500)]
    watchers: usize,
    /// Set the size of each of the eight uploads in MB
    #[arg(long, default_value_t = 130)]
    upload_mb: usize,
}

#[tokio::main]
async fn main() {
    let options = Options::parse();
    let credentials = Credentials {
        token: options.token_file.as_ref().map(|path| std::fs::read_to_string(path).unwrap()),
        authority_pem: options.ca_file.as_ref().map(|path| std::fs::read(path).unwrap()),
        ..Credentials::default()
    };
    let connect = || Client::connect_as(&options.server, &credentials).unwrap();
    let client = connect();
    let target = prepare(&client).await;
    let run = u64::from(std::process::id());
    let busy = submit(&client, &target, 10_000, -100, &format!("busy-{run}")).await;
    wait_for_state(&client, &busy, State::Running).await;

    let cores = std::thread::available_parallelism().unwrap();
    println!("{}, {} cores, {}\n", processor(), cores, options.server.split(':').next().unwrap());
    println!("| what | asked | measured |\n|---|---|---|");
    let submitted = measure_submits(&client, &target, &options, run).await;
    measure_lists(&client, options.pages).await;
    measure_followers(&client, &connect, &submitted[..options.watchers.min(submitted.len())]).await;
    measure_uploads(&connect, &options, run).await;
    let job = client.get_job(v1::GetJobRequest { name: busy.clone() }).await.unwrap();
    println!("| the job that ran meanwhile | no missed heartbeat | attempt {}, {:?} |", job.attempt, job.state());
    client.cancel_job(v1::CancelJobRequest { name: busy }).await.unwrap();
}

/// Submits many jobs, prints how long each took, and returns their names.
async fn measure_submits(client: &Client, target: &str, options: &Options, run: u64) -> Vec<String> {
    let started = Instant::now();
    let submits = stream::iter(0..options.submits).map(|n| async move {
        let begin = Instant::now();
        (submit(client, target, 5, 50, &format!("load-{run}-{n}")).await, begin.elapsed())
    });
    let (names, times): (Vec<String>, Vec<Duration>) = submits.buffer_unordered(options.at_once).unzip().await;
    let rate = options.submits as f64 / started.elapsed().as_secs_f64();
    let measurement = format!("{} submits, {} at once", options.submits, options.at_once);
    println!("| {measurement} | 300 a second, p99 < 50 ms | {rate:.0} a second, {} |", Times::of(times));
    names
}

/// Lists pages of jobs from the newest to the oldest, then starts again with the newest.
async fn measure_lists(client: &Client, pages: usize) {
    let mut times = Vec::new();
    let mut request = v1::ListJobsRequest::default();
    for _ in 0..pages {
        let begin = Instant::now();
        let page = client.list_jobs(request.clone()).await.unwrap();
        times.push(begin.elapsed());
        request.page_token = page.next_page_token;
    }
    println!("| {pages} pages of 50 jobs, one after the other | p99 < 50 ms | {} |", Times::of(times));
}

/// Follows jobs, cancels each, and measures the delay until its follower receives the new state.
async fn measure_followers(client: &Client, connect: &impl Fn() -> Client, watched: &[String]) {
    let end_times = Arc::new(Mutex::new(HashMap::new()));
    let mut followers = Vec::new();
    for names in watched.chunks(WATCHERS_PER_CONNECTION) {
        let client = connect();
        for name in names {
            let mut stream = client.watch_job(v1::WatchJobRequest { name: name.clone() }).await.unwrap();
            let (end_times, name) = (Arc::clone(&end_times), name.clone());
            followers.push(tokio::spawn(async move {
                while let Some(job) = stream.message().await.unwrap() {
                    if job.state() == State::Cancelled {
                        end_times.lock().await.insert(name.clone(), Instant::now());
                    }
                }
            }));
        }
    }
    let mut cancelled = Vec::new();
    for name in watched {
        client.cancel_job(v1::CancelJobRequest { name: name.clone() }).await.unwrap();
        cancelled.push((name, Instant::now()));
    }
    for follower in followers {
        follower.await.unwrap();
    }
    let end_times = end_times.lock().await;
    let delays = cancelled.iter().map(|(name, at)| end_times[*name].saturating_duration_since(*at));
    let measurement = format!("{} clients that follow a job hear of its end", watched.len());
    println!("| {measurement} | p99 < 1 s | {} after the answer |", Times::of(delays));
}

/// Uploads eight large artifacts in parallel.
async fn measure_uploads(connect: &impl Fn() -> Client, options: &Options, run: u64) {
    let uploads = (0..8_u8).map(|n| {
        let client = connect();
        let bytes: Vec<u8> =
            (0..options.upload_mb * 1_000_000).map(|i| (i as u8).wrapping_mul(31) ^ n ^ run as u8).collect();
        async move { client.upload_bytes(bytes).await.unwrap() }
    });
    let uploads: Vec<_> = uploads.map(tokio::spawn).collect();
    let begin = Instant::now();
    for upload in uploads {
        upload.await.unwrap();
    }
    let rate = 8.0 * options.upload_mb as f64 / begin.elapsed().as_secs_f64();
    println!("| 8 uploads of {} MB side by side | – | {rate:.0} MB/s |", options.upload_mb);
}

/// Name of the machine's processor, from `/proc/cpuinfo`.
fn processor() -> String {
    let known = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = known.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name));
    name.unwrap_or("unknown processor").to_owned()
}

/// Declares the display and uploads the target of all jobs. Returns the digest of the target.
async fn prepare(client: &Client) -> String {
    let display = v1::Display {
        name: names::display("load"),
        modulator: Some(v1::Modulator::of_phase(1920, 1080, 8e-6)),
        wavelengths_m: vec![515e-9],
        ..Default::default()
    };
    client.create_display(v1::CreateDisplayRequest { display: Some(display) }).await.unwrap();
    client.upload_bytes(png(64, 48)).await.unwrap()
}

async fn submit(client: &Client, target: &str, iterations: u32, priority: i32, request_id: &str) -> String {
    let spec = OptimizeHologram {
        display: names::display("load"),
        planes: vec![ImagePlane { place: Some(v1::Place::at_m(0.05)), target: target.to_owned(), weight: None }],
        iterations: Some(iterations),
        ..Default::default()
    };
    let spec = Some(spec_of(job_spec::Kind::OptimizeHologram(spec)));
    let request = SubmitJobRequest { spec, priority, request_id: request_id.to_owned(), ..Default::default() };
    client.submit_job(request).await.unwrap().name
}

/// Waits until a job is in `state`.
async fn wait_for_state(client: &Client, job: &str, state: State) {
    let mut watch = client.watch_job(v1::WatchJobRequest { name: job.to_owned() }).await.unwrap();
    while watch.message().await.unwrap().is_some_and(|job| job.state() != state) {}
}

/// Sorted durations of one kind of call.
struct Times(Vec<Duration>);

impl Times {
    fn of(times: impl IntoIterator<Item = Duration>) -> Self {
        let mut times: Vec<_> = times.into_iter().collect();
        times.sort();
        Self(times)
    }
}

impl std::fmt::Display for Times {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let at = |part: usize| self.0[(self.0.len() * part / 100).min(self.0.len() - 1)].as_secs_f64() * 1e3;
        write!(f, "median {:.1} ms, p99 {:.1} ms", at(50), at(99))
    }
}

/// Writes a PNG file without compression and without a library.
mod test_pattern {
    /// A grey PNG file with a fixed pattern.
    pub(crate) fn png(width_px: u32, height_px: u32) -> Vec<u8> {
        let rows: Vec<u8> = (0..height_px)
            .flat_map(|y| std::iter::once(0).chain((0..width_px).map(move |x| (x * 7 + y * 13) as u8)))
            .collect();
        let mut data = vec![0x78, 0x01, 0x01];
        data.extend((rows.len() as u16).to_le_bytes());
        data.extend((!(rows.len() as u16)).to_le_bytes());
        data.extend(&rows);
        data.extend(adler32(&rows).to_be_bytes());
        let mut header = width_px.to_be_bytes().to_vec();
        header.extend(height_px.to_be_bytes());
        header.extend([8, 0, 0, 0, 0]);
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, bytes) in [(b"IHDR", header), (b"IDAT", data), (b"IEND", Vec::new())] {
            let chunk = [kind.as_slice(), &bytes].concat();
            file.extend((bytes.len() as u32).to_be_bytes());
            file.extend(&chunk);
            file.extend(crc32(&chunk).to_be_bytes());
        }
        file
    }

    fn adler32(bytes: &[u8]) -> u32 {
        let (a, b) = bytes.iter().fold((1, 0), |(a, b), &byte| {
            let a = (a + u32::from(byte)) % 65521;
            (a, (b + a) % 65521)
        });
        b << 16 | a
    }

    fn crc32(bytes: &[u8]) -> u32 {
        let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xedb8_8320 } else { crc >> 1 };
        !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), step))
    }
}
