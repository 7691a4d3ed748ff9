//! Tests of the artifact folder.

use super::*;
use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

fn files(folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        match entry.file_type().unwrap().is_dir() {
            true => names.extend(files(&entry.path())),
            false => names.push(entry.file_name().into_string().unwrap()),
        }
    }
    names
}

async fn read_to_end(mut reader: ArtifactReader) -> Vec<u8> {
    let mut bytes = Vec::new();
    while let Some(chunk) = reader.next_chunk(CHUNK_BYTES).await.unwrap() {
        bytes.extend(chunk);
    }
    bytes
}

/// Begins an upload of "ada" without a digest.
async fn unnamed(artifacts: &Artifacts, size_bytes: u64) -> Result<UploadWriter> {
    artifacts.uploads().turn_unnamed("ada", size_bytes).await?.open().await
}

#[tokio::test]
async fn stored_bytes_are_read_whole_and_in_ranges() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let bytes: Vec<u8> = (0..3_000_000_u32).map(|n| (n % 251) as u8).collect();
    let digest = artifacts.put_bytes(bytes.clone()).await.unwrap();
    assert_eq!(artifacts.put_bytes(bytes.clone()).await.unwrap(), digest, "the same bytes are the same artifact");
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), bytes);
    assert_eq!(artifacts.size(&digest).await.unwrap(), Some(3_000_000));
    assert_eq!(read_to_end(artifacts.read_range_blocking(&digest, 0, 0).unwrap()).await, bytes);
    assert_eq!(read_to_end(artifacts.read_range_blocking(&digest, 5, 7).unwrap()).await, bytes[5..12]);
    assert!(read_to_end(artifacts.read_range_blocking(&digest, 3_000_000, 0).unwrap()).await.is_empty());
    let past = artifacts.read_range_blocking(&digest, 3_000_001, 0);
    assert!(matches!(past, Err(ArtifactError::OutOfRange { size_bytes: 3_000_000, .. })));
    assert!(files(&data.path().join("tmp")).is_empty());

    artifacts.delete(&digest).await.unwrap();
    artifacts.delete(&digest).await.unwrap();
    assert!(matches!(artifacts.read_all(&digest).await, Err(ArtifactError::NotFound { .. })));
}

#[tokio::test]
async fn damaged_blob_is_refused_until_stored_again() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = artifacts.put_bytes(b"kernel".to_vec()).await.unwrap();
    let path = data.path().join("artifacts").join(&digest[7..9]).join(&digest);
    fs::write(path, b"kernal").unwrap();
    assert!(matches!(artifacts.read_all(&digest).await, Err(ArtifactError::DataLoss { .. })));
    assert!(matches!(artifacts.read_range_blocking(&digest, 0, 0), Err(ArtifactError::DataLoss { .. })));
    artifacts.put_bytes(b"kernel".to_vec()).await.unwrap();
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), b"kernel", "storing the same bytes again repairs the blob");
}

#[tokio::test]
async fn damaged_and_missing_blobs_are_not_intact() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = artifacts.put_bytes(b"kernel".to_vec()).await.unwrap();
    let path = data.path().join("artifacts").join(&digest[7..9]).join(&digest);
    assert!(artifacts.is_intact(&digest).await.unwrap() && artifacts.is_intact(&digest).await.unwrap());
    fs::write(&path, b"kernel, longer").unwrap();
    assert!(!artifacts.is_intact(&digest).await.unwrap(), "the file has changed since it was found intact");
    artifacts.put_bytes(b"kernel".to_vec()).await.unwrap();
    assert!(artifacts.is_intact(&digest).await.unwrap());

    // A disk that damages a file changes neither its size nor its time.
    let modified = fs::metadata(&path).unwrap().modified().unwrap();
    fs::write(&path, b"kernal").unwrap();
    File::options().write(true).open(&path).unwrap().set_modified(modified).unwrap();
    assert!(artifacts.is_intact(&digest).await.unwrap(), "the file is not read again for some minutes");
    assert!(artifacts.read_all(&digest).await.is_err());
    assert!(!artifacts.is_intact(&digest).await.unwrap(), "a reader has found the damage");
    fs::remove_file(&path).unwrap();
    assert!(!artifacts.is_intact(&digest).await.unwrap());
    assert!(matches!(artifacts.is_intact("sha256-").await, Err(ArtifactError::BadDigest { .. })));
}

#[tokio::test]
async fn malformed_digests_are_refused() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let upper = format!("sha256-{}", "A".repeat(64));
    let long = format!("sha256-{}", "a".repeat(65));
    for bad in ["", "sha256-", "../lock", "sha256-../../../../../../etc/passwd", &upper, &long] {
        assert!(matches!(artifacts.read_all(bad).await, Err(ArtifactError::BadDigest { .. })), "{bad}");
        assert!(
            matches!(artifacts.uploads().begin(bad, "ada", 1, 0).await, Err(ArtifactError::BadDigest { .. })),
            "{bad}"
        );
    }
}

#[tokio::test]
async fn interrupted_upload_continues() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = digest_of(b"half and half");
    let mut writer = artifacts.uploads().begin(&digest, "ada", 13, 0).await.unwrap();
    writer.write(b"half ".to_vec()).await.unwrap();
    assert!(matches!(artifacts.uploads().begin(&digest, "ada", 13, 0).await, Err(ArtifactError::UploadBusy { .. })));
    drop(writer);
    drop(artifacts);

    let artifacts = Artifacts::open(data.path()).unwrap();
    assert_eq!(artifacts.uploads().received_bytes(&digest, "ada").await.unwrap(), 5);
    assert_eq!(artifacts.uploads().received_bytes(&digest, "bob").await.unwrap(), 0, "the upload belongs to its owner");
    let stolen = artifacts.uploads().begin(&digest, "bob", 13, 5).await;
    assert!(matches!(stolen, Err(ArtifactError::WrongOffset { received_bytes: 0, .. })));
    let wrong = artifacts.uploads().begin(&digest, "ada", 13, 3).await;
    assert!(matches!(wrong, Err(ArtifactError::WrongOffset { received_bytes: 5, .. })));
    let mut writer = artifacts.uploads().begin(&digest, "ada", 13, 5).await.unwrap();
    writer.write(b"and half".to_vec()).await.unwrap();
    assert_eq!(writer.received_bytes(), 13);
    writer.finish().await.unwrap();
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), b"half and half");
    let mut other = artifacts.uploads().begin(&digest, "bob", 13, 0).await.unwrap();
    other.write(b"half and half".to_vec()).await.unwrap();
    other.finish().await.unwrap();
    assert!(files(&data.path().join("uploads")).is_empty());
}

#[tokio::test]
async fn upload_with_wrong_digest_or_size_is_not_published() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = digest_of(b"right");
    let mut writer = artifacts.uploads().begin(&digest, "ada", 5, 0).await.unwrap();
    writer.write(b"wrong".to_vec()).await.unwrap();
    assert!(matches!(writer.finish().await, Err(ArtifactError::WrongDigest { .. })));
    assert_eq!(artifacts.uploads().received_bytes(&digest, "ada").await.unwrap(), 0);

    let mut writer = artifacts.uploads().begin(&digest, "ada", 5, 0).await.unwrap();
    assert!(matches!(writer.write(b"too long".to_vec()).await, Err(ArtifactError::WrongSize { .. })));
    let mut writer = artifacts.uploads().begin(&digest, "ada", 5, 0).await.unwrap();
    writer.write(b"rig".to_vec()).await.unwrap();
    assert!(matches!(writer.finish().await, Err(ArtifactError::WrongSize { .. })));
    assert_eq!(
        artifacts.uploads().received_bytes(&digest, "ada").await.unwrap(),
        3,
        "the missing bytes can still be sent"
    );
    let mut writer = artifacts.uploads().begin(&digest, "ada", 5, 0).await.unwrap();
    writer.write(b"right".to_vec()).await.unwrap();
    writer.finish().await.unwrap();
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), b"right", "the upload can also start again");
}

#[tokio::test]
async fn upload_without_a_digest_tells_it_and_leaves_nothing_if_it_is_cut() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let mut writer = unnamed(&artifacts, 5).await.unwrap();
    let mut other = unnamed(&artifacts, 5).await.unwrap();
    writer.write(b"right".to_vec()).await.unwrap();
    other.write(b"oth".to_vec()).await.unwrap();
    let digest = writer.finish().await.unwrap();
    assert_eq!(digest, digest_of(b"right"));
    assert_eq!(artifacts.read_all(&digest).await.unwrap(), b"right");
    assert!(matches!(other.finish().await, Err(ArtifactError::WrongSize { received_bytes: 3, size_bytes: 5 })));
    let mut long = unnamed(&artifacts, 2).await.unwrap();
    assert!(matches!(long.write(b"long".to_vec()).await, Err(ArtifactError::WrongSize { .. })));
    drop(long);
    let mut cut = unnamed(&artifacts, 5).await.unwrap();
    cut.write(b"cut".to_vec()).await.unwrap();
    drop(cut);
    assert!(files(&data.path().join("uploads")).is_empty());
}

#[tokio::test]
async fn folder_is_locked_and_leftovers_are_removed_at_start() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    assert!(matches!(Artifacts::open(data.path()), Err(ArtifactError::Locked { .. })));
    drop(artifacts);
    fs::write(data.path().join("tmp/half-written"), b"x").unwrap();
    let part = |content: &[u8]| data.path().join("uploads").join(interrupted::file_name(&digest_of(content), "ada"));
    let (old, new, unnamed) = (part(b"old"), part(b"new"), data.path().join("uploads/unnamed-7.part"));
    fs::write(&unnamed, b"x").unwrap();
    fs::write(&new, b"x").unwrap();
    fs::write(&old, b"x").unwrap();
    let long_ago = std::time::SystemTime::now() - 2 * UPLOAD_AGE_MAX;
    File::options().write(true).open(&old).unwrap().set_modified(long_ago).unwrap();
    Artifacts::open(data.path()).unwrap();
    assert!(files(&data.path().join("tmp")).is_empty());
    assert_eq!(files(&data.path().join("uploads")), [new.file_name().unwrap().to_str().unwrap()]);
}

/// Modes of everything in a folder that other users may read, write or enter.
fn open_to_others(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(open_to_others(&path));
        }
        if fs::metadata(&path).unwrap().permissions().mode() & 0o077 != 0 {
            found.push(path);
        }
    }
    found
}

#[tokio::test]
async fn only_the_user_of_the_server_can_read_the_files() {
    let parent = tempfile::tempdir().unwrap();
    let data = parent.path().join("a/data");
    let artifacts = Artifacts::open(&data).unwrap();
    artifacts.put_bytes(b"kernel".to_vec()).await.unwrap();
    artifacts.put_checkpoint(b"state".to_vec()).await.unwrap();
    let mut upload = artifacts.uploads().begin(&digest_of(b"part"), "ada", 4, 0).await.unwrap();
    upload.write(b"pa".to_vec()).await.unwrap();
    drop(artifacts.collecting().await.unwrap());
    assert_eq!(open_to_others(&parent.path().join("a")), Vec::<PathBuf>::new());

    // Files of a program with another mask become private, and files that are not the server's keep their modes.
    let wide = |name: &str, mode| fs::set_permissions(data.join(name), Permissions::from_mode(mode)).unwrap();
    fs::write(data.join("notes.txt"), "").unwrap();
    for name in ["lightpath.db-wal", "audit.jsonl.1"] {
        fs::write(data.join(name), "").unwrap();
        wide(name, 0o644);
    }
    wide("notes.txt", 0o644);
    wide("artifacts", 0o755);
    let mut changed = make_private(&data).unwrap();
    changed.sort();
    assert_eq!(changed, ["artifacts", "audit.jsonl.1", "lightpath.db-wal"].map(|name| data.join(name)));
    assert_eq!(open_to_others(&data), [data.join("notes.txt")]);
    assert_eq!(make_private(&data).unwrap(), Vec::<PathBuf>::new());
}

#[tokio::test]
async fn checkpoints_are_separate_from_artifacts() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = artifacts.put_checkpoint(b"state".to_vec()).await.unwrap();
    assert_eq!(artifacts.read_checkpoint(&digest).await.unwrap(), b"state");
    assert!(matches!(artifacts.read_all(&digest).await, Err(ArtifactError::NotFound { .. })));
    assert_eq!(artifacts.checkpoints().await.unwrap(), std::slice::from_ref(&digest));
    artifacts.delete_checkpoint(&digest).await.unwrap();
    assert!(artifacts.checkpoints().await.unwrap().is_empty());
}

#[tokio::test]
async fn conversions_are_checked_when_they_may_have_changed() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let digest = artifacts.put_conversion_blocking(b"converted").unwrap();
    for _ in 0..2 {
        assert_eq!(read_to_end(artifacts.read_conversion_blocking(&digest, 0, 0).unwrap()).await, b"converted");
    }
    let file = data.path().join("conversions").join(&digest[7..9]).join(&digest);
    fs::write(file, b"convErted").unwrap();
    for _ in 0..2 {
        let damaged = artifacts.read_conversion_blocking(&digest, 0, 0);
        assert!(matches!(damaged, Err(ArtifactError::DataLoss { .. })), "{damaged:?}");
    }
}

#[tokio::test]
async fn conversions_and_their_notes_survive_a_restart() {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    assert_eq!(artifacts.conversion_notes_blocking().unwrap(), None);
    let digest = artifacts.put_conversion_blocking(b"converted").unwrap();
    artifacts.write_conversion_notes_blocking(b"notes").unwrap();
    artifacts.write_conversion_notes_blocking(b"newer notes").unwrap();
    drop(artifacts);
    let artifacts = Artifacts::open(data.path()).unwrap();
    assert_eq!(artifacts.conversion_notes_blocking().unwrap().unwrap(), b"newer notes");
    assert_eq!(artifacts.conversions_blocking().unwrap(), [(digest.clone(), 9)]);
    assert_eq!(read_to_end(artifacts.read_conversion_blocking(&digest, 0, 0).unwrap()).await, b"converted");
    artifacts.delete_conversion_blocking(&digest).unwrap();
    assert!(artifacts.conversions_blocking().unwrap().is_empty());
}
