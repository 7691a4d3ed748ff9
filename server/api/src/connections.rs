//! Connections with HTTP/1.1 and HTTP/2 on one port, with or without TLS (without TLS, HTTP/2 needs prior knowledge).
//! Their number is limited, and they are closed gracefully.

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

/// Limit on open connections. More clients wait in the backlog of the system. Each connection needs a file handle, and
/// processes commonly have 1024.
const CONNECTIONS_MAX: usize = 800;
/// Limit on the open requests of one connection, including streams that follow changes.
const STREAMS_MAX: u32 = 256;
/// Bytes that a client may send in a stream before the handler reads them: enough for a fast link across a continent.
const STREAM_WINDOW_BYTES: u32 = 512 << 10;
/// Bytes that a client may send on a connection before handlers read them. Unread streams, such as waiting uploads,
/// must leave enough for the other streams of the connection.
const CONNECTION_WINDOW_BYTES: u32 = STREAMS_MAX * STREAM_WINDOW_BYTES;
/// Size of the buffers of an HTTP/1 connection \[bytes\], many times the longest header. The default of hyper is 400
/// KiB.
const HTTP1_BUFFER_BYTES: usize = 64 << 10;
/// Time after which a connection is closed that sends nothing at its start or between HTTP/1 requests.
const FIRST_BYTES_DEADLINE: Duration = Duration::from_secs(30);
/// Interval between HTTP/2 pings to each client.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(30);
/// Time for the answer to an HTTP/2 ping. A dead connection is closed, so that its streams no longer count.
const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(20);
/// Pause after the system failed to accept a connection, most likely because it has no file handles left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Time after which a client that does not read its answers is disconnected.
const WRITE_STALL_MAX: Duration = Duration::from_secs(60);
/// Time limit for the TLS handshake.
const HANDSHAKE_DEADLINE: Duration = Duration::from_secs(10);
/// Limit on the open connections from one address, including loopback, so that one client cannot use up all
/// connections.
const CONNECTIONS_PER_PEER_MAX: usize = 400;

/// Address and port of a client, stored with each of its requests.
#[derive(Clone, Copy, Debug)]
pub struct Peer(SocketAddr);

impl Peer {
    /// Address of the client without the port.
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

/// Serves `app` until `stop` is cancelled. Open requests then have the time `deadline` to end.
pub async fn serve(
    listener: TcpListener,
    tls: Option<Arc<Tls>>,
    app: Router,
    stop: CancellationToken,
    deadline: Duration,
) {
    let builder = Arc::new(builder());
    let permits = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let peers = Arc::new(ConnectionCounts::default());
    let graceful = GracefulShutdown::new();
    while let Some((stream, address, permit)) = accept_next(&listener, &permits, &stop).await {
        let Some(counted) = ConnectionCounts::count(&peers, address.ip()) else {
            tracing::debug!(%address, "refused a connection, because its address has too many");
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
            drop((permit, counted));
        });
    }
    drop(listener);
    if timeout(deadline, graceful.shutdown()).await.is_err() {
        tracing::warn!("some connections did not end in time and are closed");
    }
}

/// Numbers of open connections of each address.
#[derive(Debug, Default)]
struct ConnectionCounts(Mutex<HashMap<IpAddr, usize>>);

/// A connection that is counted for its address until it is dropped.
struct CountedConnection {
    peers: Arc<ConnectionCounts>,
    address: IpAddr,
}

impl ConnectionCounts {
    /// Counts a connection from an address; `None` if the address has too many.
    fn count(peers: &Arc<Self>, address: IpAddr) -> Option<CountedConnection> {
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

/// Waits for the first bytes of a connection. Returns `false` if none arrive in time or the server stops.
async fn sends_first_bytes(stream: &TcpStream, stop: &CancellationToken) -> bool {
    let mut byte = [0];
    tokio::select! {
        peeked = timeout(FIRST_BYTES_DEADLINE, stream.peek(&mut byte)) => peeked.is_ok_and(|peeked| peeked.is_ok()),
        () = stop.cancelled() => false,
    }
}

/// Accepts the next connection when fewer than [`CONNECTIONS_MAX`] are open; `None` when the server stops.
async fn accept_next(
    listener: &TcpListener,
    permits: &Arc<Semaphore>,
    stop: &CancellationToken,
) -> Option<(TcpStream, SocketAddr, tokio::sync::OwnedSemaphorePermit)> {
    let accept = async {
        let permit = Arc::clone(permits).acquire_owned().await.ok()?;
        loop {
            match listener.accept().await {
                Ok((stream, address)) => {
                    // A small message must not wait for the acknowledgement of the previous one.
                    let _ = stream.set_nodelay(true);
                    return Some((stream, address, permit));
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
