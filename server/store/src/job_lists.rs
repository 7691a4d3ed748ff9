//! Lists of jobs: filters, order, and what a list shows of a job.

use super::job_rows::{job_of, summary_of};
use super::rows::to_word;
use super::sql::{Builder, Pool};
use super::{Result, Store, StoreError, page};
use lightpath_domain::job::{Job, JobState, JobSummary};

/// Columns of a [`JobSummary`].
const SUMMARY: &str = "id, kind, display, owner, batch, state, cancel_requested, priority, attempt, create_time_ms, \
                       start_time_ms, finish_time_ms, progress, error, revision, label, needs, estimated_bytes, waiting_for";

/// Selection and order of the jobs in a list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct JobFilter {
    /// Only jobs in this state; `None`: all states.
    pub state: Option<JobState>,
    /// Only jobs for the display with this id; `None`: all displays.
    pub display: Option<String>,
    /// Only jobs of this batch; `None`: all jobs.
    pub batch: Option<String>,
    /// Only jobs of this kind, a word of `JobSpec::KINDS`; `None`: all kinds.
    pub kind: Option<String>,
    /// Only jobs of this owner; `None`: all owners.
    pub owner: Option<String>,
    /// Only jobs whose ids or labels contain this text, whatever the case of ASCII letters; `None`: all jobs.
    pub text: Option<String>,
    /// Only jobs that were stored at or after this time \[ms since 1970\]; `None`: all jobs.
    pub since_ms: Option<i64>,
    /// Only jobs whose ids begin with this text; `None`: all jobs.
    pub id_prefix: Option<String>,
    /// Whether the oldest jobs come first instead of the newest.
    pub oldest_first: bool,
}

impl Store {
    /// At most `limit` jobs that match the filter and follow the job `after` in its order.
    pub async fn jobs(&self, filter: &JobFilter, after: Option<&str>, limit: u32) -> Result<Vec<Job>> {
        let rows = list_query(self.readers(), "*", filter, after, limit)?.build().fetch_all(self.readers()).await?;
        rows.iter().map(job_of).collect()
    }

    /// What lists show of the same jobs as [`Self::jobs`]. It does not parse their requests and results.
    pub async fn job_summaries(&self, filter: &JobFilter, after: Option<&str>, limit: u32) -> Result<Vec<JobSummary>> {
        let rows = list_query(self.readers(), SUMMARY, filter, after, limit)?.build().fetch_all(self.readers()).await?;
        rows.iter().map(summary_of).collect()
    }

    /// What lists show of one job.
    ///
    /// # Errors
    ///
    /// [`StoreError::NotFound`].
    pub async fn job_summary(&self, id: &str) -> Result<JobSummary> {
        let mut query = Builder::new(format!("select {SUMMARY} from job where id = "));
        let row = query.push_bind(id.to_owned()).build().fetch_optional(self.readers()).await?;
        summary_of(&row.ok_or_else(|| StoreError::not_found(format!("jobs/{id}")))?)
    }
}

/// The query of a list. Each combination of state, display and batch has an index in the order of the list. Searches
/// for a kind, an owner or a text find the ids in one narrow index of all jobs.
pub(super) fn list_query(
    pool: &Pool,
    columns: &str,
    filter: &JobFilter,
    after: Option<&str>,
    limit: u32,
) -> Result<Builder> {
    let order = if filter.oldest_first { "asc" } else { "desc" };
    let mut query = Builder::new(format!("select {columns} from job "));
    if filter.kind.is_some() || filter.owner.is_some() || filter.text.is_some() {
        query.push("where id in (select id from job ");
        query.push(index(pool, "job_to_search")).push(" where true");
        push_conditions(&mut query, filter, after)?;
        query.push(format!(" order by id {order} limit ")).push_bind(page(limit));
        query.push(format!(") order by id {order}"));
    } else {
        query.push(index(pool, index_of(filter))).push(" where true");
        push_conditions(&mut query, filter, after)?;
        query.push(format!(" order by id {order} limit ")).push_bind(page(limit));
    }
    Ok(query)
}

/// Left to itself, SQLite may prefer an index that lacks one of the columns. PostgreSQL chooses by its statistics.
fn index(pool: &Pool, name: &str) -> String {
    if name.is_empty() || pool.is_postgres() { String::new() } else { format!("indexed by {name}") }
}

/// The index with exactly the columns of a filter, in the order of the list; empty: the primary key.
fn index_of(filter: &JobFilter) -> &'static str {
    match (&filter.batch, &filter.display, filter.state) {
        (None, None, None) => "",
        (None, None, Some(_)) => "job_by_state",
        (None, Some(_), None) => "job_by_display",
        (None, Some(_), Some(_)) => "job_by_display_state",
        (Some(_), None, None) => "job_by_batch",
        (Some(_), None, Some(_)) => "job_by_batch_state",
        (Some(_), Some(_), None) => "job_by_batch_display",
        (Some(_), Some(_), Some(_)) => "job_by_batch_display_state",
    }
}

fn push_conditions(query: &mut Builder, filter: &JobFilter, after: Option<&str>) -> Result<()> {
    if let Some(state) = filter.state {
        query.push(" and state = ").push_bind(to_word("job.state", &state)?);
    }
    let columns =
        [("display", &filter.display), ("batch", &filter.batch), ("kind", &filter.kind), ("owner", &filter.owner)];
    for (column, value) in columns {
        if let Some(value) = value {
            query.push(format!(" and {column} = ")).push_bind(value.clone());
        }
    }
    if let Some(text) = &filter.text {
        query.push(" and instr(words, ").push_bind(text.to_ascii_lowercase()).push(") > 0");
    }
    if let Some(since_ms) = filter.since_ms {
        query.push(" and id >= ").push_bind(first_id(since_ms));
    }
    if let Some(prefix) = &filter.id_prefix {
        // A range, unlike `like`, always reads only the part of the index with these ids. No id has a character after ~.
        query.push(" and id >= ").push_bind(prefix.clone()).push(" and id < ").push_bind(format!("{prefix}~"));
    }
    if let Some(after) = after {
        query.push(if filter.oldest_first { " and id > " } else { " and id < " }).push_bind(after.to_owned());
    }
    Ok(())
}

/// The least id of a job that was stored at this time: a UUID v7 begins with the time.
fn first_id(time_ms: i64) -> String {
    let hex = format!("{:012x}", time_ms.clamp(0, (1 << 48) - 1));
    format!("{}-{}", &hex[..8], &hex[8..])
}
