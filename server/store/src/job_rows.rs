//! Conversion of rows of the database into jobs.

use super::Result;
use super::rows::{json, json_option, word};
use super::sql::{Row, from_row};
use lightpath_domain::job::{Estimate, Job, JobSummary, Scheduling};

/// Converts a row of the table `job` into a job.
pub(super) fn job_of(row: &Row) -> Result<Job> {
    Ok(from_row!(row, Job {
        id, request_id, priority, attempt, attempts_max, create_time_ms, start_time_ms, finish_time_ms, run_time_ms,
        computer, cancel_requested, suspect, checkpoint, revision, waiting_for;
        spec: json(row, "job.spec")?,
        state: word(row, "job.state")?,
        progress: json_option(row, "job.progress")?,
        error: json_option(row, "job.error")?,
        result: json_option(row, "job.result")?,
        scheduling: from_row!(row, Scheduling {
            owner, batch, unique_key, not_before_ms, timeout_ms, label;
            after: json(row, "job.after")?,
            needs: json(row, "job.needs")?,
        }),
        estimate: Estimate {
            memory_bytes: row.try_get("estimated_bytes")?,
            time_s: row.try_get::<i64>("estimated_ms")? as f64 / 1e3,
        },
    }))
}

/// Converts the columns that a list shows into what it shows.
pub(super) fn summary_of(row: &Row) -> Result<JobSummary> {
    Ok(from_row!(row, JobSummary {
        id, kind, display, owner, batch, cancel_requested, priority, attempt, create_time_ms, start_time_ms,
        finish_time_ms, revision, label, waiting_for;
        state: word(row, "job.state")?,
        progress: json_option(row, "job.progress")?,
        error: json_option(row, "job.error")?,
        needs: json(row, "job.needs")?,
        memory_bytes: row.try_get("estimated_bytes")?,
    }))
}
