//! Ends of attempts: with a result, an error, a cancellation, a drain, or the death of the worker.

use super::changes::Change;
use super::events::append_event;
use super::job_rows::job_of;
use super::kernels::append_version;
use super::leases::{bind_lease, fenced, job_or_lease_lost, read};
use super::prepared::store_prepared;
use super::rows::to_json;
use super::sql::{Row, query, scalar};
use super::write::Write;
use super::{Result, Store, dependencies};
use lightpath_domain::job::{FailureReason, Job, JobEffect, JobError, JobResult, Lease};
use lightpath_domain::kernel::{KernelKey, NewKernelVersion};
use std::time::Duration;

/// Limit on the leases that one call expires. The next call expires the remaining ones.
const EXPIRED_MAX: i64 = 1000;

/// Time without a sign of life after which the process of an expired lease counts as dead: two signs are missing.
const SILENCE_MAX: Duration = Duration::from_secs(12);

/// End of an attempt without a result.
enum Ending {
    /// The job returns to the queue. An interrupted job keeps its `run_time_ms`, so it runs before jobs that became due
    /// after it.
    Requeued {
        run_time_ms: i64,
        failures: i64,
        cause: Cause,
    },
    Failed {
        failures: i64,
        error: JobError,
    },
    Cancelled,
}

/// Reason why a job returns to the queue.
enum Cause {
    Error(JobError),
    Drain,
    ServerDied,
}

impl Store {
    /// Ends the job with its result and applies its effect in the same transaction. Learned kernels become new versions
    /// of their kernels, and the result contains the names of these versions. If the job finalized a dataset, the
    /// result contains the dataset's digest.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`]; [`crate::StoreError::NotFound`] if an artifact of the effect is not recorded;
    /// [`crate::StoreError::Aborted`] if the dataset changed after the job read it; [`crate::StoreError::Precondition`] if the
    /// dataset was finalized in the meantime, if its split has no training pair or no test pair, or if a kernel has
    /// reached its limit of versions.
    pub async fn finish(&self, lease: &Lease, result: JobResult, effect: JobEffect, now_ms: i64) -> Result<Job> {
        let lease = lease.clone();
        self.write(async move |write| finish(write, &lease, result, effect, now_ms).await).await
    }

    /// Ends the attempt with an error. With `retry_at_ms`, the job returns to the queue and runs again at that time,
    /// unless it has no attempts left. Without it, the job fails. A job whose cancellation was requested is cancelled
    /// instead.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`].
    pub async fn fail(&self, lease: &Lease, error: JobError, retry_at_ms: Option<i64>, now_ms: i64) -> Result<Job> {
        let lease = lease.clone();
        self.write(async move |write| {
            let (job, failures, crashes) = read(write, &lease).await?;
            let ending = after_failure(&job, failures, crashes, error, retry_at_ms);
            end(write, &job.id, ending, now_ms).await
        })
        .await
    }

    /// Returns the job to the queue until `retry_at_ms` because of an error that the job did not cause. The attempt
    /// does not count as failed.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`].
    pub async fn postpone(&self, lease: &Lease, error: JobError, retry_at_ms: i64, now_ms: i64) -> Result<Job> {
        let lease = lease.clone();
        self.write(async move |write| {
            let (job, failures, _) = read(write, &lease).await?;
            let error = JobError { retryable: true, ..error };
            let ending = match job.cancel_requested {
                true => Ending::Cancelled,
                false => Ending::Requeued { run_time_ms: retry_at_ms, failures, cause: Cause::Error(error) },
            };
            end(write, &job.id, ending, now_ms).await
        })
        .await
    }

    /// Ends the job as cancelled, because a user requested it.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`].
    pub async fn end_cancelled(&self, lease: &Lease, now_ms: i64) -> Result<Job> {
        let lease = lease.clone();
        self.write(async move |write| {
            let (job, ..) = read(write, &lease).await?;
            end(write, &job.id, Ending::Cancelled, now_ms).await
        })
        .await
    }

    /// Takes every running job from the workers of a process that stops, because some of its jobs did not stop in time.
    /// `None` is the only process that works on this database. The jobs return to the queue, and neither failures nor
    /// deaths of the server are counted.
    pub async fn release_all(&self, process: Option<&str>, now_ms: i64) -> Result<Vec<Job>> {
        let mut released = Vec::new();
        loop {
            let process = process.map(str::to_owned);
            let mut jobs = self.write(async move |write| release_running(write, process, now_ms).await).await?;
            if jobs.is_empty() {
                return Ok(released);
            }
            released.append(&mut jobs);
        }
    }

    /// Returns the job to the queue that got this lease by a claim whose answer was lost, so that nobody runs it. The attempt
    /// does not count as failed.
    pub async fn abandon_claim(&self, lease_id: &str, now_ms: i64) -> Result<()> {
        let lease_id = lease_id.to_owned();
        self.write(async move |write| {
            let sql = "select * from job where state = 'running' and lease_id = $1";
            if let Some(row) = query(sql).bind(lease_id).fetch_optional(write.sql()).await? {
                let job = job_of(&row)?;
                end(write, &job.id, after_stop(&job, row.try_get("failures")?), now_ms).await?;
            }
            Ok(())
        })
        .await
    }

    /// Returns the job to the queue because the worker stops. The attempt does not count as failed.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`].
    pub async fn release(&self, lease: &Lease, now_ms: i64) -> Result<Job> {
        let lease = lease.clone();
        self.write(async move |write| {
            let (job, failures, _) = read(write, &lease).await?;
            end(write, &job.id, after_stop(&job, failures), now_ms).await
        })
        .await
    }

    /// Takes jobs from workers whose leases have expired. Each job returns to the queue, or fails if it has no attempts
    /// left.
    pub async fn expire_leases(&self, now_ms: i64) -> Result<Vec<Job>> {
        self.write(async move |write| expire(write, now_ms).await).await
    }

    /// Ends the attempt of a job that ran in a process of its own, because that process died. Its deaths count as failed
    /// attempts until the job saves a checkpoint: nothing else ran in it.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::LeaseLost`], also if the process had stored the end of the attempt before it died.
    pub async fn end_dead(&self, lease: &Lease, death: &str, retry_at_ms: i64, now_ms: i64) -> Result<Job> {
        let (lease, death) = (lease.clone(), death.to_owned());
        self.write(async move |write| {
            let (job, failures, crashes) = read(write, &lease).await?;
            let crashes = crashes + 1;
            query("update job set crashes = $1 where id = $2").bind((crashes, &job.id)).execute(write.sql()).await?;
            let message = match crashes {
                1 => format!("the process that ran this job alone {death}"),
                _ => format!(
                    "the process that ran this job alone died {crashes} times, and no state was saved in between; the last \
                     one {death}"
                ),
            };
            let error = JobError { reason: FailureReason::ProcessDied, message, retryable: true };
            // The death is counted already.
            let ending = after_failure(&job, failures - 1, crashes, error, Some(retry_at_ms));
            end(write, &job.id, ending, now_ms).await
        })
        .await
    }

    /// Takes every running job from the workers of a process at its next start: they are dead. `None` is the only process
    /// that works on this database, whose start finds all workers dead. Nobody knows which job caused the death, or
    /// whether one did. So it counts for none, and each runs in a process of its own from now on.
    pub async fn recover_orphans(&self, process: Option<&str>, now_ms: i64) -> Result<Vec<Job>> {
        let process = process.map(str::to_owned);
        self.write(async move |write| recover_orphans(write, process, now_ms).await).await
    }
}

async fn finish(
    write: &mut Write,
    lease: &Lease,
    mut result: JobResult,
    effect: JobEffect,
    now_ms: i64,
) -> Result<Job> {
    read(write, lease).await?;
    match effect {
        JobEffect::None => {}
        JobEffect::Kernels(learned) => {
            let names = append_versions(write, learned, now_ms).await?;
            if let JobResult::LearnKernel(learn) = &mut result {
                learn.kernels.iter_mut().zip(names).for_each(|(kernel, name)| kernel.kernel_version = name);
            }
        }
        JobEffect::Dataset(prepared) => {
            let dataset = store_prepared(write, *prepared, now_ms).await?;
            if let JobResult::PrepareDataset(result) = &mut result {
                result.dataset_digest = dataset.digest;
            }
        }
    }
    let sql = fenced!(
        "state = 'succeeded', lease_id = null, lease_until_ms = null, worker = null, process = null, finish_time_ms = $4, \
         error = null, checkpoint = null, result = $5"
    );
    let query = bind_lease(sql, lease).bind((now_ms, to_json("job.result", &result)?));
    let job = job_or_lease_lost(query.fetch_optional(write.sql()).await?)?;
    append_event(write, &job, now_ms, "succeeded").await?;
    dependencies::release_waiting_jobs(write, &job).await?;
    Ok(job)
}

/// Appends the learned versions to their kernels and returns the names of these versions.
async fn append_versions(
    write: &mut Write,
    learned: Vec<(KernelKey, NewKernelVersion)>,
    now_ms: i64,
) -> Result<Vec<String>> {
    let mut names = Vec::with_capacity(learned.len());
    for (key, version) in learned {
        let version = append_version(write, &key, version, now_ms).await?;
        names.push(format!("{key}/versions/{}", version.version));
    }
    Ok(names)
}

async fn expire(write: &mut Write, now_ms: i64) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for row in running_until(write, now_ms).await? {
        let job = job_of(&row)?;
        // A heartbeat takes no turn and may have come in between. In PostgreSQL this waits for it, and keeps later ones out.
        let sql = "update job set lease_until_ms = lease_until_ms where id = $1 and lease_until_ms <= $2";
        if query(sql).bind((&job.id, now_ms)).execute(write.sql()).await? == 0 {
            continue;
        }
        if has_died(write, &row, now_ms).await? {
            jobs.push(end_orphan(write, &row, now_ms).await?);
            continue;
        }
        let message = format!("{} sent no heartbeat before its lease expired", row.try_get::<String>("worker")?);
        let error = JobError { reason: FailureReason::LeaseExpired, message, retryable: true };
        let ending = after_failure(&job, row.try_get("failures")?, row.try_get("crashes")?, error, Some(now_ms));
        jobs.push(end(write, &job.id, ending, now_ms).await?);
    }
    Ok(jobs)
}

/// Whether the process is dead that ran this job: it gives no more signs of life. A process that lives and lets a lease
/// end could not store the end of the attempt, which counts as a failure of the job.
async fn has_died(write: &mut Write, row: &Row, now_ms: i64) -> Result<bool> {
    let Some(process) = row.try_get::<Option<String>>("process")? else { return Ok(false) };
    let sql = "select not exists (select 1 from process where id = $1 and seen_time_ms > $2)";
    Ok(scalar(sql).bind((process, now_ms - SILENCE_MAX.as_millis() as i64)).fetch_one(write.sql()).await?)
}

async fn release_running(write: &mut Write, process: Option<String>, now_ms: i64) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for row in running_in(write, process).await? {
        let job = job_of(&row)?;
        let ending = after_stop(&job, row.try_get("failures")?);
        jobs.push(end(write, &job.id, ending, now_ms).await?);
    }
    Ok(jobs)
}

async fn recover_orphans(write: &mut Write, process: Option<String>, now_ms: i64) -> Result<Vec<Job>> {
    let mut jobs = Vec::new();
    for row in running_in(write, process).await? {
        jobs.push(end_orphan(write, &row, now_ms).await?);
    }
    Ok(jobs)
}

/// Ends the attempt of a job whose process died while other jobs may have run in it.
async fn end_orphan(write: &mut Write, row: &Row, now_ms: i64) -> Result<Job> {
    let (job, failures) = (job_of(row)?, row.try_get("failures")?);
    let ending = match job.cancel_requested {
        true => Ending::Cancelled,
        false => Ending::Requeued { run_time_ms: job.run_time_ms, failures, cause: Cause::ServerDied },
    };
    query("update job set suspect = 1 where id = $1").bind(&job.id).execute(write.sql()).await?;
    end(write, &job.id, ending, now_ms).await
}

/// At most [`EXPIRED_MAX`] jobs that a process runs; `None`: that any process runs. A running job without a process was
/// moved here from SQLite, whose server has ended.
async fn running_in(write: &mut Write, process: Option<String>) -> Result<Vec<Row>> {
    match process {
        None => running_until(write, i64::MAX).await,
        Some(process) => {
            let sql = "select * from job where state = 'running' and (process = $1 or process is null) \
                       order by lease_until_ms limit $2";
            Ok(query(sql).bind((process, EXPIRED_MAX)).fetch_all(write.sql()).await?)
        }
    }
}

/// At most [`EXPIRED_MAX`] running jobs whose leases end by `until_ms`.
async fn running_until(write: &mut Write, until_ms: i64) -> Result<Vec<Row>> {
    let sql = "select * from job where state = 'running' and lease_until_ms <= $1 order by lease_until_ms limit $2";
    Ok(query(sql).bind((until_ms, EXPIRED_MAX)).fetch_all(write.sql()).await?)
}

/// Chooses the end of an attempt that ends because its worker stops: requeued in its old place, or cancelled.
fn after_stop(job: &Job, failures: i64) -> Ending {
    match job.cancel_requested {
        true => Ending::Cancelled,
        false => Ending::Requeued { run_time_ms: job.run_time_ms, failures, cause: Cause::Drain },
    }
}

/// Chooses the end of a failed attempt: requeued, failed or cancelled.
fn after_failure(job: &Job, failures: i64, crashes: i64, mut error: JobError, retry_at_ms: Option<i64>) -> Ending {
    let failures = failures + 1;
    if job.cancel_requested {
        return Ending::Cancelled;
    }
    match retry_at_ms {
        Some(run_time_ms) if failures + crashes < i64::from(job.attempts_max) => {
            error.retryable = true;
            Ending::Requeued { run_time_ms, failures, cause: Cause::Error(error) }
        }
        _ => {
            error.retryable = false;
            Ending::Failed { failures, error }
        }
    }
}

/// Ends the attempt of a running job. The caller has checked in this transaction that the lease is valid or has
/// expired.
async fn end(write: &mut Write, id: &str, ending: Ending, now_ms: i64) -> Result<Job> {
    let sql = "update job set state = $2, lease_id = null, lease_until_ms = null, worker = null, \
               process = null, run_time_ms = coalesce($3, run_time_ms), finish_time_ms = $4, failures = coalesce($5, failures), \
               error = $6, cancel_requested = case $2 when 'cancelled' then 1 else 0 end, \
               checkpoint = case $2 when 'cancelled' then null else checkpoint end, revision = revision + 1 \
               where id = $1 and state = 'running' returning *";
    let (state, run_time, finish_time, failures, error, message) = match ending {
        Ending::Requeued { run_time_ms, failures, cause } => {
            let (error, message) = match cause {
                Cause::Error(error) => {
                    let message = format!("{}: {}; queued again", error.reason, error.message);
                    (Some(error), message)
                }
                Cause::Drain => (None, "the server stopped; queued again".to_owned()),
                Cause::ServerDied => (None, "the server died; queued again, to run in a process of its own".to_owned()),
            };
            ("queued", Some(run_time_ms), None, Some(failures), error, message)
        }
        Ending::Failed { failures, error } => {
            let message = format!("failed: {}: {}", error.reason, error.message);
            ("failed", None, Some(now_ms), Some(failures), Some(error), message)
        }
        Ending::Cancelled => ("cancelled", None, Some(now_ms), None, None, "cancelled".to_owned()),
    };
    let row = query(sql)
        .bind((id, state, run_time, finish_time, failures))
        .bind(error.map(|error| to_json("job.error", &error)).transpose()?)
        .fetch_one(write.sql())
        .await?;
    let job = job_of(&row)?;
    append_event(write, &job, now_ms, message).await?;
    match job.state.has_ended() {
        true => dependencies::fail_waiting_jobs(write, &job, now_ms).await?,
        false => write.announce(Change::Claimable),
    }
    Ok(job)
}
