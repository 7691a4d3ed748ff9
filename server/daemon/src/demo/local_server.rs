//! A server for the demo, on a free port of the loopback address.

use crate::config::Config;
use crate::server::{self, ServeError};
use anyhow::Context as _;
use std::net::Ipv4Addr;
use std::path::Path;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// A running server. It stops when this value is dropped; [`Self::stop`] stops it cleanly.
pub(super) struct LocalServer {
    url: String,
    stop: oneshot::Sender<()>,
    running: JoinHandle<Result<(), ServeError>>,
}

impl LocalServer {
    pub(super) async fn start(data_dir: &Path) -> anyhow::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await.context("cannot listen on a loopback port")?;
        let url = format!("http://{}", listener.local_addr()?);
        let config = Config { data_dir: data_dir.to_owned(), listen: listener.local_addr()?, ..Config::default() };
        let (stop, stopped) = oneshot::channel::<()>();
        let shutdown = async move { drop(stopped.await) };
        let running = tokio::spawn(server::run(listener, config, shutdown));
        Ok(Self { url, stop, running })
    }

    pub(super) fn url(&self) -> &str {
        &self.url
    }

    /// Stops the server after its work has ended, and returns its result.
    pub(super) async fn stop(self) -> anyhow::Result<()> {
        // The server may have stopped already; its result then holds the reason.
        drop(self.stop);
        self.running.await?.context("the demo's server failed")
    }
}
