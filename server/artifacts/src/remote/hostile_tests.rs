//! Tests with a server of a bucket that answers too much.

use super::answers::{ANSWER_BYTES_MAX, ERROR_BYTES_MAX};
use super::hostile_server::{HostileServer, Wrong};
use super::tests::{MIB, cached, pattern};
use super::*;
use crate::{Artifacts, SpaceLimits};
use std::error::Error;
use std::fs;
use std::path::Path as FilePath;
use std::process::Command;

const KIND: BlobKind = BlobKind::Artifact;
/// What the operating system takes from a server although nobody reads it \[bytes\].
const BUFFERS_BYTES: u64 = 16 << 20;

fn open(data: &FilePath, server: &HostileServer, reserve_bytes: u64) -> Artifacts {
    let limits = SpaceLimits { reserve_bytes, stored_bytes_max: 0 };
    Artifacts::open_with(data, limits, Some(&server.options())).unwrap()
}

/// The messages of an error of the remote and of its sources.
fn text(error: &ArtifactError) -> String {
    assert!(matches!(error, ArtifactError::Remote { .. }), "{error:?}");
    let (mut text, mut source) = (error.to_string(), error.source());
    while let Some(error) = source {
        text.push_str(&format!(": {error}"));
        source = error.source();
    }
    text
}

#[tokio::test]
async fn answers_without_an_end_are_given_up() {
    let (server, data) = (HostileServer::start(), tempfile::tempdir().unwrap());
    let artifacts = open(data.path(), &server, 0);
    let digest = artifacts.put_bytes(b"four".to_vec()).await.unwrap();
    fs::remove_file(cached(data.path(), &digest)).unwrap();
    assert_eq!(artifacts.verify(KIND, &digest).await.unwrap(), Some(4), "the server can answer well");
    let long = format!("exceeds {ANSWER_BYTES_MAX} bytes");
    let long_error = format!("exceeds {ERROR_BYTES_MAX} bytes");
    let cases = [
        (Wrong::EndlessPages, "exceeds 1000 objects", ANSWER_BYTES_MAX),
        (Wrong::EndlessPage, long.as_str(), ANSWER_BYTES_MAX),
        (Wrong::LongPage, &long, 0),
        (Wrong::EndlessError(400), &long_error, 0),
        (Wrong::EndlessError(400), "400", 0),
        (Wrong::EndlessError(503), &long_error, 7 * BUFFERS_BYTES),
        (Wrong::LongError, &long_error, 0),
        (Wrong::LongObject, "more than the 4 bytes of lab/artifacts", 0),
        (Wrong::Sizes(1 << 60), "with 1152921504606846976 bytes, over 83886080000", 0),
    ];
    for (wrong, expected, bytes_max) in cases {
        server.set(wrong);
        let error = artifacts.verify(KIND, &digest).await.unwrap_err();
        assert!(text(&error).contains(expected), "{wrong:?}: {}", text(&error));
        let sent_bytes = server.sent_bytes();
        assert!(sent_bytes <= bytes_max + BUFFERS_BYTES, "{wrong:?}: {sent_bytes} bytes were taken");
        let error = artifacts.read_all(&digest).await.unwrap_err();
        assert!(text(&error).contains(expected), "{wrong:?}: {}", text(&error));
    }
    assert_eq!(fs::read_dir(data.path().join("tmp")).unwrap().count(), 0);
    server.set(Wrong::Nothing);
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), b"four");
}

#[tokio::test]
async fn lists_of_empty_pages_end_in_time() {
    let server = HostileServer::start();
    let (store, prefix) = server.options().connect().unwrap();
    let remote = Remote::unnamed(Arc::new(store), prefix).unwrap();
    server.set(Wrong::EmptyPages);
    let limit = ListLimit { time: Duration::from_millis(300), ..COPIES };
    let error = remote.list(Path::from("lab"), limit, Some).unwrap_err();
    assert!(text(&error).contains("the list of lab was not complete after 300ms"), "{}", text(&error));
}

#[tokio::test]
async fn copies_leave_half_of_the_reserve() {
    let (server, writing, reading) =
        (HostileServer::start(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let writer = open(writing.path(), &server, 0);
    let digest = writer.put_bytes(pattern(1, MIB)).await.unwrap();
    let free_bytes = writer.space().free_bytes().unwrap();
    let reader = open(reading.path(), &server, 4 * free_bytes);
    let low = reader.read_all(&digest).await;
    assert!(matches!(low, Err(ArtifactError::DiskLow { claimed_bytes: 1_048_576, .. })), "{low:?}");
    drop(reader);
    // Uploads have no room here.
    let reader = open(reading.path(), &server, free_bytes);
    let claim = reader.claim("ada", free_bytes / 4).await;
    assert!(matches!(claim, Err(ArtifactError::DiskLow { .. })), "{claim:?}");
    // The server's word about a size is enough to refuse it: not one byte is fetched.
    server.set(Wrong::Sizes(free_bytes));
    let low = reader.read_all(&digest).await;
    assert!(matches!(low, Err(ArtifactError::DiskLow { .. })), "{low:?}");
    assert!(server.sent_bytes() < MIB as u64);
    server.set(Wrong::Nothing);
    assert!(reader.read_all(&digest).await.unwrap() == pattern(1, MIB));
    assert_eq!(fs::read_dir(reading.path().join("tmp")).unwrap().count(), 0);
}

/// A disk of its own. It is unmounted when dropped.
struct SmallDisk(tempfile::TempDir);

impl SmallDisk {
    /// `None` if the user lacks the right to mount.
    fn mount(mib: usize) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let size = format!("size={mib}m");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(folder.path()).output();
        mounted.is_ok_and(|output| output.status.success()).then_some(Self(folder))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        drop(Command::new("umount").arg("--lazy").arg(self.0.path()).status());
    }
}

#[tokio::test]
async fn copies_and_uploads_take_the_room_of_the_oldest_copies() {
    let Some(disk) = SmallDisk::mount(20) else { return };
    let (server, writing) = (HostileServer::start(), tempfile::tempdir().unwrap());
    let writer = open(writing.path(), &server, 0);
    let mut digests = Vec::new();
    for seed in 0..3 {
        digests.push(writer.put_bytes(pattern(seed, 7 * MIB)).await.unwrap());
    }
    let data = disk.0.path().join("data");
    fs::create_dir(&data).unwrap();
    let reader = open(&data, &server, 2 << 20);
    for (digest, seed) in digests.iter().zip(0..) {
        assert!(reader.read_all(digest).await.unwrap() == pattern(seed, 7 * MIB), "{seed}");
    }
    let are_cached = || digests.iter().map(|digest| cached(&data, digest).exists()).collect::<Vec<_>>();
    assert_eq!(are_cached(), [false, true, true]);
    let _ten = reader.claim("ada", 10 << 20).await.unwrap();
    assert_eq!(are_cached(), [false, false, true]);
    let low = reader.claim("bob", 11 << 20).await;
    assert!(matches!(low, Err(ArtifactError::DiskLow { .. })), "{low:?}");
    assert_eq!(are_cached(), [false, false, true], "its room would not have been enough");
    let _seven = reader.claim("bob", 7 << 20).await.unwrap();
    let low = reader.read_all(&digests[0]).await;
    assert!(matches!(low, Err(ArtifactError::DiskLow { .. })), "what uploads have claimed is not there: {low:?}");
    assert_eq!(fs::read_dir(data.join("tmp")).unwrap().count(), 0);
}
