//! Tests of HTTP/1.1 on the port that also serves gRPC.

use crate::manifests::{Answer, curl};
use crate::serving::Serving;
use lightpath_proto::v1::kernel_service_client::KernelServiceClient;
use serde_json::Value;
use std::time::Duration;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// Status and body of a GET over HTTP/1.1.
pub(crate) async fn get(serving: &Serving, path: &str) -> (u16, String) {
    let answer = answer(serving, path).await;
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
}

/// The whole answer to a GET over HTTP/1.1.
pub(crate) async fn answer(serving: &Serving, path: &str) -> String {
    let mut stream = TcpStream::connect(serving.address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}

#[tokio::test]
async fn health_and_metrics_answer() {
    let serving = Serving::start().await;
    serving.display("never-fetched").await;
    assert_eq!(get(&serving, "/healthz").await, (200, "serving\n".into()));
    let (code, metrics) = get(&serving, "/metrics").await;
    assert_eq!(code, 200);
    for line in [
        "lightpath_queue_depth{kind=\"optimize_hologram\",state=\"queued\"} 0",
        "lightpath_requests_total{method=\"/lightpath.v1.DisplayService/CreateDisplay\",code=\"Ok\"}",
        "lightpath_build_info",
        // Counters exist before their first event.
        "lightpath_jobs_ended_total{kind=\"report_kernel\",state=\"failed\"} 0",
        "lightpath_leases_lost_total{cause=\"server_died\"}",
        "lightpath_requests_total{method=\"/lightpath.v1.KernelService/RollbackKernel\",code=\"Ok\"}",
        "lightpath_kernel_fetches_total{display=\"never-fetched\",code=\"Ok\"} 0",
        "lightpath_collected_bytes_total",
    ] {
        assert!(metrics.contains(line), "{line} in {metrics}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn metrics_count_ended_jobs_and_kernel_fetches() {
    let serving = Serving::start().await;
    let job = crate::jobs::submit_long(&serving).await;
    let watch = lightpath_proto::v1::WatchJobRequest { name: job.name.clone() };
    let mut stream = serving.jobs().watch_job(watch).await.unwrap().into_inner();
    while stream.message().await.unwrap().unwrap().progress.is_none() {}
    let cancel = lightpath_proto::v1::CancelJobRequest { name: job.name.clone() };
    serving.jobs().cancel_job(cancel).await.unwrap();
    while stream.message().await.unwrap().is_some() {}
    for display in ["lab", "nowhere"] {
        let kernel = format!("displays/{display}/kernels/515nm-50mm");
        let request = lightpath_proto::v1::FetchKernelRequest { kernel, version: Some(1), ..Default::default() };
        let mut kernels = KernelServiceClient::new(serving.channel.clone());
        assert!(kernels.fetch_kernel(request).await.is_err());
    }
    let (_, metrics) = get(&serving, "/metrics").await;
    for line in [
        "lightpath_jobs_ended_total{kind=\"optimize_hologram\",state=\"cancelled\"}",
        "lightpath_queue_oldest_seconds{kind=\"optimize_hologram\"}",
        "lightpath_hologram_iteration_seconds_count",
        "lightpath_hologram_transform_seconds_count",
        "lightpath_kernel_fetches_total{display=\"lab\",code=\"NotFound\"}",
        "lightpath_artifact_bytes",
    ] {
        assert!(metrics.contains(line), "{line} in {metrics}");
    }
    assert!(!metrics.contains("nowhere"), "requests for unknown displays add no label");
    let value = |name: &str| -> f64 {
        let line = metrics.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.trim().parse().unwrap()
    };
    // The server sees no files of PostgreSQL.
    let has_file = serving.config.database_url.is_none();
    assert_eq!(value("lightpath_wal_bytes ") > 0.0, has_file);
    assert_eq!(value("lightpath_database_bytes ") > 0.0, has_file);
}

#[tokio::test]
async fn jobs_are_served_as_protobuf_json() {
    let serving = Serving::start().await;
    let job = crate::jobs::submit_long(&serving).await;
    let (code, body) = get(&serving, &format!("/v1/{}", job.name)).await;
    let one: Value = serde_json::from_str(&body).unwrap();
    assert_eq!((code, &one["name"]), (200, &Value::from(job.name.as_str())));
    assert_eq!(one["spec"]["optimizeHologram"]["detector"], "DETECTOR_PIXEL");
    let (_, body) = get(&serving, "/v1/jobs?pageSize=1&display=displays/lab").await;
    let list: Value = serde_json::from_str(&body).unwrap();
    assert_eq!(list["jobs"][0]["name"], one["name"]);
}

#[tokio::test]
async fn refusals_are_json() {
    let serving = Serving::start().await;
    for (path, code, status) in [
        ("/v1/jobs/none", 404, "NOT_FOUND"),
        ("/v1/jobs?state=happy", 400, "INVALID_ARGUMENT"),
        ("/v1/jobs?page_size=many", 400, "INVALID_ARGUMENT"),
        ("/v1/jobs?page_token=zz", 400, "INVALID_ARGUMENT"),
        ("/nothing", 404, "NOT_FOUND"),
    ] {
        let (actual, body) = get(&serving, path).await;
        let body: Value = serde_json::from_str(&body).unwrap();
        assert_eq!((actual, &body["grpc_code"]), (code, &Value::from(status)), "{path}: {body}");
        assert_eq!(body["type"], format!("urn:lightpath:error:{}", body["reason"].as_str().unwrap()));
    }
}

#[tokio::test]
async fn problems_name_every_wrong_field_with_its_fix() {
    let serving = Serving::start().await;
    let body = r#"{"batch": "\u0007", "spec": {"optimizeHologram": {"display": "x", "iterations": 20000}}}"#;
    let (answer, problem) = problem(&serving, "/v1/jobs", &json(body)).await;
    assert_eq!((answer.status, &problem["status"], &problem["reason"]), (400, &400.into(), &"INVALID_FIELD".into()));
    assert_eq!(problem["request_id"], answer.field("x-request-id").unwrap());
    let fields = problem["fields"].as_array().unwrap();
    let named: Vec<&str> = fields.iter().map(|wrong| wrong["field"].as_str().unwrap()).collect();
    let spec = ["display", "planes", "iterations"].map(|name| format!("spec.optimize_hologram.{name}"));
    assert_eq!((named[0], &named[1..]), ("batch", &spec.each_ref().map(String::as_str)[..]), "{problem}");
    let detail = problem["detail"].as_str().unwrap();
    for wrong in fields {
        let [what, fix] = ["problem", "fix"].map(|name| wrong[name].as_str().unwrap());
        assert!(!fix.is_empty() && !what.contains(fix), "{wrong}");
        assert!(detail.contains(what) && detail.contains(fix), "{detail}");
    }
}

#[tokio::test]
async fn every_refusal_is_a_problem_with_a_fix() {
    let serving = Serving::start().await;
    for (path, arguments, status, reason) in [
        ("/v1/jobs/none:cancel", &["--request", "POST"][..], 404, "NOT_FOUND"),
        ("/healthz", &["--request", "POST"], 405, "WRONG_VERB"),
        ("/v1/queue", &["--request", "PUT"], 405, "WRONG_VERB"),
        ("/nothing", &[], 404, "NO_SUCH_PATH"),
        ("/page/nothing", &[], 404, "NO_SUCH_PATH"),
        ("/v1/colormaps/blue", &[], 404, "NO_SUCH_PATH"),
        ("/v1/jobs", &["--data", "{}"], 415, "INVALID_FIELD"),
        ("/v1/jobs", &["--header", "origin: http://other.example"], 403, "WRONG_ORIGIN"),
        ("/v1/queue:resume", &["--request", "POST"], 400, "NOT_PAUSED"),
        ("/v1/jobs?page=1", &[], 400, "INVALID_FIELD"),
    ] {
        let (answer, problem) = problem(&serving, path, arguments).await;
        assert_eq!((answer.status, &problem["reason"]), (status, &Value::from(reason)), "{path}: {problem}");
        let fix = if problem["fields"][0].is_null() { &problem["fix"] } else { &problem["fields"][0]["fix"] };
        assert!(fix.as_str().is_some_and(|fix| !fix.is_empty()), "{path}: {problem}");
    }
}

/// The problem that a refused call answers.
async fn problem(serving: &Serving, path: &str, more: &[&str]) -> (Answer, Value) {
    let answer = curl(serving, path, more).await;
    assert_eq!(answer.field("content-type"), Some("application/problem+json"), "{answer:?}");
    let problem = serde_json::from_slice(&answer.body).unwrap();
    (answer, problem)
}

/// Arguments of curl for a request with a JSON body. It is sent without asking first (`Expect: 100-continue`).
pub(crate) fn json(body: &str) -> [&str; 6] {
    ["--header", "content-type: application/json", "--header", "expect:", "--data", body]
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_submitted_watched_and_cancelled_with_curl_alone() {
    let serving = Serving::start().await;
    let example = crate::jobs::submit_long(&serving).await;
    let cancelled = curl(&serving, &format!("/v1/{}:cancel", example.name), &["--request", "POST"]).await;
    assert_eq!(cancelled.status, 200, "{}", cancelled.text());
    let body = format!(r#"{{"spec": {}, "batch": "by hand"}}"#, serde_json::to_string(&example.spec).unwrap());
    let submitted = curl(&serving, "/v1/jobs", &json(&body)).await;
    let job: Value = serde_json::from_slice(&submitted.body).unwrap();
    assert_eq!((submitted.status, &job["batch"]), (200, &Value::from("by hand")), "{job}");
    let path = format!("/v1/{}", job["name"].as_str().unwrap());
    let (watch, cancel) = (format!("{path}:watch"), format!("{path}:cancel"));
    let empty = json("{}");
    let (watched, cancelled) = tokio::join!(curl(&serving, &watch, &[]), curl(&serving, &cancel, &empty));
    assert_eq!(cancelled.status, 200, "{}", cancelled.text());
    assert_eq!(watched.field("content-type"), Some("text/event-stream"));
    // The stream ends with the job.
    let events = watched.text();
    let last = events.lines().filter_map(|line| line.strip_prefix("data: ")).next_back().unwrap();
    assert_eq!(serde_json::from_str::<Value>(last).unwrap()["state"], "STATE_CANCELLED", "{events}");
    let missing = curl(&serving, "/v1/jobs/none:watch", &[]).await;
    assert_eq!(missing.status, 404, "{}", missing.text());
}

#[tokio::test]
async fn an_answer_that_the_client_has_is_not_sent_again() {
    let serving = Serving::start().await;
    let first = curl(&serving, "/v1/displays", &[]).await;
    let etag = first.field("etag").unwrap().to_owned();
    let condition = format!("if-none-match: {etag}");
    let again = curl(&serving, "/v1/displays", &["--header", &condition]).await;
    assert_eq!((again.status, again.body.len()), (304, 0));
    assert_eq!(again.field("etag"), Some(etag.as_str()));
    serving.display("new").await;
    let changed = curl(&serving, "/v1/displays", &["--header", &condition]).await;
    assert_eq!(changed.status, 200);
    assert!(changed.text().contains("displays/new") && changed.field("etag") != Some(etag.as_str()));
    let head = curl(&serving, "/v1/displays", &["--head"]).await;
    assert_eq!((head.status, head.body.len()), (200, 0));
}

#[tokio::test]
async fn requests_in_a_wrong_form_are_refused_with_the_fix() {
    let serving = Serving::start().await;
    let folder = tempfile::tempdir().unwrap();
    let long = folder.path().join("long.json");
    std::fs::write(&long, format!("{{\"reason\": \"{}\"}}", "x".repeat(5 << 20))).unwrap();
    let long = format!("@{}", long.display());
    for (path, more, status, fix) in [
        ("/v1/queue:pause", &["--data", "{}"][..], 415, "must be application/json"),
        ("/v1/queue:pause", &json(&long)[..], 413, "at most 262144 bytes"),
        ("/v1/queue:pause", &json("{\"reason\": 3}")[..], 400, "expected a string"),
        ("/v1/queue:pause", &["--request", "DELETE"][..], 405, "only POST"),
        ("/v1/queue:pause?reason=x", &json("{}")[..], 400, "reason is unknown"),
        ("/v1/jobs?colour=red", &[][..], 400, "known are: pageSize"),
        ("/v1/jobs/1/2", &[][..], 404, "does not exist"),
    ] {
        let answer = curl(&serving, path, more).await;
        assert!(answer.status == status && answer.text().contains(fix), "{path}: {answer:?}");
    }
    let delete = curl(&serving, "/v1/jobs", &["--request", "DELETE"]).await;
    assert_eq!(delete.field("allow"), Some("POST, GET"));
}

/// The server answers when it has read the largest allowed part of a body. A client that has not sent the rest yet must
/// get the answer nevertheless, and may use the connection again.
#[tokio::test]
async fn early_answer_reaches_a_client_that_still_sends() {
    let serving = Serving::start().await;
    let mut connection = TcpStream::connect(serving.address).await.unwrap();
    let body = vec![b' '; 10 << 20];
    let head = format!(
        "POST /v1/queue:pause HTTP/1.1\r\nhost: {}\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n",
        serving.address,
        body.len(),
    );
    connection.write_all(head.as_bytes()).await.unwrap();
    for piece in body.chunks(1 << 20) {
        connection.write_all(piece).await.unwrap();
        // The server has time to answer and to close the connection.
        tokio::time::sleep(Duration::from_millis(30)).await;
    }
    connection.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await.unwrap();
    let mut answers = String::new();
    connection.read_to_string(&mut answers).await.unwrap();
    assert!(answers.starts_with("HTTP/1.1 413 ") && answers.contains("at most 262144 bytes"), "{answers}");
    assert!(answers.ends_with("serving\n"), "{answers}");
}

/// A client that asks first gets a refusal in place of leave to send a body that nobody reads.
#[tokio::test]
async fn refused_client_that_asks_first_is_not_told_to_send() {
    let serving = Serving::start().await;
    let mut connection = TcpStream::connect(serving.address).await.unwrap();
    let head = "POST /v1/nothing HTTP/1.1\r\nhost: localhost\r\ncontent-length: 9\r\nexpect: 100-continue\r\n\r\n";
    connection.write_all(head.as_bytes()).await.unwrap();
    let mut answer = String::new();
    connection.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 404 "), "{answer}");
}
