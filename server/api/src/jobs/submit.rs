//! Submission of jobs: checks a request, looks up the named resources, fills in defaults, and puts the job into the
//! queue.

use super::{scheduling, to_wire, waits_for};
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::wrong_fields::{check_all, is_about_fields};
use lightpath_domain::access::Role;
use lightpath_domain::job::{Job, JobSpec, NewJob, Scheduling};
use lightpath_proto::v1::{self, job_spec};
use uuid::Uuid;

/// Limit on the length of a request id \[bytes\]: a UUID and a few words.
const REQUEST_ID_BYTES_MAX: usize = 128;
/// Limit on the attempts: a job that failed so often has a permanent problem.
const ATTEMPTS_MAX: u32 = 20;
const ATTEMPTS_DEFAULT: u32 = 3;
const PRIORITY_MAX: i32 = 100;

impl Api {
    pub(crate) async fn submit_job(&self, call: &Call, request: v1::SubmitJobRequest) -> Result<v1::Job, ApiError> {
        let new = self.new_job(call, request).await?;
        match self.store.submit(&new, self.store.now_ms(), self.queue_limits).await {
            Ok((job, _)) => {
                call.concerns(format!("jobs/{}", job.id));
                if !waits_for::of_job(&self.store, &job).is_empty() {
                    // A process may have come in the last seconds. The job is stored, so an error changes nothing.
                    drop(self.store.read_living().await);
                }
                Ok(to_wire::job(&self.store, job))
            }
            Err(error) => Err(self.error_for(&call.caller, error).await),
        }
    }

    /// Checks a submission and converts it. Named resources are looked up and pictures are decoded, so that the request
    /// is refused now rather than by a worker an hour later.
    async fn new_job(&self, call: &Call, mut request: v1::SubmitJobRequest) -> Result<NewJob, ApiError> {
        let kind = request.spec.take().and_then(|spec| spec.kind);
        let place = match Place::in_queue(call, request) {
            // Who may not submit the job learns nothing of what its spec names.
            Err(error) if !is_about_fields(&error) => return Err(error),
            place => place,
        };
        let mut before = None;
        if let Ok(Place { scheduling, request_id, .. }) = &place {
            // The store refuses jobs that do not exist.
            if !call.caller.displays.is_empty() {
                for id in &scheduling.after {
                    self.visible_job(call, id).await?;
                }
            }
            before = self.store.job_by_request(&scheduling.owner, request_id).await?;
        }
        let spec = self.job_spec(call, kind, before.as_ref()).await;
        check_all! {
            place = place;
            spec = spec;
        }
        let (spec, decoding_bytes) = spec;
        // A repeated request returns its job, even if the limits have changed since.
        let estimate = match before {
            Some(job) => job.estimate,
            None => self.estimated(&spec, decoding_bytes).await?,
        };
        let Place { scheduling, request_id, priority, attempts_max } = place;
        Ok(NewJob { spec, request_id, priority, attempts_max, scheduling, estimate })
    }

    /// Checks what a job shall do. Returns also the largest memory for decoding one of its pictures \[bytes\]. `before` is
    /// the job of an earlier submission of the same request.
    async fn job_spec(
        &self,
        call: &Call,
        kind: Option<job_spec::Kind>,
        before: Option<&Job>,
    ) -> Result<(JobSpec, u64), ApiError> {
        let field = Field::new("spec");
        let mut decoding_bytes = 0;
        let spec = match field.required(kind)? {
            job_spec::Kind::OptimizeHologram(message) => {
                let field = field.at("optimize_hologram");
                let (spec, decoding) = self.optimize_hologram_spec(call, message, &field, before).await?;
                decoding_bytes = decoding;
                JobSpec::OptimizeHologram(Box::new(spec))
            }
            job_spec::Kind::LearnKernel(message) => {
                JobSpec::LearnKernel(self.learn_kernel_spec(call, message, &field.at("learn_kernel")).await?)
            }
            job_spec::Kind::SimulateCapture(message) => JobSpec::SimulateCapture(
                self.simulate_capture_spec(call, message, &field.at("simulate_capture")).await?,
            ),
            job_spec::Kind::EvaluateKernel(message) => {
                let field = field.at("evaluate_kernel");
                JobSpec::EvaluateKernel(self.evaluate_kernel_spec(call, message, &field, before).await?)
            }
            job_spec::Kind::PrepareDataset(message) => {
                let field = field.at("prepare_dataset");
                let spec = self.prepare_dataset_spec(call, message, &field, before).await?;
                decoding_bytes = self.dots_decoding_bytes(call, &field, &spec).await?;
                JobSpec::PrepareDataset(spec)
            }
            job_spec::Kind::ReportKernel(message) => {
                JobSpec::ReportKernel(self.report_kernel_spec(call, message, &field.at("report_kernel")).await?)
            }
            job_spec::Kind::SuggestHolograms(message) => {
                let field = field.at("suggest_holograms");
                JobSpec::SuggestHolograms(self.suggest_holograms_spec(call, message, &field).await?)
            }
            job_spec::Kind::VerifyHologram(message) => {
                JobSpec::VerifyHologram(self.verify_hologram_spec(call, message, &field.at("verify_hologram")).await?)
            }
        };
        Ok((spec, decoding_bytes))
    }
}

/// The part of a submission that is the same for all kinds of jobs.
struct Place {
    scheduling: Scheduling,
    request_id: String,
    priority: i32,
    attempts_max: u32,
}

impl Place {
    fn in_queue(call: &Call, request: v1::SubmitJobRequest) -> Result<Self, ApiError> {
        let attempts_max = Field::new("attempts_max");
        check_all! {
            scheduling = scheduling::scheduling(call, &request);
            request_id = request_id(request.request_id);
            priority = priority(call, request.priority);
            attempts_max = attempts_max.integer_or(request.attempts_max, ATTEMPTS_DEFAULT, 1..=ATTEMPTS_MAX);
        }
        Ok(Self { scheduling, request_id, priority, attempts_max })
    }
}

/// Checks a priority. Only curators and admins may let a job overtake those of others.
fn priority(call: &Call, given: i32) -> Result<i32, ApiError> {
    let field = Field::new("priority");
    let priority = field.integer(given, -PRIORITY_MAX..=PRIORITY_MAX)?;
    if priority >= 0 || matches!(call.caller.role, Role::Curator | Role::Admin) {
        return Ok(priority);
    }
    Err(ApiError::Denied(format!(
        "{field} is {priority}, but a job before those of others needs a token with the role curator or admin; use 0 to \
         {PRIORITY_MAX}"
    )))
}

fn request_id(given: String) -> Result<String, ApiError> {
    let field = Field::new("request_id");
    if given.is_empty() {
        return Ok(Uuid::now_v7().to_string());
    }
    if given.chars().any(char::is_control) {
        return Err(field.invalid("contains control characters, but must be plain text"));
    }
    field.text(given, REQUEST_ID_BYTES_MAX)
}
