use crate::material::{declare, hologram, request, target};
use crate::process::Daemon;
use lightpath::v1::{self, job::State};
use std::collections::HashSet;
use std::io::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpSocket;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// Connections of the hostile client.
const CONNECTIONS: usize = 4;
/// Streams on each connection: as many as the server accepts.
const STREAMS: u32 = 250;
/// Setting of the server: memory for messages under way \[MiB\]. It is so small that the test need not send gigabytes.
const UNDER_WAY_MIB: u64 = 64;
/// Allowed growth of the server's memory \[KiB\]: messages under way, connections, streams, and memory that the
/// allocator keeps.
const MEMORY_KIB_MAX: u64 = (UNDER_WAY_MIB + 64) << 10;
/// Announced size of each message \[bytes\].
const MESSAGE_BYTES: u32 = 4_000_000;
/// Largest frame that each HTTP/2 server accepts \[bytes\].
const FRAME_BYTES: usize = 16 << 10;
/// Frames sent of each message. Together they fit into the initial window of a stream.
const FRAMES: usize = 28;
/// Time limit for an answer of the server.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

// Kinds of HTTP/2 frames and their flags (RFC 9113, section 6).
const DATA: u8 = 0;
const HEADERS: u8 = 1;
const RST_STREAM: u8 = 3;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
const END_STREAM: u8 = 1;
const ACK: u8 = 1;
const END_HEADERS: u8 = 4;

/// An HTTP/2 frame.
fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len()).unwrap().to_be_bytes();
    [&length[1..], &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// The HEADERS frame of a call (RFC 7541): fields of the static table by number, other fields as text.
fn headers(stream: u32, path: &str) -> Vec<u8> {
    let text = |text: &str| [&[u8::try_from(text.len()).unwrap()], text.as_bytes()].concat();
    let path = [vec![0x04], text(path)].concat();
    let authority = [vec![0x01], text("localhost")].concat();
    let content_type = [vec![0x0f, 0x10], text("application/grpc")].concat();
    let block = [vec![0x83, 0x86], path, authority, content_type].concat();
    frame(HEADERS, END_HEADERS, stream, &block)
}

/// The HEADERS frame of a read over HTTP whose answer may be compressed.
fn compressed_get(stream: u32, path: &str, token: Option<&str>) -> Vec<u8> {
    let text = |text: &str| [&[u8::try_from(text.len()).unwrap()], text.as_bytes()].concat();
    let (path, authority) = ([vec![0x04], text(path)].concat(), [vec![0x01], text("localhost")].concat());
    let authorization = token.map(|token| [vec![0x0f, 0x08], text(&format!("Bearer {token}"))].concat());
    // GET, http, and accept-encoding: gzip, deflate
    let block = [vec![0x82, 0x86], path, authority, vec![0x90], authorization.unwrap_or_default()].concat();
    frame(HEADERS, END_HEADERS | END_STREAM, stream, &block)
}

/// The prefix of a gRPC message of `length` bytes.
fn prefix(length: u32) -> Vec<u8> {
    [&[0], &length.to_be_bytes()[..]].concat()
}

/// State of a connection according to the server's frames.
#[derive(Debug, Default)]
struct Received {
    /// Streams on which data has arrived.
    answered: HashSet<u32>,
    /// Streams that the server has ended.
    ended: HashSet<u32>,
    /// Number of answered pings. The server has read everything that was sent before them.
    pongs: u32,
    /// True after the server has closed the connection.
    closed: bool,
}

/// An HTTP/2 connection of a client that leaves its streams open.
pub(crate) struct StalledConnection {
    to: OwnedWriteHalf,
    received: watch::Receiver<Received>,
    pings: u32,
    listening: JoinHandle<()>,
}

impl StalledConnection {
    /// Connects from another address than the other clients. The server may send `window_bytes` on each stream.
    pub(crate) async fn connect(url: &str, window_bytes: u32) -> Self {
        let address: SocketAddr = url.trim_start_matches("http://").parse().unwrap();
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind((Ipv4Addr::new(127, 0, 1, 1), 0).into()).unwrap();
        let (from, mut to) = socket.connect(address).await.unwrap().into_split();
        let window = [&[0, 4], &window_bytes.to_be_bytes()[..]].concat();
        let preface = [b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", &frame(SETTINGS, 0, 0, &window)[..]].concat();
        to.write_all(&preface).await.unwrap();
        let (sender, received) = watch::channel(Received::default());
        Self { to, received, pings: 0, listening: tokio::spawn(listen(from, sender)) }
    }

    /// Numbers of the streams that the server has not ended.
    fn open(&self) -> Vec<u32> {
        let received = self.received.borrow();
        (0..STREAMS).map(|n| 2 * n + 1).filter(|stream| !received.ended.contains(stream)).collect()
    }

    /// Sends frames. That fails only if the server has closed the connection.
    async fn send(&mut self, frames: &[u8]) {
        if self.to.write_all(frames).await.is_err() {
            let closed = self.received.wait_for(|received| received.closed);
            tokio::time::timeout(ANSWER_TIMEOUT, closed).await.unwrap().unwrap();
        }
    }

    /// Reads a path on each open stream; the answers may be compressed.
    pub(crate) async fn ask_all(&mut self, path: &str, token: Option<&str>) {
        for stream in self.open() {
            self.send(&compressed_get(stream, path, token)).await;
        }
    }

    /// Waits until the server has read everything that was sent.
    async fn settle(&mut self) {
        self.send(&frame(PING, 0, 0, b"finished")).await;
        self.pings += 1;
        let pings = self.pings;
        let settled = self.received.wait_for(|received| received.pongs == pings || received.closed);
        tokio::time::timeout(ANSWER_TIMEOUT, settled).await.unwrap().unwrap();
    }
}

impl Drop for StalledConnection {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

/// Reads the server's frames until the connection ends, and publishes the state.
async fn listen(mut from: OwnedReadHalf, sender: watch::Sender<Received>) {
    let mut head = [0; 9];
    while from.read_exact(&mut head).await.is_ok() {
        let [l0, l1, l2, kind, flags, s0, s1, s2, s3] = head;
        let stream = u32::from_be_bytes([s0, s1, s2, s3]);
        let mut payload = vec![0; u32::from_be_bytes([0, l0, l1, l2]) as usize];
        if from.read_exact(&mut payload).await.is_err() {
            break;
        }
        sender.send_modify(|received| match kind {
            RST_STREAM => drop(received.ended.insert(stream)),
            HEADERS | DATA if flags & END_STREAM != 0 => drop(received.ended.insert(stream)),
            DATA => drop(received.answered.insert(stream)),
            PING if flags & ACK != 0 => received.pongs += 1,
            _ => {}
        });
    }
    sender.send_modify(|received| received.closed = true);
}

/// Starts a server with the memory limit of the test.
async fn start(data: &TempDir) -> Daemon {
    let under_way = UNDER_WAY_MIB.to_string();
    Daemon::start(data.path(), &["--under-way-mib-max", &under_way, "--calls-per-s-max", "0"]).await
}

/// Checks that another client's job succeeds, and that the server's memory has not grown beyond the limit.
async fn assert_server_works(daemon: &Daemon, before_kib: u64, load: &str) {
    let picture = daemon.client.upload_bytes(target(64, 48, 1)).await.unwrap();
    let job = daemon.client.submit(request(hologram("lab", &picture, 5, 1), "real")).await.unwrap();
    assert_eq!(daemon.client.wait(&job.name, |_| ()).await.unwrap().state(), State::Succeeded);
    let grown_kib = daemon.memory_peak_kib().saturating_sub(before_kib);
    let line = format!("{load}: memory grew by {} MiB", grown_kib >> 10);
    let mut stderr = std::io::stderr();
    writeln!(stderr, "{line}").unwrap();
    assert!(grown_kib < MEMORY_KIB_MAX, "{line}");
}

#[tokio::test(flavor = "multi_thread")]
async fn unfinished_messages_take_little_memory_and_block_no_other_client() {
    let data = TempDir::new().unwrap();
    let daemon = start(&data).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let before_kib = daemon.memory_peak_kib();

    let mut connections = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut connection = StalledConnection::connect(&daemon.url, 1 << 16).await;
        for stream in connection.open() {
            let call = headers(stream, "/lightpath.v1.JobService/SubmitJob");
            connection.send(&[call, frame(DATA, 0, stream, &prefix(MESSAGE_BYTES))].concat()).await;
        }
        connections.push(connection);
    }
    let part = [0; FRAME_BYTES];
    let mut sent = 0;
    for _ in 0..FRAMES {
        for connection in &mut connections {
            for stream in connection.open() {
                connection.send(&frame(DATA, 0, stream, &part)).await;
                sent += part.len();
            }
            connection.settle().await;
        }
    }
    let open: usize = connections.iter().map(|connection| connection.open().len()).sum();
    let load = format!("{CONNECTIONS} connections sent {} MiB of messages, {open} of them are open", sent >> 20);
    assert_server_works(&daemon, before_kib, &load).await;
    assert!(0 < open && open < CONNECTIONS * STREAMS as usize, "{load}");
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unread_answers_take_little_memory_and_block_no_other_client() {
    let data = TempDir::new().unwrap();
    let daemon = start(&data).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let digest = daemon.client.upload_bytes(vec![7; 8 << 20]).await.unwrap();
    daemon.client.download(&digest).await.unwrap();
    let before_kib = daemon.memory_peak_kib();

    // The field `ReadArtifactRequest.digest`.
    let message = [&[0x0a, u8::try_from(digest.len()).unwrap()], digest.as_bytes()].concat();
    let message = [prefix(u32::try_from(message.len()).unwrap()), message].concat();
    let mut connections = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut connection = StalledConnection::connect(&daemon.url, 1).await;
        for stream in connection.open() {
            let call = headers(stream, "/lightpath.v1.ArtifactService/ReadArtifact");
            connection.send(&[call, frame(DATA, END_STREAM, stream, &message)].concat()).await;
        }
        connections.push(connection);
    }
    let open = all_begun(&mut connections).await;
    let load = format!("{CONNECTIONS} connections wait for {open} downloads");
    assert_server_works(&daemon, before_kib, &load).await;
    assert!(0 < open && open < CONNECTIONS * STREAMS as usize, "{load}");

    // After the hostile client has disconnected, downloads succeed again.
    drop(connections);
    daemon.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    assert_eq!(daemon.client.download(&digest).await.unwrap().len(), 8 << 20);
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unread_compressed_answers_take_little_memory_and_block_no_other_client() {
    let data = TempDir::new().unwrap();
    let daemon = start(&data).await;
    declare(&daemon.client, "lab", 64, 48).await;
    daemon.client.pause_queue(v1::PauseQueueRequest::default()).await.unwrap();
    let picture = daemon.client.upload_bytes(target(64, 48, 1)).await.unwrap();
    for seed in 0..100 {
        daemon.client.submit(request(hologram("lab", &picture, 5, 1), &format!("waiting-{seed}"))).await.unwrap();
    }
    let before_kib = daemon.memory_peak_kib();

    let mut connections = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut connection = StalledConnection::connect(&daemon.url, 1).await;
        connection.ask_all("/v1/jobs?pageSize=100", None).await;
        connections.push(connection);
    }
    let open = all_begun(&mut connections).await;
    daemon.client.resume_queue(v1::ResumeQueueRequest::default()).await.unwrap();
    let load = format!("{CONNECTIONS} connections wait for {open} compressed answers");
    assert_server_works(&daemon, before_kib, &load).await;
    assert!(0 < open && open < CONNECTIONS * STREAMS as usize, "{load}");
    daemon.kill().await;
}

/// Waits until an answer has begun or ended on each stream, and returns the number of those that have not ended.
async fn all_begun(connections: &mut [StalledConnection]) -> usize {
    let mut open = 0;
    for connection in connections {
        let all_begun = |received: &Received| {
            received.closed || received.answered.union(&received.ended).count() == STREAMS as usize
        };
        tokio::time::timeout(ANSWER_TIMEOUT, connection.received.wait_for(all_begun)).await.unwrap().unwrap();
        open += connection.open().len();
    }
    open
}
