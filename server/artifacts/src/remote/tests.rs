//! Tests of a remote in memory.

use super::*;
use crate::{Artifacts, FolderLock, Held, SpaceLimits};
use object_store::memory::InMemory;
use std::fs;
use std::path::{Path as FilePath, PathBuf};

pub(super) const MIB: usize = 1 << 20;

/// Opens the data folder on a remote in memory, whose keys begin with `lab`.
fn open(data: &FilePath, store: &Arc<InMemory>, cache_bytes_max: u64) -> Result<Artifacts, ArtifactError> {
    let store = Arc::clone(store) as Arc<dyn ObjectStore>;
    let held = Held::Folder { _lock: FolderLock::take(data)? };
    Artifacts::open_on(data, SpaceLimits::default(), held, || {
        Ok(Some((Remote::on(store, Path::from("lab"), data)?, cache_bytes_max)))
    })
}

/// Bytes that differ from each other for each seed.
pub(super) fn pattern(seed: u32, count: usize) -> Vec<u8> {
    (0..count as u32).map(|n| (n.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 11) as u8).collect()
}

pub(super) fn cached(data: &FilePath, digest: &str) -> PathBuf {
    data.join("artifacts").join(&digest[7..9]).join(digest)
}

#[tokio::test]
async fn blobs_are_read_by_another_process() {
    let (store, one, two) = (Arc::default(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &store, u64::MAX).unwrap(), open(two.path(), &store, u64::MAX).unwrap());
    for count in [0, 1, 8 * MIB, 8 * MIB + 1, 20 * MIB] {
        let bytes = pattern(1, count);
        let digest = writer.put_bytes(bytes.clone()).await.unwrap();
        assert_eq!(writer.objects_of(BlobKind::Artifact, &digest).await.unwrap().len(), 1);
        assert_eq!(reader.size(&digest).await.unwrap(), Some(count as u64));
        assert_eq!(reader.verify(BlobKind::Artifact, &digest).await.unwrap(), Some(count as u64));
        assert!(!cached(two.path(), &digest).exists(), "neither of these fetches the blob");
        assert!(reader.read_all(&digest).await.unwrap() == bytes);
        assert!(cached(two.path(), &digest).exists());
        assert!(reader.read_all(&digest).await.unwrap() == bytes, "now from the cache");
    }
    let digest = writer.put_checkpoint(b"state".to_vec()).await.unwrap();
    assert_eq!(reader.read_checkpoint(&digest).await.unwrap(), b"state");
    assert!(matches!(reader.read_all(&digest).await, Err(ArtifactError::NotFound { .. })));
    reader.delete_checkpoint(&digest).await.unwrap();
    assert!(writer.objects_of(BlobKind::Checkpoint, &digest).await.unwrap().is_empty());
}

#[tokio::test]
async fn damaged_copies_are_found_and_replaced() {
    let (store, one, two) = (Arc::<InMemory>::default(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (writer, reader) = (open(one.path(), &store, u64::MAX).unwrap(), open(two.path(), &store, u64::MAX).unwrap());
    let digest = writer.put_bytes(b"kernel".to_vec()).await.unwrap();
    let id = writer.objects_of(BlobKind::Artifact, &digest).await.unwrap()[0].id;
    let path = Path::from(format!("lab/artifacts/{}/{digest}/{id}", &digest[7..9]));
    store.put(&path, "kernal".into()).await.unwrap();
    assert!(matches!(reader.read_all(&digest).await, Err(ArtifactError::DataLoss { .. })));
    assert!(!cached(two.path(), &digest).exists());
    assert!(!reader.is_intact(&digest).await.unwrap());
    assert_eq!(reader.put_bytes(b"kernel".to_vec()).await.unwrap(), digest);
    assert_eq!(reader.objects_of(BlobKind::Artifact, &digest).await.unwrap().len(), 2);
    fs::write(cached(two.path(), &digest), "kernal").unwrap();
    assert_eq!(reader.read_all(&digest).await.unwrap(), b"kernel", "a damaged local file is fetched again");
    fs::write(cached(one.path(), &digest), "kernal").unwrap();
    assert!(matches!(writer.store_anew(BlobKind::Artifact, &digest).await, Err(ArtifactError::Remote { .. })));
    assert_eq!(writer.read_all(&digest).await.unwrap(), b"kernel", "one of the two copies is good");
}

#[tokio::test]
async fn collectors_remove_what_they_listed_and_publishers_store_again() {
    let (store, data) = (Arc::default(), tempfile::tempdir().unwrap());
    let artifacts = open(data.path(), &store, u64::MAX).unwrap();
    let kind = BlobKind::Artifact;
    let digest = artifacts.put_bytes(b"phase".to_vec()).await.unwrap();
    artifacts.put_bytes(b"phase".to_vec()).await.unwrap();
    let listed = artifacts.objects_of(kind, &digest).await.unwrap();
    assert_eq!(listed.len(), 1, "a blob that is stored is not stored again");
    artifacts.store_anew(kind, &digest).await.unwrap();
    artifacts.delete_objects(kind, &digest, listed.clone()).await.unwrap();
    artifacts.delete_objects(kind, &digest, listed.clone()).await.unwrap();
    let left = artifacts.objects_of(kind, &digest).await.unwrap();
    assert_eq!(left.len(), 1);
    assert_ne!(left, listed);
    let byte = u8::from_str_radix(&digest[7..9], 16).unwrap();
    assert_eq!(artifacts.stored(kind, byte).await.unwrap(), std::slice::from_ref(&digest));
    assert!(artifacts.stored(kind, byte.wrapping_add(1)).await.unwrap().is_empty());
    assert!(artifacts.is_intact(&digest).await.unwrap());
    artifacts.delete_objects(kind, &digest, left).await.unwrap();
    assert!(!artifacts.is_intact(&digest).await.unwrap(), "it is only in the cache");
    artifacts.ensure_stored(kind, &digest).await.unwrap();
    artifacts.ensure_stored(kind, &digest).await.unwrap();
    assert_eq!(artifacts.objects_of(kind, &digest).await.unwrap().len(), 1);
    artifacts.delete(&digest).await.unwrap();
    assert!(artifacts.objects_of(kind, &digest).await.unwrap().is_empty());
    assert!(matches!(artifacts.read_all(&digest).await, Err(ArtifactError::NotFound { .. })));
    assert!(artifacts.ensure_stored(kind, &digest).await.unwrap_err().is_transient());
}

#[tokio::test]
async fn cache_keeps_its_bound_and_open_files_can_be_read() {
    let (store, data) = (Arc::default(), tempfile::tempdir().unwrap());
    let artifacts = open(data.path(), &store, 3 * MIB as u64).unwrap();
    let mut digests = Vec::new();
    for seed in 0..3 {
        digests.push(artifacts.put_bytes(pattern(seed, MIB)).await.unwrap());
    }
    let mut reader = artifacts.read_range_blocking(&digests[0], 0, 0).unwrap();
    let mut second = artifacts.read_range_blocking(&digests[1], 0, 0).unwrap();
    // The first is used last, so that the third goes, and then the second.
    artifacts.read_all(&digests[0]).await.unwrap();
    for seed in 3..5 {
        digests.push(artifacts.put_bytes(pattern(seed, MIB)).await.unwrap());
    }
    let is_cached = |digest: &String| cached(data.path(), digest).exists();
    assert_eq!(digests.iter().map(is_cached).collect::<Vec<_>>(), [true, false, false, true, true]);
    assert!(second.next_chunk(MIB).await.unwrap().unwrap() == pattern(1, MIB));
    artifacts.read_all(&digests[2]).await.unwrap();
    assert_eq!(digests.iter().filter(|digest| is_cached(digest)).count(), 3);
    assert!(reader.next_chunk(MIB).await.unwrap().unwrap() == pattern(0, MIB));
    // Started again with a smaller bound, and with a blob larger than the bound.
    drop(artifacts);
    let artifacts = open(data.path(), &store, MIB as u64).unwrap();
    assert_eq!(digests.iter().filter(|digest| is_cached(digest)).count(), 1);
    let large = artifacts.put_bytes(pattern(9, 2 * MIB)).await.unwrap();
    assert!(is_cached(&large) && !digests.iter().any(is_cached));
}

#[tokio::test]
async fn data_folder_keeps_to_its_remote() {
    let (one, other) = (Arc::default(), Arc::default());
    let data = tempfile::tempdir().unwrap();
    let name = open(data.path(), &one, 0).unwrap().identity().await.unwrap();
    assert_eq!(open(data.path(), &one, 0).unwrap().identity().await.unwrap(), name);
    let joined = tempfile::tempdir().unwrap();
    assert_eq!(open(joined.path(), &one, 0).unwrap().identity().await.unwrap(), name);
    let refused = open(data.path(), &other, 0).unwrap_err();
    assert!(matches!(&refused, ArtifactError::OtherRemote { kept, .. } if *kept == name), "{refused}");
    assert!(!refused.is_transient());
}

#[tokio::test]
async fn files_from_a_time_without_the_remote_are_stored_before_the_cache_removes_any() {
    let (store, data) = (Arc::default(), tempfile::tempdir().unwrap());
    let kind = BlobKind::Artifact;
    let without = || Artifacts::open(data.path()).unwrap();
    let old = without().put_bytes(b"old".to_vec()).await.unwrap();
    let state = without().put_checkpoint(b"state".to_vec()).await.unwrap();
    let damaged = without().put_bytes(b"damaged".to_vec()).await.unwrap();
    fs::write(cached(data.path(), &damaged), "domaged").unwrap();
    // A bound of 0 leaves one file in the cache.
    let artifacts = open(data.path(), &store, 0).unwrap();
    assert_eq!(artifacts.read_all(&old).await.unwrap(), b"old");
    assert_eq!(artifacts.read_checkpoint(&state).await.unwrap(), b"state");
    assert!(artifacts.objects_of(kind, &damaged).await.unwrap().is_empty());
    drop(artifacts);
    let between = without().put_bytes(b"between".to_vec()).await.unwrap();
    let artifacts = open(data.path(), &store, 0).unwrap();
    artifacts.put_bytes(b"newest".to_vec()).await.unwrap();
    assert!(!cached(data.path(), &between).exists());
    assert_eq!(artifacts.read_all(&between).await.unwrap(), b"between");
    // Once is enough: what other processes remove stays removed.
    let listed = artifacts.objects_of(kind, &between).await.unwrap();
    artifacts.delete_objects(kind, &between, listed).await.unwrap();
    drop(artifacts);
    let artifacts = open(data.path(), &store, 0).unwrap();
    assert!(artifacts.objects_of(kind, &between).await.unwrap().is_empty());
}

#[tokio::test]
async fn wrong_settings_are_refused_and_the_secret_key_is_not_shown() {
    let good = RemoteOptions {
        url: "s3://bucket/prefix".into(),
        endpoint: Some("https://127.0.0.1:1".into()),
        region: "us-east-1".into(),
        access_key_id: "id".into(),
        secret_access_key: "hush".into(),
        allow_http: false,
        cache_bytes_max: 0,
    };
    good.connect().unwrap();
    assert!(!format!("{good:?}").contains("hush"));
    let wrong: [fn(&mut RemoteOptions); 6] = [
        |options| options.url = "https://bucket".into(),
        |options| options.url = "s3://".into(),
        |options| options.url = "s3:///prefix".into(),
        |options| options.url = "s3://bucket/a//b".into(),
        |options| options.endpoint = Some("http://127.0.0.1:1".into()),
        |options| options.secret_access_key.clear(),
    ];
    for change in wrong {
        let mut options = good.clone();
        change(&mut options);
        assert!(matches!(options.connect(), Err(ArtifactError::BadRemote { .. })), "{options:?}");
    }
}
