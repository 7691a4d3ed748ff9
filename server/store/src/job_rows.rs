//! Conversion of rows of the database into jobs.

use super::StoreError;
use super::rows::{from_json, from_json_option, from_word};
use super::sql::Row;
use lightpath_domain::job::{Estimate, Job, JobSummary, Scheduling};

/// Converts a row of the table `job` into a job.
pub(super) fn job_of(row: &Row) -> Result<Job, StoreError> {
    Ok(Job {
        id: row.try_get("id")?,
        request_id: row.try_get("request_id")?,
        spec: from_json("job.spec", &row.try_get::<String>("spec")?)?,
        state: from_word("job.state", row.try_get("state")?)?,
        priority: row.try_get("priority")?,
        attempt: row.try_get("attempt")?,
        attempts_max: row.try_get("attempts_max")?,
        create_time_ms: row.try_get("create_time_ms")?,
        start_time_ms: row.try_get("start_time_ms")?,
        finish_time_ms: row.try_get("finish_time_ms")?,
        run_time_ms: row.try_get("run_time_ms")?,
        computer: row.try_get("computer")?,
        progress: from_json_option("job.progress", row.try_get("progress")?)?,
        error: from_json_option("job.error", row.try_get("error")?)?,
        result: from_json_option("job.result", row.try_get("result")?)?,
        cancel_requested: row.try_get("cancel_requested")?,
        checkpoint: row.try_get("checkpoint")?,
        revision: row.try_get::<i64>("revision")?.unsigned_abs(),
        scheduling: Scheduling {
            owner: row.try_get("owner")?,
            batch: row.try_get("batch")?,
            unique_key: row.try_get("unique_key")?,
            not_before_ms: row.try_get("not_before_ms")?,
            timeout_ms: row.try_get("timeout_ms")?,
            after: from_json("job.after", &row.try_get::<String>("after")?)?,
            label: row.try_get("label")?,
            needs: from_json("job.needs", &row.try_get::<String>("needs")?)?,
        },
        waiting_for: row.try_get("waiting_for")?,
        estimate: Estimate {
            memory_bytes: row.try_get::<i64>("estimated_bytes")?.unsigned_abs(),
            time_s: row.try_get::<i64>("estimated_ms")? as f64 / 1e3,
        },
    })
}

/// Converts the columns that a list shows into what it shows.
pub(super) fn summary_of(row: &Row) -> Result<JobSummary, StoreError> {
    Ok(JobSummary {
        id: row.try_get("id")?,
        kind: row.try_get("kind")?,
        display: row.try_get("display")?,
        owner: row.try_get("owner")?,
        batch: row.try_get("batch")?,
        state: from_word("job.state", row.try_get("state")?)?,
        cancel_requested: row.try_get("cancel_requested")?,
        priority: row.try_get("priority")?,
        attempt: row.try_get("attempt")?,
        create_time_ms: row.try_get("create_time_ms")?,
        start_time_ms: row.try_get("start_time_ms")?,
        finish_time_ms: row.try_get("finish_time_ms")?,
        progress: from_json_option("job.progress", row.try_get("progress")?)?,
        error: from_json_option("job.error", row.try_get("error")?)?,
        revision: row.try_get::<i64>("revision")?.unsigned_abs(),
        label: row.try_get("label")?,
        needs: from_json("job.needs", &row.try_get::<String>("needs")?)?,
        memory_bytes: row.try_get::<i64>("estimated_bytes")?.unsigned_abs(),
        waiting_for: row.try_get("waiting_for")?,
    })
}
