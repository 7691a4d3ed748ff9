use crate::process::Daemon;
use lightpath::{Client, v1};
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinSet;

/// Slow connections, in every run of the tests.
const CONNECTIONS: usize = 100;
/// From each address, as a farm of hostile machines has them.
const CONNECTIONS_PER_ADDRESS: usize = 300;
const CALLS: usize = 200;
/// What a call may take longer than twice its usual time on a machine that does other things, too.
const JITTER: Duration = Duration::from_millis(20);
const DRIP: Duration = Duration::from_secs(1);
/// So little that the server's answers soon find no room.
const UNREAD_BUFFER_BYTES: u32 = 4096;
const UNREAD_REQUESTS: usize = 24;
/// When the server must have closed the last of them.
const PATIENCE_MAX: Duration = Duration::from_secs(300);

/// HTTP/2 begins with it, and an empty SETTINGS frame.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// How a client keeps a connection without using it.
#[derive(Clone, Copy, Debug)]
enum Slowness {
    /// Says nothing.
    Silent,
    /// Sends a header, byte for byte.
    Headers,
    /// Agrees on HTTP/2 and falls silent.
    Preface,
    /// Promises a body, and sends it byte for byte.
    Body,
    /// Asks for much, and never reads the answer.
    Unread,
}

impl Slowness {
    /// Of the nth connection: a few ask for much, since that costs the server something before it stalls.
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
            Self::Headers => b"GET /v1/jobs HTTP/1.1\r\nhost: x\r\nx-slow: ".to_vec(),
            Self::Preface => PREFACE.to_vec(),
            Self::Body => b"POST /v1/jobs HTTP/1.1\r\nhost: x\r\ncontent-length: 1000000\r\n\r\n".to_vec(),
            Self::Unread => b"GET /metrics HTTP/1.1\r\nhost: x\r\n\r\n".repeat(UNREAD_REQUESTS),
        }
    }

    /// Until the server has enough of it.
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

/// How many: [`CONNECTIONS`], or as many as `LIGHTPATH_SLOW_CONNECTIONS` says.
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
        // Beyond what the server takes, connections wait in the system's backlog, or find no place there.
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
        // While there are places, new clients get in, too.
        let late = Client::connect(&daemon.url).unwrap();
        late.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    }
    if std::env::var_os("LIGHTPATH_SLOW_CONNECTIONS").is_some() {
        let gone = tokio::time::timeout(PATIENCE_MAX, slow.join_all()).await;
        assert!(gone.is_ok(), "a slow connection is kept for longer than {PATIENCE_MAX:?}");
    }
    daemon.kill().await;
}

/// Of many lists, one after the other.
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
async fn a_connection_that_speaks_nonsense_is_closed() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &[]).await;
    let address: SocketAddr = daemon.url.trim_start_matches("http://").parse().unwrap();
    let oversized = [b"GET / HTTP/1.1\r\nx: ".to_vec(), vec![b'x'; 1 << 20]].concat();
    // A HEADERS frame that claims 16 MiB.
    let frame = [PREFACE, b"\xff\xff\xff\x01\x04\0\0\0\x01"].concat();
    for nonsense in
        [b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03".to_vec(), b"\0\0\0\0\r\n\r\n".to_vec(), oversized, frame]
    {
        let mut stream = TcpStream::connect(address).await.unwrap();
        // It may be closed while this is still being written.
        let _ = stream.write_all(&nonsense).await;
        let mut answer = Vec::new();
        let ended = tokio::time::timeout(Duration::from_secs(10), stream.read_to_end(&mut answer)).await;
        assert!(ended.is_ok(), "still open after {:?}", &nonsense[..nonsense.len().min(20)]);
        daemon.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    }
    daemon.kill().await;
}
