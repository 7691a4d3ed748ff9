use crate::process::{Daemon, lightpathd};
use lightpath::{Client, v1};
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinSet;

/// Number of slow connections, unless `LIGHTPATH_SLOW_CONNECTIONS` sets another.
const CONNECTIONS: usize = 100;
/// Number of connections from each address. A group of hostile machines has several addresses.
const CONNECTIONS_PER_ADDRESS: usize = 300;
/// Calls of one measurement.
const CALLS: usize = 200;
/// Allowed delay beyond twice the usual time, because the machine runs other programs too.
const JITTER: Duration = Duration::from_millis(20);
/// Connections that the holder of one token may have.
const CONNECTIONS_PER_TOKEN: usize = 100;
/// Interval between the bytes of a slow sender.
const DRIP: Duration = Duration::from_secs(1);
/// Receive buffer of a client that does not read. It is so small that the server's answers soon fill it.
const UNREAD_BUFFER_BYTES: u32 = 4096;
/// Requests of a client that does not read the answers.
const UNREAD_REQUESTS: usize = 24;
/// Time within which the server must close all slow connections.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(300);

/// Start of an HTTP/2 connection: the preface and an empty SETTINGS frame.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// A way in which a client occupies a connection without using it.
#[derive(Clone, Copy, Debug)]
enum Slowness {
    /// Sends nothing.
    Silent,
    /// Sends a header, one byte at a time.
    Headers,
    /// Starts HTTP/2 and then sends nothing.
    Preface,
    /// Announces a body and sends it one byte at a time.
    Body,
    /// Sends many requests and never reads the answers.
    Unread,
}

impl Slowness {
    /// The slowness of the nth connection. Few send many requests, because answers cost the server time until the
    /// buffer is full.
    fn of(n: usize) -> Self {
        match (n % 4, n % 20) {
            (_, 19) => Self::Unread,
            (0, _) => Self::Silent,
            (1, _) => Self::Headers,
            (2, _) => Self::Preface,
            _ => Self::Body,
        }
    }

    fn first_bytes(self) -> Vec<u8> {
        match self {
            Self::Silent => Vec::new(),
            Self::Headers => b"GET /v1/jobs HTTP/1.1\r\nhost: localhost\r\nx-slow: ".to_vec(),
            Self::Preface => PREFACE.to_vec(),
            Self::Body => b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000000\r\n\r\n".to_vec(),
            Self::Unread => b"GET /metrics HTTP/1.1\r\nhost: localhost\r\n\r\n".repeat(UNREAD_REQUESTS),
        }
    }

    /// Occupies a connection until the server closes it.
    async fn keep(self, stream: TcpStream) {
        let (mut from, mut to) = stream.into_split();
        if to.write_all(&self.first_bytes()).await.is_err() {
            return;
        }
        let drip = async {
            loop {
                tokio::time::sleep(DRIP).await;
                let sent = match self {
                    Self::Headers | Self::Body | Self::Unread => to.write_all(b"x").await,
                    Self::Silent | Self::Preface => Ok(()),
                };
                if sent.is_err() {
                    return;
                }
            }
        };
        let mut bytes = [0; 1024];
        let listen = async {
            match self {
                Self::Unread => std::future::pending().await,
                _ => while from.read(&mut bytes).await.is_ok_and(|count| count > 0) {},
            }
        };
        tokio::select! {
            () = drip => {}
            () = listen => {}
        }
    }
}

/// Number of slow connections: `LIGHTPATH_SLOW_CONNECTIONS`, or [`CONNECTIONS`].
fn connections() -> usize {
    std::env::var("LIGHTPATH_SLOW_CONNECTIONS").map_or(CONNECTIONS, |count| count.parse().unwrap())
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_connections_do_not_slow_a_real_client() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &["--calls-per-s-max", "0"]).await;
    let address: SocketAddr = daemon.url.trim_start_matches("http://").parse().unwrap();
    let usual = p99(&daemon.client).await;

    let mut slow = JoinSet::new();
    let mut open = 0;
    for n in 0..connections() {
        let socket = TcpSocket::new_v4().unwrap();
        let from = Ipv4Addr::new(127, 0, 1, 1 + (n / CONNECTIONS_PER_ADDRESS) as u8);
        socket.bind((from, 0).into()).unwrap();
        if let Slowness::Unread = Slowness::of(n) {
            socket.set_recv_buffer_size(UNREAD_BUFFER_BYTES).unwrap();
        }
        // Beyond the server's limit connections wait in the system's backlog, or fail if it is full.
        let connected = tokio::time::timeout(Duration::from_secs(1), socket.connect(address)).await;
        let Ok(Ok(stream)) = connected else { continue };
        open += 1;
        slow.spawn(Slowness::of(n).keep(stream));
    }
    assert!(open >= CONNECTIONS, "only {open} connections were made; is `ulimit -n` too low?");
    let meanwhile = p99(&daemon.client).await;
    let line = format!("{open} slow connections: a call's p99 is {meanwhile:.1?}, without them {usual:.1?}");
    writeln!(std::io::stderr(), "{line}").unwrap();
    assert!(meanwhile < 2 * usual + JITTER, "{line}");
    if open < 400 {
        // Below the server's limit new clients can connect too.
        let late = Client::connect(&daemon.url).unwrap();
        late.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    }
    if std::env::var_os("LIGHTPATH_SLOW_CONNECTIONS").is_some() {
        let gone = tokio::time::timeout(CLOSE_TIMEOUT, slow.join_all()).await;
        assert!(gone.is_ok(), "a slow connection is kept for longer than {CLOSE_TIMEOUT:?}");
    }
    daemon.kill().await;
}

/// The time within which 99 % of the calls are answered. The calls list jobs, one after the other.
async fn p99(client: &Client) -> Duration {
    let mut times = Vec::new();
    for _ in 0..CALLS {
        let begin = Instant::now();
        client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
        times.push(begin.elapsed());
    }
    times.sort();
    times[CALLS * 99 / 100]
}

#[tokio::test(flavor = "multi_thread")]
async fn connection_with_invalid_bytes_is_closed() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &[]).await;
    let address: SocketAddr = daemon.url.trim_start_matches("http://").parse().unwrap();
    let oversized = [b"GET / HTTP/1.1\r\nx: ".to_vec(), vec![b'x'; 1 << 20]].concat();
    // A HEADERS frame that claims 16 MiB.
    let frame = [PREFACE, b"\xff\xff\xff\x01\x04\0\0\0\x01"].concat();
    for invalid in
        [b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03".to_vec(), b"\0\0\0\0\r\n\r\n".to_vec(), oversized, frame]
    {
        let mut stream = TcpStream::connect(address).await.unwrap();
        // The server may close the connection during the write.
        let _ = stream.write_all(&invalid).await;
        let mut answer = Vec::new();
        let ended = tokio::time::timeout(Duration::from_secs(10), stream.read_to_end(&mut answer)).await;
        assert!(ended.is_ok(), "still open after {:?}", &invalid[..invalid.len().min(20)]);
        daemon.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    }
    daemon.kill().await;
}

/// The holder of a token cannot use up the connections of others at the same address.
#[tokio::test(flavor = "multi_thread")]
async fn connections_of_one_token_are_limited() {
    let data = TempDir::new().unwrap();
    let token = async |name: &str| {
        let arguments = ["token", "create", name, "--role", "viewer", "--data-dir", data.path().to_str().unwrap()];
        lightpathd(&arguments).await.ok().trim().to_owned()
    };
    let (greedy, modest) = (token("greedy").await, token("modest").await);
    let daemon = Daemon::start(data.path(), &["--require-tokens", "true"]).await;
    let list = async |token: &str| {
        let client = Client::connect_with_token(&daemon.url, token).unwrap();
        client.list_jobs(v1::ListJobsRequest::default()).await.map(|_| client)
    };
    let mut open = Vec::new();
    for _ in 0..CONNECTIONS_PER_TOKEN {
        open.push(list(&greedy).await.unwrap());
    }
    let Err(refusal) = list(&greedy).await else { panic!("one connection too many was accepted") };
    assert!(refusal.to_string().contains("already has 100 connections"), "{refusal}");
    list(&modest).await.unwrap();
    // A connection counts until it is closed.
    open.pop();
    let again = async {
        while list(&greedy).await.is_err() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(10), again).await.unwrap();
    daemon.kill().await;
}
