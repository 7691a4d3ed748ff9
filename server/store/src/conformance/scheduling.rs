//! Tests of when and for which owner jobs run.

use super::*;
use crate::{BatchProgress, ClaimLimits, JobFilter, OwnerQueue, Pause, QueueCounts, QueueLimits, Submitted};
use lightpath_domain::ability::Abilities;
use lightpath_domain::job::{Job, JobSpec, JobState, Lease, Progress};
use lightpath_domain::reason::PreconditionReason;

async fn submit_with(store: &Store, request_id: &str, change: impl FnOnce(&mut NewJob)) -> Result<Job, StoreError> {
    let mut new = new_job(request_id, 1);
    change(&mut new);
    Ok(store.submit(&new, 10, QUEUE_LIMIT).await?.0)
}

async fn submit_for(store: &Store, owner: &str, request_id: &str) -> String {
    submit_with(store, request_id, |new| new.scheduling.owner = owner.to_owned()).await.unwrap().id
}

async fn submit_after(store: &Store, request_id: &str, after: &[&str]) -> Result<Job, StoreError> {
    submit_with(store, request_id, |new| new.scheduling.after = after.iter().map(ToString::to_string).collect()).await
}

async fn claim(store: &Store, now_ms: i64) -> Option<(Job, Lease)> {
    store.claim(now_ms, LEASE_MS, "w").await.unwrap()
}

async fn claimed_owner(store: &Store, limits: ClaimLimits, now_ms: i64) -> Option<(String, Lease)> {
    let claimed = store.claim_within(limits, now_ms, LEASE_MS, &crate::Claimant::named("w")).await.unwrap();
    claimed.map(|(job, lease)| (job.scheduling.owner, lease))
}

#[tokio::test]
async fn delayed_job_waits_without_blocking_others() {
    let (store, _folder) = store().await;
    let late = submit_with(&store, "late", |new| {
        new.priority = -9;
        new.scheduling.not_before_ms = Some(500);
    });
    let late = late.await.unwrap();
    assert_eq!(late.run_time_ms, 500);
    let now = submit_with(&store, "now", |_| ()).await.unwrap();
    assert_eq!(claim(&store, 20).await.unwrap().0.id, now.id);
    assert_eq!(
        (claim(&store, 499).await, store.next_run_time(499, &Abilities::default()).await.unwrap()),
        (None, Some(500))
    );
    assert_eq!(claim(&store, 500).await.unwrap().0.id, late.id);
    let past = submit_with(&store, "past", |new| new.scheduling.not_before_ms = Some(3)).await.unwrap();
    assert_eq!(past.run_time_ms, 10, "a start time in the past means now");
}

#[tokio::test]
async fn jobs_from_a_time_when_the_clock_was_ahead_start_when_it_is_right_again() {
    const DAY_MS: i64 = 24 * 3_600_000;
    let (store, _folder) = store().await;
    let ahead_ms = 1000 + DAY_MS;
    let submit_ahead = async |owner: &str, request_id: &str, not_before_ms| {
        let mut new = new_job(request_id, 1);
        (new.scheduling.owner, new.scheduling.not_before_ms) = (owner.to_owned(), not_before_ms);
        store.submit(&new, ahead_ms, QUEUE_LIMIT).await.unwrap().0.id
    };
    let ran = submit_ahead("ada", "ran", None).await;
    let (job, lease) = claim(&store, ahead_ms).await.unwrap();
    assert_eq!(job.id, ran);
    store.finish(&lease, result(), JobEffect::None, ahead_ms).await.unwrap();
    submit_ahead("ada", "failed", None).await;
    let (failed, lease) = claim(&store, ahead_ms).await.unwrap();
    store.fail(&lease, io_error(), Some(ahead_ms + 60), ahead_ms).await.unwrap();
    let now = submit_ahead("ada", "now", None).await;
    let later = submit_ahead("ada", "later", Some(ahead_ms + 5)).await;

    // The clock is set right.
    assert!(claim(&store, 1000).await.is_none());
    assert_eq!(store.pull_forward(1000, 300).await.unwrap(), 2);
    assert_eq!(store.pull_forward(1000, 300).await.unwrap(), 0);
    let run_time = async |id: &str| store.job(id).await.unwrap().run_time_ms;
    assert_eq!((run_time(&now).await, run_time(&failed.id).await, run_time(&later).await), (1000, 1300, ahead_ms + 5));

    // Ada's starts in the future do not cost her turns.
    let mut owners = Vec::new();
    for n in 0..2 {
        submit_with(&store, &format!("bob{n}"), |new| new.scheduling.owner = "bob".to_owned()).await.unwrap();
    }
    for now_ms in 1000..1003 {
        let (owner, lease) = claimed_owner(&store, ClaimLimits::default(), now_ms).await.unwrap();
        store.finish(&lease, result(), JobEffect::None, now_ms).await.unwrap();
        owners.push(owner);
    }
    assert_eq!(owners.iter().filter(|owner| *owner == "ada").count(), 1);
    assert_ne!(owners[2], "ada", "{owners:?}");
}

#[tokio::test]
async fn owners_take_turns() {
    let (store, _folder) = store().await;
    for n in 0..4 {
        submit_for(&store, "ada", &format!("ada{n}")).await;
    }
    for n in 0..2 {
        submit_for(&store, "bob", &format!("bob{n}")).await;
    }
    submit_for(&store, "cyd", "cyd0").await;
    let mut order = Vec::new();
    for now in 20..27 {
        let (owner, lease) = claimed_owner(&store, ClaimLimits::default(), now).await.unwrap();
        store.finish(&lease, result(), JobEffect::None, now).await.unwrap();
        order.push(owner);
    }
    assert_eq!(order, ["ada", "bob", "cyd", "ada", "bob", "ada", "ada"]);
}

#[tokio::test]
async fn owner_with_fewer_running_jobs_comes_first_and_limits_count_live_leases() {
    let (store, _folder) = store().await;
    for n in 0..3 {
        submit_for(&store, "ada", &format!("ada{n}")).await;
    }
    let (_, first) = claimed_owner(&store, ClaimLimits::default(), 20).await.unwrap();
    claimed_owner(&store, ClaimLimits::default(), 21).await.unwrap();
    submit_for(&store, "bob", "bob0").await;
    submit_for(&store, "bob", "bob1").await;
    let two = ClaimLimits { per_owner: 2, per_display: 0 };
    // Without a limit, only the order tells.
    assert_eq!(claimed_owner(&store, ClaimLimits::default(), 22).await.unwrap().0, "bob");
    assert_eq!(claimed_owner(&store, two, 23).await.unwrap().0, "bob");
    assert!(claimed_owner(&store, two, 24).await.is_none(), "both owners have two running jobs");
    store.finish(&first, result(), JobEffect::None, 25).await.unwrap();
    assert_eq!(claimed_owner(&store, two, 26).await.unwrap().0, "ada");

    submit_with(&store, "more", |_| ()).await.unwrap();
    let four_on_a_display = ClaimLimits { per_owner: 0, per_display: 4 };
    assert!(claimed_owner(&store, four_on_a_display, 27).await.is_none());
    // Expired leases no longer count towards the limits: a dead worker does not block others for ever.
    store.expire_leases(22 + LEASE_MS).await.unwrap();
    assert!(claimed_owner(&store, four_on_a_display, 23 + LEASE_MS).await.is_some());
    assert_eq!(
        store.owner_queues().await.unwrap().iter().map(|queue| queue.running).sum::<u64>(),
        store.queue_counts().await.unwrap().running
    );
}

#[tokio::test]
async fn owner_can_fill_only_part_of_the_queue() {
    let (store, _folder) = store().await;
    let limits = QueueLimits { queued: 3, queued_per_owner: 1, stored_bytes_per_owner: 0 };
    let submit = |request_id: &str, owner: &str| {
        let mut new = new_job(request_id, 1);
        new.scheduling.owner = owner.to_owned();
        let store = store.clone();
        async move { store.submit(&new, 1, limits).await.map(|(job, _)| job.id) }
    };
    submit("a", "ada").await.unwrap();
    assert!(matches!(submit("b", "ada").await, Err(StoreError::OwnerQueueFull { limit: 1 })));
    submit("c", "bob").await.unwrap();
    submit("d", "").await.unwrap();
    assert!(matches!(submit("e", "cyd").await, Err(StoreError::QueueFull { limit: 3 })));
    let one_waiting = |owner: &str| OwnerQueue { owner: owner.to_owned(), queued: 1, running: 0 };
    assert_eq!(store.owner_queues().await.unwrap(), [one_waiting(""), one_waiting("ada"), one_waiting("bob")]);
}

#[tokio::test]
async fn queue_age_counts_only_due_jobs() {
    let (store, _folder) = store().await;
    let ages = async |now_ms: i64| -> Vec<u128> {
        store.oldest_due(now_ms).await.unwrap().into_iter().map(|(_, age)| age.as_millis()).collect()
    };
    let none = [0; JobSpec::KINDS.len()];
    // Ages of the kinds in their order; captures are the third.
    let capture = |age_ms: u128| {
        let mut ages = none;
        ages[2] = age_ms;
        ages
    };
    assert_eq!(ages(50).await, none, "no job waits");
    submit_with(&store, "later", |new| new.scheduling.not_before_ms = Some(500)).await.unwrap();
    let first = submit_with(&store, "first", |_| ()).await.unwrap();
    let created_ms = first.create_time_ms;
    assert_eq!(ages(created_ms + 30).await, capture(30), "only simulated captures wait");
    assert_eq!(claim(&store, created_ms + 31).await.unwrap().0.id, first.id);
    assert_eq!(ages(499).await, none, "running and delayed jobs do not count");
    assert_eq!(ages(510).await, capture(10));
}

#[tokio::test]
async fn paused_jobs_do_not_start() {
    let (store, _folder) = store().await;
    store.create_display(&display("other"), 1).await.unwrap();
    submit_with(&store, "lab", |_| ()).await.unwrap();
    let other = submit_with(&store, "other", |new| {
        if let JobSpec::SimulateCapture(spec) = &mut new.spec {
            spec.display = "other".to_owned();
        }
    });
    let other = other.await.unwrap();
    store.pause(Some("lab"), "a lamp is out", 12).await.unwrap();
    store.pause(Some("lab"), "a lamp is in the post", 13).await.unwrap();
    let pause = Pause { display: Some("lab".to_owned()), time_ms: 12, reason: "a lamp is in the post".to_owned() };
    assert_eq!(store.pauses().await.unwrap(), [pause]);
    let (job, lease) = claim(&store, 20).await.unwrap();
    assert_eq!((job.id, claim(&store, 21).await), (other.id, None));
    store.release(&lease, 22).await.unwrap();
    store.pause(None, "", 23).await.unwrap();
    assert_eq!(claim(&store, 24).await, None);
    let claimable = store.claimable();
    store.resume(None).await.unwrap();
    claimable.notified().await;
    assert!(claim(&store, 25).await.is_some());
    store.resume(Some("lab")).await.unwrap();
    assert!(claim(&store, 26).await.is_some());
    assert!(matches!(
        store.resume(Some("lab")).await,
        Err(StoreError::Precondition { reason: PreconditionReason::NotPaused, .. })
    ));
    assert!(matches!(store.pause(Some("nowhere"), "", 1).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn at_most_one_job_with_a_unique_key_is_active() {
    let (store, _folder) = store().await;
    let key = |new: &mut NewJob| new.scheduling.unique_key = Some("calibrate".to_owned());
    let first = submit_with(&store, "first", key).await.unwrap();
    assert!(matches!(submit_with(&store, "second", key).await, Err(StoreError::AlreadyExists { .. })));
    assert_eq!(
        submit_with(&store, "first", key).await.unwrap().id,
        first.id,
        "a repeated request returns the same job"
    );
    let (_, lease) = claim(&store, 20).await.unwrap();
    assert!(matches!(submit_with(&store, "second", key).await, Err(StoreError::AlreadyExists { .. })));
    store.fail(&lease, io_error(), None, 21).await.unwrap();
    let second = submit_with(&store, "second", key).await.unwrap();
    assert!(matches!(
        store.retry(&first.id, 22).await,
        Err(StoreError::Precondition { reason: PreconditionReason::NotUnique, .. })
    ));
    store.cancel(&second.id, 23).await.unwrap();
    assert_eq!(store.retry(&first.id, 24).await.unwrap().state, JobState::Queued);
}

/// The keys and requests of one owner neither block those of another nor reveal the owner's jobs.
#[tokio::test]
async fn request_ids_and_unique_keys_belong_to_their_owner() {
    let (store, _folder) = store().await;
    let new = |owner: &str, request_id: &str, seed| {
        let mut new = new_job(request_id, seed);
        new.scheduling.owner = owner.to_owned();
        new.scheduling.unique_key = Some("calibrate".to_owned());
        new
    };
    let ada = store.submit(&new("ada", "r", 1), 10, QUEUE_LIMIT).await.unwrap().0;
    // Another owner uses the same request id with other content, and the same key.
    let (bob, made) = store.submit(&new("bob", "r", 2), 11, QUEUE_LIMIT).await.unwrap();
    assert_eq!((made, bob.id == ada.id), (Submitted::New, false));
    assert_eq!(store.job_by_request("bob", "r").await.unwrap(), Some(bob.clone()));
    assert_eq!(store.job_by_request("cyd", "r").await.unwrap(), None);
    for (owner, own) in [("ada", &ada), ("bob", &bob)] {
        let refused = store.submit(&new(owner, "other", 1), 12, QUEUE_LIMIT).await.unwrap_err().to_string();
        assert!(refused.contains(&own.id), "{refused}");
        let refused = store.submit(&new(owner, "r", 3), 12, QUEUE_LIMIT).await.unwrap_err().to_string();
        assert!(refused.contains(&own.id), "{refused}");
    }
    store.cancel(&ada.id, 13).await.unwrap();
    assert_eq!(store.retry(&ada.id, 14).await.unwrap().state, JobState::Queued, "only bob has a job with this key");
}

#[tokio::test]
async fn jobs_run_after_their_dependencies() {
    let (store, _folder) = store().await;
    let [a, b] = [submit(&store, "a", 1).await, submit(&store, "b", 2).await];
    let c = submit_after(&store, "c", &[&a, &b]).await.unwrap();
    let d = submit_after(&store, "d", &[&c.id]).await.unwrap();
    assert_eq!((c.waiting_for, d.waiting_for), (2, 1));
    assert!(matches!(submit_after(&store, "e", &["nothing"]).await, Err(StoreError::NotFound { .. })));
    assert_eq!(submit_after(&store, "c", &[&a, &b]).await.unwrap().id, c.id);
    assert!(matches!(submit_after(&store, "c", &[&a]).await, Err(StoreError::AlreadyExists { .. })));
    let (_, first) = claim(&store, 20).await.unwrap();
    let (_, second) = claim(&store, 20).await.unwrap();
    assert_eq!(claim(&store, 20).await, None);
    store.finish(&second, result(), JobEffect::None, 21).await.unwrap();
    assert_eq!((store.job(&c.id).await.unwrap().waiting_for, claim(&store, 21).await), (1, None));
    store.finish(&first, result(), JobEffect::None, 22).await.unwrap();
    for expected in [&c.id, &d.id] {
        let (job, lease) = claim(&store, 23).await.unwrap();
        assert_eq!((&job.id, job.waiting_for), (expected, 0));
        assert_eq!(claim(&store, 23).await, None);
        store.finish(&lease, result(), JobEffect::None, 24).await.unwrap();
    }
    let late = submit_after(&store, "late", &[&a]).await.unwrap();
    assert_eq!(late.waiting_for, 0, "the dependency has succeeded already");
}

#[tokio::test]
async fn dependents_of_a_failed_job_fail_and_can_be_retried_in_order() {
    let (store, _folder) = store().await;
    let a = submit(&store, "a", 1).await;
    let b = submit_after(&store, "b", &[&a]).await.unwrap().id;
    let c = submit_after(&store, "c", &[&b]).await.unwrap().id;
    let (_, lease) = claim(&store, 20).await.unwrap();
    store.fail(&lease, io_error(), None, 21).await.unwrap();
    for id in [&b, &c] {
        let job = store.job(id).await.unwrap();
        assert_eq!((job.state, job.error.unwrap().reason.as_str()), (JobState::Failed, "DEPENDENCY_FAILED"));
    }
    assert!(matches!(submit_after(&store, "d", &[&a]).await, Err(StoreError::Precondition { .. })));
    assert!(matches!(
        store.retry(&b, 22).await,
        Err(StoreError::Precondition { reason: PreconditionReason::DependencyEnded, .. })
    ));
    store.retry(&a, 23).await.unwrap();
    assert_eq!(store.retry(&b, 24).await.unwrap().waiting_for, 1);
    let (job, lease) = claim(&store, 25).await.unwrap();
    assert_eq!(job.id, a);
    store.finish(&lease, result(), JobEffect::None, 26).await.unwrap();
    assert_eq!(claim(&store, 27).await.unwrap().0.id, b);
    // Cancelling a waiting job has the same effect.
    store.retry(&c, 28).await.unwrap();
    let d = submit_after(&store, "d", &[&c]).await.unwrap().id;
    store.cancel(&c, 29).await.unwrap();
    assert_eq!(store.job(&d).await.unwrap().state, JobState::Failed);
}

#[tokio::test]
async fn batch_progress_averages_its_jobs() {
    let (store, _folder) = store().await;
    for n in 0..4 {
        submit_with(&store, &format!("r{n}"), |new| new.scheduling.batch = Some("night".to_owned())).await.unwrap();
    }
    submit_with(&store, "alone", |_| ()).await.unwrap();
    let (_, lease) = claim(&store, 20).await.unwrap();
    store.finish(&lease, result(), JobEffect::None, 21).await.unwrap();
    let (_, lease) = claim(&store, 22).await.unwrap();
    let progress = Progress { stage: "x".into(), step: 5, steps_total: 10, loss: Some(0.5), eta_s: None };
    store.progress(&lease, &progress).await.unwrap();
    let jobs = QueueCounts { queued: 2, running: 1, succeeded: 1, ..QueueCounts::default() };
    let expected = BatchProgress { jobs, done: 1.5 / 4.0 };
    assert_eq!(store.batch("night").await.unwrap(), expected);
    assert!(matches!(store.batch("day").await, Err(StoreError::NotFound { .. })));
    let filter = JobFilter { batch: Some("night".to_owned()), ..JobFilter::default() };
    assert_eq!(store.jobs(&filter, None, 50).await.unwrap().len(), 4);
}
