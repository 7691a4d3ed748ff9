//! Tests with a real S3 server, whose address is in `LIGHTPATH_TEST_S3`; without it they do nothing. `scripts/s3-for-tests`
//! starts one.

use super::tests::{MIB, cached, pattern};
use super::*;
use crate::{Artifacts, SpaceLimits, digest_of};
use std::io::Write as _;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicI64, AtomicU8, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const KIND: BlobKind = BlobKind::Artifact;
/// Time within which calls fail while the server answers with errors or is away: the 5 s in which requests are sent again,
/// and as much for a busy machine.
const GIVES_UP_WITHIN: Duration = Duration::from_secs(10);

/// A prefix of its own for a test; `None` without a server.
fn options(test: &str) -> Option<RemoteOptions> {
    let endpoint = std::env::var("LIGHTPATH_TEST_S3").ok()?;
    Some(RemoteOptions {
        url: format!("s3://lightpath-tests/{test}-{}", Uuid::now_v7()),
        endpoint: Some(endpoint),
        region: "us-east-1".into(),
        access_key_id: "lightpath-tests".into(),
        secret_access_key: "lightpath-tests".into(),
        allow_http: true,
        cache_bytes_max: 1 << 30,
    })
}

fn open(data: &std::path::Path, options: &RemoteOptions) -> Result<Artifacts, ArtifactError> {
    Artifacts::open_with(data, SpaceLimits::default(), Some(options))
}

#[tokio::test]
async fn blobs_return_as_they_were() {
    let Some(options) = options("round-trip") else { return };
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &options).unwrap(), open(two.path(), &options).unwrap());
    assert_eq!(writer.identity().await.unwrap(), reader.identity().await.unwrap());
    for count in [0, 1, 20 * MIB] {
        let bytes = pattern(2, count);
        let stored = Instant::now();
        let digest = writer.put_bytes(bytes.clone()).await.unwrap();
        let (stored, fetched) = (stored.elapsed(), Instant::now());
        assert!(reader.read_all(&digest).await.unwrap() == bytes);
        println!("{count} bytes: stored in {stored:?}, fetched in {:?}", fetched.elapsed());
        let objects = writer.objects_of(KIND, &digest).await.unwrap();
        assert_eq!(objects.iter().map(|object| object.size_bytes).collect::<Vec<_>>(), [count as u64]);
        assert_eq!(reader.verify(KIND, &digest).await.unwrap(), Some(count as u64));
        let byte = u8::from_str_radix(&digest[7..9], 16).unwrap();
        assert!(reader.stored(KIND, byte).await.unwrap().contains(&digest));
        writer.delete_objects(KIND, &digest, objects).await.unwrap();
        assert!(writer.objects_of(KIND, &digest).await.unwrap().is_empty());
    }
}

#[test]
fn racing_processes_agree() {
    let Some(options) = options("racing") else { return };
    let start = std::sync::Barrier::new(6);
    let names: HashSet<String> = thread::scope(|scope| {
        let process = || {
            let data = tempfile::tempdir().unwrap();
            start.wait();
            let artifacts = open(data.path(), &options).unwrap();
            let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
            let digest = runtime.block_on(artifacts.put_bytes(pattern(3, 9 * MIB))).unwrap();
            assert!(runtime.block_on(artifacts.verify(KIND, &digest)).unwrap().is_some());
            runtime.block_on(artifacts.identity()).unwrap()
        };
        let running: Vec<_> = (0..6).map(|_| scope.spawn(process)).collect();
        running.into_iter().map(|process| process.join().unwrap()).collect()
    });
    assert_eq!(names.len(), 1, "one of them has named the installation");
}

#[tokio::test]
async fn damaged_object_is_found() {
    let Some(options) = options("damaged") else { return };
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &options).unwrap(), open(two.path(), &options).unwrap());
    let mut bytes = pattern(4, 9 * MIB);
    let digest = writer.put_bytes(bytes.clone()).await.unwrap();
    let id = writer.objects_of(KIND, &digest).await.unwrap()[0].id;
    bytes[8 * MIB + 5] ^= 1;
    let (store, prefix) = options.connect().unwrap();
    let path = prefix.join("artifacts").join(&digest[7..9]).join(digest.clone()).join(id.to_string());
    store.put(&path, bytes.into()).await.unwrap();
    assert!(matches!(reader.read_all(&digest).await, Err(ArtifactError::DataLoss { .. })));
    assert!(matches!(reader.verify(KIND, &digest).await, Err(ArtifactError::DataLoss { .. })));
    assert!(!cached(two.path(), &digest).exists());
    assert_eq!(std::fs::read_dir(two.path().join("tmp")).unwrap().count(), 0);
}

#[tokio::test]
async fn wrong_key_is_refused() {
    let Some(options) = options("key") else { return };
    let data = tempfile::tempdir().unwrap();
    let options = RemoteOptions { secret_access_key: "wrong".into(), ..options };
    assert!(matches!(open(data.path(), &options), Err(ArtifactError::Remote { .. })));
}

/// What a proxy does with connections.
const PASS: u8 = 0;
/// Answers each request with the status 503.
const REFUSE: u8 = 1;
/// Closes each connection, as if the server were away.
const CLOSE: u8 = 2;

/// Reads requests and never answers.
const IGNORE: u8 = 3;

/// A proxy before the server, which can stop to pass on bytes.
struct Proxy {
    address: SocketAddr,
    mode: Arc<AtomicU8>,
    /// Bytes to the server after which the proxy closes all connections.
    left_bytes: Arc<AtomicI64>,
}

impl Proxy {
    fn start(server: &str) -> Self {
        let server = server.strip_prefix("http://").unwrap().to_owned();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (mode, left_bytes) = (Arc::new(AtomicU8::new(PASS)), Arc::new(AtomicI64::new(i64::MAX)));
        let proxy = Self { address, mode: Arc::clone(&mode), left_bytes: Arc::clone(&left_bytes) };
        thread::spawn(move || {
            for client in listener.incoming() {
                let (client, server) = (client.unwrap(), TcpStream::connect(&server).unwrap());
                let back = (server.try_clone().unwrap(), client.try_clone().unwrap());
                let (mode, left_bytes) = (Arc::clone(&mode), Arc::clone(&left_bytes));
                thread::spawn(move || pass_on(client, server, &mode, &left_bytes));
                thread::spawn(move || pass_on(back.0, back.1, &AtomicU8::new(PASS), &AtomicI64::new(i64::MAX)));
            }
        });
        proxy
    }

    fn set(&self, mode: u8) {
        self.left_bytes.store(i64::MAX, Ordering::SeqCst);
        self.mode.store(mode, Ordering::SeqCst);
    }
}

/// Passes bytes on until a connection ends or the mode forbids it.
fn pass_on(mut from: TcpStream, mut to: TcpStream, mode: &AtomicU8, left_bytes: &AtomicI64) {
    let mut chunk = vec![0; 1 << 16];
    while let Ok(count @ 1..) = from.read(&mut chunk) {
        if left_bytes.fetch_sub(count as i64, Ordering::SeqCst) < count as i64 {
            mode.store(CLOSE, Ordering::SeqCst);
        }
        match mode.load(Ordering::SeqCst) {
            IGNORE => continue,
            PASS if to.write_all(&chunk[..count]).is_ok() => continue,
            REFUSE => {
                let _ = from.write_all(b"HTTP/1.1 503 Slow Down\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
            }
            _ => {}
        }
        break;
    }
    // Otherwise the other thread of the connection would keep it.
    let _ = (from.shutdown(std::net::Shutdown::Both), to.shutdown(std::net::Shutdown::Both));
}

#[tokio::test]
async fn calls_fail_while_the_server_is_away_and_work_when_it_is_back() {
    let Some(mut options) = options("away") else { return };
    let proxy = Proxy::start(options.endpoint.as_ref().unwrap());
    options.endpoint = Some(format!("http://{}", proxy.address));
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &options).unwrap(), open(two.path(), &options).unwrap());
    let stored = writer.put_bytes(b"before".to_vec()).await.unwrap();
    for (seed, mode) in [(10, REFUSE), (11, CLOSE)] {
        proxy.set(mode);
        let bytes = pattern(seed, 100_000);
        let digest = digest_of(&bytes);
        let mut upload = writer.uploads().begin(&digest, "ada", 100_000, 0).await.unwrap();
        upload.write(bytes.clone()).await.unwrap();
        let began = Instant::now();
        let failed = upload.finish().await.unwrap_err();
        println!("mode {mode}: an upload failed after {:?}: {failed:?}", began.elapsed());
        assert!(matches!(failed, ArtifactError::Remote { .. }) && failed.is_transient());
        assert!(began.elapsed() < GIVES_UP_WITHIN);
        assert!(!cached(one.path(), &digest).exists(), "what is not in the remote has no name here");
        assert!(matches!(reader.read_all(&stored).await, Err(ArtifactError::Remote { .. })));
        assert!(matches!(writer.objects_of(KIND, &stored).await, Err(ArtifactError::Remote { .. })));
        assert_eq!(writer.read_all(&stored).await.unwrap(), b"before", "the cache needs no server");
        proxy.set(PASS);
        // The bytes that were sent are still here: the upload continues at its end.
        let received = writer.uploads().received_bytes(&digest, "ada").await.unwrap();
        assert_eq!(received, 100_000);
        let upload = writer.uploads().begin(&digest, "ada", 100_000, received).await.unwrap();
        assert_eq!(upload.finish().await.unwrap(), digest);
        assert!(reader.read_all(&digest).await.unwrap() == bytes);
    }
    assert_eq!(reader.read_all(&stored).await.unwrap(), b"before");
}

#[tokio::test]
async fn silent_server_is_given_up() {
    let Some(mut options) = options("silent") else { return };
    let proxy = Proxy::start(options.endpoint.as_ref().unwrap());
    options.endpoint = Some(format!("http://{}", proxy.address));
    let data = tempfile::tempdir().unwrap();
    let artifacts = open(data.path(), &options).unwrap();
    proxy.set(IGNORE);
    let began = Instant::now();
    let failed = artifacts.put_bytes(b"phase".to_vec()).await;
    println!("a silent server was given up after {:?}", began.elapsed());
    assert!(matches!(failed, Err(ArtifactError::Remote { .. })), "{failed:?}");
    // The limit of one request is 20 s.
    assert!(began.elapsed() < Duration::from_secs(20) + GIVES_UP_WITHIN);
    proxy.set(PASS);
    artifacts.put_bytes(b"phase".to_vec()).await.unwrap();
}

#[tokio::test]
async fn cut_upload_leaves_nothing_that_is_taken_for_whole() {
    let Some(mut options) = options("cut") else { return };
    let proxy = Proxy::start(options.endpoint.as_ref().unwrap());
    options.endpoint = Some(format!("http://{}", proxy.address));
    let (one, two) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &options).unwrap(), open(two.path(), &options).unwrap());
    // The last is after all parts: only the last request is cut.
    for (seed, sent_bytes) in [(20, 1_000), (21, 3 * MIB), (22, 12 * MIB), (23, 20 * MIB + 6_000)] {
        let bytes = pattern(seed, 20 * MIB);
        let digest = digest_of(&bytes);
        proxy.left_bytes.store(sent_bytes as i64, Ordering::SeqCst);
        let failed = writer.put_bytes(bytes.clone()).await;
        proxy.set(PASS);
        if failed.is_ok() {
            // The cut came after everything.
            assert_eq!(sent_bytes, 20 * MIB + 6_000);
            continue;
        }
        assert!(matches!(failed, Err(ArtifactError::Remote { .. })), "{failed:?}");
        assert!(reader.objects_of(KIND, &digest).await.unwrap().is_empty());
        assert_eq!(reader.size(&digest).await.unwrap(), None);
        assert!(matches!(reader.read_all(&digest).await, Err(ArtifactError::NotFound { .. })));
        writer.put_bytes(bytes.clone()).await.unwrap();
        assert!(reader.read_all(&digest).await.unwrap() == bytes);
    }
}
