//! A server inside the test's process, on a free port and with its own data folder.

use lightpath::{Client, v1};
use lightpath_server::config::{Config, SecretText};
use lightpath_server::server;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::{Channel, Endpoint};

/// A running server. End it with [`TestServer::stop`], which fails the test if the server stops with an error.
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

    /// Starts a server with settings that `change` has modified.
    pub(crate) async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let data = TempDir::new().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let mut config = Config {
            data_dir: data.path().to_owned(),
            database_url: lightpath_fixtures::test_database().await.map(SecretText::new),
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

    /// A new connection, for calls without the typed client.
    pub(crate) fn channel(&self) -> Channel {
        Endpoint::from_shared(self.url.clone()).unwrap().connect_lazy()
    }

    /// Checks that the server runs and answers on a new connection.
    pub(crate) async fn assert_answers(&self) {
        let client = Client::connect(&self.url).unwrap();
        client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
        assert!(!self.serving.is_finished());
    }

    /// Checks that the data folder has no incomplete files.
    pub(crate) fn assert_tidy(&self) {
        for folder in ["tmp", "uploads"] {
            let Ok(entries) = std::fs::read_dir(self.data.path().join(folder)) else { continue };
            let left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            assert!(left.is_empty(), "{folder} holds {left:?}");
        }
    }

    /// Stops the server in the same way as SIGTERM. Panics if the server ends with an error.
    pub(crate) async fn stop(self) {
        self.stop.send(()).unwrap();
        self.serving.await.unwrap();
    }
}
