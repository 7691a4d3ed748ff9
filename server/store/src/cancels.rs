//! Requests of users about a job: cancelling it and retrying it.

use super::changes::Change;
use super::events::append_event;
use super::job_rows::job_of;
use super::jobs::{active_with_key, require_datasets};
use super::sql::query;
use super::write::Write;
use super::{Result, Store, StoreError, dependencies};
use lightpath_domain::job::{Job, JobState};
use lightpath_domain::reason::PreconditionReason;

impl Store {
    /// Cancels a queued job at once. For a running job it records the request, and the worker ends the job.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`]; [`StoreError::Precondition`] if the job has ended.
    pub async fn cancel(&self, id: &str, now_ms: i64) -> Result<Job> {
        let id = id.to_owned();
        self.write(async move |write| cancel(write, &id, now_ms).await).await
    }

    /// Queues a failed or cancelled job again. It gets its full number of attempts.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`], also if a dataset of the job was deleted; [`StoreError::Precondition`] if the job
    /// waits, runs or has succeeded; [`StoreError::DependenciesFull`].
    pub async fn retry(&self, id: &str, now_ms: i64) -> Result<Job> {
        let id = id.to_owned();
        self.write(async move |write| retry(write, &id, now_ms).await).await
    }
}

async fn cancel(write: &mut Write, id: &str, now_ms: i64) -> Result<Job> {
    let job = read(write, id).await?;
    match job.state {
        JobState::Queued => {
            let row = query(
                "update job set state = 'cancelled', finish_time_ms = $2, cancel_requested = 1, checkpoint = null, \
                 revision = revision + 1 where id = $1 returning *",
            )
            .bind((id, now_ms))
            .fetch_one(write.sql())
            .await?;
            let job = job_of(&row)?;
            append_event(write, &job, now_ms, "cancelled").await?;
            dependencies::fail_waiting_jobs(write, &job, now_ms).await?;
            Ok(job)
        }
        JobState::Running if job.cancel_requested => Ok(job),
        JobState::Running => {
            let row = query("update job set cancel_requested = 1, revision = revision + 1 where id = $1 returning *")
                .bind(id)
                .fetch_one(write.sql())
                .await?;
            let job = job_of(&row)?;
            append_event(write, &job, now_ms, "cancel requested").await?;
            write.announce(Change::Cancel(job.id.clone()));
            Ok(job)
        }
        JobState::Succeeded | JobState::Failed | JobState::Cancelled => {
            let message = format!("jobs/{id} has ended ({}) and cannot be cancelled", job.state.as_str());
            Err(StoreError::precondition(PreconditionReason::JobEnded, message))
        }
    }
}

async fn retry(write: &mut Write, id: &str, now_ms: i64) -> Result<Job> {
    let job = read(write, id).await?;
    if !matches!(job.state, JobState::Failed | JobState::Cancelled) {
        let message = format!(
            "the state of jobs/{id} is {}; only a failed or cancelled job can be queued again",
            job.state.as_str()
        );
        return Err(StoreError::precondition(PreconditionReason::JobNotRetryable, message));
    }
    if let Some(key) = &job.scheduling.unique_key
        && let Some(other) = active_with_key(write.sql(), &job.scheduling.owner, key).await?
    {
        let message = format!("jobs/{other} has the same unique_key \"{key}\" and has not ended");
        return Err(StoreError::precondition(PreconditionReason::NotUnique, message));
    }
    require_datasets(write.sql(), &job.spec).await?;
    let unfinished = dependencies::unfinished(write, &job.scheduling.after).await?;
    dependencies::store_dependencies(write, id, &unfinished).await?;
    let row = query(
        "update job set state = 'queued', failures = 0, crashes = 0, cancel_requested = 0, error = null, progress = null, \
         finish_time_ms = null, run_time_ms = $2, waiting_for = $3, revision = revision + 1 where id = $1 returning *",
    )
    .bind((id, now_ms, unfinished.len() as i64))
    .fetch_one(write.sql())
    .await?;
    let job = job_of(&row)?;
    append_event(write, &job, now_ms, "queued again by hand").await?;
    write.announce(Change::Claimable);
    Ok(job)
}

async fn read(write: &mut Write, id: &str) -> Result<Job> {
    let row = query("select * from job where id = $1").bind(id).fetch_optional(write.sql()).await?;
    job_of(&row.ok_or_else(|| StoreError::not_found(format!("jobs/{id}")))?)
}
