//! The job service.

use super::caller::{require_all_displays, require_display};
use super::error::ApiError;
use super::field::Field;
use super::pages::Page;
use super::time::{now_ms, timestamp};
use super::watch::{self, Watch};
use super::{Api, jobs, names, scheduling};
use futures::stream::BoxStream;
use lightpath_domain::job::Job;
use lightpath_metrics as metrics;
use lightpath_proto::v1;
use lightpath_proto::v1::job_service_server::JobService;
use lightpath_store::{BatchProgress, JobFilter};
use tonic::{Request, Response, Status};

/// A few sentences of why.
const REASON_BYTES_MAX: usize = 1000;

#[tonic::async_trait]
impl JobService for Api {
    async fn submit_job(&self, request: Request<v1::SubmitJobRequest>) -> Result<Response<v1::Job>, Status> {
        let new = self.new_job(request.into_inner()).await?;
        let (job, _) = self.store.submit(&new, now_ms(), self.queue_limits).await.map_err(ApiError::from)?;
        Ok(Response::new(jobs::to_wire(job)))
    }

    async fn get_job(&self, request: Request<v1::GetJobRequest>) -> Result<Response<v1::Job>, Status> {
        Ok(Response::new(self.job(&request.into_inner().name).await?))
    }

    async fn list_jobs(&self, request: Request<v1::ListJobsRequest>) -> Result<Response<v1::ListJobsResponse>, Status> {
        Ok(Response::new(self.jobs(request.into_inner()).await?))
    }

    type WatchJobStream = BoxStream<'static, Result<v1::Job, Status>>;

    async fn watch_job(&self, request: Request<v1::WatchJobRequest>) -> Result<Response<Self::WatchJobStream>, Status> {
        let id = names::job_id(&Field::new("name"), &request.into_inner().name)?;
        let permit = self.watcher()?;
        // Subscribed before the first read, so that no change falls in between.
        let changes = self.store.subscribe_job_changes();
        let first = self.visible_job(&id).await?;
        let source = JobSource { store: self.store.clone(), id };
        Ok(Response::new(watch::stream(source, first, changes, self.stopping.clone(), permit)))
    }

    async fn cancel_job(&self, request: Request<v1::CancelJobRequest>) -> Result<Response<v1::Job>, Status> {
        let id = names::job_id(&Field::new("name"), &request.into_inner().name)?;
        self.visible_job(&id).await?;
        let job = self.store.cancel(&id, now_ms()).await.map_err(ApiError::from)?;
        // A running job ends at its worker, and is counted there.
        if job.state.has_ended() {
            metrics::job_ended(&job);
        }
        Ok(Response::new(jobs::to_wire(job)))
    }

    async fn retry_job(&self, request: Request<v1::RetryJobRequest>) -> Result<Response<v1::Job>, Status> {
        let id = names::job_id(&Field::new("name"), &request.into_inner().name)?;
        self.visible_job(&id).await?;
        Ok(Response::new(jobs::to_wire(self.store.retry(&id, now_ms()).await.map_err(ApiError::from)?)))
    }

    async fn list_job_events(
        &self,
        request: Request<v1::ListJobEventsRequest>,
    ) -> Result<Response<v1::ListJobEventsResponse>, Status> {
        let request = request.into_inner();
        let id = names::job_id(&Field::new("name"), &request.name)?;
        self.visible_job(&id).await?;
        let page = Page::new(&["events", &id], request.page_size, &request.page_token)?;
        let events = self.store.events(&id, page.after_number()?, page.limit()).await.map_err(ApiError::from)?;
        let to_wire = |event: lightpath_domain::job::JobEvent| v1::JobEvent {
            time: Some(timestamp(event.time_ms)),
            attempt: event.attempt,
            message: event.message,
        };
        let (events, next_page_token) = page.fill(events, |event| event.sequence.to_string(), to_wire);
        Ok(Response::new(v1::ListJobEventsResponse { events, next_page_token }))
    }

    async fn get_batch(&self, request: Request<v1::GetBatchRequest>) -> Result<Response<v1::Batch>, Status> {
        let batch = scheduling::label(&Field::new("batch"), request.into_inner().batch)?;
        let batch = batch.ok_or_else(|| Field::new("batch").invalid("is empty, but must name a batch"))?;
        // Its jobs may be about any display.
        require_all_displays("display in ListJobs")?;
        let BatchProgress { queued, running, succeeded, failed, cancelled, done } =
            self.store.batch(&batch).await.map_err(ApiError::from)?;
        Ok(Response::new(v1::Batch { batch, queued, running, succeeded, failed, cancelled, done }))
    }

    async fn get_queue(&self, _: Request<v1::GetQueueRequest>) -> Result<Response<v1::Queue>, Status> {
        require_all_displays("display in ListJobs")?;
        Ok(Response::new(self.queue().await?))
    }

    async fn pause_queue(&self, request: Request<v1::PauseQueueRequest>) -> Result<Response<v1::Queue>, Status> {
        let request = request.into_inner();
        let display = names::display_filter(&Field::new("display"), &request.display)?;
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        self.store.pause(display.as_deref(), &reason, now_ms()).await.map_err(ApiError::from)?;
        Ok(Response::new(self.queue().await?))
    }

    async fn resume_queue(&self, request: Request<v1::ResumeQueueRequest>) -> Result<Response<v1::Queue>, Status> {
        let display = names::display_filter(&Field::new("display"), &request.into_inner().display)?;
        self.store.resume(display.as_deref()).await.map_err(ApiError::from)?;
        Ok(Response::new(self.queue().await?))
    }
}

impl Api {
    async fn queue(&self) -> Result<v1::Queue, ApiError> {
        let turns = self.store.turns().await?;
        let pauses = self.store.pauses().await?;
        Ok(v1::Queue {
            queued: turns.iter().map(|turn| turn.queued).sum(),
            running: turns.iter().map(|turn| turn.running).sum(),
            turns: turns
                .into_iter()
                .map(|turn| v1::queue::Turn { owner: turn.owner, queued: turn.queued, running: turn.running })
                .collect(),
            pauses: pauses
                .into_iter()
                .map(|pause| v1::queue::Pause {
                    display: pause.display.map(|id| format!("displays/{id}")).unwrap_or_default(),
                    since: Some(timestamp(pause.time_ms)),
                    reason: pause.reason,
                })
                .collect(),
        })
    }

    /// The job called `name`, as clients see it.
    pub(crate) async fn job(&self, name: &str) -> Result<v1::Job, ApiError> {
        let id = names::job_id(&Field::new("name"), name)?;
        Ok(jobs::to_wire(self.visible_job(&id).await?))
    }

    /// A job about a display that the caller may use.
    pub(super) async fn visible_job(&self, id: &str) -> Result<Job, ApiError> {
        let job = self.store.job(id).await?;
        require_display(job.spec.display())?;
        Ok(job)
    }

    /// A page of jobs, as clients see them.
    pub(crate) async fn jobs(&self, request: v1::ListJobsRequest) -> Result<v1::ListJobsResponse, ApiError> {
        let state = Field::new("state").known(request.state, jobs::state_from_wire)?;
        let display = names::display_filter(&Field::new("display"), &request.display)?;
        let batch = scheduling::label(&Field::new("batch"), request.batch)?;
        let list = ["jobs", &request.state.to_string(), &request.display, batch.as_deref().unwrap_or_default()];
        let page = Page::new(&list, request.page_size, &request.page_token)?;
        let filter = JobFilter { state, display, batch };
        let jobs = self.store.jobs(&filter, page.after.as_deref(), page.limit()).await?;
        let (jobs, next_page_token) = page.fill(jobs, |job| job.id.clone(), jobs::to_wire);
        Ok(v1::ListJobsResponse { jobs, next_page_token })
    }
}

struct JobSource {
    store: lightpath_store::Store,
    id: String,
}

impl Watch for JobSource {
    type Item = Job;
    type Change = String;
    type Message = v1::Job;

    async fn read(&self) -> Result<Job, ApiError> {
        Ok(self.store.job(&self.id).await?)
    }

    fn concerns(&self, change: &String) -> bool {
        *change == self.id
    }

    fn is_last(&self, job: &Job) -> bool {
        job.state.has_ended()
    }

    fn message(&self, job: &Job) -> v1::Job {
        jobs::to_wire(job.clone())
    }
}
