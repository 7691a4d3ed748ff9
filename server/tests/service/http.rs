//! Plain HTTP on the same port.

use crate::serving::Serving;
use serde_json::Value;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// Status and body of a GET over HTTP/1.1.
async fn get(serving: &Serving, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(serving.address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    let (head, body) = answer.split_once("\r\n\r\n").unwrap();
    (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
}

#[tokio::test]
async fn health_and_metrics_answer() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    assert_eq!(get(&serving, "/healthz").await, (200, "serving\n".into()));
    let (code, metrics) = get(&serving, "/metrics").await;
    assert_eq!(code, 200);
    for line in [
        "lightpath_queue_depth{kind=\"optimize_hologram\",state=\"queued\"} 0",
        "lightpath_requests_total{method=\"/lightpath.v1.DisplayService/CreateDisplay\",code=\"Ok\"}",
        "lightpath_build_info",
    ] {
        assert!(metrics.contains(line), "{line} in {metrics}");
    }
}

#[tokio::test]
async fn jobs_come_as_protobuf_json() {
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
        assert_eq!((actual, &body["error"]["status"]), (code, &Value::from(status)), "{path}: {body}");
    }
}
