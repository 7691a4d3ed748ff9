use crate::material::{declare, hologram, request, target};
use crate::process::{Daemon, lightpath};
use lightpath::v1;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::timeout;

/// Time within which a delivery arrives, also on a machine with much other work. The first repetition comes after 5 s.
const ARRIVES_WITHIN: Duration = Duration::from_secs(60);

/// An address that receives deliveries.
struct Receiver {
    listener: TcpListener,
    url: String,
}

/// A delivery whose sender waits for the answer.
struct Received {
    stream: TcpStream,
    id: String,
    event: String,
    data: Value,
}

impl Receiver {
    async fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        Self { listener, url }
    }

    async fn next(&self) -> Received {
        let (mut stream, _) = timeout(ARRIVES_WITHIN, self.listener.accept()).await.unwrap().unwrap();
        let mut text = String::new();
        loop {
            let mut bytes = [0; 4096];
            let count = stream.read(&mut bytes).await.unwrap();
            assert!(count > 0, "{text}");
            text.push_str(std::str::from_utf8(&bytes[..count]).unwrap());
            let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
            let field = |name: &str| {
                let line = head.lines().find(|line| line.to_ascii_lowercase().starts_with(name)).unwrap();
                line.split_once(": ").unwrap().1.to_owned()
            };
            if body.len() == field("content-length:").parse::<usize>().unwrap() {
                let body: Value = serde_json::from_str(body).unwrap();
                let event = body["type"].as_str().unwrap().to_owned();
                return Received { stream, id: field("webhook-id:"), event, data: body["data"].clone() };
            }
        }
    }

    /// Whether nothing arrives for a while.
    async fn is_quiet(&self) -> bool {
        timeout(Duration::from_millis(500), self.listener.accept()).await.is_err()
    }
}

impl Received {
    async fn answer(mut self, status: &str) {
        let answer = format!("HTTP/1.1 {status}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
        self.stream.write_all(answer.as_bytes()).await.unwrap();
        self.stream.shutdown().await.unwrap();
    }
}

async fn create(daemon: &Daemon, id: &str, url: &str, events: &[&str]) {
    let events = events.iter().map(|&event| event.to_owned()).collect();
    let request = v1::CreateWebhookRequest { id: id.into(), url: url.into(), events, display: String::new() };
    daemon.client.create_webhook(request).await.unwrap();
}

async fn start(data: &Path, origins: &str) -> Daemon {
    Daemon::start(data, &["--webhook-origins", origins, "--compute-threads", "1"]).await
}

#[tokio::test(flavor = "multi_thread")]
async fn webhook_learns_of_jobs_although_server_and_receiver_fail() {
    let (data, receiver) = (TempDir::new().unwrap(), Receiver::start().await);
    let daemon = start(data.path(), &receiver.url).await;
    create(&daemon, "ci", &format!("{}/jobs?team=a", receiver.url), &["job.succeeded", "job.cancelled"]).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let digest = daemon.client.upload_bytes(target(64, 48, 1)).await.unwrap();
    let good = daemon.client.submit(request(hologram("lab", &digest, 3, 1), "good")).await.unwrap();
    daemon.client.wait(&good.name, |_| ()).await.unwrap();
    let first = receiver.next().await;
    assert_eq!((first.event.as_str(), first.data["job"].as_str()), ("job.succeeded", Some(good.name.as_str())));
    let first_id = first.id.clone();
    // The server dies while the receiver thinks, and another job ends meanwhile.
    daemon.client.pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let later = daemon.client.submit(request(hologram("lab", &digest, 3, 2), "later")).await.unwrap();
    daemon.client.cancel_job(v1::CancelJobRequest { name: later.name.clone() }).await.unwrap();
    daemon.kill().await;
    drop(first);
    assert!(receiver.is_quiet().await);

    let daemon = start(data.path(), &receiver.url).await;
    let again = receiver.next().await;
    assert_eq!(again.id, first_id, "the delivery is repeated with its id");
    again.answer("503 Service Unavailable").await;
    let cancelled = receiver.next().await;
    assert_eq!(cancelled.event, "job.cancelled");
    cancelled.answer("204 No Content").await;
    // A redirect could lead anywhere, and is not followed.
    let third = receiver.next().await;
    assert_eq!(third.id, first_id);
    let elsewhere = Receiver::start().await;
    third.answer(&format!("307 Temporary Redirect\r\nlocation: {}/", elsewhere.url)).await;
    let fourth = receiver.next().await;
    assert!(fourth.id == first_id && elsewhere.is_quiet().await);
    fourth.answer("200 OK").await;
    assert!(receiver.is_quiet().await, "what was accepted is not repeated");

    let shown = lightpath(&daemon.url, &["webhook", "show", "ci", "--output", "json"]).await.json();
    let deliveries = shown["deliveries"].as_array().unwrap();
    let seen: BTreeSet<_> = deliveries.iter().map(|delivery| delivery["id"].as_str().unwrap()).collect();
    assert_eq!((deliveries.len(), seen.contains(first_id.as_str())), (2, true), "{shown}");
    assert!(deliveries.iter().all(|delivery| delivery["delivered"] == true), "{shown}");
    daemon.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn receivers_that_hang_delay_no_other_webhook() {
    let (data, prompt, hanging) = (TempDir::new().unwrap(), Receiver::start().await, Receiver::start().await);
    let daemon = start(data.path(), &format!("{},{}", prompt.url, hanging.url)).await;
    let events = ["job.cancelled"];
    for n in 0..31 {
        // The listener accepts no connection, so nothing ever answers.
        create(&daemon, &format!("hanging-{n}"), &hanging.url, &events).await;
    }
    create(&daemon, "prompt", &prompt.url, &events).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let digest = daemon.client.upload_bytes(target(64, 48, 1)).await.unwrap();
    daemon.client.pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    for seed in 1..=3 {
        let name = format!("job-{seed}");
        let job = daemon.client.submit(request(hologram("lab", &digest, 3, seed), &name)).await.unwrap();
        let cancelled = Instant::now();
        daemon.client.cancel_job(v1::CancelJobRequest { name: job.name }).await.unwrap();
        prompt.next().await.answer("204 No Content").await;
        assert!(cancelled.elapsed() < Duration::from_secs(5), "it took {:?}", cancelled.elapsed());
    }
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn webhooks_go_only_where_the_setting_allows() {
    let (data, receiver) = (TempDir::new().unwrap(), Receiver::start().await);
    let daemon = start(data.path(), &receiver.url).await;
    for url in ["http://169.254.169.254/latest", &receiver.url.replace("127.0.0.1", "localhost"), "http://127.0.0.1/"] {
        let refused = lightpath(&daemon.url, &["webhook", "create", "ci", url]).await;
        refused.assert_refused(1, &["webhook_origins", &receiver.url]);
    }
    let forged = lightpath(&daemon.url, &["webhook", "create", "ci", &format!("{}@evil.example/", receiver.url)]).await;
    forged.assert_refused(1, &["url is", "but must be an address"]);
    let wrong = lightpath(&daemon.url, &["webhook", "create", "ci", &receiver.url, "--event", "job.done"]).await;
    wrong.assert_refused(1, &["events[0]", "job.succeeded, job.failed"]);
    let created = lightpath(&daemon.url, &["webhook", "create", "ci", &receiver.url]).await.ok();
    assert!(created.contains("secret: whsec_"), "{created}");
    let command = ["webhook", "test", "ci"];
    let (tested, ()) = tokio::join!(lightpath(&daemon.url, &command), async {
        let received = receiver.next().await;
        assert_eq!(received.event, "webhook.test");
        received.answer("202 Accepted").await;
    });
    assert_eq!(tested.ok(), "accepted: HTTP 202\n");
    let listed = lightpath(&daemon.url, &["webhook", "list", "--output", "json"]).await.ok();
    assert!(listed.contains("webhooks/ci") && !listed.contains("whsec_"), "{listed}");
    daemon.stop().await;

    // The operator takes the permission away: the webhook stays, and gets nothing.
    let daemon = Daemon::start(data.path(), &[]).await;
    let tested = lightpath(&daemon.url, &command).await.ok();
    assert!(tested.contains("not accepted: the setting webhook_origins does not allow"), "{tested}");
    assert!(receiver.is_quiet().await);
    lightpath(&daemon.url, &["webhook", "delete", "ci"]).await.ok();
    let unknown = lightpath(&daemon.url, &command).await;
    unknown.assert_refused(1, &["webhooks/ci does not exist"]);
    daemon.stop().await;
}
