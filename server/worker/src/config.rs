//! Settings of the workers.

use crate::backoff::Backoff;
use crate::job_memory::jobs_bytes_max;
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_domain::job::Job;
use lightpath_store::ClaimLimits;
use std::collections::BTreeMap;
use std::time::Duration;

/// Settings of the workers.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerConfig {
    /// Number of jobs that run at once.
    pub workers: usize,
    /// Compute threads for each job; 0: as many as there are cores.
    pub compute_threads: usize,
    /// Time without a heartbeat after which a job goes to another worker.
    pub lease: Duration,
    /// Time between two checkpoints of a job.
    pub checkpoint_interval: Duration,
    /// Pauses before failed attempts are repeated.
    pub backoff: Backoff,
    /// Limits on the numbers of running jobs for each owner and each display.
    pub limits: ClaimLimits,
    /// Time limits of attempts, for jobs that do not set one.
    pub timeouts: Timeouts,
    /// Limit on the estimated memory of all running jobs, and of what is kept from job to job \[bytes\].
    pub memory_bytes: u64,
    /// Name of the workers in the events of jobs.
    pub name: String,
    /// Id of this process, if several share the database. No two living processes have the same.
    pub process: Option<String>,
    /// Labels of this process: it runs only jobs whose needs are among them, and jobs without needs.
    pub labels: Labels,
}

impl WorkerConfig {
    /// What this process offers to jobs. If no other process shares the database, it takes jobs of every size: those above
    /// its limit, because that was lowered, run alone.
    #[must_use]
    pub fn abilities(&self) -> Abilities {
        let memory_bytes = match self.process {
            Some(_) => jobs_bytes_max(self.memory_bytes),
            None => u64::MAX,
        };
        Abilities { labels: self.labels.clone(), memory_bytes, ..Abilities::default() }
    }
}

impl Default for WorkerConfig {
    fn default() -> Self {
        Self {
            workers: 1,
            compute_threads: 0,
            lease: Duration::from_secs(30),
            checkpoint_interval: Duration::from_secs(10),
            backoff: Backoff::default(),
            limits: ClaimLimits::default(),
            timeouts: Timeouts::default(),
            memory_bytes: 4 << 30,
            name: "worker".to_owned(),
            process: None,
            labels: Labels::default(),
        }
    }
}

/// Time limits of attempts by kind of job.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timeouts(BTreeMap<&'static str, Duration>);

impl FromIterator<(&'static str, Option<Duration>)> for Timeouts {
    /// The limits of kinds, each a word of `JobSpec::KINDS`; `None`: no limit.
    fn from_iter<T: IntoIterator<Item = (&'static str, Option<Duration>)>>(limits: T) -> Self {
        Self(limits.into_iter().filter_map(|(kind, limit)| Some((kind, limit?))).collect())
    }
}

impl Timeouts {
    /// Time limit of an attempt at this job.
    #[must_use]
    pub fn of(&self, job: &Job) -> Option<Duration> {
        let requested = job.scheduling.timeout_ms.map(|ms| Duration::from_millis(ms.unsigned_abs()));
        requested.or_else(|| self.0.get(job.spec.kind()).copied())
    }
}
