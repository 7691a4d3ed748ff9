//! Tests of the dashboard's files and of compressed answers.

use crate::access::Guarded;
use crate::jobs::submit_long;
use crate::manifests::{curl, curl_until};
use crate::serving::Serving;
use serde_json::Value;

#[tokio::test]
async fn page_is_served_without_a_token_under_a_strict_policy() {
    let guarded = Guarded::start().await;
    let index = curl(&guarded.serving, "/", &[]).await;
    assert_eq!((index.status, index.field("content-type")), (200, Some("text/html; charset=utf-8")));
    let policy = index.field("content-security-policy").unwrap();
    assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"), "{policy}");
    assert!(!policy.contains("unsafe") && policy.contains("frame-ancestors 'none'"), "{policy}");
    let text = index.text();
    assert!(!text.contains("style=") && !text.contains("onclick=") && !text.contains("<script>"), "{text}");
    for (file, content_type) in [
        ("main.js", "text/javascript; charset=utf-8"),
        ("pages/jobs.js", "text/javascript; charset=utf-8"),
        ("style.css", "text/css; charset=utf-8"),
        ("icon.svg", "image/svg+xml"),
        ("vendor/uplot/uPlot.esm.js", "text/javascript; charset=utf-8"),
    ] {
        let answer = curl(&guarded.serving, &format!("/page/{file}"), &[]).await;
        assert_eq!((answer.status, answer.field("content-type")), (200, Some(content_type)), "{file}");
        assert_eq!(answer.field("x-content-type-options"), Some("nosniff"));
        let tag = format!("if-none-match: {}", answer.field("etag").unwrap());
        let again = curl(&guarded.serving, &format!("/page/{file}"), &["--header", &tag]).await;
        assert_eq!((again.status, again.body.len()), (304, 0), "{file}");
    }
    for unknown in ["/page/none.js", "/page/../Cargo.toml", "/page/%2e%2e/Cargo.toml", "/page/pages", "/page/"] {
        let answer = curl(&guarded.serving, unknown, &["--path-as-is"]).await;
        assert!([401, 404].contains(&answer.status), "{unknown}: {}", answer.status);
    }
    assert_eq!(curl(&guarded.serving, "/v1/jobs", &[]).await.status, 401, "the data need a token");
}

#[tokio::test]
async fn compressed_answers_have_etags_of_their_own() {
    let serving = Serving::start().await;
    submit_long(&serving).await;
    let plain = curl(&serving, "/openapi.json", &[]).await;
    assert_eq!(plain.field("content-encoding"), None);
    let etag = plain.field("etag").unwrap().trim_matches('"').to_owned();
    let accept = ["--header", "accept-encoding: gzip"];
    let packed = curl(&serving, "/openapi.json", &accept).await;
    assert_eq!(packed.field("content-encoding"), Some("gzip"));
    assert!(packed.body.len() * 3 < plain.body.len(), "{} bytes", packed.body.len());
    let own = format!("\"{etag}-gzip\"");
    assert_eq!(packed.field("etag"), Some(own.as_str()));
    let tag = format!("if-none-match: {own}");
    let again = curl(&serving, "/openapi.json", &[&accept[..], &["--header", &tag]].concat()).await;
    assert_eq!((again.status, again.body.len()), (304, 0));
    let short = curl(&serving, "/healthz", &["--compressed"]).await;
    assert_eq!((short.field("content-encoding"), short.text().as_str()), (None, "serving\n"));
    let events = curl_until(&serving, "/v1/events", &["--compressed"], |_| true).await;
    assert_eq!(events.field("content-encoding"), None, "an event must not wait in a compressor");
    let unpacked = curl(&serving, "/v1/jobs", &["--compressed"]).await;
    assert!(serde_json::from_slice::<Value>(&unpacked.body).unwrap()["jobs"][0]["name"].is_string());
}
