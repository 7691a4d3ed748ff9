//! One method for each call of the API. Requests and answers are the messages of [`crate::v1`], which documents them.

use crate::client::{CALL_TIMEOUT, PREPARING_TIMEOUT, with_timeout};
use crate::{Client, Result, v1};
use tonic::Streaming;

macro_rules! calls {
    ($limit:ident; $($(#[$doc:meta])* $service:ident.$call:ident($request:ident) -> $response:ident;)*) => {
        impl Client {
            $(
                $(#[$doc])*
                ///
                /// # Errors
                ///
                /// [`crate::Error::Refused`] when the server refuses the call, [`crate::Error::Unreachable`] when no
                /// server answers.
                pub async fn $call(&self, request: v1::$request) -> Result<v1::$response> {
                    let answer = self.$service().$call(with_timeout(request, $limit)).await;
                    Ok(answer.map_err(|status| self.error(status))?.into_inner())
                }
            )*
        }
    };
}

calls! {
    CALL_TIMEOUT;

    /// Declares a display and returns it.
    displays.create_display(CreateDisplayRequest) -> Display;
    /// Returns a display.
    displays.get_display(GetDisplayRequest) -> Display;
    /// Returns a page of displays, ordered by id.
    displays.list_displays(ListDisplaysRequest) -> ListDisplaysResponse;
    /// Returns how light would be propagated to a distance: the method, the reason and the limits of its validity.
    displays.plan_propagation(PlanPropagationRequest) -> PlanPropagationResponse;
    /// Changes the notes of a display.
    displays.update_display(UpdateDisplayRequest) -> Display;
    /// Deletes a display that has no datasets, kernels or jobs.
    displays.delete_display(DeleteDisplayRequest) -> DeleteDisplayResponse;

    /// Creates an open dataset.
    datasets.create_dataset(CreateDatasetRequest) -> Dataset;
    /// Returns a dataset without its pairs.
    datasets.get_dataset(GetDatasetRequest) -> Dataset;
    /// Returns a page of datasets, ordered by id.
    datasets.list_datasets(ListDatasetsRequest) -> ListDatasetsResponse;
    /// Returns a page of a dataset's pairs, ordered by id.
    datasets.list_pairs(ListPairsRequest) -> ListPairsResponse;
    /// Deletes a dataset with its pairs. Kernels learned from it are kept.
    datasets.delete_dataset(DeleteDatasetRequest) -> DeleteDatasetResponse;
    /// Creates the target picture of dots. Its hologram is displayed and photographed to align a camera.
    datasets.create_calibration_target(CreateCalibrationTargetRequest) -> CalibrationTarget;

    /// Submits a job without retries. [`Client::submit`] retries after a lost connection.
    jobs.submit_job(SubmitJobRequest) -> Job;
    /// Checks the request of a job, and estimates its memory and time.
    jobs.estimate_job(EstimateJobRequest) -> JobEstimate;
    /// Returns a job.
    jobs.get_job(GetJobRequest) -> Job;
    /// Returns a page of jobs, newest first.
    jobs.list_jobs(ListJobsRequest) -> ListJobsResponse;
    /// Cancels a job: a queued one at once, a running one within an iteration.
    jobs.cancel_job(CancelJobRequest) -> Job;
    /// Queues a failed or cancelled job again.
    jobs.retry_job(RetryJobRequest) -> Job;
    /// Returns a page of the events of a job, oldest first.
    jobs.list_job_events(ListJobEventsRequest) -> ListJobEventsResponse;
    /// Returns how many jobs of a batch are queued, running and ended, and their progress as a whole.
    jobs.get_batch(GetBatchRequest) -> Batch;
    /// Returns the number of queued and running jobs of each owner, and the pauses.
    jobs.get_queue(GetQueueRequest) -> Queue;
    /// Pauses the queue for one display or for all: no further job starts.
    jobs.pause_queue(PauseQueueRequest) -> Queue;
    /// Resumes the queue for one display or for all: jobs start again.
    jobs.resume_queue(ResumeQueueRequest) -> Queue;

    /// Returns a kernel.
    kernels.get_kernel(GetKernelRequest) -> Kernel;
    /// Returns a page of kernels, ordered by name.
    kernels.list_kernels(ListKernelsRequest) -> ListKernelsResponse;
    /// Returns a version of a kernel.
    kernels.get_kernel_version(GetKernelVersionRequest) -> KernelVersion;
    /// Returns a page of a kernel's versions, newest first.
    kernels.list_kernel_versions(ListKernelVersionsRequest) -> ListKernelVersionsResponse;
    /// Sets what versions must show before they become active on a display.
    kernels.set_promotion_gate(SetPromotionGateRequest) -> DisplayGate;
    /// Returns the promotion gate of a display with its history.
    kernels.get_promotion_gate(GetPromotionGateRequest) -> DisplayGate;
    /// Lets an alias name a version, or removes the alias.
    kernels.set_kernel_alias(SetKernelAliasRequest) -> Kernel;
    /// Marks a version as deprecated, or takes that back.
    kernels.deprecate_kernel_version(DeprecateKernelVersionRequest) -> KernelVersion;
    /// Compares two versions of the kernels of one display.
    kernels.compare_kernel_versions(CompareKernelVersionsRequest) -> KernelComparison;
    /// Finds the kernels of a display whose distances are nearest to a distance.
    kernels.find_nearest_kernels(FindNearestKernelsRequest) -> FindNearestKernelsResponse;
    /// Makes the version active again that was active before the last change. The request names the version that is
    /// active now.
    kernels.rollback_kernel(RollbackKernelRequest) -> Kernel;
    /// Returns a page of the moves of `active` and other aliases, newest first.
    kernels.list_kernel_moves(ListKernelMovesRequest) -> ListKernelMovesResponse;
    /// Returns the signed manifest of a kernel's active version.
    kernels.get_kernel_manifest(GetKernelManifestRequest) -> KernelManifest;
    /// Returns the keys that may sign manifests.
    kernels.get_keyring(GetKeyringRequest) -> Keyring;
    /// Stores an uploaded kernel file as the next version of a kernel.
    kernels.import_kernel(ImportKernelRequest) -> KernelVersion;
    /// Interpolates a kernel at a distance between photographed distances, and stores it as the next version there.
    kernels.interpolate_kernel(InterpolateKernelRequest) -> KernelVersion;

    /// Ends a rollout: all devices go back to the active version.
    rollouts.halt_rollout(HaltRolloutRequest) -> Rollout;
    /// Returns a rollout with its events.
    rollouts.get_rollout(GetRolloutRequest) -> Rollout;
    /// Returns facts about the server and about the caller's token.
    server.get_server(GetServerRequest) -> Server;

    /// Returns a page of the rollouts of a kernel, newest first.
    rollouts.list_rollouts(ListRolloutsRequest) -> ListRolloutsResponse;

    /// Reports the kernel that a device uses.
    devices.report_device(ReportDeviceRequest) -> ReportDeviceResponse;
    /// Returns a page of the devices of a display, ordered by id.
    devices.list_devices(ListDevicesRequest) -> ListDevicesResponse;
    /// Puts a device into a group, or takes it out of its group.
    devices.set_device_group(SetDeviceGroupRequest) -> Device;
    /// Forgets a device and its reports.
    devices.delete_device(DeleteDeviceRequest) -> DeleteDeviceResponse;

    /// Returns the rigs that are connected to the server.
    rigs.list_rigs(ListRigsRequest) -> ListRigsResponse;

    /// Finds a target in a photograph and compares the two.
    photos.score_photo(ScorePhotoRequest) -> PhotoScore;

    /// Creates a webhook. Only this answer has its secret.
    webhooks.create_webhook(CreateWebhookRequest) -> Webhook;
    /// Returns a webhook.
    webhooks.get_webhook(GetWebhookRequest) -> Webhook;
    /// Returns all webhooks, ordered by id.
    webhooks.list_webhooks(ListWebhooksRequest) -> ListWebhooksResponse;
    /// Changes the address, the events or the display of a webhook.
    webhooks.update_webhook(UpdateWebhookRequest) -> Webhook;
    /// Sends an event to a webhook that only tries it.
    webhooks.test_webhook(TestWebhookRequest) -> WebhookDelivery;
    /// Returns a page of what a webhook is to learn and has learned lately, newest first.
    webhooks.list_webhook_deliveries(ListWebhookDeliveriesRequest) -> ListWebhookDeliveriesResponse;
    /// Deletes a webhook, with what it has not received yet.
    webhooks.delete_webhook(DeleteWebhookRequest) -> DeleteWebhookResponse;

    /// Returns the size and the time of a stored artifact. Refused with NOT_FOUND if it is not stored.
    artifacts.get_artifact(GetArtifactRequest) -> Artifact;
    /// Returns how many bytes of an upload the server has received.
    artifacts.get_upload(GetUploadRequest) -> Upload;
}

calls! {
    PREPARING_TIMEOUT;

    /// Submits jobs without retries, all or none. [`Client::submit_all`] retries after a lost connection.
    jobs.submit_jobs(SubmitJobsRequest) -> SubmitJobsResponse;
    /// Adds pairs of holograms and photographs to an open dataset, all or none.
    datasets.add_pairs(AddPairsRequest) -> AddPairsResponse;
    /// Makes a version the active one.
    kernels.promote_kernel(PromoteKernelRequest) -> Kernel;
    /// Checks a version with the display's promotion gate, and changes nothing.
    kernels.check_promotion(CheckPromotionRequest) -> PromotionVerdict;
    /// Starts a staged rollout of a version.
    rollouts.start_rollout(StartRolloutRequest) -> Rollout;
    /// Gives the version of a rollout to a larger share of the devices.
    rollouts.widen_rollout(WidenRolloutRequest) -> Rollout;
    /// Ends a rollout by making its version active.
    rollouts.complete_rollout(CompleteRolloutRequest) -> Rollout;
}

/// Calls whose answers are streams.
macro_rules! streams {
    ($($(#[$doc:meta])* $service:ident.$call:ident($request:ident) -> $item:ident;)*) => {
        impl Client {
            $(
                $(#[$doc])*
                ///
                /// # Errors
                ///
                /// [`crate::Error::Refused`] when the server refuses the call, [`crate::Error::Unreachable`] when no
                /// server answers.
                pub async fn $call(&self, request: v1::$request) -> Result<Streaming<v1::$item>> {
                    Ok(self.$service().$call(request).await.map_err(|status| self.error(status))?.into_inner())
                }
            )*
        }
    };
}

streams! {
    /// Streams the current state of a job, then each change, until the job has ended.
    ///
    /// The stream ends early if the connection is lost. [`Client::wait`] reconnects.
    jobs.watch_job(WatchJobRequest) -> Job;
    /// Streams the current state of a kernel, then each change: a new version or another active version.
    ///
    /// The stream ends when the connection is lost.
    kernels.watch_kernel(WatchKernelRequest) -> Kernel;
    /// Streams an event after each change on the server, for dashboards.
    ///
    /// The stream ends when the connection is lost. A client that then names the last event it received misses none.
    events.watch_events(WatchEventsRequest) -> Event;
    /// Streams a range of an artifact's bytes without checking the digest. [`Client::download`] checks it.
    artifacts.read_artifact(ReadArtifactRequest) -> ReadArtifactResponse;
}
