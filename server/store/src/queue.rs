//! The queue as a whole: pausing it, and how it stands.

use super::changes::Change;
use super::{PreconditionReason, Store, StoreError};
use sqlx::Row;

/// Why nothing starts, and for whom.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pause {
    /// Id of the display; `None`: the whole queue.
    pub display: Option<String>,
    /// Since when \[ms since 1970\].
    pub time_ms: i64,
    /// For people.
    pub reason: String,
}

/// How many jobs somebody has in the queue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Turn {
    /// Empty: jobs that nobody's name is on.
    pub owner: String,
    /// Waiting.
    pub queued: u64,
    /// At a worker.
    pub running: u64,
}

/// How the jobs of a batch stand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BatchProgress {
    /// Waiting.
    pub queued: u64,
    /// At a worker.
    pub running: u64,
    /// Ended with a result.
    pub succeeded: u64,
    /// Ended without.
    pub failed: u64,
    /// Ended on request.
    pub cancelled: u64,
    /// 0 to 1: the mean over all jobs, of which those that ended count as done.
    pub done: f64,
}

impl Store {
    /// From now on nothing starts for the display (`None`: at all); what runs goes on. Paused already, the reason is
    /// replaced.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] where there is no such display.
    pub async fn pause(&self, display: Option<&str>, reason: &str, now_ms: i64) -> Result<(), StoreError> {
        let (display, reason) = (display.unwrap_or_default().to_owned(), reason.to_owned());
        self.write(move |write| {
            Box::pin(async move {
                let known = sqlx::query_scalar("select ?1 = '' or exists (select 1 from display where id = ?1)");
                let known: bool = known.bind(&display).fetch_one(write.sql()).await?;
                if !known {
                    return Err(StoreError::not_found(format!("displays/{display}")));
                }
                let sql = "insert into pause values (?, ?, ?) on conflict do update set reason = excluded.reason";
                sqlx::query(sql).bind(display).bind(now_ms).bind(reason).execute(write.sql()).await?;
                Ok(())
            })
        })
        .await
    }

    /// Jobs start again for the display (`None`: for all that are not paused themselves).
    ///
    /// # Errors
    ///
    /// [`StoreError::Precondition`] where nothing is paused.
    pub async fn resume(&self, display: Option<&str>) -> Result<(), StoreError> {
        let display = display.unwrap_or_default().to_owned();
        self.write(move |write| {
            Box::pin(async move {
                let gone = sqlx::query("delete from pause where display = ?").bind(&display).execute(write.sql());
                if gone.await?.rows_affected() == 0 {
                    let what = if display.is_empty() { "the queue".to_owned() } else { format!("displays/{display}") };
                    return Err(StoreError::precondition(
                        PreconditionReason::NotPaused,
                        format!("{what} is not paused"),
                    ));
                }
                write.announce(Change::Claimable);
                Ok(())
            })
        })
        .await
    }

    /// All pauses.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn pauses(&self) -> Result<Vec<Pause>, StoreError> {
        let rows = sqlx::query("select * from pause order by display").fetch_all(self.readers()).await?;
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

    /// Everybody who has a job in the queue.
    ///
    /// # Errors
    ///
    /// [`StoreError::Database`].
    pub async fn turns(&self) -> Result<Vec<Turn>, StoreError> {
        let rows: Vec<(String, i64, i64)> = sqlx::query_as(
            "select owner, sum(iif(state = 'queued', jobs, 0)), sum(iif(state = 'running', jobs, 0)) from job_count \
             where state in ('queued', 'running') group by owner having sum(jobs) > 0 order by owner",
        )
        .fetch_all(self.readers())
        .await?;
        let turn = |(owner, queued, running): (String, i64, i64)| Turn {
            owner,
            queued: queued.unsigned_abs(),
            running: running.unsigned_abs(),
        };
        Ok(rows.into_iter().map(turn).collect())
    }

    /// How the jobs of a batch stand.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`] where it has none.
    pub async fn batch(&self, name: &str) -> Result<BatchProgress, StoreError> {
        let rows: Vec<(String, i64, f64)> = sqlx::query_as(
            "select state, count(*), total(case state when 'queued' then 0.0 when 'running' then \
             coalesce((progress ->> '$.step') / cast(nullif(progress ->> '$.steps_total', 0) as real), 0.0) else 1.0 end) \
             from job where batch = ? group by state",
        )
        .bind(name)
        .fetch_all(self.readers())
        .await?;
        let mut progress = BatchProgress::default();
        let (mut jobs, mut done) = (0, 0.0);
        for (state, count, part) in rows {
            let slot = match super::rows::from_word("job.state", state)? {
                lightpath_domain::job::JobState::Queued => &mut progress.queued,
                lightpath_domain::job::JobState::Running => &mut progress.running,
                lightpath_domain::job::JobState::Succeeded => &mut progress.succeeded,
                lightpath_domain::job::JobState::Failed => &mut progress.failed,
                lightpath_domain::job::JobState::Cancelled => &mut progress.cancelled,
            };
            *slot = count.unsigned_abs();
            jobs += count;
            done += part;
        }
        if jobs == 0 {
            return Err(StoreError::not_found(format!("batch {name:?}")));
        }
        progress.done = done / jobs as f64;
        Ok(progress)
    }
}
