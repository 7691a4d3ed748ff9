//! The workload of the fail point tests: all kinds of operations that a server acknowledges, one after the other. Each
//! acknowledgement is written to a file.

use lightpath_api::audit::{Audit, Change};
use lightpath_artifacts::{Artifacts, digest_of};
use lightpath_domain::job::{Job, JobEffect, JobState, NewJob, Progress, Scheduling};
use lightpath_domain::kernel::{Cause, KernelKey, KernelMetrics, KernelModel, NewKernelVersion};
use lightpath_domain::lineage::{KernelLineage, KernelOrigin, Learning};
use lightpath_fixtures::{DISTANCE, WAVELENGTH, capture_job, capture_result, display};
use lightpath_server::database::DATABASE;
use lightpath_server::upkeep::{RestoredTokens, Retention, backup, restore};
use lightpath_store::{Promotion, Store};
use lightpath_worker::{Backoff, Clock, JobContext, TaskError, TaskOutput, Worker, WorkerConfig};
use std::error::Error;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

const TARGET: &[u8] = b"what the jobs read";
const DAY: Duration = Duration::from_secs(24 * 3600);
/// Size at which the audit log is rotated \[bytes\].
const AUDIT_BYTES: u64 = 64 << 20;
/// Time limit for all jobs, long enough for a busy machine.
const JOBS_END_WITHIN: Duration = Duration::from_secs(60);

/// Result of an operation. The error can be of any type, because any operation can fail at a fail point.
type Outcome<T = ()> = Result<T, Box<dyn Error + Send + Sync>>;

/// Folder of one run of the workload.
pub(super) struct WorkFolder(pub(super) PathBuf);

impl WorkFolder {
    pub(super) fn data(&self) -> PathBuf {
        self.0.join("data")
    }

    pub(super) fn backup(&self) -> PathBuf {
        self.0.join("backup")
    }

    /// Writes an acknowledgement to the file: its kind, and the id of the acknowledged item.
    fn acknowledged(&self, kind: &str, id: &str) {
        let mut file = File::options().create(true).append(true).open(self.0.join("acknowledged")).unwrap();
        writeln!(file, "{kind} {id}").unwrap();
    }

    /// Kinds and ids of everything that was acknowledged, in order.
    pub(super) fn acknowledgements(&self) -> Vec<(String, String)> {
        let text = std::fs::read_to_string(self.0.join("acknowledged")).unwrap_or_default();
        text.lines().filter_map(|line| line.split_once(' ')).map(|(kind, id)| (kind.into(), id.into())).collect()
    }
}

/// The store and the artifacts of a data folder, as a server opens them.
pub(super) struct Server {
    pub(super) store: Store,
    pub(super) artifacts: Artifacts,
}

impl Server {
    pub(super) async fn open(data: &Path) -> Outcome<Self> {
        let artifacts = Artifacts::open(data)?;
        Ok(Self { store: Store::open(&data.join(DATABASE)).await?, artifacts })
    }

    /// Uploads bytes in two halves.
    async fn upload(&self, bytes: &[u8], digest: &str) -> Outcome {
        let (first, second) = bytes.split_at(bytes.len() / 2);
        let mut upload = self.artifacts.uploads().begin(digest, "", bytes.len() as u64, 0).await?;
        upload.write(first.to_vec()).await?;
        upload.write(second.to_vec()).await?;
        let (store, size_bytes) = (&self.store, bytes.len() as u64);
        let record = async |digest: String, seen: Option<String>| {
            Ok(store.record_artifact(&digest, size_bytes, "ada", seen.as_deref(), now_ms()).await?)
        };
        self.artifacts.publish(upload, record).await.map(drop)
    }

    /// Runs the waiting jobs that have no start time, until all of them have ended.
    pub(super) async fn run_jobs(&self) -> Outcome {
        let config = WorkerConfig {
            compute_threads: 1,
            // A job whose end failed returns to the queue when its lease ends.
            lease: Duration::from_secs(3),
            checkpoint_interval: Duration::ZERO,
            backoff: Backoff::uniform(Duration::from_millis(1), Duration::from_millis(2)),
            ..WorkerConfig::default()
        };
        let drain = CancellationToken::new();
        let worker = Worker::new(self.store.clone(), self.artifacts.clone(), config, Arc::new(task));
        let working = tokio::spawn(worker.run(drain.clone()));
        let mut changes = self.store.subscribe_job_changes();
        let ended = async {
            // Cancelled and delayed jobs are not waited for.
            while self.store.jobs(&Default::default(), None, 100).await?.iter().any(is_due) {
                drop(changes.recv().await);
            }
            Outcome::Ok(())
        };
        let ended = tokio::time::timeout(JOBS_END_WITHIN, ended).await;
        drain.cancel();
        working.await??;
        ended?
    }
}

fn is_due(job: &Job) -> bool {
    !job.state.has_ended() && job.scheduling.not_before_ms.is_none()
}

/// A task of three steps, with a saved state after each step, and an artifact as its result.
fn task(job: &Job, context: &JobContext) -> Result<TaskOutput, TaskError> {
    let first = context.take_saved_state().map_or(0, |state| state[0]);
    for step in first..3 {
        let progress =
            Progress { stage: "count".to_owned(), step: u32::from(step), steps_total: 3, loss: None, eta_s: None };
        context.step(progress, || vec![step + 1])?;
    }
    let photo = context.put_artifact(result_of(&job.request_id))?;
    Ok(TaskOutput { result: capture_result(&photo), effect: JobEffect::None })
}

/// Result of the job of this request. Interruptions must not change it.
pub(super) fn result_of(request_id: &str) -> Vec<u8> {
    format!("the result of {request_id}").into_bytes()
}

/// Runs the workload, and stops at the first operation that fails.
pub(super) async fn work(folder: &WorkFolder) -> Outcome {
    let data = folder.data();
    let audit = Audit::open(&data)?;
    let server = Server::open(&data).await?;
    server.store.create_display(&display("lab"), now_ms()).await?;
    folder.acknowledged("display", "lab");
    let target = digest_of(TARGET);
    server.upload(TARGET, &target).await?;
    folder.acknowledged("artifact", &target);
    // An upload whose bytes do not match the digest is refused and discarded.
    let wrong = server.upload(b"other bytes", &digest_of(b"than promised")).await;
    assert!(wrong.is_err());

    for request in ["one", "two", "later"] {
        let not_before_ms = (request == "later").then(|| now_ms() + DAY.as_millis() as i64);
        let (job, _) = server.store.submit(&new_job(request, &target, not_before_ms), now_ms(), 10).await?;
        folder.acknowledged("job", &job.id);
        if not_before_ms.is_some() {
            server.store.cancel(&job.id, now_ms()).await?;
            folder.acknowledged("cancelled", &job.id);
        }
    }
    server.run_jobs().await?;
    for job in server.store.jobs(&Default::default(), None, 10).await? {
        if job.state == JobState::Succeeded {
            folder.acknowledged("succeeded", &job.id);
        }
    }

    let cause = Cause { caller: "ada".into(), reason: "better".into() };
    for (number, expected_active) in [("1", None), ("2", Some(1))] {
        let version = server.store.add_kernel_version(&kernel(), new_version(&target), now_ms()).await?;
        assert_eq!(version.version.to_string(), number);
        folder.acknowledged("version", number);
        let (version, overridden) = (version.version, Vec::new());
        let promotion = Promotion { version, expected_active, cause: cause.clone(), overridden };
        server.store.promote(&kernel(), promotion, now_ms()).await?;
        folder.acknowledged("active", number);
    }

    // No record refers to this artifact, so the collection removes it.
    server.upload(b"unreferenced", &digest_of(b"unreferenced")).await?;
    Retention { artifacts: Some(DAY), jobs: None }
        .collect(&server.store, &server.artifacts, now_ms() + 2 * DAY.as_millis() as i64)
        .await?;
    backup(&data, &folder.backup()).await?;
    folder.acknowledged("backup", "made");
    restore(&folder.backup(), &folder.0.join("restored"), &RestoredTokens::Keep).await?;
    folder.acknowledged("restored", "whole");
    File::options().write(true).open(data.join("audit.jsonl"))?.set_len(AUDIT_BYTES)?;
    drop(audit);
    let audit = Audit::open(&data)?;
    audit.change(&Change {
        caller: "ada".into(),
        address: String::new(),
        call: "/x".into(),
        object: "displays/lab".into(),
        outcome: "OK".into(),
    });
    audit.flush();
    Ok(())
}

pub(super) fn kernel() -> KernelKey {
    KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE }
}

pub(super) fn now_ms() -> i64 {
    Clock::default().now_ms()
}

fn new_job(request_id: &str, phase: &str, not_before_ms: Option<i64>) -> NewJob {
    let scheduling = Scheduling { owner: "ada".to_owned(), not_before_ms, ..Scheduling::default() };
    NewJob { attempts_max: 5, scheduling, ..capture_job(request_id, phase, 1) }
}

fn new_version(artifact: &str) -> NewKernelVersion {
    NewKernelVersion {
        model: KernelModel::Dense,
        artifact: artifact.to_owned(),
        size_bytes: TARGET.len() as u64,
        metrics: KernelMetrics::default(),
        lineage: KernelLineage::of(KernelOrigin::Learned(Learning::default())),
    }
}
