//! Tests of the limit on the memory of unfinished requests and answers.

use crate::http::answer;
use crate::serving::{Serving, small_display};
use lightpath_proto::v1;
use std::time::Duration;
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

fn assert_refused(status: &Status) {
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    let details = status.get_error_details();
    assert_eq!(details.error_info().unwrap().reason, "TOO_MUCH_UNDER_WAY");
    assert_eq!(details.retry_info().unwrap().retry_delay, Some(Duration::from_secs(1)));
}

#[tokio::test]
async fn message_beyond_the_memory_limit_is_refused_and_others_are_not() {
    // The limit is enough for three calls, or for one call with a message of 64 KiB.
    let serving = Serving::start_with(|config| config.under_way_mib_max = 0.125).await;
    serving.display("lab").await;
    for _ in 0..3 {
        let display = v1::Display { notes: "x".repeat(100_000), ..small_display("large") };
        let request = v1::CreateDisplayRequest { display: Some(display) };
        assert_refused(&serving.displays().create_display(request).await.unwrap_err());
    }
    serving.display("small").await;
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn answer_beyond_the_memory_limit_is_refused_before_it_begins() {
    let serving = Serving::start_with(|config| config.under_way_mib_max = 1.0).await;
    let digest = serving.upload(&[7; 500_000]).await;
    let request = v1::ReadArtifactRequest { digest: digest.clone(), ..Default::default() };
    let mut stream = serving.artifacts().read_artifact(request).await.unwrap().into_inner();
    assert_refused(&stream.message().await.unwrap_err());
    let part = v1::ReadArtifactRequest { digest, limit_bytes: Some(100_000), ..Default::default() };
    let mut stream = serving.artifacts().read_artifact(part).await.unwrap().into_inner();
    assert_eq!(stream.message().await.unwrap().unwrap().chunk.len(), 100_000);
    serving.stop().await.unwrap();
}

#[tokio::test]
async fn http_call_beyond_the_memory_limit_is_refused_with_json() {
    let serving = Serving::start_with(|config| config.under_way_mib_max = 1e-6).await;
    let refused = answer(&serving, "/v1/jobs").await;
    assert!(refused.starts_with("HTTP/1.1 429 "), "{refused}");
    assert!(refused.contains("retry-after: 1\r\n") && refused.contains("TOO_MUCH_UNDER_WAY"), "{refused}");
    let healthy = answer(&serving, "/healthz").await;
    assert!(healthy.starts_with("HTTP/1.1 200 "), "{healthy}");
    serving.stop().await.unwrap();
}
