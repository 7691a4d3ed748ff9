//! Connections: HTTP/1.1 and HTTP/2 without TLS (prior knowledge) on one port, within limits, ended gracefully.

use axum::Router;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;

/// Connections at once; more wait in the system's backlog. Each takes a file handle, of which processes commonly
/// have 1024.
const CONNECTIONS_MAX: usize = 800;
/// Requests at once on one connection, watching streams included.
const STREAMS_MAX: u32 = 256;
/// Bytes that a stream may send before its handler reads them: fills a fast link over a continent.
const STREAM_WINDOW_BYTES: u32 = 512 << 10;
/// Unread streams, such as uploads that wait for their turn, must never use up what the connection's others need.
const CONNECTION_WINDOW_BYTES: u32 = STREAMS_MAX * STREAM_WINDOW_BYTES;
/// A connection that says nothing for this long at its beginning, or between HTTP/1 requests, is closed.
const FIRST_BYTES_DEADLINE: Duration = Duration::from_secs(30);
/// HTTP/2 peers are asked this often whether they still live ...
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(30);
/// ... and have this long to answer, so that watchers behind a dead link free their places.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);
/// Pause after the system refused a connection, most likely for want of file handles.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves `app` until `stop` is cancelled, then lets open requests end, for at most `deadline`.
pub(crate) async fn serve(listener: TcpListener, app: Router, stop: CancellationToken, deadline: Duration) {
    let builder = Arc::new(builder());
    let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let graceful = GracefulShutdown::new();
    while let Some((stream, place)) = next(&listener, &places, &stop).await {
        let watcher = graceful.watcher();
        let (builder, stop) = (Arc::clone(&builder), stop.clone());
        let service = TowerToHyperService::new(app.clone());
        tokio::spawn(async move {
            if speaks(&stream, &stop).await {
                let connection = builder.serve_connection(TokioIo::new(stream), service).into_owned();
                if let Err(error) = watcher.watch(connection).await {
                    tracing::debug!(%error, "a connection ended early");
                }
            }
            drop(place);
        });
    }
    drop(listener);
    if timeout(deadline, graceful.shutdown()).await.is_err() {
        tracing::warn!("some connections did not end in time and are cut");
    }
}

fn builder() -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    builder.http1().timer(TokioTimer::new()).header_read_timeout(FIRST_BYTES_DEADLINE);
    builder
        .http2()
        .timer(TokioTimer::new())
        .max_concurrent_streams(STREAMS_MAX)
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT);
    builder
}

/// Waits for a connection's first bytes; `false` where none come, or the server stops before.
async fn speaks(stream: &TcpStream, stop: &CancellationToken) -> bool {
    let mut byte = [0];
    tokio::select! {
        peeked = timeout(FIRST_BYTES_DEADLINE, stream.peek(&mut byte)) => peeked.is_ok_and(|peeked| peeked.is_ok()),
        () = stop.cancelled() => false,
    }
}

/// The next connection and its place among [`CONNECTIONS_MAX`]; `None` when it is time to stop.
async fn next(
    listener: &TcpListener,
    places: &Arc<Semaphore>,
    stop: &CancellationToken,
) -> Option<(TcpStream, tokio::sync::OwnedSemaphorePermit)> {
    let accept = async {
        let place = Arc::clone(places).acquire_owned().await.ok()?;
        loop {
            match listener.accept().await {
                Ok((stream, _)) => {
                    // Small messages must not wait for the acknowledgement of the one before.
                    let _ = stream.set_nodelay(true);
                    return Some((stream, place));
                }
                Err(error) => {
                    tracing::warn!(%error, "a connection could not be accepted");
                    sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    };
    tokio::select! {
        biased;
        () = stop.cancelled() => None,
        accepted = accept => accepted,
    }
}
