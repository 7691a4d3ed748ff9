//! One method for each call of the API. Requests and answers are the messages of [`crate::v1`], documented there.

use crate::client::bounded;
use crate::{Client, Result, v1};
use tonic::Streaming;

macro_rules! calls {
    ($($(#[$doc:meta])* $service:ident.$call:ident($request:ident) -> $response:ident;)*) => {
        impl Client {
            $(
                $(#[$doc])*
                ///
                /// # Errors
                ///
                /// What the server refused ([`crate::Error::Refused`]), or that it could not be reached.
                pub async fn $call(&self, request: v1::$request) -> Result<v1::$response> {
                    let answer = self.$service().$call(bounded(request)).await;
                    Ok(answer.map_err(|status| self.error(status))?.into_inner())
                }
            )*
        }
    };
}

calls! {
    /// Declares a display.
    displays.create_display(CreateDisplayRequest) -> Display;
    /// One display.
    displays.get_display(GetDisplayRequest) -> Display;
    /// A page of displays, in the order of their ids.
    displays.list_displays(ListDisplaysRequest) -> ListDisplaysResponse;
    /// How the light's way to a distance would be computed, and how good that is.
    displays.plan_propagation(PlanPropagationRequest) -> PlanPropagationResponse;
    /// Deletes a display that nothing refers to.
    displays.delete_display(DeleteDisplayRequest) -> DeleteDisplayResponse;

    /// Opens a dataset.
    datasets.create_dataset(CreateDatasetRequest) -> Dataset;
    /// One dataset with its pairs.
    datasets.get_dataset(GetDatasetRequest) -> Dataset;
    /// A page of datasets without their pairs, in the order of their ids.
    datasets.list_datasets(ListDatasetsRequest) -> ListDatasetsResponse;
    /// Adds one (hologram, photograph) pair to an open dataset.
    datasets.add_pair(AddPairRequest) -> Dataset;
    /// The picture whose hologram is displayed to find an alignment.
    datasets.create_calibration_target(CreateCalibrationTargetRequest) -> CalibrationTarget;

    /// Submits a job, once. [`Client::submit`] can also try again.
    jobs.submit_job(SubmitJobRequest) -> Job;
    /// One job.
    jobs.get_job(GetJobRequest) -> Job;
    /// A page of jobs, newest first.
    jobs.list_jobs(ListJobsRequest) -> ListJobsResponse;
    /// Asks for the end of a job.
    jobs.cancel_job(CancelJobRequest) -> Job;
    /// Queues a failed or cancelled job again.
    jobs.retry_job(RetryJobRequest) -> Job;
    /// A page of what happened to a job, oldest first.
    jobs.list_job_events(ListJobEventsRequest) -> ListJobEventsResponse;
    /// How the jobs of a batch stand, as one.
    jobs.get_batch(GetBatchRequest) -> Batch;
    /// How the queue stands.
    jobs.get_queue(GetQueueRequest) -> Queue;
    /// Lets nothing start any more, for a display or at all.
    jobs.pause_queue(PauseQueueRequest) -> Queue;
    /// Lets jobs start again.
    jobs.resume_queue(ResumeQueueRequest) -> Queue;

    /// One kernel.
    kernels.get_kernel(GetKernelRequest) -> Kernel;
    /// A page of kernels, in the order of their names.
    kernels.list_kernels(ListKernelsRequest) -> ListKernelsResponse;
    /// One version of a kernel.
    kernels.get_kernel_version(GetKernelVersionRequest) -> KernelVersion;
    /// A page of a kernel's versions, newest first.
    kernels.list_kernel_versions(ListKernelVersionsRequest) -> ListKernelVersionsResponse;
    /// Points `active` to a version.
    kernels.promote_kernel(PromoteKernelRequest) -> Kernel;
    /// Points `active` back to where it was before its last move.
    kernels.rollback_kernel(RollbackKernelRequest) -> Kernel;
    /// A page of the moves of `active`, newest first.
    kernels.list_kernel_moves(ListKernelMovesRequest) -> ListKernelMovesResponse;
    /// Stores an uploaded kernel file as a kernel's next version.
    kernels.import_kernel(ImportKernelRequest) -> KernelVersion;
    /// Stores the kernel of a distance between photographed ones as its kernel's next version.
    kernels.interpolate_kernel(InterpolateKernelRequest) -> KernelVersion;

    /// Whether an artifact is stored.
    artifacts.get_artifact(GetArtifactRequest) -> Artifact;
    /// How much of an interrupted upload the server has.
    artifacts.get_upload(GetUploadRequest) -> Upload;
}

impl Client {
    /// The job now, and again whenever it changes, until it has ended. Ends with the connection;
    /// [`Client::wait`] goes on.
    ///
    /// # Errors
    ///
    /// What the server refused ([`crate::Error::Refused`]), or that it could not be reached.
    pub async fn watch_job(&self, request: v1::WatchJobRequest) -> Result<Streaming<v1::Job>> {
        Ok(self.jobs().watch_job(request).await.map_err(|status| self.error(status))?.into_inner())
    }

    /// The kernel now, and again whenever it gets a version or `active` moves. Ends with the connection.
    ///
    /// # Errors
    ///
    /// What the server refused ([`crate::Error::Refused`]), or that it could not be reached.
    pub async fn watch_kernel(&self, request: v1::WatchKernelRequest) -> Result<Streaming<v1::Kernel>> {
        Ok(self.kernels().watch_kernel(request).await.map_err(|status| self.error(status))?.into_inner())
    }

    /// A part of an artifact's bytes, unchecked; [`Client::download`] checks them.
    ///
    /// # Errors
    ///
    /// What the server refused ([`crate::Error::Refused`]), or that it could not be reached.
    pub async fn read_artifact(&self, request: v1::ReadArtifactRequest) -> Result<Streaming<v1::ReadArtifactResponse>> {
        Ok(self.artifacts().read_artifact(request).await.map_err(|status| self.error(status))?.into_inner())
    }
}
