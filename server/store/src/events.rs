//! The events of a job, for people.

use super::changes::Change;
use super::sql::{from_row, query};
use super::write::Write;
use super::{Result, Store, page};
use lightpath_domain::job::{Job, JobEvent};

impl Store {
    /// At most `limit` events of a job, oldest first, behind the event `after`.
    ///
    /// # Errors
    ///
    /// [`crate::StoreError::NotFound`] if the job does not exist.
    pub async fn events(&self, job: &str, after: Option<i64>, limit: u32) -> Result<Vec<JobEvent>> {
        self.job(job).await?;
        let rows = query("select * from job_event where job = $1 and sequence > $2 order by sequence limit $3")
            .bind((job, after.unwrap_or(0), page(limit)))
            .fetch_all(self.readers())
            .await?;
        rows.iter().map(|row| Ok(from_row!(row, JobEvent { sequence, time_ms, attempt, message }))).collect()
    }
}

/// Limit on the events of a job: more than a person reads. The oldest ones are removed, because a client can cancel and
/// retry a job for ever.
pub(super) const EVENTS_MAX: u32 = 1000;

/// Appends an event in the transaction that caused it, and announces the change of the job.
pub(super) async fn append_event(write: &mut Write, job: &Job, now_ms: i64, message: impl Into<String>) -> Result<()> {
    query("insert into job_event (job, time_ms, attempt, message) values ($1, $2, $3, $4)")
        .bind((&job.id, now_ms, job.attempt, message.into()))
        .execute(write.sql())
        .await?;
    // Each event comes with a new revision, so a job has no more events than revisions.
    if job.revision > u64::from(EVENTS_MAX) {
        let forget_old = "delete from job_event where job = $1 and sequence <= \
                          (select sequence from job_event where job = $1 order by sequence desc limit 1 offset $2)";
        query(forget_old).bind((&job.id, EVENTS_MAX)).execute(write.sql()).await?;
    }
    write.announce(Change::Job(job.id.clone()));
    // Each end of a job is an event; its progress is none.
    write.announce(Change::Deliverable);
    Ok(())
}
