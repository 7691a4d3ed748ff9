//! Streams that follow the changes of a job.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::call::Answers;
use crate::names;
use crate::watch::{self, Watch};
use lightpath_domain::access::Caller;
use lightpath_domain::job::Job;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Jobs, Result};

impl Api {
    pub(crate) async fn watch_job(&self, call: &Call, request: v1::WatchJobRequest) -> Result<Answers<v1::Job>> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        let open = self.streams.open(StreamKind::Watch, &call.client)?;
        // The stream subscribes before the first read, so that it misses no change.
        let changes = self.store.subscribe_job_changes();
        let first = self.service.jobs.visible(call, &id).await?;
        let source = JobSource { jobs: self.service.jobs.clone(), caller: call.caller.clone(), id };
        Ok(watch::stream(source, first, changes, self.stopping.clone(), open))
    }
}

/// The job that a stream follows, and the caller who sees it.
struct JobSource {
    jobs: Jobs,
    caller: Caller,
    id: String,
}

impl Watch for JobSource {
    type Item = Job;
    type Change = String;
    type Message = v1::Job;

    async fn read(&self) -> Result<Job> {
        self.jobs.followed_by(&self.caller, &self.id).await
    }

    fn concerns(&self, change: &String) -> bool {
        *change == self.id
    }

    fn is_last(&self, job: &Job) -> bool {
        job.state.has_ended()
    }

    fn message(&self, job: &Job) -> v1::Job {
        to_wire::job(&self.jobs, job.clone())
    }
}
