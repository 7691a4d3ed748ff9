//! A server inside the test's process: port 0, a fresh data folder, nothing shared with other tests.

use lightpath::{Client, v1};
use lightpath_server::config::Config;
use lightpath_server::server;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::{Channel, Endpoint};

/// A running server. End it with [`TestServer::stop`], so that a test sees a stop that fails.
pub(crate) struct TestServer {
    pub(crate) client: Client,
    url: String,
    data: TempDir,
    stop: oneshot::Sender<()>,
    serving: JoinHandle<()>,
}

impl TestServer {
    pub(crate) async fn start() -> Self {
        Self::with(|_| ()).await
    }

    /// A server whose settings `change` has changed.
    pub(crate) async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let data = TempDir::new().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let mut config = Config {
            data_dir: data.path().to_owned(),
            listen: address,
            compute_threads: 1,
            checkpoint_interval_s: 0.05,
            drain_deadline_s: 5.0,
            ..Config::default()
        };
        change(&mut config);
        let (stop, stopped) = oneshot::channel::<()>();
        let serving = tokio::spawn(async move {
            server::run(listener, config, async move { drop(stopped.await) }).await.unwrap();
        });
        let url = format!("http://{address}");
        Self { client: Client::connect(&url).unwrap(), url, data, stop, serving }
    }

    pub(crate) fn url(&self) -> &str {
        &self.url
    }

    /// A connection of its own, for raw calls.
    pub(crate) fn channel(&self) -> Channel {
        Endpoint::from_shared(self.url.clone()).unwrap().connect_lazy()
    }

    /// The server is up, and answers a new connection.
    pub(crate) async fn assert_answers(&self) {
        let client = Client::connect(&self.url).unwrap();
        client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
        assert!(!self.serving.is_finished());
    }

    /// Nothing half-written lies in the data folder.
    pub(crate) fn assert_tidy(&self) {
        for folder in ["tmp", "uploads"] {
            let Ok(entries) = std::fs::read_dir(self.data.path().join(folder)) else { continue };
            let left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            assert!(left.is_empty(), "{folder} holds {left:?}");
        }
    }

    /// Stops it as SIGTERM does, and fails where that fails.
    pub(crate) async fn stop(self) {
        self.stop.send(()).unwrap();
        self.serving.await.unwrap();
    }
}
