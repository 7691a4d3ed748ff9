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

/// Of the hostile client.
const CONNECTIONS: usize = 4;
/// On each of them, as many as the server takes.
const STREAMS: u32 = 250;
/// Setting of the server, so small that the test need not send gigabytes.
const UNDER_WAY_MIB: u64 = 64;
/// Beside them: connections, streams, and what the allocator keeps.
const MEMORY_KIB_MAX: u64 = (UNDER_WAY_MIB + 64) << 10;
/// What every message promises to be \[bytes\].
const MESSAGE_BYTES: u32 = 4_000_000;
/// The largest frame that a server must take \[bytes\].
const FRAME_BYTES: usize = 16 << 10;
/// Of every message: together within the window that a stream begins with.
const FRAMES: usize = 28;
const PATIENCE_MAX: Duration = Duration::from_secs(60);

/// Kinds of frames and their flags (RFC 9113, section 6).
const DATA: u8 = 0;
const HEADERS: u8 = 1;
const RST_STREAM: u8 = 3;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
const END_STREAM: u8 = 1;
const ACK: u8 = 1;
const END_HEADERS: u8 = 4;

fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = u32::try_from(payload.len()).unwrap().to_be_bytes();
    [&length[1..], &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// The headers of a call (RFC 7541: fields of the static table by number, the others as they are).
fn headers(stream: u32, path: &str) -> Vec<u8> {
    let text = |text: &str| [&[u8::try_from(text.len()).unwrap()], text.as_bytes()].concat();
    let path = [vec![0x04], text(path)].concat();
    let authority = [vec![0x01], text("lab")].concat();
    let content_type = [vec![0x0f, 0x10], text("application/grpc")].concat();
    let block = [vec![0x83, 0x86], path, authority, content_type].concat();
    frame(HEADERS, END_HEADERS, stream, &block)
}

/// The head of a gRPC message.
fn prefix(length: u32) -> Vec<u8> {
    [&[0], &length.to_be_bytes()[..]].concat()
}

/// What the server has said on a connection.
#[derive(Debug, Default)]
struct Said {
    /// Streams with a first byte of their answer.
    answered: HashSet<u32>,
    /// Streams that it has ended.
    ended: HashSet<u32>,
    /// It has read all that was sent before so many pings.
    pongs: u32,
    closed: bool,
}

/// A connection that speaks HTTP/2, frame by frame.
struct Hoarder {
    to: OwnedWriteHalf,
    said: watch::Receiver<Said>,
    pings: u32,
    listening: JoinHandle<()>,
}

impl Hoarder {
    /// Connects from an address of its own; a stream may send it `window_bytes`.
    async fn connect(url: &str, window_bytes: u32) -> Self {
        let address: SocketAddr = url.trim_start_matches("http://").parse().unwrap();
        let socket = TcpSocket::new_v4().unwrap();
        socket.bind((Ipv4Addr::new(127, 0, 1, 1), 0).into()).unwrap();
        let (from, mut to) = socket.connect(address).await.unwrap().into_split();
        let window = [&[0, 4], &window_bytes.to_be_bytes()[..]].concat();
        let preface = [b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", &frame(SETTINGS, 0, 0, &window)[..]].concat();
        to.write_all(&preface).await.unwrap();
        let (say, said) = watch::channel(Said::default());
        Self { to, said, pings: 0, listening: tokio::spawn(listen(from, say)) }
    }

    /// The numbers of its streams that the server has not ended.
    fn open(&self) -> Vec<u32> {
        let said = self.said.borrow();
        (0..STREAMS).map(|n| 2 * n + 1).filter(|stream| !said.ended.contains(stream)).collect()
    }

    async fn send(&mut self, frames: &[u8]) {
        self.to.write_all(frames).await.unwrap();
    }

    /// Waits until the server has read everything.
    async fn settle(&mut self) {
        self.send(&frame(PING, 0, 0, b"finished")).await;
        self.pings += 1;
        let pings = self.pings;
        let settled = self.said.wait_for(|said| said.pongs == pings || said.closed);
        tokio::time::timeout(PATIENCE_MAX, settled).await.unwrap().unwrap();
    }
}

impl Drop for Hoarder {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

/// Notes what the server says, until it says no more.
async fn listen(mut from: OwnedReadHalf, say: watch::Sender<Said>) {
    let mut head = [0; 9];
    while from.read_exact(&mut head).await.is_ok() {
        let [l0, l1, l2, kind, flags, s0, s1, s2, s3] = head;
        let stream = u32::from_be_bytes([s0, s1, s2, s3]);
        let mut payload = vec![0; u32::from_be_bytes([0, l0, l1, l2]) as usize];
        if from.read_exact(&mut payload).await.is_err() {
            break;
        }
        say.send_modify(|said| match kind {
            RST_STREAM => drop(said.ended.insert(stream)),
            HEADERS | DATA if flags & END_STREAM != 0 => drop(said.ended.insert(stream)),
            DATA => drop(said.answered.insert(stream)),
            PING if flags & ACK != 0 => said.pongs += 1,
            _ => {}
        });
    }
    say.send_modify(|said| said.closed = true);
}

async fn start(data: &TempDir) -> Daemon {
    let under_way = UNDER_WAY_MIB.to_string();
    Daemon::start(data.path(), &["--under-way-mib-max", &under_way, "--calls-per-s-max", "0"]).await
}

/// Others get their work done, and the server has not grown beyond its limit.
async fn assert_unmoved(daemon: &Daemon, before_kib: u64, what: &str) {
    let picture = daemon.client.upload_bytes(target(64, 48, 1)).await.unwrap();
    let job = daemon.client.submit(request(hologram("lab", &picture, 5, 1), "real")).await.unwrap();
    assert_eq!(daemon.client.wait(&job.name, |_| ()).await.unwrap().state(), State::Succeeded);
    let grown_kib = daemon.memory_peak_kib().saturating_sub(before_kib);
    let line = format!("{what}: memory grew by {} MiB", grown_kib >> 10);
    let mut stderr = std::io::stderr();
    writeln!(stderr, "{line}").unwrap();
    assert!(grown_kib < MEMORY_KIB_MAX, "{line}");
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_that_never_end_take_little_memory_and_hold_up_nobody() {
    let data = TempDir::new().unwrap();
    let daemon = start(&data).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let before_kib = daemon.memory_peak_kib();

    let mut hoarders = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut hoarder = Hoarder::connect(&daemon.url, 1 << 16).await;
        for stream in hoarder.open() {
            let call = headers(stream, "/lightpath.v1.JobService/SubmitJob");
            hoarder.send(&[call, frame(DATA, 0, stream, &prefix(MESSAGE_BYTES))].concat()).await;
        }
        hoarders.push(hoarder);
    }
    let part = [0; FRAME_BYTES];
    let mut sent = 0;
    for _ in 0..FRAMES {
        for hoarder in &mut hoarders {
            for stream in hoarder.open() {
                hoarder.send(&frame(DATA, 0, stream, &part)).await;
                sent += part.len();
            }
            hoarder.settle().await;
        }
    }
    let open: usize = hoarders.iter().map(|hoarder| hoarder.open().len()).sum();
    let what = format!("{CONNECTIONS} connections sent {} MiB of messages, {open} of them go on", sent >> 20);
    assert_unmoved(&daemon, before_kib, &what).await;
    assert!(0 < open && open < CONNECTIONS * STREAMS as usize, "{what}");
    daemon.kill().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_that_nobody_takes_take_little_memory_and_hold_up_nobody() {
    let data = TempDir::new().unwrap();
    let daemon = start(&data).await;
    declare(&daemon.client, "lab", 64, 48).await;
    let digest = daemon.client.upload_bytes(vec![7; 8 << 20]).await.unwrap();
    daemon.client.download(&digest).await.unwrap();
    let before_kib = daemon.memory_peak_kib();

    // `ReadArtifactRequest.digest`
    let message = [&[0x0a, u8::try_from(digest.len()).unwrap()], digest.as_bytes()].concat();
    let message = [prefix(u32::try_from(message.len()).unwrap()), message].concat();
    let mut hoarders = Vec::new();
    for _ in 0..CONNECTIONS {
        let mut hoarder = Hoarder::connect(&daemon.url, 1).await;
        for stream in hoarder.open() {
            let call = headers(stream, "/lightpath.v1.ArtifactService/ReadArtifact");
            hoarder.send(&[call, frame(DATA, END_STREAM, stream, &message)].concat()).await;
        }
        hoarders.push(hoarder);
    }
    let mut open = 0;
    for hoarder in &mut hoarders {
        let all_begun = |said: &Said| said.closed || said.answered.union(&said.ended).count() == STREAMS as usize;
        tokio::time::timeout(PATIENCE_MAX, hoarder.said.wait_for(all_begun)).await.unwrap().unwrap();
        open += hoarder.open().len();
    }
    let what = format!("{CONNECTIONS} connections wait for {open} downloads");
    assert_unmoved(&daemon, before_kib, &what).await;
    assert!(0 < open && open < CONNECTIONS * STREAMS as usize, "{what}");

    // When the hostile client has gone, there is room again.
    drop(hoarders);
    daemon.client.list_jobs(v1::ListJobsRequest::default()).await.unwrap();
    assert_eq!(daemon.client.download(&digest).await.unwrap().len(), 8 << 20);
    daemon.kill().await;
}
