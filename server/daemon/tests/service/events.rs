//! Tests of the stream of all events, over gRPC and HTTP.

use crate::access::{Guarded, create_token, with_token};
use crate::jobs::submit_long;
use crate::manifests::{curl, curl_until};
use crate::serving::{Serving, small_display};
use lightpath_domain::access::Role;
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::event::Change;
use lightpath_proto::v1::event_service_client::EventServiceClient;
use serde_json::Value;
use std::time::Duration;
use tokio::time::timeout;
use tonic::transport::Channel;
use tonic::{Request, Streaming};

/// Time within which an event arrives, also on a machine with much other work.
const ARRIVES_WITHIN: Duration = Duration::from_secs(20);

async fn watch(channel: &Channel, token: &str, last_event_id: &str) -> Streaming<v1::Event> {
    let request = v1::WatchEventsRequest { last_event_id: last_event_id.to_owned() };
    let request = if token.is_empty() { Request::new(request) } else { with_token(token, request) };
    EventServiceClient::new(channel.clone()).watch_events(request).await.unwrap().into_inner()
}

async fn next(stream: &mut Streaming<v1::Event>) -> (String, Change) {
    let event = timeout(ARRIVES_WITHIN, stream.message()).await.unwrap().unwrap().unwrap();
    (event.id, event.change.unwrap())
}

/// The first event that `wanted` accepts.
async fn until(stream: &mut Streaming<v1::Event>, wanted: impl Fn(&Change) -> bool) -> (String, Change) {
    loop {
        let event = next(stream).await;
        if wanted(&event.1) {
            return event;
        }
    }
}

fn is_job(change: &Change, name: &str, state: v1::job::State) -> bool {
    matches!(change, Change::Job(job) if job.name == name && job.state() == state)
}

#[tokio::test]
async fn changes_arrive_as_events_and_none_is_missed_after_a_pause() {
    let serving = Serving::start().await;
    let mut stream = watch(&serving.channel, "", "").await;
    assert!(matches!(next(&mut stream).await.1, Change::Reset(_)));
    let job = submit_long(&serving).await;
    let display = until(&mut stream, |change| matches!(change, Change::Display(_))).await;
    assert_eq!(display.1, Change::Display(v1::event::Changed { name: "displays/lab".into() }));
    let (seen, _) = until(&mut stream, |change| is_job(change, &job.name, v1::job::State::Running)).await;
    drop(stream);

    let pause = v1::PauseQueueRequest { reason: "laser off".into(), ..Default::default() };
    serving.jobs().pause_queue(pause).await.unwrap();
    serving.jobs().cancel_job(v1::CancelJobRequest { name: job.name.clone() }).await.unwrap();
    let mut resumed = watch(&serving.channel, "", &seen).await;
    let queue = until(&mut resumed, |change| matches!(change, Change::Queue(_) | Change::Reset(_))).await;
    assert!(matches!(queue.1, Change::Queue(_)));
    let mut resumed = watch(&serving.channel, "", &seen).await;
    let first = next(&mut resumed).await;
    assert!(!matches!(first.1, Change::Reset(_)), "{first:?}");
    if !is_job(&first.1, &job.name, v1::job::State::Cancelled) {
        until(&mut resumed, |change| is_job(change, &job.name, v1::job::State::Cancelled)).await;
    }
    for unknown in ["1-1", "x", &format!("{seen}999")] {
        let (_, first) = next(&mut watch(&serving.channel, "", unknown).await).await;
        assert!(matches!(first, Change::Reset(_)), "{unknown}: {first:?}");
    }
}

#[tokio::test]
async fn tokens_for_some_displays_receive_only_events_about_them() {
    let guarded = Guarded::start().await;
    let store = guarded.store().await;
    let viewer = create_token(&store, "wall", Role::Viewer, &["lab".to_owned()], None).await;
    let channel = &guarded.serving.channel;
    let mut stream = watch(channel, &viewer, "").await;
    assert!(matches!(next(&mut stream).await.1, Change::Reset(_)));
    let admin = &guarded.tokens["admin"];
    for id in ["other", "lab"] {
        let request = v1::CreateDisplayRequest { display: Some(small_display(id)) };
        DisplayServiceClient::new(channel.clone()).create_display(with_token(admin, request)).await.unwrap();
    }
    let seen = next(&mut stream).await.1;
    assert_eq!(seen, Change::Display(v1::event::Changed { name: "displays/lab".into() }));
    let request = with_token(&guarded.tokens["firmware"], v1::WatchEventsRequest::default());
    let refused = EventServiceClient::new(channel.clone()).watch_events(request).await.unwrap_err();
    assert_eq!(refused.code(), tonic::Code::PermissionDenied);
}

#[tokio::test]
async fn events_are_server_sent_events_that_resume_by_their_header() {
    let serving = Serving::start().await;
    let first = curl_until(&serving, "/v1/events", &[], |text| text.contains("\n\n")).await;
    assert_eq!(first.field("content-type"), Some("text/event-stream"));
    let text = first.text();
    let id = text.lines().find_map(|line| line.strip_prefix("id: ")).unwrap();
    assert!(text.starts_with("event: reset\ndata: {}\nid: "), "{text}");
    let job = submit_long(&serving).await;
    let header = format!("last-event-id: {id}");
    let has_job = |text: &str| text.split_once("event: job\ndata: ").is_some_and(|(_, rest)| rest.contains('\n'));
    let text = curl_until(&serving, "/v1/events?lastEventId=1-1", &["--header", &header], has_job).await.text();
    assert!(!text.contains("event: reset"), "{text}");
    let (_, rest) = text.split_once("event: job\ndata: ").unwrap();
    let data: Value = serde_json::from_str(rest.lines().next().unwrap()).unwrap();
    assert_eq!(
        (&data["name"], &data["kind"]),
        (&Value::from(job.name), &Value::from("KIND_OPTIMIZE_HOLOGRAM")),
        "{data}"
    );
}

#[tokio::test]
async fn lists_have_summaries_that_are_filtered() {
    let serving = Serving::start().await;
    let job = submit_long(&serving).await;
    let list = async |query: &str| {
        let answer = curl(&serving, &format!("/v1/jobs?view=basic&{query}"), &[]).await;
        (answer.status, serde_json::from_slice::<Value>(&answer.body).unwrap())
    };
    let id = job.name.strip_prefix("jobs/").unwrap();
    for query in
        ["", "kind=optimize_hologram", &format!("text={id}"), "since=2026-01-01T00:00:00Z", "order=oldest_first"]
    {
        let (status, page) = list(query).await;
        assert_eq!((status, &page["summaries"][0]["name"]), (200, &Value::from(job.name.clone())), "{query}: {page}");
        assert_eq!((&page["jobs"], page["summaries"].as_array().unwrap().len()), (&Value::Array(vec![]), 1));
    }
    for query in ["kind=learn_kernel", "text=nothing", "since=2126-01-01T00:00:00Z", "owner=ada"] {
        assert_eq!(list(query).await.1["summaries"], Value::Array(vec![]), "{query}");
    }
    for (query, refusal) in [
        ("kind=magic", "kind is wrong"),
        ("since=yesterday", "since is \"yesterday\""),
        ("order=upwards", "order is wrong"),
    ] {
        let (status, page) = list(query).await;
        let message = page["detail"].as_str().unwrap();
        assert!(status == 400 && message.starts_with(refusal), "{query}: {message}");
    }
}
