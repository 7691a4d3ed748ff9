//! What a forecast of the queue is made from: the running jobs, and the first waiting jobs of each lane.

use super::rows::{json, json_option};
use super::sql::{Builder, Row, from_row, query, query_as};
use super::{Result, Store};
use lightpath_domain::ability::Labels;
use lightpath_domain::job::Progress;
use std::collections::HashMap;

/// Limit on the lanes that are read. Each is a small part of one statement.
const LANES_MAX: u32 = 64;
/// Limit on the jobs that are read: a forecast beyond them would be a guess.
const JOBS_MAX: u32 = 500;
/// What is read of a job. It is about its label, or else its dataset or display.
const COLUMNS: &str = "id, kind, coalesce(label, dataset, display) as subject, display, owner, priority, needs, \
                       estimated_bytes, estimated_ms, run_time_ms, start_time_ms, progress, process";

/// A job that runs or waits for a worker.
#[derive(Clone, Debug, PartialEq)]
pub struct QueuedJob {
    /// Id: the last part of the resource name.
    pub id: String,
    /// Kind: a word of `JobSpec::KINDS`.
    pub kind: String,
    /// What the job is about, for people: its label, or else its dataset or display.
    pub subject: String,
    /// Id of the display.
    pub display: String,
    /// Owner; empty: unknown.
    pub owner: String,
    /// Priority. Jobs with a lower number run first.
    pub priority: i32,
    /// Labels that the process must have that runs the job.
    pub needs: Labels,
    /// Estimated memory of an attempt \[bytes\]; 0: not estimated.
    pub memory_bytes: u64,
    /// Estimated time of an attempt \[ms\]; 0: not estimated.
    pub estimated_ms: i64,
    /// Earliest time at which the job may start \[ms since 1970\].
    pub run_time_ms: i64,
    /// Start of the latest attempt \[ms since 1970\].
    pub start_time_ms: Option<i64>,
    /// Progress of the latest attempt.
    pub progress: Option<Progress>,
    /// Process that runs the job, where several share the database.
    pub process: Option<String>,
}

/// The running jobs, and the waiting ones that come first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ahead {
    /// Jobs that run.
    pub running: Vec<QueuedJob>,
    /// The jobs of each lane that come first there, without those that wait for other jobs.
    pub waiting: Vec<QueuedJob>,
    /// Displays whose jobs are paused, with the reasons; an empty id: all displays.
    pub paused: HashMap<String, String>,
    /// Latest start of a job of each owner \[ms since 1970\].
    pub last_starts_ms: HashMap<String, i64>,
}

/// A lane.
struct Lane {
    priority: i32,
    owner: String,
    display: String,
    needs: String,
    counted_bytes: i64,
}

impl Store {
    /// The running jobs, and the waiting ones that come first, at most some hundred.
    pub async fn ahead(&self) -> Result<Ahead> {
        let mut sql = self.readers().acquire().await?;
        let mut running =
            Builder::new(format!("select {COLUMNS} from job where state = 'running' order by start_time_ms, id"));
        let running = running.build().fetch_all(&mut sql).await?.iter().map(queued_job).collect::<Result<_>>()?;
        let lanes = query("select * from lane order by priority, owner, display, needs, counted_bytes limit $1");
        let lanes = lanes.bind(LANES_MAX).fetch_all(&mut sql).await?;
        let lanes: Vec<Lane> = lanes.iter().map(lane_of).collect::<Result<_>>()?;
        let waiting = match lanes.as_slice() {
            [] => Vec::new(),
            lanes => {
                first_of(lanes).build().fetch_all(&mut sql).await?.iter().map(queued_job).collect::<Result<_>>()?
            }
        };
        let paused: Vec<(String, String)> = query_as("select display, reason from pause").fetch_all(&mut sql).await?;
        // The condition says that the index of starts has the row.
        let starts = "select owner, (select max(start_time_ms) from job where job.owner = lane.owner \
                      and start_time_ms is not null) from lane group by owner";
        let starts: Vec<(String, Option<i64>)> = query_as(starts).fetch_all(&mut sql).await?;
        let last_starts_ms = starts.into_iter().filter_map(|(owner, start)| Some((owner, start?))).collect();
        Ok(Ahead { running, waiting, paused: paused.into_iter().collect(), last_starts_ms })
    }
}

/// The first jobs of each of these lanes. One statement asks for all, with a part for each lane that ends in its index.
fn first_of(lanes: &[Lane]) -> Builder {
    let each = JOBS_MAX / lanes.len() as u32;
    let mut query = Builder::new("");
    for (n, lane) in lanes.iter().enumerate() {
        query.push(if n == 0 { "select * from (" } else { " union all select * from (" });
        query.push(format!("select {COLUMNS} from job where state = 'queued' and waiting_for = 0 and priority = "));
        query.push_bind(lane.priority).push(" and owner = ").push_bind(&lane.owner);
        query.push(" and display = ").push_bind(&lane.display).push(" and needs = ").push_bind(&lane.needs);
        query.push(" and counted_bytes = ").push_bind(lane.counted_bytes);
        query.push(" order by run_time_ms, id limit ").push_bind(each).push(") part");
    }
    query
}

fn lane_of(row: &Row) -> Result<Lane> {
    Ok(from_row!(row, Lane { priority, owner, display, needs, counted_bytes; }))
}

fn queued_job(row: &Row) -> Result<QueuedJob> {
    Ok(from_row!(row, QueuedJob {
        id, kind, subject, display, owner, priority, estimated_ms, run_time_ms, start_time_ms, process;
        needs: json(row, "job.needs")?,
        progress: json_option(row, "job.progress")?,
        memory_bytes: row.try_get("estimated_bytes")?,
    }))
}
