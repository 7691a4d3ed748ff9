//! State shared by all services.

use crate::accounts::Streams;
use crate::event_log::EventLog;
use lightpath_artifacts::Artifacts;
use lightpath_media::live_pictures::LivePictures;
use lightpath_rigs::Rigs;
use lightpath_service::{Result, Service, ServiceError};
use lightpath_store::Store;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;

/// A server that cannot read its database within this time, or write to it, reports that it is not serving.
const DATABASE_ANSWER_MAX: Duration = Duration::from_secs(5);

/// State shared by all services; cheap to clone.
#[derive(Clone, Debug)]
pub struct Api {
    /// What the methods do.
    pub(crate) service: Service,
    /// For methods that only read.
    pub(crate) store: Store,
    pub(crate) artifacts: Artifacts,
    pub(crate) streams: Streams,
    pub(crate) events: EventLog,
    pub(crate) live_pictures: LivePictures,
    pub(crate) rigs: Rigs,
    pub(crate) stopping: CancellationToken,
    /// Result of the latest health check.
    health: watch::Sender<Result<(), String>>,
}

impl Api {
    /// Creates the shared state for `service`, which is on `store` and `artifacts`. Cancelling `stopping` ends all streams
    /// when the server stops.
    pub fn new(service: Service, store: Store, artifacts: Artifacts, stopping: CancellationToken) -> Self {
        Self {
            service,
            store,
            artifacts,
            streams: Streams::default(),
            events: EventLog::default(),
            live_pictures: LivePictures::default(),
            rigs: Rigs::default(),
            stopping,
            health: watch::Sender::new(Ok(())),
        }
    }

    /// The same with the rigs that jobs ask for photographs.
    #[must_use]
    pub fn with_rigs(self, rigs: Rigs) -> Self {
        Self { rigs, ..self }
    }

    /// The pictures of running jobs that the API shows; workers draw them.
    #[must_use]
    pub fn live_pictures(&self) -> LivePictures {
        self.live_pictures.clone()
    }

    /// Checks that the server can answer requests and run jobs: it is not stopping, its database can be read and
    /// written, and its disk has room.
    pub async fn is_serving(&self) -> Result<()> {
        if self.is_stopping() {
            return Err(ServiceError::Stopping);
        }
        self.artifacts.space().room_to_start()?;
        let counts = timeout(DATABASE_ANSWER_MAX, self.store.queue_counts()).await;
        counts.map_err(|_| ServiceError::DatabaseSilent)??;
        timeout(DATABASE_ANSWER_MAX, self.store.wait_for_writer()).await.map_err(|_| ServiceError::Locked)??;
        Ok(())
    }

    /// Keeps the result of a health check, which `/healthz` then answers.
    pub fn set_health(&self, result: Result<(), String>) {
        drop(self.health.send_replace(result));
    }

    /// The latest result of [`Self::is_serving`] that was kept, or the reason why the server does not serve. It costs
    /// nothing, so that nobody can load the server with health checks.
    pub(crate) fn health(&self) -> Result<(), String> {
        if self.is_stopping() { Err(ServiceError::Stopping.to_string()) } else { self.health.borrow().clone() }
    }

    /// Whether the server is stopping and refuses new requests.
    pub(crate) fn is_stopping(&self) -> bool {
        self.stopping.is_cancelled()
    }

    /// The store of the server.
    pub fn store(&self) -> &Store {
        &self.store
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use lightpath_domain::origin::Origins;
    use lightpath_fixtures::lock_database;
    use lightpath_service::{JobLimits, ManifestRules, ServiceLimits};
    use lightpath_store::QueueLimits;
    use std::path::Path;

    const DATABASE: &str = "lightpath.db";

    /// The services with an empty database in `folder`.
    pub(crate) async fn api_in(folder: &Path) -> Api {
        let (store, artifacts) = (Store::open(&folder.join(DATABASE)).await.unwrap(), Artifacts::open(folder).unwrap());
        let limits = ServiceLimits {
            queue: QueueLimits::from(10),
            jobs: JobLimits::default(),
            computing_bytes: 1 << 30,
            manifests: ManifestRules::default(),
        };
        let stopping = CancellationToken::new();
        let service = Service::new(&store, &artifacts, &limits, Origins::default(), stopping.clone());
        Api::new(service, store, artifacts, stopping)
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn server_serves_only_while_it_can_write_and_is_not_stopping() {
        let folder = tempfile::tempdir().unwrap();
        let api = api_in(folder.path()).await;
        api.is_serving().await.unwrap();
        let lock = lock_database(&folder.path().join(DATABASE)).await;
        assert!(matches!(api.is_serving().await, Err(ServiceError::Locked)));
        drop(lock);
        api.is_serving().await.unwrap();
        api.stopping.cancel();
        assert!(matches!(api.is_serving().await, Err(ServiceError::Stopping)));
    }
}
