//! Streams that follow the changes of a job.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::call::{Answers, Call};
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::watch::{self, Watch};
use lightpath_domain::access::Caller;
use lightpath_domain::job::Job;
use lightpath_proto::v1;

impl Api {
    pub(crate) async fn watch_job(
        &self,
        call: &Call,
        request: v1::WatchJobRequest,
    ) -> Result<Answers<v1::Job>, ApiError> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        let open = self.accounts.streams.open(StreamKind::Watch, &call.client)?;
        // The stream subscribes before the first read, so that it misses no change.
        let changes = self.store.subscribe_job_changes();
        let first = self.visible_job(call, &id).await?;
        let source = JobSource { api: self.clone(), caller: call.caller.clone(), id };
        Ok(watch::stream(source, first, changes, self.stopping.clone(), open))
    }
}

/// The job that a stream follows, and the caller who sees it.
struct JobSource {
    api: Api,
    caller: Caller,
    id: String,
}

impl Watch for JobSource {
    type Item = Job;
    type Change = String;
    type Message = v1::Job;

    async fn read(&self) -> Result<Job, ApiError> {
        self.api.seen_by(&self.caller, self.api.store.job(&self.id).await?).await
    }

    fn concerns(&self, change: &String) -> bool {
        *change == self.id
    }

    fn is_last(&self, job: &Job) -> bool {
        job.state.has_ended()
    }

    fn message(&self, job: &Job) -> v1::Job {
        to_wire::job(&self.api.store, job.clone())
    }
}
