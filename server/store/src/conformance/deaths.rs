//! Tests of what deaths and failures count for: of the server, of a job's own process, and stops, which are none.

use super::queue::claim;
use super::*;
use lightpath_domain::job::JobState;

#[tokio::test]
async fn stop_without_the_jobs_is_no_death_of_the_server() {
    let (store, _folder) = store().await;
    let id = submit(&store, "r", 1).await;
    let cancelled = submit(&store, "cancelled", 2).await;
    for stop in 0..10 {
        let (_, lease) = claim(&store, 10).await.unwrap();
        let other = claim(&store, 10).await;
        if other.is_some() {
            store.cancel(&cancelled, 11).await.unwrap();
        }
        assert_eq!(store.release_all(None, 12).await.unwrap().len(), if stop == 0 { 2 } else { 1 });
        let late = store.finish(&lease, result(), JobEffect::None, 13).await;
        assert!(matches!(late, Err(StoreError::LeaseLost)), "the computation that still ran writes nothing");
    }
    let job = store.job(&id).await.unwrap();
    assert_eq!((job.state, job.error, job.run_time_ms), (JobState::Queued, None, 1));
    assert_eq!(store.job(&cancelled).await.unwrap().state, JobState::Cancelled);
    assert!(!job.suspect);
}

#[tokio::test]
async fn failures_and_deaths_of_its_own_process_spend_attempts_until_a_checkpoint() {
    let (store, _folder) = store().await;
    let id = submit(&store, "r", 1).await;
    for drain in 1..=5 {
        let (_, lease) = claim(&store, drain).await.unwrap();
        let job = store.release(&lease, drain).await.unwrap();
        assert_eq!((job.state, job.error), (JobState::Queued, None));
    }
    let (_, lease) = claim(&store, 10).await.unwrap();
    let job = store.fail(&lease, io_error(), Some(50), 10).await.unwrap();
    assert_eq!((job.state, job.run_time_ms), (JobState::Queued, 50));
    assert!(job.error.unwrap().retryable);
    assert_eq!(claim(&store, 49).await, None);
    let (_, lease) = claim(&store, 50).await.unwrap();
    assert_eq!(store.checkpoint(&lease, &digest(1)).await.unwrap(), None);
    assert_eq!(store.checkpoint(&lease, &digest(2)).await.unwrap(), Some(digest(1)));
    assert_eq!(store.checkpoint(&lease, &digest(2)).await.unwrap(), None);
    let orphans = store.recover_orphans(None, 52).await.unwrap();
    assert_eq!((orphans.len(), orphans[0].state, &orphans[0].error), (1, JobState::Queued, &None));
    let (_, lease) = claim(&store, 53).await.unwrap();
    let job = store.end_dead(&lease, "was killed by signal 9", 55, 54).await.unwrap();
    assert_eq!((job.state, job.run_time_ms, job.suspect), (JobState::Queued, 55, true));

    for state in [JobState::Queued, JobState::Failed] {
        let (_, lease) = claim(&store, 60).await.unwrap();
        let job = store.fail(&lease, io_error(), Some(60), 60).await.unwrap();
        assert_eq!(job.state, state, "a death of its process and two failures since the checkpoint");
    }
    let job = store.job(&id).await.unwrap();
    assert_eq!((job.attempt, job.finish_time_ms), (10, Some(60)));
    assert!(!job.error.unwrap().retryable);
    assert_eq!(job.checkpoint, Some(digest(2)), "a retry by hand continues from the checkpoint");

    let job = store.retry(&id, 70).await.unwrap();
    assert_eq!((job.state, job.error, job.finish_time_ms), (JobState::Queued, None, None));
    let (_, lease) = claim(&store, 70).await.unwrap();
    assert_eq!(store.fail(&lease, io_error(), None, 71).await.unwrap().state, JobState::Failed, "permanent");
}

#[tokio::test]
async fn deaths_of_the_server_count_for_no_job_and_those_of_its_own_process_do() {
    let (store, _folder) = store().await;
    let (id, other) = (submit(&store, "r", 1).await, submit(&store, "other", 50).await);
    for _ in 0..20 {
        claim(&store, 10).await.unwrap();
        store.recover_orphans(None, 10).await.unwrap();
    }
    let job = store.job(&id).await.unwrap();
    assert_eq!((job.state, job.error, job.suspect), (JobState::Queued, None, true));
    assert!(!store.job(&other).await.unwrap().suspect, "it never ran");
    let mut deaths = 0;
    while store.job(&id).await.unwrap().state == JobState::Queued {
        let (_, lease) = claim(&store, 10).await.unwrap();
        store.end_dead(&lease, "was killed by signal 11", 10, 10).await.unwrap();
        let late = store.end_dead(&lease, "again", 10, 10).await;
        assert!(matches!(late, Err(StoreError::LeaseLost)), "a death counts once");
        deaths += 1;
    }
    assert_eq!(deaths, 3);
    let error = store.job(&id).await.unwrap().error.unwrap();
    assert_eq!((error.reason.as_str(), error.retryable), ("PROCESS_DIED", false));
    assert!(error.message.contains("died 3 times") && error.message.ends_with("signal 11"), "{}", error.message);
    let job = store.retry(&id, 20).await.unwrap();
    assert_eq!((job.state, job.suspect), (JobState::Queued, true), "by hand, too, it runs in a process of its own");
}
