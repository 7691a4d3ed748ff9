//! Calls over HTTP that happen once (`idempotency-key`) or only if nothing has changed (`if-match`), and the file of a
//! version without its digest.

use crate::http::json;
use crate::kernels::KERNEL;
use crate::manifests::{Answer, curl, serving};
use crate::serving::Serving;
use lightpath_artifacts::digest_of;
use serde_json::{Value, json};

async fn post(serving: &Serving, path: &str, body: &Value, headers: &[&str]) -> (u16, Value) {
    let body = body.to_string();
    let mut arguments = json(&body).to_vec();
    headers.iter().for_each(|header| arguments.extend(["--header", *header]));
    let answer = curl(serving, path, &arguments).await;
    (answer.status, serde_json::from_slice(&answer.body).unwrap())
}

async fn if_match(serving: &Serving) -> String {
    let answer = curl(serving, &format!("/v1/{KERNEL}"), &[]).await;
    format!("if-match: {}", answer.field("etag").unwrap())
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_version_becomes_active_only_if_nothing_has_changed_since() {
    let serving = serving().await;
    let promote = async |version: u32, header: &str| {
        post(&serving, &format!("/v1/{KERNEL}:promote"), &json!({ "version": version, "reason": "" }), &[header]).await
    };
    let seen = if_match(&serving).await;
    let (status, kernel) = promote(2, &seen).await;
    assert_eq!((status, &kernel["activeVersion"]), (200, &2.into()), "{kernel}");
    // Somebody who saw the first version does not undo that.
    let (status, problem) = promote(3, &seen).await;
    assert_eq!((status, &problem["reason"], &problem["status"]), (412, &"CHANGED".into(), &412.into()), "{problem}");
    assert_eq!(promote(3, "if-match: \"other\"").await.0, 412);
    assert_eq!(promote(3, &if_match(&serving).await).await.1["activeVersion"], 3);

    // Another field of the same resource is given by the same header, and may be repeated, but not contradicted.
    let alias = |expected: Value| {
        let mut body = json!({ "alias": "night", "version": 1 });
        body.as_object_mut().unwrap().extend(expected.as_object().unwrap().clone());
        body
    };
    let (path, seen) = (format!("/v1/{KERNEL}:setAlias"), if_match(&serving).await);
    let (status, problem) = post(&serving, &path, &alias(json!({ "expectedVersion": 2 })), &[&seen]).await;
    assert_eq!((status, &problem["fields"][0]["fix"]), (400, &"give one of them".into()), "{problem}");
    let (status, kernel) = post(&serving, &path, &alias(json!({ "expectedVersion": 0 })), &[&seen]).await;
    assert_eq!((status, &kernel["aliases"]["night"]), (200, &1.into()), "{kernel}");
    let (status, problem) = post(&serving, "/v1/queue:pause", &json!({}), &["if-match: \"a\""]).await;
    assert_eq!((status, &problem["fields"][0]["field"]), (400, &"the header if-match".into()), "{problem}");
}

#[tokio::test]
async fn a_display_is_patched_only_if_nothing_has_changed_since() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let seen = curl(&serving, "/v1/displays/lab", &[]).await.field("etag").unwrap().to_owned();
    let patch = async |query: &str, body: Value, header: &str| {
        let body = body.to_string();
        let mut arguments = json(&body).to_vec();
        arguments.extend(["--request", "PATCH", "--header", header]);
        let answer = curl(&serving, &format!("/v1/displays/lab{query}"), &arguments).await;
        (answer.status, serde_json::from_slice::<Value>(&answer.body).unwrap())
    };
    let (status, display) = patch("", json!({ "notes": "new lamp" }), &format!("if-match: {seen}")).await;
    assert_eq!((status, &display["notes"], &display["revision"]), (200, &"new lamp".into(), &2.into()), "{display}");
    let (status, problem) = patch("", json!({ "notes": "old" }), &format!("if-match: {seen}")).await;
    assert_eq!((status, &problem["reason"]), (412, &"CHANGED".into()), "{problem}");
    let (status, display) = patch("?updateMask=notes&expectedRevision=2", json!({}), "x: y").await;
    assert_eq!((status, &display["notes"]), (200, &"".into()), "{display}");
    let (status, problem) = patch("?updateMask=notes", json!({ "name": "displays/other" }), "x: y").await;
    assert_eq!((status, &problem["fields"][0]["field"]), (400, &"display.name".into()), "{problem}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_repeated_request_imports_one_version_and_starts_one_rollout() {
    let serving = serving().await;
    let read = async |path: String| serde_json::from_slice::<Value>(&curl(&serving, &path, &[]).await.body).unwrap();
    let kernel = read(format!("/v1/{KERNEL}")).await;
    let version = read(format!("/v1/{KERNEL}/versions/1")).await;
    let display = KERNEL.split_once("/kernels/").unwrap().0;
    let import = async |body: &Value, header: &str| {
        post(&serving, &format!("/v1/{display}/kernels:import"), body, &[header]).await
    };
    let body = json!({ "place": kernel["place"], "artifact": version["artifact"] });
    let (status, first) = import(&body, "idempotency-key: once").await;
    assert_eq!(status, 200, "{first}");
    assert_eq!(import(&body, "idempotency-key: once").await, (200, first.clone()));
    let (status, other) = import(&body, "idempotency-key: twice").await;
    assert_eq!(
        (status, other["version"].as_u64()),
        (200, first["version"].as_u64().map(|version| version + 1)),
        "{other}"
    );
    let changed = json!({ "place": kernel["place"], "artifact": version["artifact"], "fromAnotherDisplay": true });
    let (status, problem) = import(&changed, "idempotency-key: once").await;
    assert_eq!(status, 409, "{problem}");

    let start = async |header: &str| {
        let body = json!({ "version": 3, "share": 0.1, "reason": "try", "force": true });
        post(&serving, &format!("/v1/{KERNEL}/rollouts"), &body, &[header]).await
    };
    let (status, rollout) = start("idempotency-key: roll").await;
    assert_eq!(status, 200, "{rollout}");
    assert_eq!(start("idempotency-key: roll").await.1["name"], rollout["name"]);
    let (status, problem) = start("idempotency-key: again").await;
    assert_eq!(status, 400, "another rollout is running: {problem}");
    assert_eq!(start("idempotency-key: once").await.0, 409, "the id is that of an import");
}

#[tokio::test]
async fn a_repeated_idempotency_key_submits_one_job() {
    let serving = Serving::start().await;
    let job = crate::jobs::submit_long(&serving).await;
    let (_, job) = crate::http::get(&serving, &format!("/v1/{}", job.name)).await;
    let job: Value = serde_json::from_str(&job).unwrap();
    let submit = async |extra: Value, headers: &[&str]| {
        let mut body = json!({ "spec": job["spec"] });
        body.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
        post(&serving, "/v1/jobs", &body, headers).await
    };
    let key = "idempotency-key: \"night-3\"";
    let (status, first) = submit(json!({}), &[key]).await;
    assert_eq!((status, &first["requestId"]), (200, &"night-3".into()), "{first}");
    assert_eq!(submit(json!({ "requestId": "night-3" }), &["idempotency-key: night-3"]).await.1["name"], first["name"]);
    let (status, problem) = submit(json!({ "requestId": "night-4" }), &[key]).await;
    assert_eq!((status, &problem["fields"][0]["field"]), (400, &"request_id".into()), "{problem}");
    let (status, problem) = post(&serving, "/v1/queue:pause", &json!({}), &[key]).await;
    assert_eq!((status, &problem["fields"][0]["field"]), (400, &"the header idempotency-key".into()), "{problem}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_file_of_a_version_needs_no_digest() {
    let serving = serving().await;
    let get = async |path: &str, more: &[&str]| -> Answer {
        curl(&serving, &format!("/v1/{KERNEL}/versions/{path}"), more).await
    };
    let whole = get("2/file?format=compact", &[]).await;
    let digest = format!("\"{}\"", digest_of(&whole.body));
    assert_eq!((whole.status, whole.field("etag")), (200, Some(digest.as_str())));
    assert_ne!(get("1/file?format=compact", &[]).await.body, whole.body);
    let range = get("2/file?format=compact", &["--range", "100-119", "--header", &format!("if-range: {digest}")]).await;
    assert_eq!((range.status, &range.body[..]), (206, &whole.body[100..120]));
    let behind = get("2/file?format=compact", &["--range", "100000000-"]).await;
    let problem: Value = serde_json::from_slice(&behind.body).unwrap();
    let size = format!("bytes */{}", whole.body.len());
    assert_eq!((behind.status, behind.field("content-range")), (416, Some(size.as_str())), "{problem}");
    assert_eq!(problem["reason"], "OUT_OF_RANGE");
    let known = get("2/file?format=compact", &["--header", &format!("if-none-match: {digest}")]).await;
    assert_eq!((known.status, known.body.len()), (304, 0));
    for (path, status, field) in [
        ("2/file?format=png", 400, "format"),
        ("x/file", 400, "version"),
        ("2/file?form=compact", 400, "the query"),
        ("9/file", 404, ""),
    ] {
        let answer = get(path, &[]).await;
        let problem: Value = serde_json::from_slice(&answer.body).unwrap();
        assert_eq!((answer.status, problem["fields"][0]["field"].as_str().unwrap_or("")), (status, field), "{problem}");
    }
}
