//! Jobs that wait for other jobs.

use super::changes::Change;
use super::events::append_event;
use super::job_rows::job_of;
use super::rows::{to_json, word};
use super::sql::{query, scalar};
use super::write::Write;
use super::{Result, Store, StoreError};
use lightpath_domain::job::{FailureReason, Job, JobError, JobState};
use lightpath_domain::reason::PreconditionReason;
use std::collections::{HashSet, VecDeque};

impl Store {
    /// Those of the jobs `ids` that exist and are about one of these displays.
    pub async fn jobs_on(&self, ids: &[String], displays: &[String]) -> Result<HashSet<String>> {
        let sql = "select id from job where id in (select value from json_each($1)) \
                   and display in (select value from json_each($2))";
        let found = scalar(sql).bind((to_json("job.after", &ids)?, to_json("display", &displays)?));
        Ok(found.fetch_all(self.readers()).await?.into_iter().collect())
    }
}

/// Limit on the dependencies of all queued jobs: a few dozen for each job of a full queue. Each takes about 100 bytes.
pub(super) const DEPENDENCIES_MAX: u32 = 100_000;

/// Stores the dependencies of a queued job: it waits for the jobs in `after`, which have not succeeded yet.
///
/// # Errors
///
/// [`StoreError::DependenciesFull`].
pub(super) async fn store_dependencies(write: &mut Write, job: &str, after: &[String]) -> Result<()> {
    if after.is_empty() {
        return Ok(());
    }
    let stored: i64 = scalar("select count(*) from job_dependency").fetch_one(write.sql()).await?;
    if stored.unsigned_abs() + after.len() as u64 > u64::from(DEPENDENCIES_MAX) {
        return Err(StoreError::DependenciesFull { limit: DEPENDENCIES_MAX });
    }
    for other in after {
        let sql = "insert into job_dependency values ($1, $2) on conflict do nothing";
        query(sql).bind((job, other)).execute(write.sql()).await?;
    }
    Ok(())
}

/// Those of these jobs that have not succeeded yet.
///
/// # Errors
///
/// [`StoreError::NotFound`]; [`StoreError::Precondition`] if one of the jobs has failed or was cancelled.
pub(super) async fn unfinished(write: &mut Write, after: &[String]) -> Result<Vec<String>> {
    let mut unfinished = Vec::new();
    for id in after {
        let row = query("select state from job where id = $1").bind(id).fetch_optional(write.sql()).await?;
        let row = row.ok_or_else(|| StoreError::not_found(format!("jobs/{id}")))?;
        match word(&row, "job.state")? {
            JobState::Queued | JobState::Running => unfinished.push(id.clone()),
            JobState::Succeeded => {}
            state @ (JobState::Failed | JobState::Cancelled) => {
                let message = format!("jobs/{id} must succeed first, but is {}; retry it first", state.as_str());
                return Err(StoreError::precondition(PreconditionReason::DependencyEnded, message));
            }
        }
    }
    Ok(unfinished)
}

/// Releases the jobs that waited only for `job`, which has succeeded.
pub(super) async fn release_waiting_jobs(write: &mut Write, job: &Job) -> Result<()> {
    let sql = "update job set waiting_for = waiting_for - 1, revision = revision + 1 \
               where id in (select job from job_dependency where after = $1) and state = 'queued' returning id";
    let waiting: Vec<String> = scalar(sql).bind(&job.id).fetch_all(write.sql()).await?;
    query("delete from job_dependency where after = $1").bind(&job.id).execute(write.sql()).await?;
    for id in waiting {
        write.announce(Change::Job(id));
        write.announce(Change::Claimable);
    }
    Ok(())
}

/// Fails the jobs that waited for `job`, directly or through other jobs, because `job` failed or was cancelled.
pub(super) async fn fail_waiting_jobs(write: &mut Write, job: &Job, now_ms: i64) -> Result<()> {
    let mut ended = VecDeque::from([(job.id.clone(), job.state)]);
    while let Some((id, state)) = ended.pop_front() {
        let message = format!("jobs/{id}, which this job waited for, is {}", state.as_str());
        let error = JobError { reason: FailureReason::DependencyFailed, message: message.clone(), retryable: false };
        let sql = "update job set state = 'failed', error = $2, finish_time_ms = $3, checkpoint = null, \
                   revision = revision + 1 \
                   where id in (select job from job_dependency where after = $1) and state = 'queued' returning *";
        let rows = query(sql).bind((&id, to_json("job.error", &error)?, now_ms)).fetch_all(write.sql()).await?;
        for row in rows {
            let waiting = job_of(&row)?;
            append_event(write, &waiting, now_ms, format!("failed: DEPENDENCY_FAILED: {message}")).await?;
            ended.push_back((waiting.id, waiting.state));
        }
        // The ended job waits no more. If it is retried, its dependencies are stored again.
        query("delete from job_dependency where job = $1").bind(&id).execute(write.sql()).await?;
    }
    Ok(())
}
