//! Tests of the small pictures that running holograms show.

use crate::access::{Guarded, create_token};
use crate::jobs::{optimize, picture, submit, watch_to_end};
use crate::manifests::curl;
use crate::serving::Serving;
use lightpath_artifacts::digest_of;
use lightpath_domain::access::Role;
use lightpath_media::pictures::picture_size;
use lightpath_proto::v1::{self, HologramMethod, OptimizeHologram, job_spec::Kind};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_running_hologram_shows_what_it_has_reached() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    // Adam takes all of its steps, so the job runs for longer than the time before its first picture.
    let spec = OptimizeHologram { method: HologramMethod::Adam as i32, subframes: Some(24), ..optimize(&target) };
    let job = submit(&serving, Kind::OptimizeHologram(spec), "").await.unwrap();
    let path = format!("/v1/{}/picture", job.name);
    let mut changes =
        serving.jobs().watch_job(v1::WatchJobRequest { name: job.name.clone() }).await.unwrap().into_inner();
    let first = loop {
        let answer = curl(&serving, &path, &[]).await;
        if answer.status == 200 {
            break answer;
        }
        assert_eq!((answer.status, answer.body.len()), (204, 0), "{}", answer.text());
        assert!(changes.message().await.unwrap().is_some(), "the job ended without a picture");
    };
    assert_eq!(first.field("content-type"), Some("image/png"));
    assert_eq!(first.field("cache-control"), Some("private, no-cache"));
    let (width_px, height_px) = picture_size(&first.body).unwrap();
    assert!(width_px <= 320 && height_px <= 320 && first.body.len() < 100_000);

    serving.jobs().cancel_job(v1::CancelJobRequest { name: job.name.clone() }).await.unwrap();
    watch_to_end(&serving, &job.name).await;
    let ended = curl(&serving, &path, &["--header", &format!("if-none-match: {}", first.field("etag").unwrap())]).await;
    assert_eq!(ended.status, 204, "the job has ended");
    let unknown = curl(&serving, "/v1/jobs/none/picture", &[]).await;
    assert!(unknown.status == 404 && unknown.text().contains("jobs/none"), "{}", unknown.text());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn tokens_for_other_displays_see_no_picture() {
    let guarded = Guarded::start().await;
    let (serving, admin) = (&guarded.serving, format!("authorization: Bearer {}", guarded.tokens["admin"]));
    let send = async |verb: &str, path: &str, kind: &str, body: &str| {
        let kind = format!("content-type: {kind}");
        let more = ["--request", verb, "--header", &admin, "--header", &kind, "--data-binary", body];
        let answer = curl(serving, path, &more).await;
        assert_eq!(answer.status, 200, "{}", answer.text());
        serde_json::from_slice::<serde_json::Value>(&answer.body).unwrap()
    };
    for display in ["lab", "other"] {
        let body = format!(
            r#"{{"name": "displays/{display}", "modulator": {{"widthPx": 32, "heightPx": 24, "pixelPitchXM": 8e-6}}, "wavelengthsM": [515e-9]}}"#
        );
        send("POST", "/v1/displays", "application/json", &body).await;
    }
    let (bytes, file) = (picture(), serving.config.data_dir.join("picture.png"));
    std::fs::write(&file, &bytes).unwrap();
    let (target, body) = (digest_of(&bytes), format!("@{}", file.display()));
    send("PUT", &format!("/v1/artifacts/{target}/upload"), "application/octet-stream", &body).await;
    let planes = format!(r#"[{{"place": {{"distanceM": 0.05}}, "target": "{target}"}}]"#);
    let spec = format!(r#"{{"spec": {{"optimizeHologram": {{"display": "displays/lab", "planes": {planes}}}}}}}"#);
    let job = send("POST", "/v1/jobs", "application/json", &spec).await;
    let path = format!("/v1/{}/picture", job["name"].as_str().unwrap());
    let store = guarded.store().await;
    for (display, expected) in [("lab", [200, 204].as_slice()), ("other", &[404])] {
        let token = create_token(&store, display, Role::Viewer, &[display.to_owned()], None).await;
        let answer = curl(serving, &path, &["--header", &format!("authorization: Bearer {token}")]).await;
        assert!(expected.contains(&answer.status), "{display}: {} {}", answer.status, answer.text());
    }
}
