//! A server of the demo's own, on a free loopback port.

use crate::config::Config;
use crate::server::{self, ServeError};
use anyhow::Context as _;
use std::net::Ipv4Addr;
use std::path::Path;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// A running server; stops when dropped, cleanly with [`Self::stop`].
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

    /// Lets it end its work, and says how that went.
    pub(super) async fn stop(self) -> anyhow::Result<()> {
        // It may have ended by itself already; why is in its result.
        drop(self.stop);
        self.running.await?.context("the demo's server failed")
    }
}
