//! Lists of jobs and of their events, as a caller sees them.

use super::Jobs;
use crate::call::Call;
use crate::error::Result;
use crate::permissions::require_all_displays;
use lightpath_domain::job::{Job, JobEvent, JobSummary};
use lightpath_store::{BatchProgress, JobFilter};
use std::mem;

impl Jobs {
    /// At most `limit` jobs behind `after`.
    pub async fn list(&self, call: &Call, filter: &JobFilter, after: Option<&str>, limit: u32) -> Result<Vec<Job>> {
        let mut jobs = Vec::new();
        for job in self.store.jobs(filter, after, limit).await? {
            jobs.push(self.seen_by(&call.caller, job).await?);
        }
        Ok(jobs)
    }

    /// The same without what jobs ask for and give.
    pub async fn summaries(
        &self,
        call: &Call,
        filter: &JobFilter,
        after: Option<&str>,
        limit: u32,
    ) -> Result<Vec<JobSummary>> {
        let mut summaries = self.store.job_summaries(filter, after, limit).await?;
        for error in summaries.iter_mut().filter_map(|job| job.error.as_mut()) {
            error.message = self.text_for(&call.caller, mem::take(&mut error.message)).await?;
        }
        Ok(summaries)
    }

    /// At most `limit` events of a job behind the one with the number `after`.
    pub async fn events(&self, call: &Call, id: &str, after: Option<i64>, limit: u32) -> Result<Vec<JobEvent>> {
        let mut events = self.store.events(id, after, limit).await?;
        for event in &mut events {
            event.message = self.text_for(&call.caller, mem::take(&mut event.message)).await?;
        }
        Ok(events)
    }

    /// Numbers of the jobs of a batch, which may be about any display.
    pub async fn batch(&self, call: &Call, batch: &str) -> Result<BatchProgress> {
        require_all_displays(call, "display in ListJobs")?;
        Ok(self.store.batch(batch).await?)
    }
}
