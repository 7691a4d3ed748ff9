//! Connections with HTTP/1.1 and HTTP/2 on one port, with or without TLS (without TLS, HTTP/2 needs prior knowledge).
//! Their number is limited, and they are closed gracefully.

use crate::accounts::{CONNECTIONS_MAX, OpenStream, StreamKind, Streams};
use crate::tls::Tls;
use axum::{Extension, Router};
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use lightpath_service::{Client, Result};
use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{sleep, timeout};
use tokio_io_timeout::TimeoutStream;
use tokio_util::sync::CancellationToken;

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

/// Time for the last answer of a connection that is closed, because its client has too many.
const LAST_ANSWER: Duration = Duration::from_secs(1);

/// The other end of a connection, stored with each of its requests.
#[derive(Clone, Debug)]
pub(crate) struct Peer {
    address: SocketAddr,
    /// The connection, counted for the first holder of a token who used it.
    counted: Arc<Mutex<Option<OpenStream>>>,
    /// Cancelled to close the connection.
    close: CancellationToken,
}

impl Peer {
    fn new(address: SocketAddr) -> Self {
        Self { address, counted: Arc::default(), close: CancellationToken::new() }
    }

    /// Address of the client without the port.
    pub(crate) fn ip(&self) -> IpAddr {
        self.address.ip()
    }

    /// Counts the connection for the holder of a token. Connections without a token are only counted by address.
    ///
    /// # Errors
    ///
    /// [`lightpath_service::ServiceError::Exhausted`] if the client has too many connections. This one is closed after the answer.
    pub(crate) fn count(&self, streams: &Streams, client: &Client) -> Result<()> {
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        if matches!(client, Client::Token(_)) && counted.is_none() {
            *counted = Some(streams.open(StreamKind::Connection, client).inspect_err(|_| self.close.cancel())?);
        }
        Ok(())
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
        let peer = Peer::new(address);
        let close = peer.close.clone();
        let service = TowerToHyperService::new(app.clone().layer(Extension(peer)));
        let connection = async move {
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
        };
        tokio::spawn(async move {
            tokio::select! {
                () = connection => {}
                () = closed_soon(&close) => {}
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

/// Ends when a connection that is to be closed has had the time for its last answer.
async fn closed_soon(close: &CancellationToken) {
    close.cancelled().await;
    sleep(LAST_ANSWER).await;
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
