//! Measures how long queries take when there are many jobs.
//!
//! `LIGHTPATH_SCALE_JOBS=1000000 cargo test --release -p lightpath-store --lib many_jobs -- --nocapture` fills the
//! database with a million finished jobs and a tenth as many waiting ones, and compares the times with their limits.
//! `scripts/with-postgres env LIGHTPATH_TEST_DATABASE=postgres …` does so on PostgreSQL. `LIGHTPATH_SCALE_WAITING` sets
//! the number of waiting jobs, and `LIGHTPATH_SCALE_OWNERS` that of their owners: 67 make 1005 lanes. Without
//! `LIGHTPATH_SCALE_JOBS`, the test uses a hundredth of these jobs and checks only the results, since the machine may
//! be busy.

use super::*;
use crate::{ClaimLimits, JobFilter};
use lightpath_domain::job::JobState;
use std::io::Write as _;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const FINISHED: u32 = 10_000;
const SAMPLES: u32 = 300;
/// Time within which 99 % of the claims must have been made and ended in SQLite.
///
/// In PostgreSQL each of the two transactions sends several messages and waits for a flush by a server that has other work,
/// too. What counts there is how many of them all processes make together, [`CLAIMS_PER_S_MIN`]; the time is only printed.
const CLAIM_MAX: Duration = Duration::from_millis(20);
/// What 16 callers must reach together in PostgreSQL, with 100,000 waiting jobs in 1000 lanes.
const CLAIMS_PER_S_MIN: f64 = 100.0;
const SUBMITS_PER_S_MIN: f64 = 300.0;
const LIST_MAX: Duration = Duration::from_millis(50);
/// Time of the first claim.
const CLAIM_MS: i64 = i64::MAX / 4;

/// Sorted durations of an operation that was repeated.
struct Times(Vec<Duration>);

impl Times {
    fn p99(&self) -> Duration {
        self.0[self.0.len() * 99 / 100]
    }

    fn median(&self) -> Duration {
        self.0[self.0.len() / 2]
    }

    fn print(&self, operation: &str) {
        let median = self.median();
        writeln!(std::io::stderr(), "{operation}: median {median:.2?}, p99 {:.2?}", self.p99()).unwrap();
    }
}

async fn times<F: Future<Output = ()>>(mut work: impl FnMut(u32) -> F) -> Times {
    let mut times = Vec::new();
    for n in 0..SAMPLES {
        let started = Instant::now();
        work(n).await;
        times.push(started.elapsed());
    }
    times.sort();
    Times(times)
}

/// Number of owners: 20, or `LIGHTPATH_SCALE_OWNERS`. With 67 the waiting jobs are in 1005 lanes.
fn owners() -> u32 {
    std::env::var("LIGHTPATH_SCALE_OWNERS").map_or(20, |owners| owners.parse().unwrap())
}

/// Runs `work` by 16 callers at once. Prints and returns how many calls a second they made.
async fn rate<F: Future<Output = ()> + Send>(
    operation: &str,
    calls: u32,
    work: impl Fn(u32) -> F + Send + Sync,
) -> f64 {
    let started = Instant::now();
    let (next, work) = (AtomicU32::new(0), &work);
    let callers = (0..16).map(|_| async {
        loop {
            let n = next.fetch_add(1, Ordering::Relaxed);
            if n >= calls {
                return;
            }
            work(n).await;
        }
    });
    futures::future::join_all(callers).await;
    let rate = f64::from(calls) / started.elapsed().as_secs_f64();
    writeln!(std::io::stderr(), "{operation}: {rate:.0} a second").unwrap();
    rate
}

/// Fills the database with jobs as after months of use: the waiting jobs have 20 batches, 5 displays and 3 priorities.
async fn fill(database: &TestDatabase, finished: u32, waiting: u32) {
    let owners = owners();
    let spec = serde_json::to_string(&new_job("", 1).spec).unwrap();
    let result = serde_json::to_string(&result()).unwrap();
    let insert = |from: u32, to: u32, prefix: &str, state: &str, times: &str, result: &str| {
        format!(
            "with recursive n(i) as (select {from} union all select i + 1 from n where i + 1 < {to}), \
             named as (select i, '{prefix}' || substr('00000000000' || i, length('' || i)) as id from n) \
             insert into job (id, request_id, display, spec, state, priority, attempt, attempts_max, create_time_ms, \
             run_time_ms, start_time_ms, finish_time_ms, result, owner, batch, kind, words) \
             select id, '{prefix}' || i, 'lab-' || (i % 5), '{spec}', '{state}', i % 3, 1, 3, i, i, {times}, {result}, \
             'owner ' || (i % {owners}), 'batch ' || (i % 20), 'simulate_capture', id || ' {prefix}' || i || ' owner ' || \
             (i % {owners}) || ' batch ' || (i % 20) || ' lab-' || (i % 5) from named"
        )
    };
    let result = format!("'{result}'");
    for (count, prefix, state, times, result) in
        [(finished, "a", "succeeded", "i, i + 1", result.as_str()), (waiting, "b", "queued", "null, null", "null")]
    {
        // In parts: PostgreSQL keeps every version of a counter until the transaction has ended.
        for from in (0..count).step_by(2000) {
            database.change(&insert(from, count.min(from + 2000), prefix, state, times, result)).await;
        }
    }
    let events = "insert into job_event (job, time_ms, attempt, message) select id, 1, 0, 'queued' from job \
                  union all select id, 2, 1, 'succeeded' from job where state = 'succeeded'";
    database.change(events).await;
    if database.url.is_some() {
        database.change("analyze").await;
    }
}

/// Measures lists of jobs, summaries and searches; returns the times of the lists.
async fn lists(store: &Store, finished: u32) -> Times {
    let filters = [
        JobFilter::default(),
        JobFilter { state: Some(JobState::Succeeded), ..JobFilter::default() },
        JobFilter { state: Some(JobState::Running), display: Some("lab-1".to_owned()), ..JobFilter::default() },
        JobFilter { state: Some(JobState::Succeeded), display: Some("lab-1".to_owned()), ..JobFilter::default() },
        JobFilter { state: Some(JobState::Running), batch: Some("batch 1".to_owned()), ..JobFilter::default() },
        JobFilter { display: Some("lab-2".to_owned()), batch: Some("batch 1".to_owned()), ..JobFilter::default() },
        JobFilter { id_prefix: Some("a00000000".to_owned()), ..JobFilter::default() },
    ];
    let filters = &filters;
    let list = times(async |n| {
        // The pages are spread over the whole list.
        let after = format!("a{:012}", u64::from(n) * u64::from(finished) / u64::from(SAMPLES));
        store.jobs(&filters[n as usize % filters.len()], Some(&after), 51).await.unwrap();
    })
    .await;
    list.print("list");
    let summaries = times(async |n| {
        store.job_summaries(&filters[n as usize % filters.len()], None, 51).await.unwrap();
    })
    .await;
    summaries.print("list summaries");
    let one = JobFilter { id_prefix: Some("a000000001234".to_owned()), ..JobFilter::default() };
    let found = times(async |_| assert_eq!(store.job_summaries(&one, None, 51).await.unwrap().len(), 1)).await;
    found.print("find one job by the beginning of its id");
    let searches = [
        JobFilter { text: Some("no job has this text".to_owned()), ..JobFilter::default() },
        JobFilter { owner: Some("nobody".to_owned()), oldest_first: true, ..JobFilter::default() },
        JobFilter { kind: Some("learn_kernel".to_owned()), ..JobFilter::default() },
    ];
    let search = times(async |n| {
        store.job_summaries(&searches[n as usize % searches.len()], None, 51).await.unwrap();
    })
    .await;
    search.print("search through all jobs");
    list
}

/// Many jobs wait that are too large for the process, and behind them one that is not. `LIGHTPATH_SCALE_WAITING` sets their
/// number.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn many_jobs_for_others_delay_no_claim() {
    const MIB: u64 = 1 << 20;
    let requested = std::env::var("LIGHTPATH_SCALE_WAITING").ok().map(|jobs| jobs.parse::<u32>().unwrap());
    let (store, database) = store().await;
    let spec = serde_json::to_string(&new_job("", 1).spec).unwrap();
    for (counted, estimate, limit) in [(168 * MIB, 165 * MIB, 150 * MIB), (104 * MIB, 101 * MIB, 100 * MIB)] {
        for from in (0..requested.unwrap_or(1000)).step_by(2000) {
            let to = (from + 2000).min(requested.unwrap_or(1000));
            database
                .change(&format!(
                    "with recursive n(i) as (select {from} union all select i + 1 from n where i + 1 < {to}) \
                     insert into job (id, request_id, display, kind, words, spec, state, priority, attempts_max, \
                     create_time_ms, run_time_ms, estimated_bytes, counted_bytes) select '{counted} ' || i, '{counted} ' || i, \
                     'lab', 'simulate_capture', '', '{spec}', 'queued', 0, 3, 1, 1, {estimate}, {counted} from n"
                ))
                .await;
        }
        if database.url.is_some() {
            database.change("vacuum analyze").await;
        }
        let small = super::needs::needy_job(&format!("small {limit}"), "", 98 * MIB);
        let (store, claimant) = (&store, || super::needs::able("", limit));
        let small = &store.submit(&small, 5, u32::MAX).await.unwrap().0;
        let claim = times(async |_| {
            let claimed = store.claim_within(ClaimLimits::default(), 10, LEASE_MS, &claimant()).await.unwrap();
            let (job, lease) = claimed.unwrap();
            assert_eq!(job.id, small.id);
            store.release(&lease, 5).await.unwrap();
        })
        .await;
        claim.print(&format!("claim and release behind jobs of {estimate} bytes on a process with {limit}"));
        store.cancel(&small.id, 11).await.unwrap();
        let none = times(async |_| {
            store.next_run_time(10, &claimant().abilities).await.unwrap();
            let idle = store.claim_within(ClaimLimits::default(), 10, LEASE_MS, &claimant()).await;
            assert!(idle.unwrap().is_none());
        })
        .await;
        none.print("claim without a job, and the time of the next one");
        if requested.is_some() {
            assert!(claim.median() < CLAIM_MAX && none.median() < CLAIM_MAX);
        }
    }
}

/// Times in which a claim is made and ended.
async fn claims(store: &Store) -> Times {
    let limits = ClaimLimits { per_owner: 50, per_display: 0 };
    // Each claim has a time of its own, so that owners do not tie for their turns.
    times(async |n| {
        let now_ms = CLAIM_MS + i64::from(n);
        let (_, lease) =
            store.claim_within(limits, now_ms, LEASE_MS, &crate::Claimant::named("w")).await.unwrap().unwrap();
        store.finish(&lease, result(), JobEffect::None, now_ms + 1).await.unwrap();
    })
    .await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn many_jobs_keep_queries_fast() {
    let requested_jobs = std::env::var("LIGHTPATH_SCALE_JOBS").ok().map(|jobs| jobs.parse().unwrap());
    let finished = requested_jobs.unwrap_or(FINISHED);
    let waiting = std::env::var("LIGHTPATH_SCALE_WAITING").map_or(finished / 10, |jobs| jobs.parse().unwrap());
    let (store, database) = store().await;
    for n in 0..5 {
        store.create_display(&display(&format!("lab-{n}")), 1).await.unwrap();
    }
    fill(&database, finished, waiting).await;
    let store = &store;
    let counts = store.queue_counts().await.unwrap();
    assert_eq!((counts.succeeded, counts.queued), (u64::from(finished), u64::from(waiting)));

    let claim = claims(store).await;
    claim.print("claim and finish");
    let submit = times(async |n| {
        let mut new = new_job(&format!("new {n}"), 1);
        new.scheduling.owner = format!("owner {}", n % 20);
        store.submit(&new, 1, u32::MAX).await.unwrap();
    })
    .await;
    submit.print("submit");
    let submits_per_s = rate("submit by 16 callers", SAMPLES * 4, |n| async move {
        let mut new = new_job(&format!("rate {n}"), 1);
        new.scheduling.owner = format!("owner {}", n % 20);
        store.submit(&new, 1, u32::MAX).await.unwrap();
    })
    .await;
    let claims_per_s = rate("claim by 16 callers", SAMPLES * 4, |n| async move {
        let now_ms = CLAIM_MS + i64::from(SAMPLES + n);
        store
            .claim_within(ClaimLimits::default(), now_ms, LEASE_MS, &crate::Claimant::named("w"))
            .await
            .unwrap()
            .unwrap();
    })
    .await;
    store.release_all(None, 2).await.unwrap();
    let list = lists(store, finished).await;
    let batch = times(async |n| {
        store.batch(&format!("batch {}", n % 20)).await.unwrap();
    })
    .await;
    batch.print("batch");
    let depths = times(async |_| drop(store.queue_depths().await.unwrap())).await;
    depths.print("queue depths");
    let counts = store.queue_counts().await.unwrap();
    assert_eq!((counts.succeeded, counts.queued), (u64::from(finished + SAMPLES), u64::from(waiting + SAMPLES * 4)));
    if requested_jobs.is_some() {
        match database.url {
            None => assert!(claim.p99() < CLAIM_MAX, "{:?}", claim.p99()),
            Some(_) => assert!(claims_per_s >= CLAIMS_PER_S_MIN && submits_per_s >= SUBMITS_PER_S_MIN),
        }
        assert!(list.p99() < LIST_MAX, "{:?}", list.p99());
        assert!(batch.p99() < LIST_MAX, "{:?}", batch.p99());
    }
}
