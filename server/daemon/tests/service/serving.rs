//! A running server for one test, and a client of it.

use lightpath_artifacts::digest_of;
use lightpath_proto::v1;
use lightpath_proto::v1::artifact_service_client::ArtifactServiceClient;
use lightpath_proto::v1::display_service_client::DisplayServiceClient;
use lightpath_proto::v1::job_service_client::JobServiceClient;
use lightpath_proto::v1::write_artifact_request::Part;
use lightpath_server::config::{Config, SecretText};
use lightpath_server::server::{self, ServeError};
use std::net::SocketAddr;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};
use tonic::Code;
use tonic::Status;
use tonic::transport::Channel;

/// A running server; stopped when [`Serving::stop`] is called or the test ends.
pub(crate) struct Serving {
    pub(crate) address: SocketAddr,
    pub(crate) config: Config,
    pub(crate) channel: Channel,
    shutdown: CancellationToken,
    /// Stops the server when the test fails.
    _guard: DropGuard,
    running: JoinHandle<Result<(), ServeError>>,
    folder: TempDir,
}

impl Serving {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let data_dir = folder.path().join("data");
        let database_url = lightpath_fixtures::test_database().await.map(SecretText::new);
        let config = Config { data_dir, database_url, ..Config::default() };
        Self::start_in(folder, config, change).await
    }

    /// Starts a server with TLS. Its `channel` does not use TLS and cannot be used.
    pub(crate) async fn start_secured(change: impl FnOnce(&mut Config)) -> Self {
        Self::start_with(change).await
    }

    pub(crate) async fn start_in(folder: TempDir, mut config: Config, change: impl FnOnce(&mut Config)) -> Self {
        config.compute_threads = 1;
        change(&mut config);
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let shutdown = CancellationToken::new();
        let stop = shutdown.clone();
        let running = tokio::spawn(server::run(listener, config.clone(), async move { stop.cancelled().await }));
        let endpoint = Channel::from_shared(format!("http://{address}")).unwrap();
        let channel = match config.tls_cert {
            None => endpoint.connect().await.unwrap(),
            Some(_) => endpoint.connect_lazy(),
        };
        let guard = shutdown.clone().drop_guard();
        Self { address, config, channel, shutdown, _guard: guard, running, folder }
    }

    /// Stops the server, and starts another one on the same data.
    pub(crate) async fn restart(self) -> Self {
        self.restart_with(|_| {}).await
    }

    /// Stops the server, and starts another one on the same data with changed settings.
    pub(crate) async fn restart_with(self, change: impl FnOnce(&mut Config)) -> Self {
        self.shutdown.cancel();
        self.running.await.unwrap().unwrap();
        Self::start_in(self.folder, self.config, change).await
    }

    /// Stops the server and waits for its end.
    pub(crate) async fn stop(self) -> Result<(), ServeError> {
        self.shutdown.cancel();
        self.running.await.unwrap()
    }

    pub(crate) fn begin_to_stop(&self) {
        self.shutdown.cancel();
    }

    pub(crate) fn displays(&self) -> DisplayServiceClient<Channel> {
        DisplayServiceClient::new(self.channel.clone())
    }

    pub(crate) fn jobs(&self) -> JobServiceClient<Channel> {
        JobServiceClient::new(self.channel.clone())
    }

    pub(crate) fn artifacts(&self) -> ArtifactServiceClient<Channel> {
        ArtifactServiceClient::new(self.channel.clone())
    }

    /// Creates a display of 64×48 px.
    pub(crate) async fn display(&self, id: &str) -> v1::Display {
        let request = v1::CreateDisplayRequest { display: Some(small_display(id)) };
        self.displays().create_display(request).await.unwrap().into_inner()
    }

    /// Uploads `bytes` and returns their digest.
    pub(crate) async fn upload(&self, bytes: &[u8]) -> String {
        let digest = digest_of(bytes);
        self.write(&digest, bytes.len() as u64, 0, bytes).await.unwrap().digest
    }

    /// Downloads an artifact.
    pub(crate) async fn read(&self, digest: &str) -> Vec<u8> {
        let request = v1::ReadArtifactRequest { digest: digest.to_owned(), ..Default::default() };
        let mut stream = self.artifacts().read_artifact(request).await.unwrap().into_inner();
        let mut bytes = Vec::new();
        while let Some(message) = stream.message().await.unwrap() {
            bytes.extend_from_slice(&message.chunk);
        }
        bytes
    }

    pub(crate) async fn write(
        &self,
        digest: &str,
        size_bytes: u64,
        offset_bytes: u64,
        bytes: &[u8],
    ) -> Result<v1::Artifact, Status> {
        let start = v1::WriteArtifactStart { digest: digest.to_owned(), size_bytes, offset_bytes };
        let mut parts = vec![v1::WriteArtifactRequest { part: Some(Part::Start(start)) }];
        for chunk in bytes.chunks(1 << 20) {
            parts.push(v1::WriteArtifactRequest { part: Some(Part::Chunk(chunk.to_vec().into())) });
        }
        Ok(self.artifacts().write_artifact(tokio_stream::iter(parts)).await?.into_inner())
    }
}

pub(crate) fn small_display(id: &str) -> v1::Display {
    sized_display(id, 64, 48)
}

/// A display with pixels of 8 µm and one wavelength.
pub(crate) fn sized_display(id: &str, width_px: u32, height_px: u32) -> v1::Display {
    v1::Display {
        name: format!("displays/{id}"),
        modulator: Some(v1::Modulator::of_phase(width_px, height_px, 8e-6)),
        wavelengths_m: vec![515e-9],
        ..Default::default()
    }
}

/// Asserts that the answer is an error with this code and a message that begins with `start`.
pub(crate) fn expect<T: std::fmt::Debug>(answer: Result<T, Status>, code: Code, start: &str) {
    let status = answer.unwrap_err();
    assert_eq!(status.code(), code, "{}", status.message());
    assert!(status.message().starts_with(start), "{}", status.message());
}
