//! Tests of the room that uploads claim, and of interrupted uploads that make room.

use super::*;
use interrupted::file_name;
use std::fs;
use std::time::{Duration, Instant, SystemTime};

/// An upload of "ada" that was interrupted after these bytes.
async fn interrupted(artifacts: &Artifacts, content: &[u8], received_bytes: usize) {
    let mut upload = artifacts.uploads().begin(&digest_of(content), "ada", content.len() as u64, 0).await.unwrap();
    upload.write(content[..received_bytes].to_vec()).await.unwrap();
}

async fn received_bytes(artifacts: &Artifacts, content: &[u8]) -> u64 {
    artifacts.uploads().received_bytes(&digest_of(content), "ada").await.unwrap()
}

fn limited(stored_bytes_max: u64) -> (tempfile::TempDir, Artifacts) {
    let data = tempfile::tempdir().unwrap();
    let artifacts = Artifacts::open_within(data.path(), SpaceLimits { reserve_bytes: 0, stored_bytes_max }).unwrap();
    (data, artifacts)
}

#[tokio::test]
async fn uploads_side_by_side_cannot_use_the_same_room() {
    let (_data, artifacts) = limited(100);
    let uploads = artifacts.uploads();
    let mut first = uploads.begin(&digest_of(&[1; 60]), "ada", 60, 0).await.unwrap();
    let second = uploads.begin(&digest_of(&[2; 60]), "bob", 60, 0).await;
    assert!(matches!(second, Err(ArtifactError::QuotaSpent { stored_bytes: 60, .. })), "{second:?}");
    first.write(vec![1; 60]).await.unwrap();
    let record = async |_, _| Ok::<_, ArtifactError>(Ok(()));
    artifacts.publish(first, record).await.unwrap();
    let third = uploads.begin(&digest_of(&[3; 60]), "bob", 60, 0).await;
    assert!(
        matches!(third, Err(ArtifactError::QuotaSpent { stored_bytes: 60, .. })),
        "the stored bytes count at once: {third:?}"
    );
    drop(uploads.begin(&digest_of(&[4; 40]), "bob", 40, 0).await.unwrap());
    uploads.begin(&digest_of(&[5; 40]), "bob", 40, 0).await.expect("an upload that has ended gives its room back");
}

#[tokio::test]
async fn uploads_leave_the_reserve_and_what_others_have_claimed() {
    let data = tempfile::tempdir().unwrap();
    let free_bytes = Artifacts::open(data.path()).unwrap().space().free_bytes().unwrap();
    let limits = SpaceLimits { reserve_bytes: free_bytes / 2, stored_bytes_max: 0 };
    let artifacts = Artifacts::open_within(data.path(), limits).unwrap();
    let size_bytes = free_bytes / 3;
    let first = artifacts.uploads().begin(&digest_of(b"1"), "ada", size_bytes, 0).await.unwrap();
    let second = artifacts.uploads().begin(&digest_of(b"2"), "bob", size_bytes, 0).await;
    assert!(matches!(second, Err(ArtifactError::DiskLow { .. })), "{second:?}");
    drop(first);
    artifacts.uploads().begin(&digest_of(b"2"), "bob", size_bytes, 0).await.unwrap();
}

#[tokio::test]
async fn interrupted_uploads_make_room_the_oldest_first_and_running_ones_stay() {
    let (_data, artifacts) = limited(100);
    let (oldest, newer) = ([1_u8; 20], [2_u8; 20]);
    let mut running = artifacts.uploads().begin(&digest_of(&[3; 40]), "ada", 40, 0).await.unwrap();
    running.write(vec![3; 20]).await.unwrap();
    interrupted(&artifacts, &oldest, 10).await;
    interrupted(&artifacts, &newer, 10).await;
    let too_large = artifacts.uploads().begin(&digest_of(&[4; 61]), "bob", 61, 0).await;
    assert!(matches!(too_large, Err(ArtifactError::QuotaSpent { .. })), "{too_large:?}");
    assert_eq!(received_bytes(&artifacts, &oldest).await, 10, "their room was not enough, so they stay");
    let _other = artifacts.uploads().begin(&digest_of(&[5; 45]), "bob", 45, 0).await.unwrap();
    assert_eq!((received_bytes(&artifacts, &oldest).await, received_bytes(&artifacts, &newer).await), (0, 10));
    running.write(vec![3; 20]).await.unwrap();
    running.finish().await.unwrap();
}

#[tokio::test]
async fn interrupted_uploads_end_after_a_day_while_the_server_runs() {
    let (data, artifacts) = limited(0);
    interrupted(&artifacts, b"left alone", 5).await;
    interrupted(&artifacts, b"nothing came", 0).await;
    let path = data.path().join("uploads").join(file_name(&digest_of(b"left alone"), "ada"));
    let files = || fs::read_dir(data.path().join("uploads")).unwrap().count();
    assert_eq!(files(), 1, "an upload without bytes leaves no file");
    let interrupted = artifacts.space().interrupted();
    interrupted.remove_old(SystemTime::now() + UPLOAD_AGE_MAX - Duration::from_secs(60));
    assert!(path.exists());
    let refused = artifacts.uploads().begin(&digest_of(b"left alone"), "ada", 10, 3).await;
    assert!(matches!(refused, Err(ArtifactError::WrongOffset { received_bytes: 5, .. })), "{refused:?}");
    interrupted.remove_old(SystemTime::now() + UPLOAD_AGE_MAX + Duration::from_secs(1));
    assert_eq!(files(), 0);
    assert_eq!(received_bytes(&artifacts, b"left alone").await, 0);
}

#[tokio::test]
async fn an_owner_has_few_interrupted_uploads() {
    let (data, artifacts) = limited(0);
    for number in 0..130_u32 {
        interrupted(&artifacts, &number.to_le_bytes(), 2).await;
    }
    assert_eq!(fs::read_dir(data.path().join("uploads")).unwrap().count(), 100);
    assert_eq!(received_bytes(&artifacts, &129_u32.to_le_bytes()).await, 2, "the newest stay");
}

#[tokio::test]
async fn an_interrupted_upload_is_hashed_once() {
    const SIZE_BYTES: u64 = 256 << 20;
    let (data, artifacts) = limited(0);
    drop(artifacts);
    let digest = digest_of(b"never complete");
    let part = fs::File::create(data.path().join("uploads").join(file_name(&digest, "ada"))).unwrap();
    part.set_len(SIZE_BYTES).unwrap();
    let artifacts = Artifacts::open(data.path()).unwrap();
    let begun = Instant::now();
    drop(artifacts.uploads().begin(&digest, "ada", 2 * SIZE_BYTES, SIZE_BYTES).await.unwrap());
    let first = begun.elapsed();
    let begun = Instant::now();
    for _ in 0..10 {
        drop(artifacts.uploads().begin(&digest, "ada", 2 * SIZE_BYTES, SIZE_BYTES).await.unwrap());
    }
    assert!(begun.elapsed() < first, "ten more: {:?}, the first: {first:?}", begun.elapsed());
}
