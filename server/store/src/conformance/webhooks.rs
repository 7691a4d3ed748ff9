//! Tests of webhooks: which events they learn of, and what becomes of a delivery.

use super::*;
use crate::{Attempt, WEBHOOKS_MAX, WebhookChange};
use lightpath_domain::reason::PreconditionReason;
use lightpath_domain::rollout::RolloutPlan;
use lightpath_domain::webhook::{Delivery, Webhook, WebhookEvent, WebhookSecret, WebhookUrl};
use serde_json::{Value, json};

fn webhook(id: &str, events: &[WebhookEvent], display: Option<&str>) -> Webhook {
    Webhook {
        id: id.to_owned(),
        url: WebhookUrl::parse("https://hooks.example/lightpath").unwrap(),
        events: events.to_vec(),
        display: display.map(str::to_owned),
        caller: "ada".to_owned(),
        create_time_ms: 1,
        revision: 1,
    }
}

/// Adds a webhook that learns of everything.
pub(super) async fn add_webhook(store: &Store, id: &str) {
    add(store, &webhook(id, &[], None)).await;
}

async fn add(store: &Store, webhook: &Webhook) {
    store.create_webhook(webhook, &WebhookSecret::generate().unwrap()).await.unwrap();
}

/// All deliveries of a webhook, the oldest first.
async fn deliveries(store: &Store, id: &str) -> Vec<Delivery> {
    let mut found = store.deliveries(id, None, 1000).await.unwrap();
    found.reverse();
    found
}

async fn events(store: &Store, id: &str) -> Vec<&'static str> {
    deliveries(store, id).await.iter().map(|delivery| delivery.event.as_str()).collect()
}

fn subject(delivery: &Delivery) -> Value {
    serde_json::from_str(&delivery.subject).unwrap()
}

/// Ends jobs in every way, and moves a kernel in every way.
async fn live(store: &Store) {
    for (request, end) in [("good", 0), ("bad", 1), ("cancelled", 2)] {
        submit(store, request, 10).await;
        let (_, lease) = store.claim(10, LEASE_MS, "w").await.unwrap().unwrap();
        match end {
            0 => drop(store.finish(&lease, result(), JobEffect::None, 11).await.unwrap()),
            1 => drop(store.fail(&lease, JobError { retryable: false, ..io_error() }, None, 12).await.unwrap()),
            _ => {
                store.cancel(&lease.job, 13).await.unwrap();
                store.end_cancelled(&lease, 13).await.unwrap();
            }
        }
    }
    record(store, 4).await;
    for version in 1..=3 {
        store.add_kernel_version(&key(), new_version(version), 20).await.unwrap();
    }
    store.promote(&key(), promotion(1, None), 21).await.unwrap();
    let plan = |version| RolloutPlan {
        version,
        share: 0.1,
        group: String::new(),
        failed_share_max: 0.1,
        devices_min: 1,
        self_test_loss_max: None,
        cause: cause("a better lens"),
        overridden: Vec::new(),
    };
    store.start_rollout(&key(), plan(2), Some(1), 22).await.unwrap();
    store.halt_rollout(&key(), 1, &cause("blurred"), 23).await.unwrap();
    store.start_rollout(&key(), plan(3), Some(1), 24).await.unwrap();
    store.complete_rollout(&key(), 2, None, "ada", 25).await.unwrap();
}

#[tokio::test]
async fn webhook_learns_of_every_event_or_of_those_that_it_asks_for() {
    let (store, _folder) = store().await;
    store.create_display(&display("other"), 1).await.unwrap();
    add(&store, &webhook("all", &[], None)).await;
    add(&store, &webhook("some", &[WebhookEvent::JobFailed, WebhookEvent::KernelActivated], Some("lab"))).await;
    add(&store, &webhook("elsewhere", &[], Some("other"))).await;
    live(&store).await;
    assert_eq!(
        events(&store, "all").await,
        [
            "job.succeeded",
            "job.failed",
            "job.cancelled",
            "kernel.version_created",
            "kernel.version_created",
            "kernel.version_created",
            "kernel.activated",
            "rollout.halted",
            "rollout.completed",
            "kernel.activated",
        ]
    );
    assert_eq!(events(&store, "some").await, ["job.failed", "kernel.activated", "kernel.activated"]);
    assert_eq!(events(&store, "elsewhere").await, Vec::<&str>::new());

    let all = deliveries(&store, "all").await;
    let failed = subject(&all[1]);
    assert_eq!((&failed["display"], &failed["error"]), (&json!("displays/lab"), &json!("the disk failed")));
    let job = store.job(failed["job"].as_str().unwrap().strip_prefix("jobs/").unwrap()).await.unwrap();
    assert_eq!((job.request_id.as_str(), all[1].time_ms), ("bad", 12));
    let activated = subject(&all[9]);
    assert_eq!(activated["kernel"], "displays/lab/kernels/515nm-150mm");
    assert_eq!((&activated["version"], &activated["previousVersion"]), (&json!(3), &json!(1)));
    assert_eq!(subject(&all[7])["rollout"], "displays/lab/kernels/515nm-150mm/rollouts/1");
    let mut ids: Vec<_> = all.iter().map(|delivery| &delivery.id).collect();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), all.len());
}

#[tokio::test]
async fn delivery_waits_until_it_is_accepted_or_given_up() {
    let (store, _folder) = store().await;
    add(&store, &webhook("ci", &[WebhookEvent::JobSucceeded], None)).await;
    assert_eq!(store.next_attempt_ms().await.unwrap(), None);
    let first = store.test_webhook("ci", "ada", 5).await.unwrap().id;
    let second = store.test_webhook("ci", "ada", 6).await.unwrap().id;
    assert_eq!((store.next_attempt_ms().await.unwrap(), store.deliveries_waiting().await.unwrap()), (Some(5), 2));
    assert_eq!(store.webhooks_due(4).await.unwrap(), Vec::<String>::new());
    assert_eq!(store.webhooks_due(6).await.unwrap(), ["ci"]);

    // The first fails and waits, so the second comes before it.
    let due = store.due_delivery("ci", 7).await.unwrap().unwrap();
    assert_eq!((&due.id, due.attempts), (&first, 0));
    store.note_attempt(&due, Attempt::RetryAt(50), "HTTP 503").await.unwrap();
    let due = store.due_delivery("ci", 7).await.unwrap().unwrap();
    assert_eq!(due.id, second);
    store.note_attempt(&due, Attempt::Accepted, "HTTP 204").await.unwrap();
    assert_eq!(store.due_delivery("ci", 49).await.unwrap(), None);
    assert_eq!(store.next_attempt_ms().await.unwrap(), Some(50));
    let due = store.due_delivery("ci", 50).await.unwrap().unwrap();
    assert_eq!((&due.id, due.attempts, due.answer.as_str()), (&first, 1, "HTTP 503"));
    store.note_attempt(&due, Attempt::GivenUp, "HTTP 500").await.unwrap();
    assert_eq!((store.next_attempt_ms().await.unwrap(), store.deliveries_waiting().await.unwrap()), (None, 0));
    let ended: Vec<_> = deliveries(&store, "ci").await.iter().map(|d| (d.attempts, d.delivered)).collect();
    assert_eq!(ended, [(2, false), (1, true)]);
}

#[tokio::test]
async fn only_the_latest_ended_deliveries_stay_and_all_that_wait() {
    let (store, _folder) = store().await;
    add(&store, &webhook("ci", &[], None)).await;
    let waiting = store.test_webhook("ci", "ada", 5).await.unwrap().id;
    let due = store.due_delivery("ci", 5).await.unwrap().unwrap();
    store.note_attempt(&due, Attempt::RetryAt(1_000_000), "HTTP 503").await.unwrap();
    for n in 0..103 {
        store.test_webhook("ci", "ada", 6 + n).await.unwrap();
        let due = store.due_delivery("ci", 999).await.unwrap().unwrap();
        store.note_attempt(&due, Attempt::Accepted, "HTTP 204").await.unwrap();
    }
    let kept = deliveries(&store, "ci").await;
    assert_eq!((kept.len(), &kept[0].id, kept[1].time_ms), (101, &waiting, 9));
}

#[tokio::test]
async fn webhooks_are_kept_apart_and_limited() {
    let (store, database) = store().await;
    let ci = webhook("ci", &[WebhookEvent::JobFailed], Some("lab"));
    let secret = WebhookSecret::generate().unwrap();
    store.create_webhook(&ci, &secret).await.unwrap();
    let again = store.create_webhook(&ci, &secret).await;
    assert!(matches!(again, Err(StoreError::AlreadyExists { .. })), "{again:?}");
    let elsewhere = store.create_webhook(&webhook("a", &[], Some("none")), &secret).await;
    assert!(matches!(elsewhere, Err(StoreError::NotFound { .. })), "{elsewhere:?}");
    store.close().await;
    let store = database.open().await;
    assert_eq!(store.webhook("ci").await.unwrap(), ci);
    assert_eq!(store.webhook_secret("ci").await.unwrap(), secret);
    for n in 1..WEBHOOKS_MAX {
        add(&store, &webhook(&format!("n{n}"), &[], None)).await;
    }
    let full = store.create_webhook(&webhook("more", &[], None), &secret).await;
    assert!(matches!(full, Err(StoreError::Precondition { reason: PreconditionReason::WebhooksFull, .. })), "{full:?}");
    store.test_webhook("ci", "ada", 5).await.unwrap();
    store.delete_webhook("ci").await.unwrap();
    assert_eq!(store.deliveries_waiting().await.unwrap(), 0);
    for missing in [
        store.delete_webhook("ci").await.map(drop),
        store.webhook("ci").await.map(drop),
        store.webhook_secret("ci").await.map(drop),
        store.test_webhook("ci", "ada", 6).await.map(drop),
        store.deliveries("ci", None, 9).await.map(drop),
    ] {
        assert!(matches!(&missing, Err(StoreError::NotFound { resource }) if resource == "webhooks/ci"), "{missing:?}");
    }
    assert_eq!(store.webhooks().await.unwrap().len() as u32, WEBHOOKS_MAX - 1);
}

#[tokio::test]
async fn a_webhook_changes_only_from_the_revision_that_was_seen() {
    let (store, _folder) = store().await;
    add(&store, &webhook("ci", &[WebhookEvent::JobFailed], Some("lab"))).await;
    let change = WebhookChange { events: Some(Vec::new()), display: Some(None), ..Default::default() };
    let changed = store.update_webhook("ci", change.clone(), 1).await.unwrap();
    assert_eq!(changed, Webhook { revision: 2, ..webhook("ci", &[], None) });
    assert_eq!(store.update_webhook("ci", change, 2).await.unwrap(), changed, "the same again changes nothing");
    let url = WebhookUrl::parse("https://hooks.example/other").unwrap();
    let change = WebhookChange { url: Some(url), ..Default::default() };
    let late = store.update_webhook("ci", change.clone(), 1).await;
    assert!(matches!(late, Err(StoreError::Aborted { .. })), "{late:?}");
    assert_eq!(store.update_webhook("ci", change, 2).await.unwrap(), store.webhook("ci").await.unwrap());
    let lost = WebhookChange { display: Some(Some("nowhere".to_owned())), ..Default::default() };
    assert!(matches!(store.update_webhook("ci", lost, 3).await, Err(StoreError::NotFound { .. })));
}
