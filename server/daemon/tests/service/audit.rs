//! Tests of the audit log.

use crate::access::{Guarded, with_token};
use crate::serving::{Serving, small_display};
use lightpath_media::pictures;
use lightpath_optics::Plane;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::{self, job_spec};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};

/// Submits whose clients wait for the answer.
const PATIENT_SUBMITS: u64 = 5;
/// Submits whose clients leave early.
const HASTY_SUBMITS: u64 = 200;

/// The lines of a log.
fn lines(serving: &Serving, name: &str) -> Vec<Value> {
    let text = fs::read_to_string(serving.config.data_dir.join(name)).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// The refusals of a call with an outcome, as soon as they are written.
async fn refusal(serving: &Serving, call: &str, outcome: &str) -> Value {
    let is_meant = |line: &Value| line["call"] == call && line["outcome"] == outcome;
    for _ in 0..100 {
        if let Some(line) = lines(serving, "refusals.jsonl").into_iter().find(is_meant) {
            return line;
        }
        sleep(Duration::from_millis(100)).await;
    }
    panic!("no refusal of {call} with {outcome} is logged");
}

/// Names of all jobs.
async fn jobs(serving: &Serving) -> BTreeSet<String> {
    let mut jobs = BTreeSet::new();
    let mut request = v1::ListJobsRequest { page_size: 1000, ..Default::default() };
    loop {
        let page = serving.jobs().list_jobs(request.clone()).await.unwrap().into_inner();
        jobs.extend(page.jobs.into_iter().map(|job| job.name));
        request.page_token = page.next_page_token;
        if request.page_token.is_empty() {
            return jobs;
        }
    }
}

/// Names of the jobs whose submits are in the log.
fn logged_jobs(serving: &Serving) -> BTreeSet<String> {
    let is_submit = |line: &Value| line["call"] == "/lightpath.v1.JobService/SubmitJob";
    let submits = lines(serving, "audit.jsonl").into_iter().filter(is_submit);
    submits.map(|line| line["object"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_job_has_a_line_even_if_its_client_left() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    serving.jobs().pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let picture = Plane::from_fn(48, 64, |y, x| ((y + x) % 97) as f32 / 97.0);
    let target = serving.upload(&pictures::grey_png_srgb(&picture).unwrap()).await;
    let plane = v1::optimize_hologram::ImagePlane { place: Some(v1::Place::at_m(0.05)), target, weight: None };
    let spec = v1::OptimizeHologram { display: "displays/lab".into(), planes: vec![plane], ..Default::default() };
    let spec = v1::JobSpec { kind: Some(job_spec::Kind::OptimizeHologram(spec)) };
    let request = v1::SubmitJobRequest { spec: Some(spec), ..Default::default() };
    // How long a submit takes on this machine. The first one decodes the target.
    let mut shortest = Duration::MAX;
    for _ in 0..PATIENT_SUBMITS {
        let begin = Instant::now();
        serving.jobs().submit_job(request.clone()).await.unwrap();
        shortest = shortest.min(begin.elapsed());
    }
    let mut left = 0;
    for n in 0..HASTY_SUBMITS {
        // Clients leave before, while and after their job is stored.
        let patience = shortest.mul_f64((n % 50) as f64 / 50.0);
        left += u64::from(timeout(patience, serving.jobs().submit_job(request.clone())).await.is_err());
    }
    let mut unequal = vec![String::new()];
    // Changes that have begun end soon, and their lines follow.
    for _ in 0..100 {
        sleep(Duration::from_millis(100)).await;
        let (jobs, logged) = (jobs(&serving).await, logged_jobs(&serving));
        // More jobs than clients that stayed: some were stored although their client left.
        let stored = jobs.len() as u64 - PATIENT_SUBMITS;
        assert!(
            stored > HASTY_SUBMITS - left,
            "{left} of {HASTY_SUBMITS} left, {stored} stored: the times test nothing"
        );
        unequal = jobs.symmetric_difference(&logged).cloned().collect();
        if unequal.is_empty() {
            break;
        }
    }
    assert!(unequal.is_empty(), "{unequal:?}");
}

#[tokio::test]
async fn changes_name_their_object_and_refusals_are_counted() {
    let guarded = Guarded::start().await;
    let mut displays = DisplayServiceClient::new(guarded.serving.channel.clone());
    let create = |id: &str| v1::CreateDisplayRequest { display: Some(small_display(id)) };
    displays.create_display(with_token(&guarded.tokens["admin"], create("lab"))).await.unwrap();
    for _ in 0..20 {
        displays.create_display(with_token(&guarded.tokens["viewer"], create("other"))).await.unwrap_err();
    }
    let changes = lines(&guarded.serving, "audit.jsonl");
    assert_eq!(changes.len(), 1, "{changes:?}");
    for (key, value) in [
        ("caller", "admin"),
        ("address", "127.0.0.1"),
        ("call", "/lightpath.v1.DisplayService/CreateDisplay"),
        ("object", "displays/lab"),
        ("outcome", "OK"),
    ] {
        assert_eq!(changes[0][key], value, "{changes:?}");
    }
    let refused = refusal(&guarded.serving, "/lightpath.v1.DisplayService/CreateDisplay", "PERMISSION_DENIED").await;
    assert_eq!(refused["caller"], "viewer");
    assert!(refused["count"].as_u64().unwrap() <= 20);
}

#[tokio::test]
async fn long_paths_and_other_content_types_do_not_mislead_the_log() {
    let guarded = Guarded::start().await;
    let long = format!("/{}", "x".repeat(10_000));
    for (path, token) in [
        (long.as_str(), ""),
        ("/lightpath.v1.DisplayService/DeleteDisplay", guarded.tokens["viewer"].as_str()),
        ("/lightpath.v1.QueueService/Unknown", guarded.tokens["admin"].as_str()),
    ] {
        let mut stream = TcpStream::connect(guarded.serving.address).await.unwrap();
        let request = format!(
            "POST {path} HTTP/1.1\r\nhost: lab\r\ncontent-type: text/plain\r\nauthorization: Bearer {token}\r\n\
             content-length: 0\r\nconnection: close\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        stream.read_to_end(&mut Vec::new()).await.unwrap();
    }
    for (call, outcome) in [
        ("/lightpath.v1.DisplayService/DeleteDisplay", "INVALID_ARGUMENT"),
        ("unknown path", "UNAUTHENTICATED"),
        ("unknown path", "INVALID_ARGUMENT"),
    ] {
        refusal(&guarded.serving, call, outcome).await;
    }
    let text = fs::read_to_string(guarded.serving.config.data_dir.join("refusals.jsonl")).unwrap();
    assert!(text.len() < 2000 && !text.contains("xxx"), "{text}");
    assert!(lines(&guarded.serving, "audit.jsonl").is_empty());
}
