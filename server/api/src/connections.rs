//! Connections: HTTP/1.1 and HTTP/2, with TLS or without (prior knowledge), on one port, within limits, ended gracefully.

use crate::tls::Tls;
use axum::{Extension, Router};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use std::collections::HashMap;
use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};
use tokio_io_timeout::TimeoutStream;
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
/// Buffers of an HTTP/1 connection: many times the longest header. hyper's default would be 400 KiB.
const HTTP1_BUFFER_BYTES: usize = 64 << 10;
/// A connection that says nothing for this long at its beginning, or between HTTP/1 requests, is closed.
const FIRST_BYTES_DEADLINE: Duration = Duration::from_secs(30);
/// HTTP/2 peers are asked this often whether they still live ...
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(30);
/// ... and have this long to answer, so that watchers behind a dead link free their places.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);
/// Pause after the system refused a connection, most likely for want of file handles.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// A client that does not read what it asked for loses its connection, and frees its place.
const WRITE_STALL_MAX: Duration = Duration::from_secs(60);
/// Time for the TLS handshake.
const HANDSHAKE_DEADLINE: Duration = Duration::from_secs(10);
/// Connections at once from one address: one client cannot take everybody's place. Loopback counts too.
const CONNECTIONS_PER_PEER_MAX: usize = 400;

/// Where a connection came from; kept with each of its requests.
#[derive(Clone, Copy, Debug)]
pub struct Peer(SocketAddr);

impl Peer {
    /// The address without the port.
    #[must_use]
    pub fn ip(&self) -> IpAddr {
        self.0.ip()
    }
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Serves `app` until `stop` is cancelled, then lets open requests end, for at most `deadline`.
pub async fn serve(
    listener: TcpListener,
    tls: Option<Arc<Tls>>,
    app: Router,
    stop: CancellationToken,
    deadline: Duration,
) {
    let builder = Arc::new(builder());
    let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let peers = Arc::new(ConnectionCounts::default());
    let graceful = GracefulShutdown::new();
    while let Some((stream, address, place)) = next(&listener, &places, &stop).await {
        let Some(counted) = ConnectionCounts::take_place(&peers, address.ip()) else {
            tracing::debug!(%address, "refused a connection: its address has too many");
            continue;
        };
        let watcher = graceful.watcher();
        let (builder, stop) = (Arc::clone(&builder), stop.clone());
        let acceptor = tls.as_ref().map(|tls| tls.acceptor());
        let service = TowerToHyperService::new(app.clone().layer(Extension(Peer(address))));
        tokio::spawn(async move {
            if sends_first_bytes(&stream, &stop).await {
                let mut stream = TimeoutStream::new(stream);
                stream.set_write_timeout(Some(WRITE_STALL_MAX));
                let stream = Box::pin(stream);
                let ended = match acceptor {
                    None => watcher.watch(builder.serve_connection(TokioIo::new(stream), service).into_owned()).await,
                    Some(acceptor) => match timeout(HANDSHAKE_DEADLINE, acceptor.accept(stream)).await {
                        Ok(Ok(stream)) => {
                            watcher.watch(builder.serve_connection(TokioIo::new(stream), service).into_owned()).await
                        }
                        Ok(Err(error)) => Err(error.into()),
                        Err(elapsed) => Err(elapsed.into()),
                    },
                };
                if let Err(error) = ended {
                    tracing::debug!(%error, "a connection ended early");
                }
            }
            drop((place, counted));
        });
    }
    drop(listener);
    if timeout(deadline, graceful.shutdown()).await.is_err() {
        tracing::warn!("some connections did not end in time and are cut");
    }
}

/// How many connections each address has.
#[derive(Debug, Default)]
struct ConnectionCounts(Mutex<HashMap<IpAddr, usize>>);

/// One connection's place among those of its address; given back on drop.
struct CountedConnection {
    peers: Arc<ConnectionCounts>,
    address: IpAddr,
}

impl ConnectionCounts {
    fn take_place(peers: &Arc<Self>, address: IpAddr) -> Option<CountedConnection> {
        let mut counts = peers.0.lock().unwrap_or_else(PoisonError::into_inner);
        let count = counts.entry(address).or_default();
        if *count >= CONNECTIONS_PER_PEER_MAX {
            return None;
        }
        *count += 1;
        Some(CountedConnection { peers: Arc::clone(peers), address })
    }
}

impl Drop for CountedConnection {
    fn drop(&mut self) {
        let mut counts = self.peers.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(count) = counts.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.address);
            }
        }
    }
}

fn builder() -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    builder.http1().timer(TokioTimer::new()).header_read_timeout(FIRST_BYTES_DEADLINE).max_buf_size(HTTP1_BUFFER_BYTES);
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
async fn sends_first_bytes(stream: &TcpStream, stop: &CancellationToken) -> bool {
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
) -> Option<(TcpStream, SocketAddr, tokio::sync::OwnedSemaphorePermit)> {
    let accept = async {
        let place = Arc::clone(places).acquire_owned().await.ok()?;
        loop {
            match listener.accept().await {
                Ok((stream, address)) => {
                    // Small messages must not wait for the acknowledgement of the one before.
                    let _ = stream.set_nodelay(true);
                    return Some((stream, address, place));
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
