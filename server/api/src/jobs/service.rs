//! The job service.

use super::scheduling::label;
use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::enumerations::WireField as _;
use crate::names;
use crate::pages::Page;
use crate::time::ms;
use lightpath_domain::job::JobState;
use lightpath_proto::v1;
use lightpath_proto::v1::job_service_server::JobService;
use lightpath_proto::v1::list_jobs_request::{Order, View};
use lightpath_service::{Call, Field, Result, shortened};
use lightpath_store::{BatchProgress, JobFilter, QueueCounts};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};

answers! {
    JobService {
        submit_job(v1::SubmitJobRequest) -> v1::Job;
        submit_jobs(v1::SubmitJobsRequest) -> v1::SubmitJobsResponse;
        estimate_job(v1::EstimateJobRequest) -> v1::JobEstimate;
        get_job(v1::GetJobRequest) -> v1::Job;
        list_jobs(v1::ListJobsRequest) -> v1::ListJobsResponse;
        cancel_job(v1::CancelJobRequest) -> v1::Job;
        retry_job(v1::RetryJobRequest) -> v1::Job;
        list_job_events(v1::ListJobEventsRequest) -> v1::ListJobEventsResponse;
        get_batch(v1::GetBatchRequest) -> v1::Batch;
        get_queue(v1::GetQueueRequest) -> v1::Queue;
        pause_queue(v1::PauseQueueRequest) -> v1::Queue;
        resume_queue(v1::ResumeQueueRequest) -> v1::Queue;
    }
    streams {
        watch_job(v1::WatchJobRequest) -> v1::Job as WatchJobStream;
    }
}

impl Api {
    /// Returns the message of the named job.
    pub(crate) async fn get_job(&self, call: &Call, request: v1::GetJobRequest) -> Result<v1::Job> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        let job = self.service.jobs.visible(call, &id).await?;
        Ok(to_wire::job(&self.service.jobs.outlook(&call.caller, [(job.state, job.create_time_ms)]).await?, job))
    }

    /// Returns a page of jobs.
    pub(crate) async fn list_jobs(&self, call: &Call, request: v1::ListJobsRequest) -> Result<v1::ListJobsResponse> {
        let filter = filter_of(call, &request)?;
        let page = Page::new(&["jobs", &hash_of(&filter)], request.page_size, &request.page_token)?;
        let after = page.after.as_deref();
        let jobs = &self.service.jobs;
        // Before the jobs are read, because it may have to wait, and a page of jobs takes much memory.
        let outlook = jobs.outlook(&call.caller, [(JobState::Queued, 0)]).await?;
        if Field::new("view").wire_value::<View>(request.view)? == View::Basic {
            let summaries = jobs.summaries(call, &filter, after, page.limit()).await?;
            let (summaries, next_page_token) =
                page.fill(summaries, |job| job.id.clone(), |job| to_wire::summary(&outlook, job));
            return Ok(v1::ListJobsResponse { summaries, next_page_token, ..Default::default() });
        }
        let found = jobs.list(call, &filter, after, page.limit()).await?;
        let (jobs, next_page_token) = page.fill(found, |job| job.id.clone(), |job| to_wire::job(&outlook, job));
        Ok(v1::ListJobsResponse { jobs, next_page_token, ..Default::default() })
    }

    async fn cancel_job(&self, call: &Call, request: v1::CancelJobRequest) -> Result<v1::Job> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        call.concerns(format!("jobs/{id}"));
        let jobs = &self.service.jobs;
        let job = jobs.cancel(call, &id).await?;
        Ok(to_wire::job(&jobs.outlook(&call.caller, [(job.state, job.create_time_ms)]).await?, job))
    }

    async fn retry_job(&self, call: &Call, request: v1::RetryJobRequest) -> Result<v1::Job> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        call.concerns(format!("jobs/{id}"));
        let jobs = &self.service.jobs;
        let job = jobs.retry(call, &id).await?;
        Ok(to_wire::job(&jobs.outlook(&call.caller, [(job.state, job.create_time_ms)]).await?, job))
    }

    async fn list_job_events(
        &self,
        call: &Call,
        request: v1::ListJobEventsRequest,
    ) -> Result<v1::ListJobEventsResponse> {
        let id = names::job_id(&Field::new("name"), &request.name)?;
        self.service.jobs.visible(call, &id).await?;
        let page = Page::new(&["events", &id], request.page_size, &request.page_token)?;
        let events = self.service.jobs.events(call, &id, page.after_number()?, page.limit()).await?;
        let (events, next_page_token) = page.fill(events, |event| event.sequence.to_string(), to_wire::event);
        Ok(v1::ListJobEventsResponse { events, next_page_token })
    }

    async fn get_batch(&self, call: &Call, request: v1::GetBatchRequest) -> Result<v1::Batch> {
        let batch = label(&Field::new("batch"), request.batch)?;
        let batch = batch.ok_or_else(|| Field::new("batch").but("is empty", "must name a batch"))?;
        let BatchProgress { jobs, done } = self.service.jobs.batch(call, &batch).await?;
        let QueueCounts { queued, running, succeeded, failed, cancelled } = jobs;
        Ok(v1::Batch { batch, queued, running, succeeded, failed, cancelled, done })
    }
}

/// Checks the filters of a list.
fn filter_of(call: &Call, request: &v1::ListJobsRequest) -> Result<JobFilter> {
    let since = Field::new("since");
    let since_ms = request
        .since
        .as_ref()
        .map(|time| ms(time).ok_or_else(|| since.invalid("is not a valid time", "give one after 1970")));
    Ok(JobFilter {
        state: Field::new("state").enum_value(request.state)?,
        display: names::display_filter(call, &Field::new("display"), &request.display)?,
        batch: label(&Field::new("batch"), request.batch.clone())?,
        kind: to_wire::kind_word(Field::new("kind").wire_value(request.kind)?),
        owner: label(&Field::new("owner"), request.owner.clone())?,
        text: label(&Field::new("text"), request.text.clone())?,
        since_ms: since_ms.transpose()?,
        id_prefix: id_prefix(&Field::new("id_prefix"), &request.id_prefix)?,
        oldest_first: Field::new("order").wire_value::<Order>(request.order)? == Order::OldestFirst,
    })
}

/// Checks the beginning of an id; `None` if it is empty.
fn id_prefix(field: &Field, given: &str) -> Result<Option<String>> {
    const LENGTH_MAX: usize = 36;
    if given.len() > LENGTH_MAX || !given.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f' | b'-')) {
        let rule = "must be the beginning of a job's id: at most 36 characters of 0-9, a-f and '-'";
        return Err(field.but(format!("is {:?}", shortened(given)), rule));
    }
    Ok((!given.is_empty()).then(|| given.to_owned()))
}

/// A short text that is another one for another filter.
fn hash_of(filter: &JobFilter) -> String {
    let mut hasher = DefaultHasher::new();
    filter.hash(&mut hasher);
    format!("{:016x}", hasher.finish())
}
