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

const AT_ONCE: u64 = 8;
/// Of each of the uploads at once, in every run of the tests.
const SIZE_MB: usize = 24;
/// What the server may need for all of them.
const MEMORY_KIB_MAX: u64 = 64 << 10;
const CUTS: u32 = 12;
const CUT_SIZE: usize = 3_000_000;
const CHUNK: usize = 100_000;
/// Every so often the server dies, too.
const DEATH_EVERY: u32 = 4;

/// `LIGHTPATH_…`, or what every run takes.
fn setting<T: std::str::FromStr>(name: &str, default: T) -> T {
    std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name} is {text}")))
}

/// Bytes that no compression makes smaller, others for every `seed`.
fn noise(size: usize, seed: u64) -> Vec<u8> {
    let mut bytes = vec![0; size];
    ChaCha8Rng::seed_from_u64(seed).fill(&mut bytes[..]);
    bytes
}

#[tokio::test(flavor = "multi_thread")]
async fn large_uploads_side_by_side_take_little_memory() {
    let data = TempDir::new().unwrap();
    let daemon = Daemon::start(data.path(), &[]).await;
    let size = setting("LIGHTPATH_UPLOAD_MB", SIZE_MB) * 1_000_000;
    // Once for what is made with the first upload and stays.
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

/// Sends `bytes` from `offset_bytes` on as all of an artifact that has `size_bytes`.
async fn send(url: &str, digest: &str, size_bytes: u64, offset_bytes: u64, bytes: &[u8]) -> Result<(), Status> {
    let channel = Channel::from_shared(url.to_owned()).unwrap().connect().await.unwrap();
    let start = WriteArtifactStart { digest: digest.to_owned(), size_bytes, offset_bytes };
    let chunks = bytes.chunks(CHUNK).map(|chunk| Part::Chunk(chunk.to_vec().into()));
    let parts: Vec<_> = std::iter::once(Part::Start(start)).chain(chunks).collect();
    let messages = parts.into_iter().map(|part| WriteArtifactRequest { part: Some(part) });
    ArtifactServiceClient::new(channel).write_artifact(stream::iter(messages)).await.map(drop)
}

async fn received(client: &Client, digest: &str) -> u64 {
    client.get_upload(v1::GetUploadRequest { digest: digest.to_owned() }).await.unwrap().received_bytes
}

async fn assert_not_published(client: &Client, digest: &str) {
    let asked = client.get_artifact(v1::GetArtifactRequest { digest: digest.to_owned() }).await;
    assert_eq!(asked.unwrap_err().code(), Some(Code::NotFound));
    assert!(client.download(digest).await.is_err());
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_that_is_cut_anywhere_ends_with_the_same_bytes() {
    let data = TempDir::new().unwrap();
    let mut daemon = Daemon::start(data.path(), &[]).await;
    let (bytes, mut random) = (noise(CUT_SIZE, 1), ChaCha8Rng::seed_from_u64(5));
    let (digest, size) = (digest_of(&bytes), CUT_SIZE as u64);
    let mut here = 0;
    for cut in 1..=setting("LIGHTPATH_UPLOAD_CUTS", CUTS) {
        let end = here as usize + random.random_range(0..size - here) as usize;
        let sent = send(&daemon.url, &digest, size, here, &bytes[here as usize..end]).await;
        assert_eq!(sent.unwrap_err().code(), Code::InvalidArgument, "cut {cut}: bytes are missing");
        if cut % DEATH_EVERY == 0 {
            daemon.kill().await;
            daemon = Daemon::start(data.path(), &[]).await;
        }
        assert_eq!(received(&daemon.client, &digest).await, end as u64, "cut {cut}");
        assert_not_published(&daemon.client, &digest).await;
        // Near its end it begins again, so that there is always something left to cut.
        here = if end as u64 > size / 10 * 9 { 0 } else { end as u64 };
    }
    // A client that goes away in the middle of a chunk.
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
        // At once, or after a part that was right.
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
        assert_eq!(received(&daemon.client, &digest).await, 0, "nothing of it is kept");
    }
    send(&daemon.url, &digest, size, 0, &bytes).await.unwrap();
    assert!(daemon.client.download(&digest).await.unwrap() == bytes);
    daemon.kill().await;
}
