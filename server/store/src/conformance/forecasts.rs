//! Tests of the forecast: it must say what claims will do.

use super::needs::able;
use super::*;
use crate::{ClaimLimits, Place, Process, ProcessKind, forecast};
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_domain::job::Progress;
use std::collections::HashMap;

fn process(labels: &str, workers: u32) -> Process {
    Process {
        id: "here".to_owned(),
        kind: ProcessKind::Both,
        name: String::new(),
        version: String::new(),
        abilities: Abilities { labels: Labels::parse(labels).unwrap(), ..Abilities::default() },
        workers,
        start_time_ms: 0,
        seen_time_ms: 0,
    }
}

/// A job of an owner whose estimate is this time \[s\].
fn job_of(owner: &str, request_id: &str, time_s: f64) -> NewJob {
    let mut new = new_job(request_id, 1);
    new.scheduling.owner = owner.to_owned();
    new.estimate.time_s = time_s;
    new
}

async fn places(store: &Store, processes: &[Process], limits: ClaimLimits, now_ms: i64) -> HashMap<String, Place> {
    forecast(&store.ahead().await.unwrap(), processes, limits, now_ms)
}

#[tokio::test]
async fn one_worker_claims_jobs_in_the_order_and_at_the_times_of_the_forecast() {
    let (store, _database) = store().await;
    for id in ["b", "c"] {
        store.create_display(&display(id), 1).await.unwrap();
    }
    let mut random = 7_u64;
    let mut draw = |below: u64| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) % below
    };
    for n in 0..40 {
        let mut new = job_of(["ada", "bob", "eve"][draw(3) as usize], &n.to_string(), 1.0 + draw(5) as f64);
        new.priority = [0, 0, 0, -1, 5][draw(5) as usize];
        new.scheduling.needs = Labels::parse(["", "", "gpu"][draw(3) as usize]).unwrap();
        new.scheduling.not_before_ms = (draw(4) == 0).then(|| 1000 * draw(60) as i64);
        if let JobSpec::SimulateCapture(spec) = &mut new.spec {
            spec.display = ["lab", "b", "c"][draw(3) as usize].to_owned();
        }
        store.submit(&new, 10 + n, QUEUE_LIMIT).await.unwrap();
    }
    store.pause(Some("c"), "new lamp", 50).await.unwrap();
    let mut now_ms = 100;
    let places = places(&store, &[process("gpu", 1)], ClaimLimits::default(), now_ms).await;
    let mut count = 0;
    loop {
        let claimed =
            store.claim_within(ClaimLimits::default(), now_ms, LEASE_MS, &able("gpu", u64::MAX)).await.unwrap();
        let Some((job, lease)) = claimed else {
            // Nothing is due: the worker waits for the next job that will be.
            let abilities = able("gpu", u64::MAX).abilities;
            match store.next_run_time(now_ms, &abilities).await.unwrap() {
                Some(next_ms) => now_ms = next_ms,
                None => break,
            }
            continue;
        };
        let place = &places[&job.id];
        assert_eq!(
            (place.jobs_before, place.start_ms, &place.behind),
            (count, Some(now_ms), &None),
            "{}",
            job.request_id
        );
        count += 1;
        now_ms += (1e3 * job.estimate.time_s) as i64;
        store.finish(&lease, result(), JobEffect::None, now_ms).await.unwrap();
    }
    assert!(count > 20 && count as usize == places.len(), "{count} of {}: paused jobs have no place", places.len());
}

#[tokio::test]
async fn a_place_is_behind_the_running_job_whose_worker_it_gets() {
    let (store, _database) = store().await;
    let mut learning = job_of("ada", "long", 600.0);
    learning.scheduling.label = Some("bench-1".to_owned());
    let long = store.submit(&learning, 10, QUEUE_LIMIT).await.unwrap().0.id;
    store.submit(&job_of("bob", "short", 20.0), 11, QUEUE_LIMIT).await.unwrap();
    let (_, lease) = store.claim(1000, LEASE_MS, "w").await.unwrap().unwrap();
    let (short, _) = store.claim(1000, LEASE_MS, "w").await.unwrap().unwrap();
    let mut ids = Vec::new();
    for (owner, request_id, time_s) in [("bob", "first", 10.0), ("bob", "second", 10.0), ("eve", "third", 10.0)] {
        ids.push(store.submit(&job_of(owner, request_id, time_s), 1010, QUEUE_LIMIT).await.unwrap().0.id);
    }
    let two = [process("", 2)];
    let found = places(&store, &two, ClaimLimits::default(), 6000).await;
    let place = |id: &str| (found[id].jobs_before, found[id].others_before, found[id].start_ms);
    // 5 s have passed of the 20 s. Eve has run nothing yet, so hers is first.
    assert_eq!(place(&ids[2]), (0, 0, Some(21_000)));
    assert_eq!(place(&ids[0]), (1, 1, Some(31_000)));
    assert_eq!(place(&ids[1]), (2, 1, Some(41_000)));
    assert!(ids.iter().all(|id| found[id].behind.as_ref().unwrap().id == short.id));

    // With one worker all are behind the long job, whose progress says more than its estimate.
    let progress = Progress { stage: "fit".to_owned(), step: 1, steps_total: 2, loss: None, eta_s: Some(42.0) };
    store.progress(&lease, &progress).await.unwrap();
    let found = places(&store, &[process("", 1)], ClaimLimits::default(), 6000).await;
    let behind = found[&ids[2]].behind.clone().unwrap();
    assert_eq!(
        (behind.id.as_str(), behind.subject.as_str(), found[&ids[2]].start_ms),
        (&*long, "bench-1", Some(48_000))
    );

    let limits = ClaimLimits { per_display: 1, ..ClaimLimits::default() };
    let limited = places(&store, &two, limits, 6000).await;
    assert_eq!(limited[&ids[2]].start_ms, Some(48_000), "one job at a time for the display");
}
