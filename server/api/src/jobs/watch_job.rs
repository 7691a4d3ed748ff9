//! Streams that follow the changes of a job.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::call::Answers;
use crate::names;
use crate::watch::{self, Watch};
use lightpath_domain::access::Caller;
use lightpath_proto::v1;
use lightpath_proto::v1::job::State;
use lightpath_service::{Call, Field, Jobs, Result};
use std::time::Duration;

/// Interval between looks at the place of a queued job: other jobs change it, and no change of the job says so.
const PLACE_READ: Duration = Duration::from_secs(2);

impl Api {
    pub(crate) async fn watch_job(&self, call: &Call, request: v1::WatchJobRequest) -> Result<Answers<v1::Job>> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        let open = self.streams.open(StreamKind::Watch, &call.client)?;
        // The stream subscribes before the first read, so that it misses no change.
        let changes = self.store.subscribe_job_changes();
        self.service.jobs.visible(call, &id).await?;
        let source = JobSource { jobs: self.service.jobs.clone(), caller: call.caller.clone(), id };
        let first = source.read().await?;
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
    type Item = v1::Job;
    type Change = String;
    type Message = v1::Job;

    async fn read(&self) -> Result<v1::Job> {
        let job = self.jobs.followed_by(&self.caller, &self.id).await?;
        let outlook = self.jobs.outlook(&self.caller, [(job.state, job.create_time_ms)]).await?;
        Ok(to_wire::job(&outlook, job))
    }

    fn concerns(&self, change: &String) -> bool {
        *change == self.id
    }

    fn is_last(&self, job: &v1::Job) -> bool {
        job.end_time.is_some()
    }

    fn again(&self, job: &v1::Job) -> Option<Duration> {
        (job.state() == State::Queued).then_some(PLACE_READ)
    }

    fn message(&self, job: &v1::Job) -> v1::Job {
        job.clone()
    }
}
