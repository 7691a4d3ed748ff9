//! The gRPC services: what comes in is checked and turned into domain types, what goes out is turned into messages.
//!
//! # Layout
//!
//! - `field`, `names`, `pages`: checking fields, resource names and pages. `submit`, `scheduling`, `optimize`, `kernel_choice`,
//!   `pictures`, `lit`: checking submitted jobs. `captures`: checking and aligning pairs of datasets.
//!   `import`, `interpolate`, `report`: of kernels.
//! - `displays`, `datasets`, `jobs`, `holograms`, `kernels`, `propagation`, `encodings`, `time`: messages from and to domain
//!   types.
//! - `*_service`: one gRPC service each. `watch`: streams that follow something.
//! - `rules`: who may make each call, and what it does. `caller`: who makes it, and for which displays. `error`, `status`: why a request is refused, and the one map to gRPC statuses.

mod artifact_service;
mod caller;
mod captures;
mod dataset_service;
mod datasets;
mod display_service;
mod displays;
mod encodings;
mod error;
mod field;
mod holograms;
mod import;
mod interpolate;
mod job_service;
mod jobs;
mod kernel_choice;
mod kernel_service;
mod kernels;
mod lit;
mod names;
mod optimize;
mod pages;
mod pictures;
mod propagation;
mod report;
pub(crate) mod rules;
mod scheduling;
mod status;
mod submit;
mod time;
mod watch;

pub(crate) use caller::handle_for;
pub use error::ApiError;
pub(crate) use time::now_ms;

use field::Field;
use lightpath_artifacts::Artifacts;
use lightpath_proto::v1::artifact_service_server::ArtifactServiceServer;
use lightpath_proto::v1::dataset_service_server::DatasetServiceServer;
use lightpath_proto::v1::display_service_server::DisplayServiceServer;
use lightpath_proto::v1::job_service_server::JobServiceServer;
use lightpath_proto::v1::kernel_service_server::KernelServiceServer;
use lightpath_store::{QueueLimits, Store};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::service::Routes;
use tonic_health::server::HealthReporter;

/// Largest message that clients may send \[bytes\]: a chunk of an upload, twice over.
pub(crate) const MESSAGE_BYTES_MAX: usize = 4 << 20;
/// Streams that may follow jobs and kernels at once, all clients together: each costs a little memory and a read
/// at every change.
const WATCHERS_MAX: usize = 1000;
/// Uploads at once, all clients together: each may hold what its connection has received, some 2 MiB.
const UPLOADS_MAX: usize = 64;
/// Pictures that are decoded at once for checking: one may take 1 GiB.
const DECODERS_MAX: usize = 2;

/// A server whose database lets nobody write for this long is not well.
const WRITE_TURN_MAX: Duration = Duration::from_secs(5);

/// What all services share; cheap to clone.
#[derive(Clone, Debug)]
pub struct Api {
    store: Store,
    artifacts: Artifacts,
    queue_limits: QueueLimits,
    decoders: Arc<Semaphore>,
    watchers: Arc<Semaphore>,
    uploaders: Arc<Semaphore>,
    lit: lit::Lit,
    reconstructor: captures::LastReconstructor,
    stopping: CancellationToken,
}

impl Api {
    /// `stopping` ends the streams when the server stops.
    pub fn new(store: Store, artifacts: Artifacts, queue_limits: QueueLimits, stopping: CancellationToken) -> Self {
        let decoders = Arc::new(Semaphore::new(DECODERS_MAX));
        let watchers = Arc::new(Semaphore::new(WATCHERS_MAX));
        let uploaders = Arc::new(Semaphore::new(UPLOADS_MAX));
        let reconstructor = captures::LastReconstructor::default();
        Self {
            store,
            artifacts,
            queue_limits,
            decoders,
            watchers,
            uploaders,
            lit: lit::Lit::default(),
            reconstructor,
            stopping,
        }
    }

    /// All services, with health and reflection, and the means to say that the server stops.
    pub fn routes(self) -> Result<(Routes, HealthReporter), tonic_reflection::server::Error> {
        let (health, health_service) = tonic_health::server::health_reporter();
        let reflection = || {
            tonic_reflection::server::Builder::configure()
                .register_encoded_file_descriptor_set(lightpath_proto::DESCRIPTORS)
                .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
        };
        let limit = MESSAGE_BYTES_MAX;
        let routes = Routes::default()
            .add_service(DisplayServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(DatasetServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(JobServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(KernelServiceServer::new(self.clone()).max_decoding_message_size(limit))
            .add_service(ArtifactServiceServer::new(self).max_decoding_message_size(limit))
            .add_service(health_service)
            .add_service(reflection().build_v1()?)
            .add_service(reflection().build_v1alpha()?);
        Ok((routes, health))
    }

    /// Whether requests can be answered and jobs run: the server is not stopping, its database reads and writes, and its
    /// disk has room.
    pub async fn is_serving(&self) -> Result<(), ApiError> {
        if self.is_stopping() {
            return Err(ApiError::Stopping);
        }
        self.artifacts.room_to_start()?;
        self.store.queue_counts().await?;
        timeout(WRITE_TURN_MAX, self.store.take_turn()).await.map_err(|_| ApiError::Locked)??;
        Ok(())
    }

    /// Whether the server takes no more requests.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stopping.is_cancelled()
    }

    /// Where everything is kept.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The files.
    pub(crate) fn artifacts(&self) -> &Artifacts {
        &self.artifacts
    }

    fn watcher(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        Arc::clone(&self.watchers).try_acquire_owned().map_err(|_| ApiError::Exhausted {
            reason: "TOO_MANY_WATCHERS",
            message: format!("{WATCHERS_MAX} streams follow jobs and kernels already; end one, or try again later"),
            retry_after: Duration::from_secs(5),
        })
    }

    fn uploader(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        Arc::clone(&self.uploaders).try_acquire_owned().map_err(|_| ApiError::Exhausted {
            reason: "TOO_MANY_UPLOADS",
            message: format!("{UPLOADS_MAX} uploads are under way already; go on when one of them has ended"),
            retry_after: Duration::from_secs(1),
        })
    }
}

/// A field of message type must be set.
fn required<T>(field: &Field, value: Option<T>) -> Result<T, ApiError> {
    value.ok_or_else(|| field.invalid("is not set, but is required"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_fixtures::held_by_another;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_server_serves_only_while_it_can_write_and_is_not_about_to_stop() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lightpath.db");
        let (store, artifacts) = (Store::open(&path).await.unwrap(), Artifacts::open(folder.path()).unwrap());
        let stopping = CancellationToken::new();
        let api = Api::new(store, artifacts, QueueLimits::from(10), stopping.clone());
        api.is_serving().await.unwrap();
        let held = held_by_another(&path).await;
        assert!(matches!(api.is_serving().await, Err(ApiError::Locked)));
        drop(held);
        api.is_serving().await.unwrap();
        stopping.cancel();
        assert!(matches!(api.is_serving().await, Err(ApiError::Stopping)));
    }
}
