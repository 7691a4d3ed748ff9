//! Tests of what a process must have to run a job: labels and memory.

use super::*;
use crate::{ClaimLimits, Claimant};
use lightpath_domain::ability::{Abilities, Labels};

const MIB: u64 = 1 << 20;

pub(super) fn able(labels: &str, memory_bytes: u64) -> Claimant {
    let abilities = Abilities { labels: Labels::parse(labels).unwrap(), memory_bytes, ..Abilities::default() };
    Claimant { abilities, ..Claimant::named("w") }
}

/// A job with needs and memory.
pub(super) fn needy_job(request_id: &str, needs: &str, memory_bytes: u64) -> NewJob {
    let mut new = new_job(request_id, 1);
    new.scheduling.needs = Labels::parse(needs).unwrap();
    new.estimate.memory_bytes = memory_bytes;
    new
}

async fn submit_new(store: &Store, new: &NewJob) -> String {
    store.submit(new, 10, QUEUE_LIMIT).await.unwrap().0.id
}

/// Request ids of the jobs that the claimant gets, one after the other, until it gets none.
async fn claims(store: &Store, claimant: &Claimant) -> Vec<String> {
    let mut requests = Vec::new();
    while let Some((job, lease)) = store.claim_within(ClaimLimits::default(), 20, LEASE_MS, claimant).await.unwrap() {
        store.finish(&lease, result(), JobEffect::None, 20).await.unwrap();
        requests.push(job.request_id);
    }
    requests
}

#[tokio::test]
async fn job_runs_only_where_all_labels_are_that_it_needs() {
    let (store, _database) = store().await;
    for needs in ["", "bench-2", "gpu", "bench-2,gpu", "gpu-2"] {
        let job = store.submit(&needy_job(&format!("r {needs}"), needs, 0), 10, QUEUE_LIMIT).await.unwrap().0;
        assert_eq!(job.scheduling.needs, Labels::parse(needs).unwrap());
        assert_eq!(store.job(&job.id).await.unwrap(), job);
        assert_eq!(store.job_summary(&job.id).await.unwrap().needs, job.scheduling.needs);
    }
    assert_eq!(claims(&store, &able("", u64::MAX)).await, ["r "]);
    assert_eq!(claims(&store, &able("gp,gpu-,bench", u64::MAX)).await, [""; 0], "parts of labels count nothing");
    assert_eq!(claims(&store, &able("a,gpu,z", u64::MAX)).await, ["r gpu"]);
    assert_eq!(claims(&store, &able("bench-2,gpu", u64::MAX)).await, ["r bench-2", "r bench-2,gpu"]);
    assert_eq!(claims(&store, &able("gpu-2", u64::MAX)).await, ["r gpu-2"]);
    let repeated = store.submit(&needy_job("r gpu", "", 0), 30, QUEUE_LIMIT).await;
    assert!(matches!(repeated, Err(StoreError::AlreadyExists { .. })), "other needs are another request");
}

#[tokio::test]
async fn waiting_work_is_told_apart_by_needs() {
    let (store, _database) = store().await;
    for (n, needs) in ["", "gpu", "gpu", "bench-2,gpu"].iter().enumerate() {
        let mut new = needy_job(&format!("r{n}"), needs, 0);
        new.estimate.time_s = 10.0 + n as f64;
        submit_new(&store, &new).await;
    }
    let work = store.waiting_work(20).await.unwrap();
    let of_kind = work.iter().filter(|work| work.kind == "simulate_capture");
    let times: Vec<(String, u64)> = of_kind.map(|work| (work.needs.to_string(), work.time.as_secs())).collect();
    let expected = [("", 10), ("bench-2, gpu", 13), ("gpu", 23)].map(|(needs, time_s)| (needs.to_owned(), time_s));
    assert_eq!(times, expected);
    assert_eq!(work.iter().filter(|work| work.needs.is_empty() && work.time.is_zero()).count(), 8, "the other kinds");
    assert!(store.waiting_work(9).await.unwrap().iter().all(|work| work.time.is_zero()), "no job is due");
}

#[tokio::test]
async fn jobs_for_others_block_nothing() {
    let (store, _database) = store().await;
    for (n, owner) in ["ada", "bob", "ada"].iter().enumerate() {
        let mut urgent = needy_job(&format!("gpu {n}"), "gpu", 0);
        (urgent.priority, urgent.scheduling.owner) = (-50, (*owner).to_owned());
        submit_new(&store, &urgent).await;
        let mut large = needy_job(&format!("large {n}"), "", 64 * MIB);
        (large.priority, large.scheduling.owner) = (-40, (*owner).to_owned());
        submit_new(&store, &large).await;
    }
    for (n, owner) in ["ada", "ada", "bob", "bob"].iter().enumerate() {
        let mut new = needy_job(&format!("{owner} {n}"), "", MIB);
        new.scheduling.owner = (*owner).to_owned();
        submit_new(&store, &new).await;
    }
    let small = able("", 63 * MIB);
    assert_eq!(store.next_run_time(5, &small.abilities).await.unwrap(), Some(10));
    // The turns are those among the jobs that this process can run.
    assert_eq!(claims(&store, &small).await, ["ada 0", "bob 2", "ada 1", "bob 3"]);
    assert_eq!(store.next_run_time(5, &small.abilities).await.unwrap(), None, "nothing to wait for");
    assert_eq!(claims(&store, &able("gpu", 64 * MIB)).await.len(), 6);
}

#[tokio::test]
async fn limits_count_the_jobs_of_all_processes() {
    let (store, _database) = store().await;
    for (n, needs) in ["gpu", "", ""].iter().enumerate() {
        submit_new(&store, &needy_job(&format!("r{n}"), needs, 0)).await;
    }
    let limits = ClaimLimits { per_owner: 2, per_display: 0 };
    let claim = async |claimant: &Claimant| store.claim_within(limits, 20, LEASE_MS, claimant).await.unwrap();
    let (_, first) = claim(&able("gpu", u64::MAX)).await.unwrap();
    assert!(claim(&able("", u64::MAX)).await.is_some());
    assert!(claim(&able("", u64::MAX)).await.is_none(), "two jobs run");
    store.finish(&first, result(), JobEffect::None, 21).await.unwrap();
    assert!(claim(&able("", u64::MAX)).await.is_some());
}

#[tokio::test]
async fn job_runs_only_where_its_memory_is() {
    let (store, _database) = store().await;
    // The second and third count for 104 MiB.
    for bytes in [100 * MIB, 100 * MIB + 1, 101 * MIB, 200 * MIB, 0] {
        submit_new(&store, &needy_job(&format!("r {bytes}"), "", bytes)).await;
    }
    let sizes = async |limit| -> Vec<u64> {
        let requests = claims(&store, &able("", limit)).await;
        requests.iter().map(|request| request[2..].parse().unwrap()).collect()
    };
    assert_eq!(sizes(100 * MIB).await, [100 * MIB, 0]);
    assert_eq!(sizes(100 * MIB).await, [0; 0]);
    assert_eq!(sizes(104 * MIB - 1).await, [0; 0]);
    assert_eq!(sizes(104 * MIB).await, [100 * MIB + 1, 101 * MIB]);
    assert_eq!(sizes(u64::MAX).await, [200 * MIB]);
}
