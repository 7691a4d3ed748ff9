//! Tests of the states of jobs, their leases and their events.

use super::*;
use crate::{ClaimLimits, JobFilter, QueueCounts, Submitted};
use lightpath_domain::ability::Abilities;
use lightpath_domain::job::{CaptureResult, JobState, LearnResult, LearnedKernel, Lease, Progress};

pub(super) async fn claim(store: &Store, now_ms: i64) -> Option<(String, Lease)> {
    store.claim(now_ms, LEASE_MS, "w").await.unwrap().map(|(job, lease)| (job.id, lease))
}

#[tokio::test]
async fn repeated_request_returns_the_same_job() {
    let (store, _folder) = store().await;
    let (job, made) = store.submit(&new_job("r", 1), 10, QUEUE_LIMIT).await.unwrap();
    assert_eq!((made, job.state, job.revision), (Submitted::New, JobState::Queued, 1));
    let (again, made) = store.submit(&new_job("r", 1), 20, QUEUE_LIMIT).await.unwrap();
    assert_eq!((made, &again), (Submitted::Existing, &job));
    assert!(matches!(store.submit(&new_job("r", 2), 20, QUEUE_LIMIT).await, Err(StoreError::AlreadyExists { .. })));
    let urgent = NewJob { priority: -1, ..new_job("r", 1) };
    assert!(matches!(store.submit(&urgent, 20, QUEUE_LIMIT).await, Err(StoreError::AlreadyExists { .. })));
    assert_eq!(store.job_by_request("", "r").await.unwrap(), Some(job.clone()));
    assert_eq!(store.job(&job.id).await.unwrap(), job);
    assert!(matches!(store.job("nothing").await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn full_queue_refuses_new_jobs_but_returns_existing_ones() {
    let (store, _folder) = store().await;
    store.submit(&new_job("a", 1), 1, 2).await.unwrap();
    store.submit(&new_job("b", 1), 1, 2).await.unwrap();
    assert!(matches!(store.submit(&new_job("c", 1), 1, 2).await, Err(StoreError::QueueFull { limit: 2 })));
    assert_eq!(store.submit(&new_job("b", 1), 1, 2).await.unwrap().1, Submitted::Existing);
    claim(&store, 2).await.unwrap();
    store.submit(&new_job("c", 1), 3, 2).await.unwrap();
    let mut lost = new_job("d", 1);
    if let JobSpec::SimulateCapture(spec) = &mut lost.spec {
        spec.display = "nowhere".to_owned();
    }
    assert!(matches!(store.submit(&lost, 3, QUEUE_LIMIT).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn claims_are_ordered_by_priority_then_due_time_then_age() {
    let (store, _folder) = store().await;
    let first = submit(&store, "first", 10).await;
    let second = submit(&store, "second", 10).await;
    let earlier = submit(&store, "earlier", 5).await;
    let urgent = NewJob { priority: -5, ..new_job("urgent", 1) };
    let urgent = store.submit(&urgent, 20, QUEUE_LIMIT).await.unwrap().0.id;
    assert_eq!(store.next_run_time(4, &Abilities::default()).await.unwrap(), Some(5));
    assert_eq!(claim(&store, 4).await, None, "nothing is due yet");
    for expected in [urgent, earlier, first, second] {
        assert_eq!(claim(&store, 20).await.unwrap().0, expected);
    }
    assert_eq!(claim(&store, 20).await, None);
    assert_eq!(store.next_run_time(4, &Abilities::default()).await.unwrap(), None);
}

#[tokio::test]
async fn interrupted_job_keeps_its_place() {
    let (store, _folder) = store().await;
    let first = submit(&store, "first", 10).await;
    submit(&store, "second", 11).await;
    let (job, lease) = claim(&store, 20).await.unwrap();
    assert_eq!(job, first);
    store.release(&lease, 21).await.unwrap();
    assert_eq!(claim(&store, 22).await.unwrap().0, first, "after a drain");
    store.recover_orphans(None, 23).await.unwrap();
    assert_eq!(claim(&store, 24).await.unwrap().0, first, "after a server death");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_stores_claim_every_job_once() {
    let (store, database) = store().await;
    for n in 0..40 {
        submit(&store, &format!("r{n}"), 1).await;
    }
    let other = database.open().await;
    let run = |store: Store| {
        tokio::spawn(async move {
            let mut claimed = Vec::new();
            while let Some((id, lease)) = claim(&store, 2).await {
                store.finish(&lease, result(), JobEffect::None, 3).await.unwrap();
                claimed.push(id);
            }
            claimed
        })
    };
    let (a, b, c) = tokio::join!(run(store.clone()), run(other.clone()), run(store.clone()));
    let mut claimed = [a.unwrap(), b.unwrap(), c.unwrap()].concat();
    claimed.sort();
    claimed.dedup();
    assert_eq!(claimed.len(), 40);
    assert_eq!(other.queue_counts().await.unwrap(), QueueCounts { succeeded: 40, ..QueueCounts::default() });
}

#[tokio::test]
async fn lost_lease_changes_nothing() {
    let (store, _folder) = store().await;
    let id = submit(&store, "r", 1).await;
    let (_, stale) = claim(&store, 10).await.unwrap();
    let late = 10 + LEASE_MS;
    assert_eq!(store.expire_leases(late - 1).await.unwrap(), []);
    assert_eq!(store.expire_leases(late).await.unwrap().len(), 1);
    let (_, fresh) = claim(&store, late).await.unwrap();
    assert_eq!(fresh.attempt, 2);

    let forged = Lease { lease_id: stale.lease_id.clone(), ..fresh.clone() };
    for bad in [&stale, &forged] {
        let now = late + 1;
        let progress = Progress { stage: "x".into(), step: 1, steps_total: 2, loss: Some(0.5), eta_s: None };
        assert!(matches!(store.heartbeat(bad, now, LEASE_MS).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.progress(bad, &progress).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.checkpoint(bad, &digest(5)).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.finish(bad, result(), JobEffect::None, now).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.fail(bad, io_error(), None, now).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.release(bad, now).await, Err(StoreError::LeaseLost)));
        assert!(matches!(store.end_cancelled(bad, now).await, Err(StoreError::LeaseLost)));
    }
    let job = store.job(&id).await.unwrap();
    assert_eq!((job.state, job.attempt, job.progress, job.checkpoint), (JobState::Running, 2, None, None));

    let done = store.finish(&fresh, result(), JobEffect::None, late + 2).await.unwrap();
    assert_eq!((done.state, done.result), (JobState::Succeeded, Some(result())));
    assert!(
        matches!(store.finish(&fresh, result(), JobEffect::None, late + 3).await, Err(StoreError::LeaseLost)),
        "a job ends only once"
    );
}

#[tokio::test]
async fn heartbeats_keep_a_lease() {
    let (store, _folder) = store().await;
    submit(&store, "r", 1).await;
    let (_, lease) = claim(&store, 1).await.unwrap();
    let mut now = 1;
    for _ in 0..5 {
        now += LEASE_MS - 1;
        let beat = store.heartbeat(&lease, now, LEASE_MS).await.unwrap();
        assert_eq!((beat.until_ms, beat.cancel_requested), (now + LEASE_MS, false));
        assert_eq!(store.expire_leases(now).await.unwrap(), []);
    }
    store.heartbeat(&lease, now - LEASE_MS / 2, LEASE_MS).await.unwrap();
    assert_eq!(
        store.expire_leases(now + LEASE_MS - 1).await.unwrap(),
        [],
        "a heartbeat that came late shortens no lease"
    );
    store.finish(&lease, result(), JobEffect::None, now).await.unwrap();
}

/// A process that was suspended finds its leases at their ends. It is still the only one that runs its jobs.
#[tokio::test]
async fn lease_is_valid_until_it_is_taken_back() {
    let (store, _folder) = store().await;
    let id = submit(&store, "r", 1).await;
    let (_, lease) = claim(&store, 1).await.unwrap();
    let late = 1 + 5 * LEASE_MS;
    let progress = Progress { stage: "x".into(), step: 1, steps_total: 2, loss: Some(0.5), eta_s: None };
    store.progress(&lease, &progress).await.unwrap();
    store.checkpoint(&lease, &digest(5)).await.unwrap();
    store.heartbeat(&lease, late, LEASE_MS).await.unwrap();
    assert_eq!(store.expire_leases(late + LEASE_MS - 1).await.unwrap(), []);
    assert_eq!(store.expire_leases(late + LEASE_MS).await.unwrap().len(), 1);
    assert!(matches!(store.heartbeat(&lease, late, LEASE_MS).await, Err(StoreError::LeaseLost)));
    let (_, lease) = claim(&store, 2 * late).await.unwrap();
    store.finish(&lease, result(), JobEffect::None, 9 * late).await.unwrap();
    assert_eq!(store.job(&id).await.unwrap().attempt, 2);
}

#[tokio::test]
async fn cancel_ends_a_waiting_job_and_notifies_a_running_job() {
    let (store, _folder) = store().await;
    let waiting = submit(&store, "waiting", 1).await;
    let job = store.cancel(&waiting, 2).await.unwrap();
    assert_eq!((job.state, job.finish_time_ms), (JobState::Cancelled, Some(2)));
    assert!(matches!(store.cancel(&waiting, 3).await, Err(StoreError::Precondition { .. })));

    let mut cancels = store.subscribe_cancels();
    let running = submit(&store, "running", 1).await;
    let (_, lease) = claim(&store, 5).await.unwrap();
    assert!(matches!(store.retry(&running, 6).await, Err(StoreError::Precondition { .. })));
    let job = store.cancel(&running, 6).await.unwrap();
    assert_eq!((job.state, job.cancel_requested), (JobState::Running, true));
    assert_eq!(cancels.try_recv().unwrap(), running);
    assert_eq!(store.cancel(&running, 7).await.unwrap().revision, job.revision, "a second request changes nothing");
    assert!(store.heartbeat(&lease, 8, LEASE_MS).await.unwrap().cancel_requested);
    assert_eq!(store.end_cancelled(&lease, 9).await.unwrap().state, JobState::Cancelled);

    // A cancelled job whose attempt ends without a result is cancelled, whether the attempt fails, is drained or
    // crashes.
    for (request, how) in [("fail", 0), ("drain", 1), ("crash", 2)] {
        let id = submit(&store, request, 10).await;
        let (_, lease) = claim(&store, 10).await.unwrap();
        store.cancel(&id, 11).await.unwrap();
        match how {
            0 => drop(store.fail(&lease, io_error(), Some(12), 12).await.unwrap()),
            1 => drop(store.release(&lease, 12).await.unwrap()),
            _ => drop(store.recover_orphans(None, 12).await.unwrap()),
        }
        assert_eq!(store.job(&id).await.unwrap().state, JobState::Cancelled, "{request}");
    }
    let job = store.retry(&running, 20).await.unwrap();
    assert_eq!((job.state, job.cancel_requested), (JobState::Queued, false));
}

#[tokio::test]
async fn learned_kernel_becomes_a_version_when_its_job_ends() {
    let (store, _folder) = store().await;
    record(&store, 3).await;
    submit(&store, "r", 1).await;
    let (_, lease) = claim(&store, 1).await.unwrap();
    let JobResult::SimulateCapture(CaptureResult { propagation, .. }) = result() else { panic!("another kind") };
    let kernel = LearnedKernel {
        kernel_version: String::new(),
        dataset: "d".to_owned(),
        metrics: Default::default(),
        left_out_pairs: Vec::new(),
        propagation,
    };
    let learned =
        LearnResult { kernels: vec![kernel.clone(), kernel], loss_history: vec![0.5], degree: 0, parts: Vec::new() };
    let learned = JobResult::LearnKernel(learned);
    let far = KernelKey { distance: Distance { nm: 200_000_000 }, ..key() };
    let both = |artifact| JobEffect::Kernels(vec![(key(), new_version(artifact)), (far.clone(), new_version(2))]);
    let missing = store.finish(&lease, learned.clone(), both(99), 2).await;
    assert!(matches!(missing, Err(StoreError::NotFound { .. })));
    let job = store.finish(&lease, learned.clone(), both(1), 2).await.unwrap();
    let Some(JobResult::LearnKernel(result)) = job.result else { panic!("{:?}", job.result) };
    assert_eq!(result.kernels[0].kernel_version, "displays/lab/kernels/515nm-150mm/versions/1");
    assert_eq!(result.kernels[1].kernel_version, "displays/lab/kernels/515nm-200mm/versions/1");
    let again = store.finish(&lease, learned, both(2), 3).await;
    assert!(matches!(again, Err(StoreError::LeaseLost)));
    assert_eq!(store.kernel(&key()).await.unwrap().latest_version, 1, "a lost lease adds no version");
}

#[tokio::test]
async fn lists_are_filtered_and_paged_newest_first() {
    let (store, _folder) = store().await;
    let mut ids = Vec::new();
    for n in 0..5 {
        ids.push(submit(&store, &format!("r{n}"), 1).await);
    }
    ids.reverse();
    let list = |filter: JobFilter, after: Option<String>, limit| {
        let store = store.clone();
        async move {
            let jobs = store.jobs(&filter, after.as_deref(), limit).await.unwrap();
            jobs.into_iter().map(|job| job.id).collect::<Vec<_>>()
        }
    };
    assert_eq!(list(JobFilter::default(), None, 50).await, ids);
    assert_eq!(list(JobFilter::default(), Some(ids[1].clone()), 2).await, ids[2..4]);
    let (running, _) = claim(&store, 2).await.unwrap();
    let running_only =
        JobFilter { state: Some(JobState::Running), display: Some("lab".into()), ..JobFilter::default() };
    assert_eq!(list(running_only, None, 50).await, [running]);
    let oldest_first = JobFilter { oldest_first: true, ..JobFilter::default() };
    assert_eq!(list(oldest_first, Some(ids[3].clone()), 2).await, [ids[2].clone(), ids[1].clone()]);
    let elsewhere = JobFilter { display: Some("elsewhere".into()), ..JobFilter::default() };
    assert!(list(elsewhere, None, 50).await.is_empty());
    let counts = store.queue_counts().await.unwrap();
    assert_eq!((counts.queued, counts.running), (4, 1));
}

#[tokio::test]
async fn lists_are_searched_for_kinds_owners_times_and_texts() {
    let (store, _folder) = store().await;
    let mut ids = Vec::new();
    for (request_id, owner, batch) in [("r-1", "ada", None), ("R-2", "bob", Some("Night")), ("r-3", "ada", None)] {
        let mut new = new_job(request_id, 1);
        new.scheduling.owner = owner.to_owned();
        new.scheduling.batch = batch.map(str::to_owned);
        ids.push(store.submit(&new, 1, QUEUE_LIMIT).await.unwrap().0.id);
    }
    let list = async |filter: JobFilter, after: Option<&str>| {
        let jobs = store.job_summaries(&filter, after, 50).await.unwrap();
        jobs.iter().map(|job| ids.iter().position(|id| *id == job.id).unwrap()).collect::<Vec<_>>()
    };
    let all = JobFilter::default;
    let word = |word: &str| Some(word.to_owned());
    assert_eq!(list(JobFilter { kind: word("simulate_capture"), ..all() }, None).await, [2, 1, 0]);
    assert_eq!(list(JobFilter { kind: word("learn_kernel"), ..all() }, None).await, [0; 0]);
    assert_eq!(list(JobFilter { owner: word("ada"), ..all() }, None).await, [2, 0]);
    assert_eq!(list(JobFilter { owner: word("ada"), ..all() }, Some(&ids[2])).await, [0]);
    assert_eq!(list(JobFilter { owner: word("ada"), oldest_first: true, ..all() }, None).await, [0, 2]);
    for (text, found) in [("r-2", vec![1]), ("NIGHT", vec![1]), ("ada", vec![2, 0]), (&ids[2], vec![2]), ("%", vec![])]
    {
        assert_eq!(list(JobFilter { text: word(text), ..all() }, None).await, found, "{text}");
    }
    let both = JobFilter { text: word("r-"), owner: word("bob"), state: Some(JobState::Queued), ..all() };
    assert_eq!(list(both, None).await, [1]);
    let time_ms = i64::from_str_radix(&ids[0].replace('-', "")[..12], 16).unwrap();
    assert_eq!(list(JobFilter { since_ms: Some(time_ms), ..all() }, None).await, [2, 1, 0]);
    assert_eq!(list(JobFilter { since_ms: Some(time_ms + 60_000), ..all() }, None).await, [0; 0]);
    assert_eq!(list(JobFilter { since_ms: Some(i64::MIN), ..all() }, None).await, [2, 1, 0]);
    for (prefix, found) in [(&ids[1][..], vec![1]), ("0", vec![2, 1, 0]), ("g", vec![]), (&ids[0][..9], vec![2, 1, 0])]
    {
        let filter = JobFilter { id_prefix: word(prefix), ..all() };
        assert_eq!(list(filter, None).await, found, "{prefix}");
    }
    let with_state = JobFilter { id_prefix: word("0"), state: Some(JobState::Running), ..all() };
    assert_eq!(list(with_state, None).await, [0; 0]);
    let one = store.job_summary(&ids[1]).await.unwrap();
    assert_eq!(
        (one.kind.as_str(), one.batch.as_deref(), one.display.as_str()),
        ("simulate_capture", Some("Night"), "lab")
    );
    assert_eq!(list(all(), None).await, [2, 1, 0]);
}

#[tokio::test]
async fn job_changes_are_recorded_as_events_and_announced() {
    let (store, _folder) = store().await;
    let mut changes = store.subscribe_job_changes();
    let claimable = store.claimable();
    let id = submit(&store, "r", 1).await;
    claimable.notified().await;
    let (_, lease) = claim(&store, 2).await.unwrap();
    let progress = Progress { stage: "optimize".into(), step: 3, steps_total: 9, loss: Some(0.25), eta_s: Some(1.5) };
    store.progress(&lease, &progress).await.unwrap();
    assert_eq!(store.job(&id).await.unwrap().progress, Some(progress));
    store.fail(&lease, io_error(), Some(5), 4).await.unwrap();
    claimable.notified().await;
    let mut announced = 0;
    while let Ok(announced_id) = changes.try_recv() {
        assert_eq!(announced_id, id);
        announced += 1;
    }
    assert_eq!(announced, 4);
    let events = store.events(&id, None, 50).await.unwrap();
    let recorded: Vec<_> = events.iter().map(|event| (event.time_ms, event.attempt, event.message.as_str())).collect();
    assert_eq!(
        recorded,
        [(1, 0, "queued"), (2, 1, "attempt 1 started by w"), (4, 1, "IO: the disk failed; queued again")]
    );
    assert_eq!(store.events(&id, Some(events[0].sequence), 1).await.unwrap(), events[1..2]);
    assert!(matches!(store.events("nothing", None, 50).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn dropped_submit_leaves_no_partial_write() {
    let (store, _folder) = store().await;
    for n in 0..20 {
        let new = new_job(&format!("r{n}"), 1);
        let mut submit = std::pin::pin!(store.submit(&new, 1, QUEUE_LIMIT));
        // The future is polled once and then dropped, as a server drops the call of a client that disconnected.
        let _ = futures::poll!(submit.as_mut());
    }
    let (last, _) = store.submit(&new_job("last", 1), 1, QUEUE_LIMIT).await.unwrap();
    let jobs = store.jobs(&JobFilter::default(), None, 50).await.unwrap();
    assert!(jobs.contains(&last));
    for job in jobs {
        assert_eq!(store.events(&job.id, None, 50).await.unwrap().len(), 1, "every job has its event");
    }
}

/// Workers try to write after other workers got their jobs. Number of such workers: 50, or `LIGHTPATH_ZOMBIES`.
#[tokio::test]
async fn zombies_write_nothing() {
    let zombies = std::env::var("LIGHTPATH_ZOMBIES").map_or(50, |zombies| zombies.parse().unwrap());
    let (store, database) = store().await;
    let elsewhere = database.open().await;
    let mut rejected = 0;
    for n in 0..zombies {
        let now = 10 + i64::from(n) * 3 * LEASE_MS;
        let new = needs::needy_job(&format!("r{n}"), if n % 2 == 0 { "" } else { "gpu" }, 100);
        let id = store.submit(&new, now, QUEUE_LIMIT).await.unwrap().0.id;
        let claimant = || needs::able("gpu", 100);
        let claim_at = async |store: &Store, now_ms| {
            let claimed = store.claim_within(ClaimLimits::default(), now_ms, LEASE_MS, &claimant()).await.unwrap();
            claimed.map(|(job, lease)| (job.id, lease)).unwrap()
        };
        let (_, zombie) = claim_at(&elsewhere, now).await;
        let late = now + LEASE_MS;
        assert_eq!(store.expire_leases(late).await.unwrap().len(), 1);
        // A job that returned to the queue still needs what it needed.
        let without = needs::able("", u64::MAX);
        let elsewhere_too = store.claim_within(ClaimLimits::default(), late, LEASE_MS, &without).await.unwrap();
        assert_eq!(elsewhere_too.as_ref().map(|(job, _)| &job.id), (n % 2 == 0).then_some(&id));
        if let Some((_, lease)) = elsewhere_too {
            store.release(&lease, late).await.unwrap();
        }
        let (rescued, fresh) = claim_at(&store, late).await;
        assert_eq!((&rescued, fresh.attempt), (&id, 3 - n % 2));
        let saved = store.checkpoint(&fresh, &digest(n)).await.unwrap();
        let before = store.job(&id).await.unwrap();
        let progress = Progress { stage: "x".into(), step: 1, steps_total: 2, loss: Some(0.5), eta_s: None };
        let writes = [
            elsewhere.heartbeat(&zombie, late, LEASE_MS).await.map(drop),
            elsewhere.progress(&zombie, &progress).await,
            elsewhere.checkpoint(&zombie, &digest(1_000_000)).await.map(drop),
            elsewhere.finish(&zombie, result(), JobEffect::None, late).await.map(drop),
            elsewhere.fail(&zombie, io_error(), None, late).await.map(drop),
            elsewhere.postpone(&zombie, io_error(), late, late).await.map(drop),
            elsewhere.release(&zombie, late).await.map(drop),
            elsewhere.end_cancelled(&zombie, late).await.map(drop),
        ];
        for write in writes {
            assert!(matches!(write, Err(StoreError::LeaseLost)), "{write:?}");
            rejected += 1;
        }
        assert_eq!((saved, store.job(&id).await.unwrap()), (None, before), "nothing has changed");
        store.finish(&fresh, result(), JobEffect::None, late + 1).await.unwrap();
    }
    assert_eq!(rejected, 8 * zombies);
}

#[tokio::test]
async fn job_of_a_claim_whose_answer_was_lost_returns_to_the_queue() {
    let (store, _database) = store().await;
    let id = submit(&store, "r", 5).await;
    let claimant = crate::Claimant::named("w");
    store.claim_within(ClaimLimits::default(), 6, LEASE_MS, &claimant).await.unwrap().unwrap();
    store.abandon_claim("another lease", 7).await.unwrap();
    assert_eq!(store.job(&id).await.unwrap().state, JobState::Running);
    store.abandon_claim(&claimant.lease_id, 7).await.unwrap();
    store.abandon_claim(&claimant.lease_id, 8).await.unwrap();
    let (job, _) = store.claim(9, LEASE_MS, "w").await.unwrap().unwrap();
    assert_eq!((job.id, job.attempt, job.error), (id, 2, None));
}
