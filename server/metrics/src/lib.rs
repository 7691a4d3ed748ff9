//! Metrics of the server for Prometheus.
//!
//! Counters and histograms are updated when events happen. Gauges with values from the database are read at each
//! request for the metrics.
#![cfg_attr(test, allow(clippy::unwrap_used))]

use lightpath_artifacts::Artifacts;
use lightpath_domain::job::{Job, JobSpec, JobState};
use lightpath_store::{LIMIT_MAX, ProcessKind, Store, StoreError, WaitingWork};
use metrics::{Unit, counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

const QUEUE_DEPTH: &str = "lightpath_queue_depth";
const QUEUE_OLDEST: &str = "lightpath_queue_oldest_seconds";
const QUEUE_WORK: &str = "lightpath_queue_work_seconds";
const PROCESSES: &str = "lightpath_processes";
const JOBS_ENDED: &str = "lightpath_jobs_ended_total";
const JOB: &str = "lightpath_job_seconds";
const LEASES_LOST: &str = "lightpath_leases_lost_total";
const ITERATION: &str = "lightpath_hologram_iteration_seconds";
const TRANSFORM: &str = "lightpath_hologram_transform_seconds";
const FETCHES: &str = "lightpath_kernel_fetches_total";
const CONVERSIONS: &str = "lightpath_kernel_conversions_total";
const REQUESTS: &str = "lightpath_requests_total";
const REQUEST: &str = "lightpath_request_seconds";
const ARTIFACTS: &str = "lightpath_artifacts";
const ARTIFACT_BYTES: &str = "lightpath_artifact_bytes";
const COLLECTED_JOBS: &str = "lightpath_collected_jobs_total";
const COLLECTED_ARTIFACTS: &str = "lightpath_collected_artifacts_total";
const COLLECTED_BYTES: &str = "lightpath_collected_bytes_total";
const WEBHOOK_ATTEMPTS: &str = "lightpath_webhook_attempts_total";
const WEBHOOKS_WAITING: &str = "lightpath_webhook_deliveries_waiting";
const DATABASE_BYTES: &str = "lightpath_database_bytes";
const WAL_BYTES: &str = "lightpath_wal_bytes";
const DISK_FREE: &str = "lightpath_disk_free_bytes";
const DISK_RESERVE: &str = "lightpath_disk_reserve_bytes";
const BUILD_INFO: &str = "lightpath_build_info";

/// Buckets for the time of an iteration \[s\]: from a small hologram on a fast machine to a large one on a slow
/// machine.
const ITERATION_BUCKETS_S: [f64; 12] = [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0];
/// Buckets for the time of a job \[s\]: from a very small picture to a kernel that is learned overnight.
const JOB_BUCKETS_S: [f64; 10] = [0.1, 0.5, 1.0, 5.0, 15.0, 60.0, 300.0, 1200.0, 3600.0, 14_400.0];
/// Buckets for the time of a request \[s\]: from a read of one row to the check of a large picture.
const REQUEST_BUCKETS_S: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.25, 1.0, 5.0, 30.0];

/// Limit on the sets of needs that metrics tell apart: submitters choose them, and each is a time series for each kind.
const NEEDS_SHOWN_MAX: usize = 64;

/// Why a job lost its lease.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeaseLoss {
    /// The lease expired without a heartbeat.
    Expired,
    /// The server died, and the next one found the job.
    ServerDied,
}

impl LeaseLoss {
    fn as_str(self) -> &'static str {
        match self {
            Self::Expired => "expired",
            Self::ServerDied => "server_died",
        }
    }
}

/// Records the end of a job, and the time of its last attempt if that ran to its end.
pub fn job_ended(job: &Job) {
    let (kind, state) = (job.spec.kind(), job.state.as_str());
    counter!(JOBS_ENDED, "kind" => kind, "state" => state).increment(1);
    if let (JobState::Succeeded | JobState::Failed, Some(start_ms), Some(finish_ms)) =
        (job.state, job.start_time_ms, job.finish_time_ms)
    {
        let took = Duration::from_millis(finish_ms.saturating_sub(start_ms).max(0).unsigned_abs());
        histogram!(JOB, "kind" => kind, "state" => state).record(took.as_secs_f64());
    }
}

/// Records that a job lost its lease.
pub fn lease_lost(cause: LeaseLoss, job: &Job) {
    counter!(LEASES_LOST, "cause" => cause.as_str()).increment(1);
    if job.state.has_ended() {
        job_ended(job);
    }
}

/// Records a request for a kernel file of an existing display. A stream counts as OK once it has started.
pub fn kernel_fetch(display: &str, code: String) {
    counter!(FETCHES, "display" => display.to_owned(), "code" => code).increment(1);
}

/// Records the end of a conversion of a kernel file of a display to another form.
pub fn kernel_conversion(display: &str, succeeded: bool) {
    let outcome = if succeeded { "succeeded" } else { "failed" };
    counter!(CONVERSIONS, "display" => display.to_owned(), "outcome" => outcome).increment(1);
}

/// Records one iteration of a hologram optimization, with `transforming`: the part of its time for Fourier transforms.
pub fn hologram_iteration(time: Duration, transforming: Duration) {
    histogram!(ITERATION).record(time.as_secs_f64());
    histogram!(TRANSFORM).record(transforming.as_secs_f64());
}

/// Records an answered request. A stream counts as answered once it has started.
pub fn request(method: String, code: String, time: Duration) {
    counter!(REQUESTS, "method" => method.clone(), "code" => code).increment(1);
    histogram!(REQUEST, "method" => method).record(time.as_secs_f64());
}

/// Records an attempt to tell a webhook something.
pub fn webhook_attempt(accepted: bool) {
    counter!(WEBHOOK_ATTEMPTS, "outcome" => if accepted { "accepted" } else { "failed" }).increment(1);
}

/// Records what a collection has removed.
pub fn collected(jobs: u64, artifacts: u64, bytes: u64) {
    counter!(COLLECTED_JOBS).increment(jobs);
    counter!(COLLECTED_ARTIFACTS).increment(artifacts);
    counter!(COLLECTED_BYTES).increment(bytes);
}

/// Starts recording; earlier measurements are lost. The recorder belongs to the process: all its servers share it.
/// Every counter starts at 0, because a rate can be computed only if the counter existed before its first event.
pub fn install() {
    let _ = handle();
    for kind in JobSpec::KINDS {
        for state in JobState::ENDED {
            counter!(JOBS_ENDED, "kind" => kind, "state" => state.as_str()).increment(0);
        }
    }
    for cause in [LeaseLoss::Expired, LeaseLoss::ServerDied] {
        counter!(LEASES_LOST, "cause" => cause.as_str()).increment(0);
    }
    for outcome in ["accepted", "failed"] {
        counter!(WEBHOOK_ATTEMPTS, "outcome" => outcome).increment(0);
    }
    collected(0, 0, 0);
}

/// Starts the counters of answers without errors at 0. `methods` are all methods, each with the code of such an answer.
/// The counters of errors appear with the first error, because each method has many codes.
pub fn expect_requests(methods: impl IntoIterator<Item = (String, &'static str)>) {
    for (method, code) in methods {
        counter!(REQUESTS, "method" => method, "code" => code).increment(0);
    }
}

/// Moves measurements into the buckets of their histograms. Before that, every measurement takes memory of its own,
/// even if no client reads the metrics.
pub fn summarize() {
    if let Some(handle) = handle() {
        handle.run_upkeep();
    }
}

/// All metrics in the text format of Prometheus.
pub async fn render(store: &Store, files: &Artifacts, now_ms: i64) -> Result<String, StoreError> {
    let Some(handle) = handle() else {
        return Ok(String::new());
    };
    for depth in store.queue_depths().await? {
        gauge!(QUEUE_DEPTH, "kind" => depth.kind, "state" => depth.state.as_str()).set(depth.jobs as f64);
    }
    for (kind, age) in store.oldest_due(now_ms).await? {
        gauge!(QUEUE_OLDEST, "kind" => kind).set(age.as_secs_f64());
    }
    set_waiting_work(store.waiting_work(now_ms).await?);
    for kind in ProcessKind::ALL {
        let living = store.living().iter().filter(|process| process.kind == kind).count();
        gauge!(PROCESSES, "kind" => kind.as_str()).set(living as f64);
    }
    gauge!(WEBHOOKS_WAITING).set(store.deliveries_waiting().await? as f64);
    let (database, wal) = store.database_bytes().await?;
    gauge!(DATABASE_BYTES).set(database as f64);
    gauge!(WAL_BYTES).set(wal as f64);
    let (artifacts, bytes) = store.artifact_totals().await?;
    gauge!(ARTIFACTS).set(artifacts as f64);
    gauge!(ARTIFACT_BYTES).set(bytes as f64);
    if let Ok(free) = files.space().free_bytes() {
        gauge!(DISK_FREE).set(free as f64);
    }
    gauge!(DISK_RESERVE).set(files.space().limits().reserve_bytes as f64);
    gauge!(BUILD_INFO, "version" => env!("CARGO_PKG_VERSION")).set(1.0);
    for (display, _) in store.displays(None, LIMIT_MAX).await? {
        counter!(FETCHES, "display" => display.id.clone(), "code" => "Ok").increment(0);
        counter!(CONVERSIONS, "display" => display.id, "outcome" => "succeeded").increment(0);
    }
    handle.run_upkeep();
    Ok(handle.render())
}

/// Sets the gauge of each kind and set of needs. Sets that no job needs any more become 0, because a gauge keeps its value.
fn set_waiting_work(all: Vec<WaitingWork>) {
    static KNOWN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let mut seconds: BTreeMap<(&'static str, String), f64> = BTreeMap::new();
    for work in all {
        let needs = work.needs.to_string();
        let is_shown = needs.is_empty() || known.contains(&needs) || known.len() < NEEDS_SHOWN_MAX;
        let needs = if is_shown { needs } else { "other".to_owned() };
        known.insert(needs.clone());
        *seconds.entry((work.kind, needs)).or_default() += work.time.as_secs_f64();
    }
    for kind in JobSpec::KINDS {
        for needs in known.iter() {
            let time_s = seconds.get(&(kind, needs.clone())).copied().unwrap_or(0.0);
            gauge!(QUEUE_WORK, "kind" => kind, "needs" => needs.clone()).set(time_s);
        }
    }
}

fn handle() -> Option<&'static PrometheusHandle> {
    static HANDLE: OnceLock<Option<PrometheusHandle>> = OnceLock::new();
    // `None` if the program that embeds the server has installed its own recorder.
    let install = || {
        let builder = PrometheusBuilder::new()
            .set_buckets_for_metric(Matcher::Full(ITERATION.to_owned()), &ITERATION_BUCKETS_S)
            .and_then(|builder| {
                builder.set_buckets_for_metric(Matcher::Full(TRANSFORM.to_owned()), &ITERATION_BUCKETS_S)
            })
            .and_then(|builder| builder.set_buckets_for_metric(Matcher::Full(JOB.to_owned()), &JOB_BUCKETS_S))
            .and_then(|builder| builder.set_buckets_for_metric(Matcher::Full(REQUEST.to_owned()), &REQUEST_BUCKETS_S));
        let handle = builder.and_then(PrometheusBuilder::install_recorder).ok()?;
        describe();
        Some(handle)
    };
    HANDLE.get_or_init(install).as_ref()
}

fn describe() {
    describe_gauge!(QUEUE_DEPTH, "Jobs that wait or run, by kind and state");
    describe_gauge!(QUEUE_OLDEST, Unit::Seconds, "Time since the earliest waiting job became due, by kind");
    describe_gauge!(
        QUEUE_WORK,
        Unit::Seconds,
        "Estimated time of the jobs that are due and wait, by kind and needed labels"
    );
    describe_gauge!(PROCESSES, "Living processes that serve or run jobs, by kind");
    describe_counter!(JOBS_ENDED, "Jobs that ended, by kind and state");
    describe_histogram!(JOB, Unit::Seconds, "Time of the last attempt of jobs that succeeded or failed");
    describe_counter!(
        LEASES_LOST,
        "Jobs that lost their lease because a worker was silent or the server died, by cause"
    );
    describe_counter!(FETCHES, "Requests for kernel files, by display and status code");
    describe_counter!(CONVERSIONS, "Conversions of kernel files to other forms, by display and outcome");
    describe_histogram!(ITERATION, Unit::Seconds, "Time of one iteration of a hologram optimization");
    describe_histogram!(
        TRANSFORM,
        Unit::Seconds,
        "Time of the Fourier transforms in one iteration, with the other work of the same passes"
    );
    describe_counter!(REQUESTS, "Requests, by method and status code");
    describe_histogram!(REQUEST, Unit::Seconds, "Time to the answer, by method");
    describe_gauge!(ARTIFACTS, "Number of stored artifacts");
    describe_gauge!(ARTIFACT_BYTES, Unit::Bytes, "Size of all stored artifacts");
    describe_counter!(COLLECTED_JOBS, "Ended jobs that were removed because of their age");
    describe_counter!(COLLECTED_ARTIFACTS, "Unreferenced artifacts that were removed because of their age");
    describe_counter!(
        COLLECTED_BYTES,
        Unit::Bytes,
        "Size of the unreferenced artifacts that were removed because of their age"
    );
    describe_counter!(WEBHOOK_ATTEMPTS, "Attempts to tell a webhook something, by outcome");
    describe_gauge!(WEBHOOKS_WAITING, "What webhooks are to learn and have not accepted yet");
    describe_gauge!(DATABASE_BYTES, Unit::Bytes, "Size of the database file");
    describe_gauge!(WAL_BYTES, Unit::Bytes, "Size of the database's write-ahead log");
    describe_gauge!(DISK_FREE, Unit::Bytes, "Free space on the disk of the data folder");
    describe_gauge!(DISK_RESERVE, Unit::Bytes, "Free space below which new jobs and uploads are refused");
    describe_gauge!(BUILD_INFO, "Version of the server, as a label");
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::ability::Labels;

    #[test]
    fn work_that_nobody_waits_for_any_more_is_zero() {
        install();
        let work = |needs: &str| {
            let needs = Labels::parse(needs).unwrap();
            vec![WaitingWork { kind: "learn_kernel", needs, time: Duration::from_secs(7) }]
        };
        let shows = |line: &str| handle().unwrap().render().lines().any(|shown| shown == line);
        set_waiting_work(work("bench-2,gpu"));
        assert!(shows(r#"lightpath_queue_work_seconds{kind="learn_kernel",needs="bench-2, gpu"} 7"#));
        set_waiting_work(Vec::new());
        assert!(shows(r#"lightpath_queue_work_seconds{kind="learn_kernel",needs="bench-2, gpu"} 0"#));
        (0..100).for_each(|n| set_waiting_work(work(&n.to_string())));
        assert!(shows(r#"lightpath_queue_work_seconds{kind="learn_kernel",needs="other"} 7"#));
        assert!(!shows(r#"lightpath_queue_work_seconds{kind="learn_kernel",needs="99"} 7"#));
    }

    #[test]
    fn counters_start_at_zero() {
        super::install();
        super::expect_requests([("/x".to_owned(), "Ok")]);
        let text = super::handle().unwrap().render();
        let source = include_str!("lib.rs");
        let counters: Vec<&str> = source.lines().filter_map(|line| line.strip_suffix("_total\";")).collect();
        assert_eq!(counters.len(), 9, "{counters:?}");
        for counter in counters {
            let name = format!("{}_total", counter.split_once('"').unwrap().1);
            // Only the store knows the displays.
            let zero = |line: &str| line.starts_with(&name) && line.ends_with(" 0");
            assert!(
                [super::FETCHES, super::CONVERSIONS].contains(&&*name) || text.lines().any(zero),
                "{name} is not in\n{text}"
            );
        }
        assert!(text.contains(r#"lightpath_jobs_ended_total{kind="report_kernel",state="cancelled"} 0"#), "{text}");
        assert!(text.contains(r#"lightpath_leases_lost_total{cause="server_died"} 0"#), "{text}");
    }

    /// Names of the metrics in a text, without the suffixes that Prometheus adds for histograms.
    fn names(text: &str) -> BTreeSet<String> {
        let is_part = |c: char| c.is_ascii_lowercase() || c == '_';
        let starts = text.match_indices("lightpath_").map(|(start, _)| &text[start..]);
        let ends = |rest: &str| rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        let whole = starts.map(|rest| rest[..ends(rest)].to_owned());
        let suffixes = ["_bucket", "_sum", "_count"];
        whole
            .map(|name| suffixes.iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(&name).to_owned())
            .collect()
    }

    #[test]
    fn documentation_and_dashboard_match_the_metrics() {
        let constants: String = include_str!("lib.rs").lines().filter(|line| line.starts_with("const ")).collect();
        let metrics = names(&constants);
        let page = names(include_str!("../../../docs/operating.md"));
        let dashboard = names(include_str!("../../../docs/operating/grafana.json"));
        // The page also names this crate, because its log lists every request.
        let named = page.union(&dashboard).filter(|name| *name != "lightpath_api");
        let unknown: Vec<_> = named.filter(|name| !metrics.contains(*name)).collect();
        assert_eq!(unknown, Vec::<&String>::new(), "these metrics do not exist");
        let undocumented: Vec<_> = metrics.difference(&page).collect();
        assert_eq!(undocumented, Vec::<&String>::new(), "docs/operating.md does not describe these metrics");
    }
}
