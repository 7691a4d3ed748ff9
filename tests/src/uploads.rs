use crate::process::{Daemon, lightpathd};
use futures::stream;
use lightpath::v1::artifact_service_client::ArtifactServiceClient;
use lightpath::v1::write_artifact_request::Part;
use lightpath::v1::{self, WriteArtifactRequest, WriteArtifactStart};
use lightpath::{Client, digest_of};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use tempfile::TempDir;
use tonic::transport::Channel;
use tonic::{Code, Status};

/// Parallel uploads.
const AT_ONCE: u64 = 8;
/// Size of each parallel upload \[MB\], unless `LIGHTPATH_UPLOAD_MB` sets another.
const SIZE_MB: usize = 24;
/// Allowed growth of the server's memory for all parallel uploads \[KiB\].
const MEMORY_KIB_MAX: u64 = 64 << 10;
/// Number of interruptions of an upload, unless `LIGHTPATH_UPLOAD_CUTS` sets another.
const CUTS: u32 = 12;
/// Size of the interrupted upload \[bytes\].
const CUT_SIZE: usize = 3_000_000;
/// Size of a chunk \[bytes\].
const CHUNK: usize = 100_000;
/// The server is killed after each group of this many interruptions.
const KILL_EVERY: u32 = 4;

/// Value of an environment variable `LIGHTPATH_…`, or `default`.
fn setting<T: std::str::FromStr>(name: &str, default: T) -> T {
    std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is {text}")))
}

/// Random bytes, different for each `seed`. They cannot be compressed.
pub(crate) fn noise(size: usize, seed: u64) -> Vec<u8> {
    let mut bytes = vec![0; size];
    ChaCha8Rng::seed_from_u64(seed).fill(&mut bytes[..]);
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn parallel_uploads_take_little_memory() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &[]).await;
    let size = setting("LIGHTPATH_UPLOAD_MB", SIZE_MB) * 1_000_000;
    // The first upload allocates memory that the server keeps.
    daemon.client.upload_bytes(noise(size, 99)).await.unwrap();
    let before = daemon.memory_peak_kib();
    let uploads = (0..AT_ONCE).map(|n| {
        let client = Client::connect(&daemon.url).unwrap();
        tokio::spawn(async move { client.upload_bytes(noise(size, n)).await.unwrap() })
    });
    let uploads: Vec<_> = uploads.collect();
    for (upload, n) in uploads.into_iter().zip(0..) {
        assert_eq!(upload.await.unwrap(), digest_of(&noise(size, n)));
    }
    let grown = daemon.memory_peak_kib() - before;
    let line = format!("{AT_ONCE} uploads of {} MB at once: memory grew by {} MiB", size / 1_000_000, grown >> 10);
    writeln!(std::io::stderr(), "{line}").unwrap();
    assert!(grown < MEMORY_KIB_MAX, "{line}");
    daemon.kill().await;
}

/// Uploads `bytes` as the rest of an artifact of `size_bytes`, starting at `offset_bytes`.
pub(crate) async fn send(
    url: &str,
    digest: &str,
    size_bytes: u64,
    offset_bytes: u64,
    bytes: &[u8],
) -> Result<(), Status> {
    let channel = Channel::from_shared(url.to_owned()).unwrap().connect().await.unwrap();
    let start = WriteArtifactStart { digest: digest.to_owned(), size_bytes, offset_bytes };
    let chunks = bytes.chunks(CHUNK).map(|chunk| Part::Chunk(chunk.to_vec().into()));
    let parts: Vec<_> = std::iter::once(Part::Start(start)).chain(chunks).collect();
    let messages = parts.into_iter().map(|part| WriteArtifactRequest { part: Some(part) });
    ArtifactServiceClient::new(channel).write_artifact(stream::iter(messages)).await.map(drop)
}

/// Number of bytes of an upload that the server has received.
async fn received(client: &Client, digest: &str) -> u64 {
    client.get_upload(v1::GetUploadRequest { digest: digest.to_owned() }).await.unwrap().received_bytes
}

/// Checks that an artifact cannot be found or downloaded.
async fn assert_not_published(client: &Client, digest: &str) {
    let asked = client.get_artifact(v1::GetArtifactRequest { digest: digest.to_owned() }).await;
    assert_eq!(asked.unwrap_err().code(), Some(Code::NotFound));
    assert!(client.download(digest).await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn interrupted_upload_can_be_completed() {
    let data = TempDir::new().unwrap();
    let mut daemon = Daemon::start(data.path(), &[]).await;
    let (bytes, mut random) = (noise(CUT_SIZE, 1), ChaCha8Rng::seed_from_u64(5));
    let (digest, size) = (digest_of(&bytes), CUT_SIZE as u64);
    let mut offset = 0;
    for cut in 1..=setting("LIGHTPATH_UPLOAD_CUTS", CUTS) {
        let end = offset as usize + random.random_range(0..size - offset) as usize;
        let sent = send(&daemon.url, &digest, size, offset, &bytes[offset as usize..end]).await;
        assert_eq!(sent.unwrap_err().code(), Code::InvalidArgument, "cut {cut}: bytes are missing");
        if cut % KILL_EVERY == 0 {
            daemon.kill().await;
            daemon = Daemon::start(data.path(), &[]).await;
        }
        assert_eq!(received(&daemon.client, &digest).await, end as u64, "cut {cut}");
        assert_not_published(&daemon.client, &digest).await;
        // Near the end of the artifact start again, so that there is always a rest to interrupt.
        offset = if end as u64 > size / 10 * 9 { 0 } else { end as u64 };
    }
    // A client disconnects in the middle of a chunk.
    let half = tokio::spawn({
        let (url, digest, bytes) = (daemon.url.clone(), digest.clone(), bytes.clone());
        async move { send(&url, &digest, size, 0, &bytes).await }
    });
    half.abort();
    assert_eq!(daemon.client.upload_bytes(bytes.clone()).await.unwrap(), digest);
    assert!(daemon.client.download(&digest).await.unwrap() == bytes);
    daemon.kill().await;
    lightpathd(&["check", "--data-dir", data.path().to_str().unwrap()]).await.ok();
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_content_is_never_published() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &[]).await;
    let (bytes, mut random) = (noise(CUT_SIZE, 2), ChaCha8Rng::seed_from_u64(6));
    let (digest, size) = (digest_of(&bytes), CUT_SIZE as u64);
    for round in 0..6 {
        let mut damaged = bytes.clone();
        damaged[random.random_range(0..size) as usize] ^= 1 << random.random_range(0..8);
        // Even rounds send damaged bytes at once, odd rounds after a correct part.
        let cut = if round % 2 == 0 { 0 } else { random.random_range(0..size) as usize };
        if cut > 0 {
            send(&daemon.url, &digest, size, 0, &bytes[..cut]).await.unwrap_err();
            damaged[..cut].copy_from_slice(&bytes[..cut]);
            damaged[cut] ^= 1;
        }
        let refused = send(&daemon.url, &digest, size, cut as u64, &damaged[cut..]).await.unwrap_err();
        assert_eq!(refused.code(), Code::InvalidArgument, "{refused:?}");
        assert!(refused.message().contains("hashes to"), "{refused:?}");
        assert_not_published(&daemon.client, &digest).await;
        assert_eq!(received(&daemon.client, &digest).await, 0, "the server keeps no damaged bytes");
    }
    send(&daemon.url, &digest, size, 0, &bytes).await.unwrap();
    assert!(daemon.client.download(&digest).await.unwrap() == bytes);
    daemon.kill().await;
}
