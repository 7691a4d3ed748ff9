//! Limits on the estimated memory and time of a job.

use super::{Jobs, kinds};
use crate::error::{Result, ServiceError};
use lightpath_domain::ability::counted_memory;
use lightpath_domain::job::{Estimate, JobSpec};
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::ClaimLimits;

const MIB: f64 = 1_048_576.0;

/// Limits on a job, and the speed with which its time is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobLimits {
    /// Limit on the memory of a job \[bytes\].
    pub memory_bytes: u64,
    /// Limit on the memory for transfer functions that are kept from job to job \[bytes\].
    pub cache_bytes: u64,
    /// Limit on the time of an attempt \[s\].
    pub time_s: f64,
    /// Work that this machine does each second, in the unit of `lightpath_optics::memory`.
    pub work_per_s: f64,
    /// Threads of a job.
    pub threads: usize,
    /// Limits on the numbers of running jobs, as far as this process knows them.
    pub running: ClaimLimits,
}

impl Default for JobLimits {
    /// No limits.
    fn default() -> Self {
        let running = ClaimLimits::default();
        Self { memory_bytes: u64::MAX, cache_bytes: 0, time_s: f64::INFINITY, work_per_s: 1e9, threads: 1, running }
    }
}

impl Jobs {
    /// Estimates memory and time of a job. Refuses a job that would exceed the limits. `decoding_bytes` is the largest
    /// memory for decoding one of its pictures \[bytes\].
    ///
    /// # Errors
    ///
    /// A precondition with the reason `JOB_TOO_LARGE` if the job would exceed the limits; errors of the store.
    pub async fn estimated(&self, spec: &JobSpec, decoding_bytes: u64) -> Result<Estimate> {
        let need = kinds::need(self, spec, decoding_bytes).await?;
        let estimate = need.on(self.limits.work_per_s);
        // A server alone runs whatever is within its limit.
        let counted =
            if self.store.is_shared() { counted_memory(estimate.memory_bytes) } else { estimate.memory_bytes };
        if counted > self.largest_memory_bytes() {
            // A larger process may have come in the last seconds.
            self.store.read_living().await?;
        }
        let limits = JobLimits { memory_bytes: self.largest_memory_bytes(), ..self.limits };
        require_within(&Estimate { memory_bytes: counted, ..estimate }, &limits, spec)?;
        Ok(estimate)
    }

    /// The largest memory that a living process, or this one, gives a job \[bytes\].
    fn largest_memory_bytes(&self) -> u64 {
        let living = self.store.living();
        let largest = living.iter().map(|process| process.abilities.memory_bytes).max().unwrap_or(0);
        largest.max(self.limits.memory_bytes)
    }
}

/// Refuses a job that needs more memory or time than the living processes give a job.
fn require_within(estimate: &Estimate, limits: &JobLimits, spec: &JobSpec) -> Result<()> {
    let Estimate { memory_bytes, time_s } = *estimate;
    if memory_bytes <= limits.memory_bytes && time_s <= limits.time_s {
        return Ok(());
    }
    let mib = |bytes: u64| (bytes as f64 / MIB).ceil();
    let message = format!(
        "spec: the job would need {} MiB of memory and {:.0} s, but a job gets at most {} MiB \
         (job_memory_mib_max) and {:.0} s (job_time_s_max); {}",
        mib(memory_bytes),
        time_s.ceil(),
        mib(limits.memory_bytes),
        limits.time_s,
        kinds::advice(spec)
    );
    Err(ServiceError::Precondition { reason: PreconditionReason::JobTooLarge, message })
}
