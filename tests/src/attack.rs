//! Attackers of every kind at once, and an honest client beside them.
//!
//! The server's memory must stay within its documented limits, its disk must keep the reserve, the honest client must get
//! its answers, nothing that was acknowledged may be lost, and the audit log must name every job.

mod attackers;
mod hostile_files;

use crate::disk::TinyDisk;
use crate::material::{DISTANCE_M, WAVELENGTH_M, declare, display, hologram, kernel_file, request, target};
use crate::process::{Daemon, lightpathd};
use attackers::{ATTACKERS, BATCH, Field, attack, role};
use hostile_files::HostileFiles;
use lightpath::{Client, names, v1};
use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::runtime::{Builder, Runtime};
use tokio::task::JoinSet;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// Duration of the attack \[s\], unless `LIGHTPATH_ATTACK_SECONDS` sets another.
const ATTACK_S: u64 = 6;
/// From this duration on \[s\], the attackers use the largest pictures and displays, and the server its usual settings.
const FULL_S: u64 = 60;
/// Allowed memory beyond the limits, as a part of them.
const MEMORY_MARGIN: f64 = 0.1;
/// Interval between the calls of the honest client.
const HONEST_INTERVAL: Duration = Duration::from_millis(100);
/// Size of the server's disk \[MiB\].
const DISK_MIB: u64 = 768;
/// How much of it must stay free \[MiB\].
const RESERVE_MIB: u64 = 256;
/// Scheduling priority of the attackers' threads, as of the command `nice`.
const ATTACKERS_NICENESS: i32 = 10;
/// Interval between looks at the disk.
const LOOK: Duration = Duration::from_millis(20);

/// Sizes and limits of one run.
struct Scale {
    duration: Duration,
    /// Side of the largest picture \[px\].
    side_px: u32,
    /// Width of the kernel that is fetched \[px\]. It is twice its height.
    kernel_width_px: u32,
    /// Times within which 99 % of the honest client's submits and of the health checks are answered \[s\]. Before turns
    /// were fair, an answer took minutes. The short attack is no measurement: a program that is not optimized decodes a picture
    /// for seconds, and thirteen attackers keep both processors busy.
    p99_s_max: [f64; 2],
    /// Limit on the memory of messages \[MiB\].
    under_way_mib: u64,
    /// Limit on the memory of computations for calls \[MiB\].
    computing_mib: u64,
}

impl Scale {
    fn from_environment() -> Self {
        let seconds = std::env::var("LIGHTPATH_ATTACK_SECONDS").map_or(ATTACK_S, |text| text.parse().unwrap());
        let duration = Duration::from_secs(seconds);
        if seconds >= FULL_S {
            Self {
                duration,
                side_px: 8192,
                kernel_width_px: 3840,
                p99_s_max: [0.2, 0.5],
                under_way_mib: 512,
                computing_mib: 3072,
            }
        } else {
            Self {
                duration,
                side_px: 2048,
                kernel_width_px: 1024,
                p99_s_max: [20.0, 5.0],
                under_way_mib: 64,
                computing_mib: 256,
            }
        }
    }
}

async fn token(data: &Path, name: &str, role: &str) -> String {
    let arguments = ["token", "create", name, "--role", role, "--data-dir", data.to_str().unwrap()];
    lightpathd(&arguments).await.ok().trim().to_owned()
}

/// Times of the answers to an honest client \[s\], ascending, and the jobs that the server acknowledged.
struct Honest {
    submits_s: Vec<f64>,
    health_s: Vec<f64>,
    jobs: BTreeSet<String>,
}

async fn work_honestly(client: Client, url: String, end: CancellationToken) -> Honest {
    let (mut submits_s, mut health_s, mut jobs) = (Vec::new(), Vec::new(), BTreeSet::new());
    let address = url.trim_start_matches("http://").to_owned();
    let mut number = 0;
    while !end.is_cancelled() {
        number += 1;
        let digest = client.upload_bytes(target(64, 48, number)).await.unwrap();
        let begin = Instant::now();
        let job = client.submit_job(request(hologram("lab", &digest, 3, 1), "")).await.unwrap();
        submits_s.push(begin.elapsed().as_secs_f64());
        jobs.insert(job.name);
        let begin = Instant::now();
        let mut stream = TcpStream::connect(&address).await.unwrap();
        stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        health_s.push(begin.elapsed().as_secs_f64());
        assert!(answer.starts_with("HTTP/1.1 200 "), "{answer}");
        sleep(HONEST_INTERVAL).await;
    }
    submits_s.sort_by(f64::total_cmp);
    health_s.sort_by(f64::total_cmp);
    Honest { submits_s, health_s, jobs }
}

/// The value below which this part of the ascending values lies.
fn quantile(ascending: &[f64], part: f64) -> f64 {
    ascending[((ascending.len() - 1) as f64 * part).round() as usize]
}

/// The displays, the kernel and the waiting job that attackers use. Returns the digest of the bomb and the job.
async fn prepare(admin: &Client, scale: &Scale) -> (String, String) {
    declare(admin, "lab", 64, 48).await;
    for (id, width_px) in [("wide", scale.side_px), ("learned", scale.kernel_width_px)] {
        let display = v1::Display { bench: None, ..display(id, width_px, width_px / 2) };
        admin.create_display(v1::CreateDisplayRequest { display: Some(display) }).await.unwrap();
    }
    let width_px = scale.kernel_width_px as usize;
    let artifact = admin.upload_bytes(kernel_file(width_px, width_px / 2, 0.1)).await.unwrap();
    let import = v1::ImportKernelRequest {
        display: names::display("learned"),
        wavelength_m: Some(WAVELENGTH_M),
        place: Some(v1::Place::at_m(DISTANCE_M)),
        artifact,
        ..Default::default()
    };
    admin.import_kernel(import).await.unwrap();
    let bomb = admin.upload_bytes(hostile_files::large_picture(scale.side_px)).await.unwrap();
    let small = admin.upload_bytes(target(64, 48, 0)).await.unwrap();
    let pause = v1::PauseQueueRequest { display: names::display("wide"), reason: "attack".into() };
    admin.pause_queue(pause).await.unwrap();
    let mut spec = hologram("wide", &small, 3, 1);
    spec.target_fit = v1::optimize_hologram::Fit::Contain.into();
    let waiting = v1::SubmitJobRequest { batch: BATCH.into(), ..request(spec, "") };
    (bomb, admin.submit_job(waiting).await.unwrap().name)
}

/// Adds the times of submits and health checks \[s\] to a table, and returns those that were too long.
fn late(scale: &Scale, times_s: [&[f64]; 2], table: &mut String) -> Vec<String> {
    let mut late = Vec::new();
    for ((name, times_s), p99_s_max) in ["submit", "health"].into_iter().zip(times_s).zip(scale.p99_s_max) {
        let [median_s, p99_s] = [0.5, 0.99].map(|part| quantile(times_s, part));
        let line = format!("{name}, {} times | median {median_s:.3} s, p99 {p99_s:.3} s", times_s.len());
        *table += &format!("| {line} |\n");
        if p99_s > p99_s_max {
            late.push(line);
        }
    }
    late
}

/// Threads of attackers, which yield to the server and to the honest client: attackers elsewhere would take none of the
/// server's processor time for themselves.
fn threads_of_attackers() -> Runtime {
    let yield_to_others = || rustix::process::setpriority_process(None, ATTACKERS_NICENESS).unwrap();
    Builder::new_multi_thread().worker_threads(2).enable_all().on_thread_start(yield_to_others).build().unwrap()
}

/// All attacks, each with a token of its own.
fn begun(field: &Field, tokens: Vec<String>, threads: &Runtime) -> JoinSet<()> {
    let mut attacks = JoinSet::new();
    for (name, token) in ATTACKERS.into_iter().zip(tokens) {
        attacks.spawn_on(attack(name, Field { token, ..field.clone() }), threads.handle());
    }
    attacks
}

/// The least free space of the disk during this time \[MiB\].
async fn least_free_mib(disk: Option<&TinyDisk>, duration: Duration) -> Option<u64> {
    let (begin, mut least_mib) = (Instant::now(), None);
    while begin.elapsed() < duration {
        least_mib = disk.map(|disk| disk.free_mib().min(least_mib.unwrap_or(u64::MAX)));
        sleep(LOOK).await;
    }
    least_mib
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_honest_client_is_served_while_others_attack() {
    let scale = Scale::from_environment();
    // Only an administrator may mount a disk. Others attack without one.
    let (disk, folder) = (TinyDisk::mount(DISK_MIB), TempDir::new().unwrap());
    let data = disk.as_ref().map_or_else(|| folder.path().to_owned(), TinyDisk::data_dir);
    let [admin, honest] = [token(&data, "admin", "admin").await, token(&data, "honest", "submitter").await];
    let mut tokens = Vec::new();
    for name in ATTACKERS {
        tokens.push(token(&data, name, role(name)).await);
    }
    let [under_way, computing, reserve] =
        [scale.under_way_mib, scale.computing_mib, RESERVE_MIB].map(|mib| mib.to_string());
    let settings = ["--require-tokens", "true", "--under-way-mib-max", &under_way, "--computing-mib-max", &computing];
    let server = Daemon::start(&data, &[&settings[..], &["--disk-reserve-mib", &reserve]].concat()).await;
    let admin = Client::connect_with_token(&server.url, &admin).unwrap();
    let (bomb, job) = prepare(&admin, &scale).await;
    let files = Arc::new(HostileFiles::make());
    let idle_kib = server.memory_kib();

    let end = CancellationToken::new();
    let (url, token) = (server.url.clone(), String::new());
    let field = Field { url, token, bomb, job, files, end: end.clone() };
    let threads = threads_of_attackers();
    let mut attacks = begun(&field, tokens, &threads);
    let working = tokio::spawn(work_honestly(
        Client::connect_with_token(&server.url, &honest).unwrap(),
        server.url.clone(),
        end.clone(),
    ));
    let free_mib = least_free_mib(disk.as_ref(), scale.duration).await;
    end.cancel();
    let Honest { submits_s, health_s, jobs } = working.await.unwrap();
    while let Some(ended) = attacks.try_join_next() {
        ended.expect("an attack that does not happen proves nothing");
    }
    attacks.shutdown().await;
    threads.shutdown_background();

    let peak_kib = server.memory_peak_kib();
    let limit_kib = idle_kib + ((scale.under_way_mib + scale.computing_mib) << 10);
    let mut table = format!("| memory, limit | {} MiB, {} MiB |\n", peak_kib >> 10, limit_kib >> 10);
    if let Some(free_mib) = free_mib {
        table += &format!("| free on the disk, reserve | {free_mib} MiB, {RESERVE_MIB} MiB |\n");
    }
    let late = late(&scale, [&submits_s, &health_s], &mut table);
    write!(std::io::stderr(), "{table}").unwrap();
    assert!(free_mib.is_none_or(|free_mib| free_mib >= RESERVE_MIB), "{free_mib:?} MiB of the disk were free");
    assert!(peak_kib as f64 <= limit_kib as f64 * (1.0 + MEMORY_MARGIN), "{peak_kib} KiB of {limit_kib} KiB");
    assert_eq!(late, [""; 0], "answers that took too long");
    for name in &jobs {
        admin.get_job(v1::GetJobRequest { name: name.clone() }).await.unwrap();
    }
    server.kill().await;
    let log = std::fs::read_to_string(data.join("audit.jsonl")).unwrap();
    for name in &jobs {
        assert!(log.contains(name), "{name} is not in the audit log");
    }
    lightpathd(&["check", "--data-dir", data.to_str().unwrap()]).await.ok();
}
