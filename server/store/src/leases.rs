//! Operations of workers on the queue: claims, and writes that need a lease.
//!
//! Every write names the job, the attempt and the lease, and takes effect only while the lease is valid. A worker that
//! lost its job changes nothing, even if it notices late. A lease is valid until the store takes it back: its end only
//! says from when the store may do so. So a process that was suspended for longer than a lease continues its jobs.

use super::changes::Change;
use super::claims::{CLAIM, NEXT_RUN_TIME};
use super::events::append_event;
use super::job_rows::job_of;
use super::rows::to_json;
use super::sql::{Query, Row, query, scalar};
use super::write::Write;
use super::{Result, Store, StoreError};
use lightpath_domain::ability::Abilities;
use lightpath_domain::job::{Job, Lease, Progress};
use uuid::Uuid;

/// Answer to a heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// New end of the lease \[ms since 1970\].
    pub until_ms: i64,
    /// Whether a user requested the cancellation of the job.
    pub cancel_requested: bool,
}

/// Who claims jobs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Claimant {
    /// Name of the worker, for people.
    pub worker: String,
    /// Id of its process, where several share the database: only this process takes the jobs back after a restart.
    pub process: Option<String>,
    /// Id of the lease that it gets. If the answer to a claim is lost, [`Store::abandon_claim`] gives the job back.
    pub lease_id: String,
    /// What its process offers to jobs. It gets no others.
    pub abilities: Abilities,
    /// What computes there, for people: the job and the event of its start name it.
    pub computer: Option<String>,
}

impl Claimant {
    /// A worker of the only process that works on the database, without labels.
    #[must_use]
    pub fn named(worker: &str) -> Self {
        let lease_id = Uuid::now_v7().to_string();
        Self { worker: worker.to_owned(), process: None, lease_id, abilities: Abilities::default(), computer: None }
    }
}

/// Limits on running jobs, which are counted by their leases. 0: no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClaimLimits {
    /// Limit on the running jobs of one owner.
    pub per_owner: u32,
    /// Limit on the running jobs for one display.
    pub per_display: u32,
}

/// SQL of an update that takes effect only while the lease `($1 job, $2 attempt, $3 lease_id)` is valid.
macro_rules! fenced {
    ($set:literal) => {
        concat!(
            "update job set revision = revision + 1, ",
            $set,
            " where id = $1 and state = 'running' and attempt = $2 and lease_id = $3 returning *"
        )
    };
}
pub(super) use fenced;

impl Store {
    /// Gives the next job to `worker`, a process without labels, with a lease of `lease_ms`. Jobs are ordered by: lowest `priority`; owner with
    /// the fewest running jobs; owner whose last start is longest ago; earliest due; oldest. Starts in the future, from
    /// a time when the clock was wrong, do not count.
    pub async fn claim(&self, now_ms: i64, lease_ms: i64, worker: &str) -> Result<Option<(Job, Lease)>> {
        self.claim_within(ClaimLimits::default(), now_ms, lease_ms, &Claimant::named(worker)).await
    }

    /// Does the same as [`Self::claim`], with limits on the running jobs of an owner and for a display. Jobs that the
    /// claimant cannot run do not count: they neither run nor block others.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::claim`].
    pub async fn claim_within(
        &self,
        limits: ClaimLimits,
        now_ms: i64,
        lease_ms: i64,
        claimant: &Claimant,
    ) -> Result<Option<(Job, Lease)>> {
        let claimant = claimant.clone();
        self.write(async move |write| claim(write, limits, now_ms, lease_ms, &claimant).await).await
    }

    /// Earliest time after `now_ms` when a waiting job becomes due \[ms since 1970\] that a process with these abilities can
    /// run; `None` if there is no such job.
    pub async fn next_run_time(&self, now_ms: i64, abilities: &Abilities) -> Result<Option<i64>> {
        let (labels, memory_bytes, only_for) = in_claim(abilities)?;
        let time = scalar(NEXT_RUN_TIME).bind((now_ms, labels, memory_bytes, only_for));
        Ok(time.fetch_one(self.readers()).await?)
    }

    /// Extends the lease, even after its end if the store has not taken it back.
    ///
    /// # Errors
    ///
    /// [`StoreError::LeaseLost`].
    pub async fn heartbeat(&self, lease: &Lease, now_ms: i64, lease_ms: i64) -> Result<Heartbeat> {
        let lease = lease.clone();
        self.write_row(async move |write| {
            // A heartbeat does not count as a change, so the revision stays the same.
            let sql = "update job set lease_until_ms = max(lease_until_ms, $4) where id = $1 and state = 'running' \
                       and attempt = $2 and lease_id = $3 returning *";
            let row = bind_lease(sql, &lease).bind(now_ms + lease_ms).fetch_optional(write.sql()).await?;
            let job = job_or_lease_lost(row)?;
            Ok(Heartbeat { until_ms: now_ms + lease_ms, cancel_requested: job.cancel_requested })
        })
        .await
    }

    /// Moves the ends of all leases by `by_ms`, because the system's clock was set.
    pub async fn shift_leases(&self, by_ms: i64) -> Result<()> {
        self.write(async move |write| {
            let sql = "update job set lease_until_ms = lease_until_ms + $1 where state = 'running'";
            query(sql).bind(by_ms).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// Lets no lease end after `latest_ms`, because a clock that was ahead has been set right.
    pub async fn cap_leases(&self, latest_ms: i64) -> Result<()> {
        let late: bool = scalar("select exists (select 1 from job where state = 'running' and lease_until_ms > $1)")
            .bind(latest_ms)
            .fetch_one(self.readers())
            .await?;
        if !late {
            return Ok(());
        }
        self.write(async move |write| {
            let sql = "update job set lease_until_ms = $1 where state = 'running' and lease_until_ms > $1";
            query(sql).bind(latest_ms).execute(write.sql()).await?;
            Ok(())
        })
        .await
    }

    /// Makes waiting jobs due earlier whose start lies further ahead than its reasons explain, because the system's
    /// clock was ahead when it was set: a job starts at the time that its submitter requested or, after a failed
    /// attempt, at most `pause_max_ms` from now. Returns the number of these jobs.
    pub async fn pull_forward(&self, now_ms: i64, pause_max_ms: i64) -> Result<u64> {
        self.write(async move |write| {
                let sql = "with late as (select id as late_id, \
                               max(coalesce(not_before_ms, 0), $1 + case when error is null then 0 else $2 end) as latest_ms \
                               from job where state = 'queued') \
                           update job set run_time_ms = latest_ms, revision = revision + 1 from late \
                           where id = late_id and run_time_ms > latest_ms returning id";
                let query = scalar(sql).bind((now_ms, pause_max_ms));
                let ids: Vec<String> = query.fetch_all(write.sql()).await?;
                let count = ids.len() as u64;
                if count > 0 {
                    write.announce(Change::Claimable);
                }
                ids.into_iter().for_each(|id| write.announce(Change::Job(id)));
                Ok(count)
})
        .await
    }

    /// Records the progress of the job.
    ///
    /// # Errors
    ///
    /// [`StoreError::LeaseLost`].
    pub async fn progress(&self, lease: &Lease, progress: &Progress) -> Result<()> {
        let (lease, progress) = (lease.clone(), to_json("job.progress", progress)?);
        self.write_row(async move |write| {
            let query = bind_lease(fenced!("progress = $4"), &lease).bind(progress);
            job_or_lease_lost(query.fetch_optional(write.sql()).await?)?;
            write.announce(Change::Job(lease.job));
            Ok(())
        })
        .await
    }

    /// Records a checkpoint that is on disk, and returns the digest of the one it replaces. Earlier failures of the job
    /// no longer count, because the job has made progress.
    ///
    /// # Errors
    ///
    /// [`StoreError::LeaseLost`].
    pub async fn checkpoint(&self, lease: &Lease, digest: &str) -> Result<Option<String>> {
        let (lease, digest) = (lease.clone(), digest.to_owned());
        self.write(async move |write| {
            let before = read(write, &lease).await?.0.checkpoint;
            let query = bind_lease(fenced!("checkpoint = $4, failures = 0, crashes = 0"), &lease).bind(&digest);
            job_or_lease_lost(query.fetch_optional(write.sql()).await?)?;
            write.announce(Change::Job(lease.job));
            Ok(before.filter(|before| *before != digest))
        })
        .await
    }
}

/// Labels, memory and the labels to start jobs for, as claims get them.
fn in_claim(abilities: &Abilities) -> Result<(String, i64, String)> {
    let memory_bytes = i64::try_from(abilities.memory_bytes).unwrap_or(i64::MAX);
    let json = |labels| to_json("process.labels", labels);
    Ok((json(&abilities.labels)?, memory_bytes, json(&abilities.only_for)?))
}

async fn claim(
    write: &mut Write,
    limits: ClaimLimits,
    now_ms: i64,
    lease_ms: i64,
    claimant: &Claimant,
) -> Result<Option<(Job, Lease)>> {
    let lease_id = claimant.lease_id.clone();
    let (labels, memory_bytes, only_for) = in_claim(&claimant.abilities)?;
    let row = query(CLAIM)
        .bind((&lease_id, now_ms + lease_ms, &claimant.worker, now_ms, limits.per_owner, limits.per_display))
        .bind((&claimant.process, labels, memory_bytes, &claimant.computer, only_for))
        .fetch_optional(write.sql())
        .await?;
    let Some(row) = row else { return Ok(None) };
    let job = job_of(&row)?;
    let on = claimant.computer.as_ref().map_or_else(String::new, |computer| format!(" on {computer}"));
    append_event(write, &job, now_ms, format!("attempt {} started by {}{on}", job.attempt, claimant.worker)).await?;
    let lease = Lease { job: job.id.clone(), attempt: job.attempt, lease_id, until_ms: now_ms + lease_ms };
    Ok(Some((job, lease)))
}

/// The job of a valid lease, the number of its failed attempts, and the number of deaths of the server while it ran.
pub(super) async fn read(write: &mut Write, lease: &Lease) -> Result<(Job, i64, i64)> {
    let sql = "select * from job where id = $1 and state = 'running' and attempt = $2 and lease_id = $3";
    let row = bind_lease(sql, lease).fetch_optional(write.sql()).await?.ok_or(StoreError::LeaseLost)?;
    Ok((job_of(&row)?, row.try_get("failures")?, row.try_get("crashes")?))
}

/// A query with the lease bound to its first three parameters, in the order of `fenced`.
pub(super) fn bind_lease(sql: &'static str, lease: &Lease) -> Query {
    query(sql).bind((lease.job.clone(), lease.attempt, lease.lease_id.clone()))
}

/// The job in the row that an update under a lease returned. Without a row, the lease was not valid.
pub(super) fn job_or_lease_lost(row: Option<Row>) -> Result<Job> {
    job_of(&row.ok_or(StoreError::LeaseLost)?)
}
