//! Tests of the commands on a data folder.

use super::*;
use crate::database::DATABASE;
use lightpath_domain::job::JobEffect;
use lightpath_fixtures::{capture_job, capture_result, change_database, display};
use lightpath_manifest::{PublicKey, SignedKeyring, SigningKey, Time, Trust};
use lightpath_store::Store;
use lightpath_worker::Clock;
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// A data folder with a display, a job that succeeded, and a waiting job with a checkpoint. It is open, as while a
/// server runs.
pub(super) struct TestData {
    folder: TempDir,
    pub(super) store: Store,
    artifacts: Artifacts,
    pub(super) photo: String,
    waiting: String,
    pub(super) checkpoint: String,
}

impl TestData {
    pub(super) async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let artifacts = Artifacts::open(folder.path()).unwrap();
        let store = Store::open(&folder.path().join(DATABASE)).await.unwrap();
        store.create_display(&display("lab"), 1).await.unwrap();
        let phase = put(&artifacts, &store, b"phase").await;
        let photo = put(&artifacts, &store, b"photo").await;
        store.submit(&capture_job("first", &phase, 1), 1, 10).await.unwrap();
        let (_, lease) = store.claim(1, 1000, "w").await.unwrap().unwrap();
        let result = capture_result(&photo);
        store.finish(&lease, result, JobEffect::None, 2).await.unwrap();
        store.submit(&capture_job("second", &phase, 1), 3, 10).await.unwrap();
        let (waiting, lease) = store.claim(3, 1000, "w").await.unwrap().unwrap();
        let checkpoint = artifacts.put_checkpoint(b"state".to_vec()).await.unwrap();
        store.checkpoint(&lease, &checkpoint).await.unwrap();
        store.release(&lease, 5).await.unwrap();
        Self { folder, store, artifacts, photo, waiting: waiting.id, checkpoint }
    }

    /// The data folder after its server has ended.
    pub(super) async fn closed(self) -> TempDir {
        self.store.close().await;
        self.folder
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    async fn problems(&self) -> Vec<(FindingKind, String, String)> {
        let report = check(self.path()).await.unwrap();
        report.problems.into_iter().map(|found| (found.kind, found.what, found.problem)).collect()
    }
}

async fn put(artifacts: &Artifacts, store: &Store, bytes: &[u8]) -> String {
    let digest = artifacts.put_bytes(bytes.to_vec()).await.unwrap();
    store.record_artifact(&digest, bytes.len() as u64, "", None, 1).await.unwrap().unwrap();
    digest
}

/// Path of a blob.
pub(super) fn file(data_dir: &Path, folder: &str, digest: &str) -> PathBuf {
    data_dir.join(folder).join(&digest[7..9]).join(digest)
}

#[tokio::test]
async fn check_finds_no_problems_in_a_sound_folder_in_use() {
    let data = TestData::new().await;
    data.artifacts.put_bytes(b"not recorded yet".to_vec()).await.unwrap();
    let report = check(data.path()).await.unwrap();
    assert_eq!(report.problems, []);
    assert_eq!((report.jobs, report.artifacts, report.artifact_bytes, report.checkpoints), (2, 2, 10, 1));
    assert_eq!(report.unreferenced_files, 1);
    // The server can still write.
    put(&data.artifacts, &data.store, b"more").await;
    let empty = tempfile::tempdir().unwrap();
    assert!(matches!(check(empty.path()).await, Err(UpkeepError::Database(DatabaseError::NoData { .. }))));
}

#[tokio::test]
async fn damaged_and_missing_files_are_found() {
    let data = TestData::new().await;
    fs::write(file(data.path(), "artifacts", &data.photo), b"phota").unwrap();
    fs::remove_file(file(data.path(), "checkpoints", &data.checkpoint)).unwrap();
    let problems = data.problems().await;
    let damaged = (FindingKind::Artifact, data.photo.clone(), "has bytes that do not match its digest".to_owned());
    let missing =
        (FindingKind::Checkpoint, format!("jobs/{}", data.waiting), format!("{} is not on disk", data.checkpoint));
    assert_eq!(problems, [damaged, missing]);
    fs::remove_file(file(data.path(), "artifacts", &data.photo)).unwrap();
    assert!(data.problems().await.contains(&(FindingKind::Artifact, data.photo.clone(), "is not on disk".to_owned())));
}

#[tokio::test]
async fn reference_to_an_unrecorded_artifact_is_found() {
    let data = TestData::new().await;
    let nothing = lightpath_artifacts::digest_of(b"nothing");
    assert!(
        data.store.submit(&capture_job("third", &nothing, 1), 9, 10).await.is_err(),
        "a new job must name recorded artifacts"
    );
    let (job, lease) = data.store.claim(9, 1000, "w").await.unwrap().unwrap();
    let result = capture_result(&nothing);
    data.store.finish(&lease, result, JobEffect::None, 9).await.unwrap();
    let problem = format!("refers to {nothing}, which is not recorded");
    assert_eq!(data.problems().await, [(FindingKind::Reference, format!("jobs/{}", job.id), problem)]);
}

#[tokio::test]
async fn finalized_dataset_with_another_digest_is_found() {
    let data = TestData::new().await;
    let insert = "insert into dataset (id, display, wavelength_pm, distance_nm, photo_encoding, digest, finalization, \
                  create_time_ms, finalize_time_ms) values ('d', 'lab', 515000, 150000000, 'linear', 'sha256-other', \
                  '{\"validation_fraction\":0.0,\"test_fraction\":0.2,\"seed\":0,\"keep_alignment\":false}', 5, 6)";
    change_database(&data.path().join(DATABASE), insert).await;
    let problem = "has a digest that does not match its pairs, split and alignment".to_owned();
    assert_eq!(data.problems().await, [(FindingKind::Dataset, "datasets/d".to_owned(), problem)]);
}

#[tokio::test]
async fn damaged_database_is_found() {
    let data = TestData::new().await;
    data.store.close().await;
    drop(data.artifacts);
    let path = data.folder.path().join(DATABASE);
    let mut bytes = fs::read(&path).unwrap();
    // Overwrite the second half of the file. The schema is in the first half.
    let middle = bytes.len() / 2;
    bytes[middle..].fill(0x55);
    fs::write(&path, bytes).unwrap();
    match check(data.folder.path()).await {
        Ok(report) => assert!(report.problems.iter().any(|found| found.kind == FindingKind::Database), "{report:?}"),
        // The database is too damaged to be read.
        Err(error) => assert!(matches!(error, UpkeepError::Database(DatabaseError::Store(_))), "{error:?}"),
    }
}

#[tokio::test]
async fn backup_of_a_running_server_restores_the_same_data() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    let done = backup(data.path(), &copy).await.unwrap();
    assert_eq!((done.manifest.jobs, done.manifest.artifacts, done.restarting_jobs), (2, 2, 0));
    assert!(matches!(backup(data.path(), &copy).await, Err(UpkeepError::NotEmpty { .. })));
    // The backup does not contain later changes.
    put(&data.artifacts, &data.store, b"later").await;

    let report = restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap();
    assert_eq!((report.problems.as_slice(), report.artifacts, report.checkpoints), ([].as_slice(), 2, 1));
    let store = Store::open(&restored.join(DATABASE)).await.unwrap();
    assert_eq!(store.job(&data.waiting).await.unwrap(), data.store.job(&data.waiting).await.unwrap());
    let artifacts = Artifacts::open(&restored).unwrap();
    assert_eq!(artifacts.read_all(&data.photo).await.unwrap(), b"photo");
    assert_eq!(artifacts.read_checkpoint(&data.checkpoint).await.unwrap(), b"state");
    assert!(matches!(restore(&copy, &restored, &RestoredTokens::Keep).await, Err(UpkeepError::NotEmpty { .. })));
}

#[tokio::test]
async fn folder_that_a_server_uses_is_no_destination() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let copy = destination.path().join("backup");
    backup(data.path(), &copy).await.unwrap();
    // This server has locked its folder, and has not created a file yet.
    let empty = destination.path().join("starting");
    let starting = lightpath_artifacts::FolderLock::take(&empty).unwrap();
    for refused in
        [restore(&copy, &empty, &RestoredTokens::Keep).await.map(drop), backup(data.path(), &empty).await.map(drop)]
    {
        assert!(matches!(refused, Err(UpkeepError::Artifacts(ArtifactError::Locked { .. }))), "{refused:?}");
    }
    drop(starting);
    assert_eq!(
        restore(&copy, &empty, &RestoredTokens::Keep).await.unwrap().problems,
        [],
        "a lock file of an earlier process does no harm"
    );
}

#[tokio::test]
async fn folder_is_not_copied_into_itself() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let copy = destination.path().join("backup");
    backup(data.path(), &copy).await.unwrap();
    for (inside, source) in [(data.path().join("a/b"), data.path()), (copy.join("data"), &*copy)] {
        let refused = match source == copy {
            true => restore(&copy, &inside, &RestoredTokens::Keep).await.map(drop),
            false => backup(data.path(), &inside).await.map(drop),
        };
        assert!(matches!(refused, Err(UpkeepError::Inside { .. })), "{refused:?}");
        assert!(!inside.exists());
    }
    assert!(matches!(backup(data.path(), data.path()).await, Err(UpkeepError::Inside { .. })));
    let link = destination.path().join("link");
    std::os::unix::fs::symlink(data.path(), &link).unwrap();
    assert!(matches!(backup(data.path(), &link.join("copy")).await, Err(UpkeepError::Inside { .. })));
}

#[tokio::test]
async fn job_restarts_if_its_checkpoint_disappears_during_the_backup() {
    let data = TestData::new().await;
    fs::remove_file(file(data.path(), "checkpoints", &data.checkpoint)).unwrap();
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    assert_eq!(backup(data.path(), &copy).await.unwrap().restarting_jobs, 1);
    assert_eq!(restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap().problems, []);
    let store = Store::open(&restored.join(DATABASE)).await.unwrap();
    assert_eq!(store.job(&data.waiting).await.unwrap().checkpoint, None);
}

#[tokio::test]
async fn unreferenced_artifacts_and_ended_jobs_are_removed_after_their_ages() {
    let data = TestData::new().await;
    let day_ms = 24 * 3600 * 1000;
    let (artifacts, jobs) = (Some(Duration::from_secs(24 * 3600)), Some(Duration::from_secs(10 * 24 * 3600)));
    let keep_jobs = Retention { artifacts, jobs: None };
    let unreferenced = put(&data.artifacts, &data.store, b"orphaned").await;
    let one = Collected { jobs: 0, artifacts: 1, artifact_bytes: 8 };
    let none = Collected::default();
    let (store, files) = (&data.store, &data.artifacts);
    // The saved state of a job may refer to artifacts that the job has made.
    store.record_artifact(&unreferenced, 8, "", None, 4).await.unwrap().unwrap();
    assert_eq!(keep_jobs.preview(store, 2 * day_ms).await.unwrap(), none);
    let (_, lease) = store.claim(day_ms / 2 - 1, 1000, "w").await.unwrap().unwrap();
    store.fail(&lease, io_error(), None, day_ms / 2).await.unwrap();
    assert_eq!(keep_jobs.preview(store, day_ms + 9).await.unwrap(), none, "a user can retry the failed job");
    assert_eq!(store.forget_old_checkpoints(day_ms / 2).await.unwrap(), Vec::<String>::new());
    let forgotten = store.forget_old_checkpoints(day_ms).await.unwrap();
    assert_eq!(forgotten, std::slice::from_ref(&data.checkpoint), "the job has failed before the given time");
    files.delete_checkpoint(&data.checkpoint).await.unwrap();

    assert_eq!(keep_jobs.preview(store, day_ms).await.unwrap(), none, "the artifact has not reached its age");
    assert_eq!(keep_jobs.preview(store, 2 * day_ms).await.unwrap(), one);
    // This records a use: a caller that finds the artifact stored relies on it.
    store.use_artifact(&unreferenced, day_ms + 9).await.unwrap();
    assert_eq!(keep_jobs.collect(store, files, 2 * day_ms).await.unwrap(), none);
    {
        let _backup = lightpath_artifacts::Inventory::of(data.path()).prevent_removal().unwrap();
        assert_eq!(keep_jobs.collect(store, files, 3 * day_ms).await.unwrap(), none, "a backup is running");
    }
    assert_eq!(keep_jobs.collect(store, files, 3 * day_ms).await.unwrap(), one);
    assert!(files.size(&unreferenced).await.unwrap().is_none());
    assert_eq!(data.problems().await, []);
    assert_eq!(put(files, store, b"orphaned").await, unreferenced, "the artifact can be stored again");

    // Jobs are removed with their events. Artifacts to which only they referred are removed when their own age is
    // reached.
    let all = Retention { artifacts, jobs };
    let preview = all.preview(store, 11 * day_ms).await.unwrap();
    assert_eq!(preview.jobs, 2, "{preview:?}");
    assert_eq!(all.collect(store, files, 11 * day_ms).await.unwrap().jobs, 2);
    assert!(store.job(&data.waiting).await.is_err());
    assert!(files.size(&data.photo).await.unwrap().is_some());
    assert_eq!(all.collect(store, files, 13 * day_ms).await.unwrap().artifacts, 2, "the photograph and the phase");
    assert!(files.size(&data.photo).await.unwrap().is_none());
    assert_eq!(data.problems().await, []);
}

fn io_error() -> lightpath_domain::job::JobError {
    lightpath_domain::job::JobError {
        reason: lightpath_domain::job::FailureReason::Io,
        message: "the disk failed".to_owned(),
        retryable: false,
    }
}

#[tokio::test]
async fn damaged_artifacts_are_named_and_everything_else_is_copied() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    fs::write(file(data.path(), "artifacts", &data.photo), b"phota").unwrap();
    let done = backup(data.path(), &copy).await.unwrap();
    let damaged =
        |problem: &str| Finding { kind: FindingKind::Artifact, what: data.photo.clone(), problem: problem.to_owned() };
    assert_eq!(done.damaged, [damaged("has bytes that do not match its digest")]);
    assert_eq!((done.manifest.artifacts, &done.manifest.damaged), (2, &vec![data.photo.clone()]));
    let report = restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap();
    assert_eq!((report.problems, report.artifacts), (vec![damaged("is not on disk")], 2));
    let artifacts = Artifacts::open(&restored).unwrap();
    assert_eq!(artifacts.read_all(&lightpath_artifacts::digest_of(b"phase")).await.unwrap(), b"phase");

    // A file that was damaged in the backup.
    put(&data.artifacts, &data.store, b"photo").await;
    let copy = destination.path().join("second");
    assert_eq!(backup(data.path(), &copy).await.unwrap().damaged, [], "storing the bytes again repairs the artifact");
    fs::write(file(&copy, "artifacts", &data.photo), b"phota").unwrap();
    let report = restore(&copy, &destination.path().join("other"), &RestoredTokens::Keep).await.unwrap();
    assert_eq!(report.problems, [damaged("is not on disk")]);
}

/// Devices refuse a lower generation and an older keyring than they have seen.
#[tokio::test]
async fn restored_server_says_what_devices_accept() {
    const NOW_MS: i64 = 1_795_458_600_000;
    let data = TestData::new().await;
    tend(&data.store, NOW_MS).await.unwrap();
    let keyring = async |store: &Store| store.keyring().await.unwrap().unwrap();
    let target = tempfile::tempdir().unwrap();
    let (copy, restored) = (target.path().join("copy"), target.path().join("restored"));
    backup(data.path(), &copy).await.unwrap();
    // The device sees three more keyrings, which the backup does not have.
    for _ in 0..3 {
        change_keyring(&data.store, KeyChange::Rotate, NOW_MS).await.unwrap();
    }
    let time = |unix_ms: i64| Time::from_unix_s(unix_ms / 1000).unwrap();
    let first = SignedKeyring::parse(keyring(&data.store).await.document.as_bytes()).unwrap().unchecked().clone();
    assert_eq!(first.version, 4);
    let device = Trust::Keyring(first);
    restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap();
    let store = Store::open(&restored.join(DATABASE)).await.unwrap();
    let document = keyring(&store).await.document;
    let now = Time::from_unix_s(Clock::default().now_ms() / 1000).unwrap();
    let accepted = device.renew(document.as_bytes(), now.max(time(NOW_MS))).unwrap();
    assert!(i64::from(accepted.version) > 1_700_000_000, "{}", accepted.version);
}

#[tokio::test]
async fn keys_are_renewed_before_they_end_and_the_root_key_can_live_elsewhere() {
    const NOW_MS: i64 = 1_795_458_600_000;
    const DAY_MS: i64 = 24 * 3600 * 1000;
    let data = TestData::new().await;
    let store = &data.store;
    assert!(matches!(state(store).await, Err(KeysError::NoKeyring)));
    tend(store, NOW_MS).await.unwrap();
    tend(store, NOW_MS + 40 * DAY_MS).await.unwrap();
    assert_eq!(state(store).await.unwrap().keyring, 1, "nothing ends soon");
    tend(store, NOW_MS + 50 * DAY_MS).await.unwrap();
    let renewed = state(store).await.unwrap();
    assert_eq!((renewed.keyring, renewed.keys.len()), (2, 2));
    tend(store, NOW_MS + 210 * DAY_MS).await.unwrap();
    let rotated = state(store).await.unwrap();
    assert_eq!((rotated.keyring, rotated.keys.len()), (3, 3), "a second key for manifests");

    // The root key moves to another place.
    let now_ms = NOW_MS + 211 * DAY_MS;
    let elsewhere = SigningKey::from_seed([5; 32]);
    let draft = keys::draft(store, KeyChange::Renew, Some(elsewhere.public()), None, now_ms).await.unwrap();
    assert_eq!(install(store, &draft, now_ms).await.unwrap(), 4);
    let old = rotated.keys.iter().find(|key| key.use_ == "root").unwrap();
    assert!(store.forget_private_key(&old.public).await.unwrap());
    let refused = change_keyring(store, KeyChange::Rotate, now_ms).await.unwrap_err();
    assert!(matches!(&refused, KeysError::RootElsewhere { root } if *root == elsewhere.public().id()), "{refused}");
    // The server only warns.
    tend(store, now_ms + 80 * DAY_MS).await.unwrap();
    assert_eq!(state(store).await.unwrap().keyring, 4);
    let next = keys::draft(store, KeyChange::Renew, None, None, now_ms).await.unwrap();
    let unsigned = install(store, &next, now_ms).await.unwrap_err();
    assert!(matches!(unsigned, KeysError::Refused(_)), "{unsigned}");
    let signature = elsewhere.sign(next.as_bytes());
    let signed = format!("{next}signature {} {signature}\n", elsewhere.public());
    assert_eq!(install(store, &signed, now_ms).await.unwrap(), 5);
    let again = install(store, &signed, now_ms).await.unwrap_err();
    assert!(matches!(again, KeysError::Store(_)), "{again}");

    // A key is revoked, with its successor, by the root key elsewhere.
    let signer = state(store).await.unwrap().keys.into_iter().find(|key| key.use_ == "manifest").unwrap();
    let revoked = KeyChange::Revoke(PublicKey::parse(&signer.public).unwrap());
    let low = keys::draft(store, revoked, None, Some(5), now_ms).await.unwrap_err();
    assert_eq!(low.to_string(), "the number 5 is too low: the next keyring has at least 6");
    let next = keys::draft(store, revoked, None, Some(70), now_ms).await.unwrap();
    let signed = format!("{next}signature {} {}\n", elsewhere.public(), elsewhere.sign(next.as_bytes()));
    assert_eq!(install(store, &signed, now_ms).await.unwrap(), 70);
    let keys = state(store).await.unwrap().keys;
    let is_here = |use_: &str| keys.iter().filter(|key| key.use_ == use_).map(|key| key.is_here).collect::<Vec<_>>();
    assert_eq!((is_here("revoked"), is_here("manifest").last()), (vec![false], Some(&true)));
}
