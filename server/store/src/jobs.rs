//! Submitting, reading and counting jobs.

use super::changes::Change;
use super::events::append_event;
use super::job_rows::job_of;
use super::rows::{from_word, to_json};
use super::sql::{Connection, query, query_as, scalar};
use super::write::Write;
use super::{Result, Store, StoreError, dependencies};
use lightpath_domain::ability::counted_memory;
use lightpath_domain::job::{Job, JobSpec, JobState, NewJob, Scheduling};
use uuid::Uuid;

/// Whether a submit created a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Submitted {
    /// The submit created the job.
    New,
    /// An earlier submit of the same request had created the job.
    Existing,
}

/// Limits on the queue and on its owners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QueueLimits {
    /// Limit on all waiting jobs.
    pub queued: u32,
    /// Limit on the waiting jobs of one owner; 0: only the limit on all waiting jobs applies.
    pub queued_per_owner: u32,
    /// An owner who has stored this many bytes can submit no more jobs; 0: no limit.
    pub stored_bytes_per_owner: u64,
}

impl From<u32> for QueueLimits {
    fn from(queued: u32) -> Self {
        Self { queued, queued_per_owner: 0, stored_bytes_per_owner: 0 }
    }
}

/// Numbers of jobs in each state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QueueCounts {
    /// Jobs that wait.
    pub queued: u64,
    /// Jobs that a worker runs.
    pub running: u64,
    /// Jobs that ended with a result.
    pub succeeded: u64,
    /// Jobs that ended with an error.
    pub failed: u64,
    /// Jobs that were cancelled.
    pub cancelled: u64,
}

impl QueueCounts {
    /// The number of jobs in a state.
    pub(super) fn of(&mut self, state: JobState) -> &mut u64 {
        match state {
            JobState::Queued => &mut self.queued,
            JobState::Running => &mut self.running,
            JobState::Succeeded => &mut self.succeeded,
            JobState::Failed => &mut self.failed,
            JobState::Cancelled => &mut self.cancelled,
        }
    }
}

impl Store {
    /// Queues a job, which is on disk when this returns. If its owner submits the same request (id and content) again,
    /// this returns the job of the first submit.
    ///
    /// # Errors
    ///
    /// [`StoreError::AlreadyExists`] if the owner used the request id with other content, or a waiting or running job
    /// of the owner has the same unique key; [`StoreError::QueueFull`] and [`StoreError::OwnerQueueFull`] if too many
    /// jobs wait already; [`StoreError::OwnerBytes`] if the owner has stored too much;
    /// [`StoreError::DependenciesFull`]; [`StoreError::Precondition`] if a job that this job waits for has failed or
    /// was cancelled; [`StoreError::NotFound`] if the display, the dataset or an artifact does not exist.
    pub async fn submit(&self, new: &NewJob, now_ms: i64, limits: impl Into<QueueLimits>) -> Result<(Job, Submitted)> {
        let (new, limits) = (new.clone(), limits.into());
        self.write(async move |write| submit(write, new, now_ms, limits).await).await
    }

    /// [`Self::submit`] for several jobs, all or none.
    ///
    /// # Errors
    ///
    /// As [`Self::submit`].
    pub async fn submit_all(
        &self,
        new: &[NewJob],
        now_ms: i64,
        limits: impl Into<QueueLimits>,
    ) -> Result<Vec<(Job, Submitted)>> {
        let (new, limits) = (new.to_vec(), limits.into());
        self.write(async move |write| {
            let mut submitted = Vec::with_capacity(new.len());
            for job in new {
                submitted.push(submit(write, job, now_ms, limits).await?);
            }
            Ok(submitted)
        })
        .await
    }

    /// Reads a job.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn job(&self, id: &str) -> Result<Job> {
        let row = query("select * from job where id = $1").bind(id).fetch_optional(self.readers()).await?;
        job_of(&row.ok_or_else(|| StoreError::not_found(format!("jobs/{id}")))?)
    }

    /// The job that the owner's request with this id created, if any. A repeated submit that names "the active kernel"
    /// must mean the version that was active at the first submit, so callers look here before they resolve that name.
    pub async fn job_by_request(&self, owner: &str, request_id: &str) -> Result<Option<Job>> {
        let row = query("select * from job where owner = $1 and request_id = $2")
            .bind((owner, request_id))
            .fetch_optional(self.readers())
            .await?;
        row.as_ref().map(job_of).transpose()
    }

    /// Digests of the checkpoints of all jobs.
    pub async fn live_checkpoints(&self) -> Result<Vec<String>> {
        let digests = scalar("select checkpoint from job where checkpoint is not null");
        Ok(digests.fetch_all(self.readers()).await?)
    }

    /// Numbers of jobs in each state.
    pub async fn queue_counts(&self) -> Result<QueueCounts> {
        let rows: Vec<(String, i64)> =
            query_as("select state, cast(sum(jobs) as bigint) from job_count group by state")
                .fetch_all(self.readers())
                .await?;
        let mut counts = QueueCounts::default();
        for (state, count) in rows {
            *counts.of(from_word("job.state", state)?) = count.unsigned_abs();
        }
        Ok(counts)
    }
}

async fn submit(write: &mut Write, new: NewJob, now_ms: i64, limits: QueueLimits) -> Result<(Job, Submitted)> {
    let spec = to_json("job.spec", &new.spec)?;
    if let Some(job) = find_existing(write.sql(), &new, &spec).await? {
        return Ok((job, Submitted::Existing));
    }
    require_display_and_room(write.sql(), &new, limits).await?;
    let Scheduling { owner, batch, unique_key, not_before_ms, timeout_ms, after, label, needs } = &new.scheduling;
    let unfinished = dependencies::unfinished(write, after).await?;
    let id = Uuid::now_v7().to_string();
    let words = words_of(&id, &new);
    let row = query(
        "insert into job (id, request_id, display, dataset, spec, state, priority, attempts_max, create_time_ms, \
         run_time_ms, owner, batch, unique_key, not_before_ms, timeout_ms, after, waiting_for, \
         estimated_bytes, estimated_ms, kind, words, label, needs, counted_bytes) \
         values ($1, $2, $3, $4, $5, 'queued', $6, $7, $8, max($8, coalesce($12, $8)), $9, $10, $11, $12, $13, $14, $15, \
         $16, $17, $18, $20, $19, $21, $22) \
         returning *",
    )
    .bind((id, &new.request_id, new.spec.display(), new.spec.dataset(), &spec, new.priority, new.attempts_max, now_ms))
    .bind((owner, batch, unique_key, not_before_ms, timeout_ms, to_json("job.after", after)?, unfinished.len() as i64))
    .bind((i64::try_from(new.estimate.memory_bytes).unwrap_or(i64::MAX), (new.estimate.time_s * 1e3) as i64))
    .bind((new.spec.kind(), label, words, to_json("job.needs", needs)?))
    .bind(i64::try_from(counted_memory(new.estimate.memory_bytes)).unwrap_or(i64::MAX))
    .fetch_one(write.sql())
    .await?;
    let job = job_of(&row)?;
    dependencies::store_dependencies(write, &job.id, &unfinished).await?;
    require_artifacts(write.sql(), &job.id).await?;
    append_event(write, &job, now_ms, "queued").await?;
    write.announce(Change::Claimable);
    Ok((job, Submitted::New))
}

/// What users find a job by, in small letters.
fn words_of(id: &str, new: &NewJob) -> String {
    let Scheduling { owner, batch, unique_key, label, .. } = &new.scheduling;
    let words = [Some(id), Some(&new.request_id), Some(owner), batch.as_deref(), unique_key.as_deref()];
    let about = [Some(new.spec.display()), new.spec.dataset(), label.as_deref()];
    let words: Vec<&str> = words.into_iter().chain(about).flatten().collect();
    words.join(" ").to_ascii_lowercase()
}

/// The job that an earlier submit of the same request created.
async fn find_existing(sql: &mut Connection, new: &NewJob, spec: &str) -> Result<Option<Job>> {
    let query = query("select * from job where owner = $1 and request_id = $2");
    let row = query.bind((&new.scheduling.owner, &new.request_id)).fetch_optional(sql).await?;
    let Some(row) = row else { return Ok(None) };
    let job = job_of(&row)?;
    // The texts are compared, not the values: a number that was rounded when stored would make the same request look
    // different.
    let same = row.try_get::<String>("spec")? == spec
        && job.priority == new.priority
        && job.attempts_max == new.attempts_max
        && job.scheduling == new.scheduling;
    if !same {
        let detail = format!("as jobs/{} with other content", job.id);
        return Err(StoreError::exists(format!("request_id \"{}\"", new.request_id), detail));
    }
    Ok(Some(job))
}

/// Checks that the display and the datasets of the job exist, that the queue has room for a job of this owner, and that no
/// waiting or running job of the owner has its unique key.
async fn require_display_and_room(sql: &mut Connection, new: &NewJob, limits: QueueLimits) -> Result<()> {
    let (queued, owned, has_display): (i64, i64, bool) = query_as(
        "select coalesce(cast(sum(jobs) as bigint), 0), coalesce(cast(sum(jobs) filter (where owner = $1) as bigint), 0), \
         exists (select 1 from display where id = $2) from job_count where state = 'queued'",
    )
    .bind((&new.scheduling.owner, new.spec.display()))
    .fetch_one(&mut *sql)
    .await?;
    if !has_display {
        return Err(StoreError::not_found(format!("displays/{}", new.spec.display())));
    }
    require_datasets(sql, &new.spec).await?;
    if queued >= i64::from(limits.queued) {
        return Err(StoreError::QueueFull { limit: limits.queued });
    }
    if limits.queued_per_owner > 0 && owned >= i64::from(limits.queued_per_owner) {
        return Err(StoreError::OwnerQueueFull { limit: limits.queued_per_owner });
    }
    super::artifacts::require_room(sql, &new.scheduling.owner, 1, limits.stored_bytes_per_owner).await?;
    let Some(key) = &new.scheduling.unique_key else { return Ok(()) };
    match active_with_key(sql, &new.scheduling.owner, key).await? {
        Some(id) => {
            Err(StoreError::exists(format!("unique_key \"{key}\""), format!("in jobs/{id}, which has not ended")))
        }
        None => Ok(()),
    }
}

/// Id of the owner's waiting or running job with this unique key.
pub(super) async fn active_with_key(sql: &mut Connection, owner: &str, key: &str) -> Result<Option<String>> {
    let query = scalar("select id from job where owner = $1 and unique_key = $2 and state in ('queued', 'running')");
    Ok(query.bind((owner, key)).fetch_optional(sql).await?)
}

/// Checks that the datasets of a job are datasets of its display. Another display may have a dataset with the id of a
/// deleted one.
pub(super) async fn require_datasets(sql: &mut Connection, spec: &JobSpec) -> Result<()> {
    if spec.datasets().is_empty() {
        return Ok(());
    }
    let missing: Option<String> = scalar(
        "select value from json_each($1) where not exists \
         (select 1 from dataset where id = value and display = $2) limit 1",
    )
    .bind((to_json("job.spec", &spec.datasets())?, spec.display()))
    .fetch_optional(sql)
    .await?;
    missing.map_or(Ok(()), |id| Err(StoreError::not_found(format!("datasets/{id}"))))
}

/// Checks that the artifacts that the new job reads still exist: unused artifacts are removed after a while.
async fn require_artifacts(sql: &mut Connection, id: &str) -> Result<()> {
    let missing: Option<String> = scalar(
        "select artifact from job_artifact where job = $1 \
         and not exists (select 1 from artifact a where a.digest = job_artifact.artifact) limit 1",
    )
    .bind(id)
    .fetch_optional(sql)
    .await?;
    missing.map_or(Ok(()), |digest| Err(StoreError::not_found(format!("artifact {digest}"))))
}
