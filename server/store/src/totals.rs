//! Totals for metrics.

use super::rows::{from_json, from_word};
use super::sql::{query_as, scalar};
use super::{Result, Store};
use lightpath_domain::ability::Labels;
use lightpath_domain::job::{JobSpec, JobState};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Number of jobs of one kind in one state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct QueueDepth {
    /// Kind of the jobs as in their stored specifications, for example `optimize_hologram`.
    pub kind: String,
    /// State of the jobs: queued or running.
    pub state: JobState,
    /// Number of jobs.
    pub jobs: u64,
}

/// Estimated time of the waiting jobs of one kind that need the same labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WaitingWork {
    /// Kind of the jobs.
    pub kind: &'static str,
    /// Labels that they need.
    pub needs: Labels,
    /// Time for which one worker would work on them.
    pub time: Duration,
}

impl Store {
    /// Numbers of waiting and running jobs, for every kind. A kind without jobs is 0.
    pub async fn queue_depths(&self) -> Result<Vec<QueueDepth>> {
        let rows: Vec<(String, String, i64)> = query_as(
            "select kind, state, cast(sum(jobs) as bigint) from job_count where state in ('queued', 'running') group by 1, 2",
        )
        .fetch_all(self.readers())
        .await?;
        let mut depths = Vec::new();
        for kind in JobSpec::KINDS {
            for state in [JobState::Queued, JobState::Running] {
                depths.push(QueueDepth { kind: kind.to_owned(), state, jobs: 0 });
            }
        }
        for (kind, state, count) in rows {
            let state: JobState = from_word("job.state", state)?;
            if let Some(depth) = depths.iter_mut().find(|depth| depth.kind == kind && depth.state == state) {
                depth.jobs = count.unsigned_abs();
            }
        }
        Ok(depths)
    }

    /// For every kind, how long its earliest due job has been ready to run without being claimed.
    pub async fn oldest_due(&self, now_ms: i64) -> Result<Vec<(&'static str, Duration)>> {
        let mut ages = Vec::new();
        for kind in JobSpec::KINDS {
            let sql = "select min(run_time_ms) from job where state = 'queued' and waiting_for = 0 and kind = $1";
            let due_ms: Option<i64> = scalar(sql).bind(kind).fetch_one(self.readers()).await?;
            let age_ms = now_ms.saturating_sub(due_ms.unwrap_or(now_ms)).max(0);
            ages.push((kind, Duration::from_millis(age_ms.unsigned_abs())));
        }
        Ok(ages)
    }

    /// For every kind and each set of labels that its jobs need, the estimated time of the jobs that are due and wait for a
    /// worker. A job without an estimate counts as 0. The empty set is there for every kind.
    pub async fn waiting_work(&self, now_ms: i64) -> Result<Vec<WaitingWork>> {
        let mut all = Vec::new();
        for kind in JobSpec::KINDS {
            let sql = "select needs, cast(sum(estimated_ms) as bigint) from job \
                       where state = 'queued' and waiting_for = 0 and kind = $1 and run_time_ms <= $2 \
                       group by needs order by needs";
            let rows: Vec<(String, i64)> = query_as(sql).bind((kind, now_ms)).fetch_all(self.readers()).await?;
            let without_needs = all.len();
            all.push(WaitingWork { kind, needs: Labels::default(), time: Duration::ZERO });
            for (needs, time_ms) in rows {
                let needs: Labels = from_json("job.needs", &needs)?;
                let time = Duration::from_millis(time_ms.unsigned_abs());
                match needs.is_empty() {
                    true => all[without_needs].time = time,
                    false => all.push(WaitingWork { kind, needs, time }),
                }
            }
        }
        Ok(all)
    }

    /// Sizes of the database and of SQLite's write-ahead log \[bytes\]; 0 for a missing file.
    pub async fn database_bytes(&self) -> Result<(u64, u64)> {
        let size = |path: &Path| fs::metadata(path).map_or(0, |metadata| metadata.len());
        let Some(path) = &self.inner.path else {
            let bytes = scalar("select pg_database_size(current_database())").fetch_one(self.readers()).await?;
            return Ok((bytes, 0));
        };
        let mut wal = path.clone().into_os_string();
        wal.push("-wal");
        Ok((size(path), size(Path::new(&wal))))
    }

    /// Number of all artifacts and their total size \[bytes\].
    pub async fn artifact_totals(&self) -> Result<(u64, u64)> {
        let sql = "select count(*), cast(coalesce(sum(size_bytes), 0) as bigint) from artifact";
        Ok(query_as(sql).fetch_one(self.readers()).await?)
    }
}
