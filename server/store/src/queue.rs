//! The queue as a whole: its pauses and its state.

use super::changes::{Change, Changed};
use super::displays::require_display;
use super::jobs::QueueCounts;
use super::rows::{from_json, from_word};
use super::sql::{query, query_as};
use super::{Result, Store, StoreError};
use lightpath_domain::job::Progress;
use lightpath_domain::reason::PreconditionReason;

/// Numbers of the jobs of a batch in each state, and the progress of each running job in a row without a state. Only the
/// progress must be read from the rows of the jobs; they are counted in the index.
pub(super) const BATCH: &str = "select state, count(*), null from job where batch = $1 group by state \
     union all select null, 0, progress from job where batch = $1 and state = 'running'";

/// A pause of the queue or of one display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pause {
    /// Id of the display; `None`: the whole queue.
    pub display: Option<String>,
    /// Time when the pause began \[ms since 1970\].
    pub time_ms: i64,
    /// Reason of the pause, a text for people.
    pub reason: String,
}

/// Numbers of waiting and running jobs of one owner.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnerQueue {
    /// Name of the owner; empty: jobs without an owner.
    pub owner: String,
    /// Jobs that wait.
    pub queued: u64,
    /// Jobs that a worker runs.
    pub running: u64,
}

/// Progress of the jobs of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BatchProgress {
    /// Numbers of the jobs in each state.
    pub jobs: QueueCounts,
    /// Mean progress of all jobs, from 0 to 1. A job that has ended counts as 1.
    pub done: f64,
}

impl Store {
    /// Pauses a display (`None`: the whole queue): no more jobs start, and running jobs continue. A pause that exists
    /// gets the new reason.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the display does not exist.
    pub async fn pause(&self, display: Option<&str>, reason: &str, now_ms: i64) -> Result<()> {
        let (display, reason) = (display.unwrap_or_default().to_owned(), reason.to_owned());
        self.write(async move |write| {
            if !display.is_empty() {
                require_display(write.sql(), &display).await?;
            }
            let sql =
                "insert into pause values ($1, $2, $3) on conflict (display) do update set reason = excluded.reason";
            query(sql).bind((display, now_ms, reason)).execute(write.sql()).await?;
            write.announce_changed(Changed::Queue);
            Ok(())
        })
        .await
    }

    /// Ends the pause of a display, or of the whole queue (`None`). Pauses of single displays outlast that of the
    /// queue.
    ///
    /// # Errors
    ///
    /// [`StoreError::Precondition`] if the display or queue is not paused.
    pub async fn resume(&self, display: Option<&str>) -> Result<()> {
        let display = display.unwrap_or_default().to_owned();
        self.write(async move |write| {
            let deleted = query("delete from pause where display = $1").bind(&display).execute(write.sql());
            if deleted.await? == 0 {
                let target = if display.is_empty() { "the queue".to_owned() } else { format!("displays/{display}") };
                return Err(StoreError::precondition(PreconditionReason::NotPaused, format!("{target} is not paused")));
            }
            write.announce(Change::Claimable);
            write.announce_changed(Changed::Queue);
            Ok(())
        })
        .await
    }

    /// Lists all pauses.
    pub async fn pauses(&self) -> Result<Vec<Pause>> {
        let rows = query("select * from pause order by display").fetch_all(self.readers()).await?;
        rows.iter()
            .map(|row| {
                let display: String = row.try_get("display")?;
                Ok(Pause {
                    display: (!display.is_empty()).then_some(display),
                    time_ms: row.try_get("time_ms")?,
                    reason: row.try_get("reason")?,
                })
            })
            .collect()
    }

    /// Numbers of waiting and running jobs of each owner who has any.
    pub async fn owner_queues(&self) -> Result<Vec<OwnerQueue>> {
        let rows = query_as(
            "select owner, cast(sum(case state when 'queued' then jobs else 0 end) as bigint), \
             cast(sum(case state when 'running' then jobs else 0 end) as bigint) from job_count \
             where state in ('queued', 'running') group by owner order by owner",
        )
        .fetch_all(self.readers())
        .await?;
        Ok(rows.into_iter().map(|(owner, queued, running)| OwnerQueue { owner, queued, running }).collect())
    }

    /// Progress of the jobs of a batch.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] if the batch has no jobs.
    pub async fn batch(&self, name: &str) -> Result<BatchProgress> {
        let rows: Vec<(Option<String>, i64, Option<String>)> =
            query_as(BATCH).bind(name).fetch_all(self.readers()).await?;
        let (mut jobs, mut count_all, mut done) = (QueueCounts::default(), 0, 0.0);
        for (state, count, running) in rows {
            let Some(state) = state else {
                if let Some(progress) = running {
                    done += from_json::<Progress>("job.progress", &progress)?.fraction();
                }
                continue;
            };
            *jobs.of(from_word("job.state", state)?) = count.unsigned_abs();
            count_all += count;
        }
        if count_all == 0 {
            return Err(StoreError::not_found(format!("batch {name:?}")));
        }
        done += (jobs.succeeded + jobs.failed + jobs.cancelled) as f64;
        Ok(BatchProgress { jobs, done: done / count_all as f64 })
    }
}
