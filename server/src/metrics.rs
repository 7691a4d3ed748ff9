//! What the server tells Prometheus.
//!
//! Counters and histograms are kept where things happen; gauges that only the database knows are read when somebody
//! asks.

use crate::artifacts::Artifacts;
use crate::job::{JobSpec, JobState};
use crate::store::{Store, StoreError};
use metrics::{Unit, counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};
use std::sync::OnceLock;
use std::time::Duration;

const QUEUE_DEPTH: &str = "lightpath_queue_depth";
const JOBS_ENDED: &str = "lightpath_jobs_ended_total";
const ITERATION: &str = "lightpath_hologram_iteration_seconds";
const REQUESTS: &str = "lightpath_requests_total";
const REQUEST: &str = "lightpath_request_seconds";
const ARTIFACTS: &str = "lightpath_artifacts";
const ARTIFACT_BYTES: &str = "lightpath_artifact_bytes";
const COLLECTED_JOBS: &str = "lightpath_collected_jobs_total";
const COLLECTED_ARTIFACTS: &str = "lightpath_collected_artifacts_total";
const COLLECTED_BYTES: &str = "lightpath_collected_bytes_total";
const DISK_FREE: &str = "lightpath_disk_free_bytes";
const DISK_RESERVE: &str = "lightpath_disk_reserve_bytes";
const BUILD_INFO: &str = "lightpath_build_info";

/// From a small hologram on a fast machine to a large one on a slow machine \[s\].
const ITERATION_BUCKETS_S: [f64; 12] = [0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0];
/// From a read of one row to the checking of a large picture \[s\].
const REQUEST_BUCKETS_S: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.1, 0.25, 1.0, 5.0, 30.0];

/// A job has ended in `state`.
pub fn job_ended(spec: &JobSpec, state: JobState) {
    counter!(JOBS_ENDED, "kind" => kind(spec), "state" => state.as_str()).increment(1);
}

/// A hologram's optimizer has done an iteration.
pub fn hologram_iteration(time: Duration) {
    histogram!(ITERATION).record(time.as_secs_f64());
}

/// A request was answered (a stream: begun).
pub(crate) fn request(method: String, code: String, time: Duration) {
    counter!(REQUESTS, "method" => method.clone(), "code" => code).increment(1);
    histogram!(REQUEST, "method" => method).record(time.as_secs_f64());
}

/// A collection has removed this much.
pub(crate) fn collected(jobs: u64, artifacts: u64, bytes: u64) {
    counter!(COLLECTED_JOBS).increment(jobs);
    counter!(COLLECTED_ARTIFACTS).increment(artifacts);
    counter!(COLLECTED_BYTES).increment(bytes);
}

/// Starts to record; everything recorded earlier is lost. The recorder is the process's: all servers in one share it.
pub(crate) fn install() {
    let _ = handle();
}

/// All metrics in Prometheus' text format.
pub(crate) async fn render(store: &Store, files: &Artifacts) -> Result<String, StoreError> {
    let Some(handle) = handle() else {
        return Ok(String::new());
    };
    for depth in store.queue_depths().await? {
        gauge!(QUEUE_DEPTH, "kind" => depth.kind, "state" => depth.state.as_str()).set(depth.jobs as f64);
    }
    let (artifacts, bytes) = store.artifact_totals().await?;
    gauge!(ARTIFACTS).set(artifacts as f64);
    gauge!(ARTIFACT_BYTES).set(bytes as f64);
    if let Ok(free) = files.free_bytes() {
        gauge!(DISK_FREE).set(free as f64);
    }
    gauge!(DISK_RESERVE).set(files.space_limits().reserve_bytes as f64);
    gauge!(BUILD_INFO, "version" => env!("CARGO_PKG_VERSION")).set(1.0);
    handle.run_upkeep();
    Ok(handle.render())
}

fn handle() -> Option<&'static PrometheusHandle> {
    static HANDLE: OnceLock<Option<PrometheusHandle>> = OnceLock::new();
    // `None` where the program that embeds the server has a recorder of its own.
    let install = || {
        let builder = PrometheusBuilder::new()
            .set_buckets_for_metric(Matcher::Full(ITERATION.to_owned()), &ITERATION_BUCKETS_S)
            .and_then(|it| it.set_buckets_for_metric(Matcher::Full(REQUEST.to_owned()), &REQUEST_BUCKETS_S));
        let handle = builder.and_then(PrometheusBuilder::install_recorder).ok()?;
        describe();
        Some(handle)
    };
    HANDLE.get_or_init(install).as_ref()
}

fn describe() {
    describe_gauge!(QUEUE_DEPTH, "Jobs that wait or run, by kind and state");
    describe_counter!(JOBS_ENDED, "Jobs that ended, by kind and state");
    describe_histogram!(ITERATION, Unit::Seconds, "Time of one iteration of a hologram's optimizer");
    describe_counter!(REQUESTS, "Requests, by method and status code");
    describe_histogram!(REQUEST, Unit::Seconds, "Time to the answer, by method");
    describe_gauge!(ARTIFACTS, "Stored artifacts");
    describe_gauge!(ARTIFACT_BYTES, Unit::Bytes, "Bytes of all stored artifacts");
    describe_counter!(COLLECTED_JOBS, "Ended jobs that were removed because of their age");
    describe_counter!(COLLECTED_ARTIFACTS, "Unreferenced artifacts that were removed because of their age");
    describe_counter!(COLLECTED_BYTES, Unit::Bytes, "Bytes of those artifacts");
    describe_gauge!(DISK_FREE, Unit::Bytes, "Free space on the disk of the data folder");
    describe_gauge!(DISK_RESERVE, Unit::Bytes, "Free space below which new jobs and uploads are refused");
    describe_gauge!(BUILD_INFO, "The server's version");
}

fn kind(spec: &JobSpec) -> &'static str {
    match spec {
        JobSpec::OptimizeHologram(_) => "optimize_hologram",
        JobSpec::LearnKernel(_) => "learn_kernel",
        JobSpec::SimulateCapture(_) => "simulate_capture",
        JobSpec::EvaluateKernel(_) => "evaluate_kernel",
    }
}
