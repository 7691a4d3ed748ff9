use super::*;
use lightpath_artifacts::Artifacts;
use lightpath_domain::job::JobEffect;
use lightpath_fixtures::{capture_job, capture_result, display};
use lightpath_store::Store;
use std::fs;
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

/// A data folder with a display, a job that succeeded, and one that waits with a checkpoint. Its server is running.
struct Lab {
    folder: TempDir,
    store: Store,
    artifacts: Artifacts,
    photo: String,
    waiting: String,
    checkpoint: String,
}

impl Lab {
    async fn new() -> Self {
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
        store.checkpoint(&lease, &checkpoint, 4).await.unwrap();
        store.release(&lease, 5).await.unwrap();
        Self { folder, store, artifacts, photo, waiting: waiting.id, checkpoint }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    async fn problems(&self) -> Vec<(FindingKind, String, String)> {
        let report = check(self.path()).await.unwrap();
        report.problems.into_iter().map(|it| (it.kind, it.what, it.problem)).collect()
    }
}

async fn put(artifacts: &Artifacts, store: &Store, bytes: &[u8]) -> String {
    let digest = artifacts.put_bytes(bytes.to_vec()).await.unwrap();
    store.record_artifact(&digest, bytes.len() as u64, "", 1).await.unwrap();
    digest
}

/// Path of a blob.
fn file(data_dir: &Path, folder: &str, digest: &str) -> PathBuf {
    data_dir.join(folder).join(&digest[7..9]).join(digest)
}

#[tokio::test]
async fn a_sound_folder_is_clean_while_its_server_runs() {
    let lab = Lab::new().await;
    lab.artifacts.put_bytes(b"not recorded yet".to_vec()).await.unwrap();
    let report = check(lab.path()).await.unwrap();
    assert_eq!(report.problems, []);
    assert_eq!((report.jobs, report.artifacts, report.artifact_bytes, report.checkpoints), (2, 2, 10, 1));
    assert_eq!(report.unreferenced_files, 1);
    // The server can still write.
    put(&lab.artifacts, &lab.store, b"more").await;
    let nowhere = tempfile::tempdir().unwrap();
    assert!(matches!(check(nowhere.path()).await, Err(UpkeepError::NoData { .. })));
}

#[tokio::test]
async fn damaged_and_missing_files_are_found() {
    let lab = Lab::new().await;
    fs::write(file(lab.path(), "artifacts", &lab.photo), b"phota").unwrap();
    fs::remove_file(file(lab.path(), "checkpoints", &lab.checkpoint)).unwrap();
    let problems = lab.problems().await;
    let damaged = (FindingKind::Artifact, lab.photo.clone(), "has bytes that do not match its digest".to_owned());
    let gone = (FindingKind::Checkpoint, format!("jobs/{}", lab.waiting), format!("{} is not on disk", lab.checkpoint));
    assert_eq!(problems, [damaged, gone]);
    fs::remove_file(file(lab.path(), "artifacts", &lab.photo)).unwrap();
    assert!(lab.problems().await.contains(&(FindingKind::Artifact, lab.photo.clone(), "is not on disk".to_owned())));
}

#[tokio::test]
async fn a_job_that_names_an_unrecorded_artifact_is_found() {
    let lab = Lab::new().await;
    let nothing = lightpath_artifacts::digest_of(b"nothing");
    assert!(lab.store.submit(&capture_job("third", &nothing, 1), 9, 10).await.is_err(), "no new job does");
    let (job, lease) = lab.store.claim(9, 1000, "w").await.unwrap().unwrap();
    let result = capture_result(&nothing);
    lab.store.finish(&lease, result, JobEffect::None, 9).await.unwrap();
    let problem = format!("names {nothing}, which is not recorded");
    assert_eq!(lab.problems().await, [(FindingKind::Reference, format!("jobs/{}", job.id), problem)]);
}

#[tokio::test]
async fn a_damaged_database_is_found() {
    let lab = Lab::new().await;
    lab.store.close().await;
    drop(lab.artifacts);
    let path = lab.folder.path().join(DATABASE);
    let mut bytes = fs::read(&path).unwrap();
    // A byte in the middle of the pages that follow the schema.
    let middle = bytes.len() / 2;
    bytes[middle..].fill(0x55);
    fs::write(&path, bytes).unwrap();
    match check(lab.folder.path()).await {
        Ok(report) => assert!(report.problems.iter().any(|it| it.kind == FindingKind::Database), "{report:?}"),
        // The database is too damaged to be read.
        Err(error) => assert!(matches!(error, UpkeepError::Store(_)), "{error:?}"),
    }
}

#[tokio::test]
async fn a_backup_of_a_running_server_becomes_the_same_folder_again() {
    let lab = Lab::new().await;
    let place = tempfile::tempdir().unwrap();
    let (copy, restored) = (place.path().join("backup"), place.path().join("data"));
    let done = backup(lab.path(), &copy).await.unwrap();
    assert_eq!((done.manifest.jobs, done.manifest.artifacts, done.restarting_jobs), (2, 2, 0));
    assert!(matches!(backup(lab.path(), &copy).await, Err(UpkeepError::NotEmpty { .. })));
    // The backup does not contain later changes.
    put(&lab.artifacts, &lab.store, b"later").await;

    let report = restore(&copy, &restored).await.unwrap();
    assert_eq!((report.problems.as_slice(), report.artifacts, report.checkpoints), ([].as_slice(), 2, 1));
    let store = Store::open(&restored.join(DATABASE)).await.unwrap();
    assert_eq!(store.job(&lab.waiting).await.unwrap(), lab.store.job(&lab.waiting).await.unwrap());
    let artifacts = Artifacts::open(&restored).unwrap();
    assert_eq!(artifacts.read_all(&lab.photo).await.unwrap(), b"photo");
    assert_eq!(artifacts.read_checkpoint(&lab.checkpoint).await.unwrap(), b"state");
    assert!(matches!(restore(&copy, &restored).await, Err(UpkeepError::NotEmpty { .. })));
}

#[tokio::test]
async fn a_checkpoint_that_goes_during_the_backup_costs_no_more_than_time() {
    let lab = Lab::new().await;
    fs::remove_file(file(lab.path(), "checkpoints", &lab.checkpoint)).unwrap();
    let place = tempfile::tempdir().unwrap();
    let (copy, restored) = (place.path().join("backup"), place.path().join("data"));
    assert_eq!(backup(lab.path(), &copy).await.unwrap().restarting_jobs, 1);
    assert_eq!(restore(&copy, &restored).await.unwrap().problems, []);
    let store = Store::open(&restored.join(DATABASE)).await.unwrap();
    assert_eq!(store.job(&lab.waiting).await.unwrap().checkpoint, None);
}

#[tokio::test]
async fn what_nothing_refers_to_goes_after_its_time_of_grace_and_nothing_else() {
    let lab = Lab::new().await;
    let day_ms = 24 * 3600 * 1000;
    let (artifacts, jobs) = (Some(Duration::from_secs(24 * 3600)), Some(Duration::from_secs(10 * 24 * 3600)));
    let keep_jobs = Retention { artifacts, jobs: None };
    let nobodys = put(&lab.artifacts, &lab.store, b"nobody's").await;
    let one = Collected { jobs: 0, artifacts: 1, artifact_bytes: 8 };
    let none = Collected::default();
    let (store, files) = (&lab.store, &lab.artifacts);
    // The saved state of a job may refer to artifacts that the job has made.
    store.record_artifact(&nobodys, 8, "", 4).await.unwrap();
    assert_eq!(keep_jobs.preview(store, 2 * day_ms).await.unwrap(), none);
    let (_, lease) = store.claim(day_ms / 2 - 1, 1000, "w").await.unwrap().unwrap();
    store.fail(&lease, no_luck(), None, day_ms / 2).await.unwrap();
    assert_eq!(keep_jobs.preview(store, day_ms + 9).await.unwrap(), none, "it can be queued again by hand");
    assert_eq!(store.forget_old_checkpoints(day_ms / 2).await.unwrap(), Vec::<String>::new());
    let forgotten = store.forget_old_checkpoints(day_ms).await.unwrap();
    assert_eq!(forgotten, std::slice::from_ref(&lab.checkpoint), "for some time");
    files.delete_checkpoint(&lab.checkpoint).await.unwrap();

    assert_eq!(keep_jobs.preview(store, day_ms).await.unwrap(), none, "too young");
    assert_eq!(keep_jobs.preview(store, 2 * day_ms).await.unwrap(), one);
    // A caller who is told that the artifact exists relies on it.
    store.use_artifact(&nobodys, day_ms + 9).await.unwrap();
    assert_eq!(keep_jobs.collect(store, files, 2 * day_ms).await.unwrap(), none);
    {
        let _backup = lightpath_artifacts::Inventory::of(lab.path()).keep().unwrap();
        assert_eq!(keep_jobs.collect(store, files, 3 * day_ms).await.unwrap(), none, "while somebody copies");
    }
    assert_eq!(keep_jobs.collect(store, files, 3 * day_ms).await.unwrap(), one);
    assert!(files.size(&nobodys).await.unwrap().is_none());
    assert_eq!(lab.problems().await, []);
    assert_eq!(put(files, store, b"nobody's").await, nobodys, "it can be stored again");

    // Jobs are removed with their events. Artifacts to which only they referred are removed when their own age is
    // reached.
    let all = Retention { artifacts, jobs };
    let preview = all.preview(store, 11 * day_ms).await.unwrap();
    assert_eq!(preview.jobs, 2, "{preview:?}");
    assert_eq!(all.collect(store, files, 11 * day_ms).await.unwrap().jobs, 2);
    assert!(store.job(&lab.waiting).await.is_err());
    assert!(files.size(&lab.photo).await.unwrap().is_some());
    assert_eq!(all.collect(store, files, 13 * day_ms).await.unwrap().artifacts, 2, "photo and phase");
    assert!(files.size(&lab.photo).await.unwrap().is_none());
    assert_eq!(lab.problems().await, []);
}

fn no_luck() -> lightpath_domain::job::JobError {
    lightpath_domain::job::JobError {
        reason: lightpath_domain::job::FailureReason::Io,
        message: "no luck".to_owned(),
        retryable: false,
    }
}

#[tokio::test]
async fn no_damaged_backup_is_made_or_restored() {
    let lab = Lab::new().await;
    let place = tempfile::tempdir().unwrap();
    let (copy, restored) = (place.path().join("backup"), place.path().join("data"));
    backup(lab.path(), &copy).await.unwrap();
    fs::write(file(&copy, "artifacts", &lab.photo), b"phota").unwrap();
    assert!(matches!(restore(&copy, &restored).await, Err(UpkeepError::Damaged { .. })));
    assert!(!restored.join(DATABASE).exists(), "nothing that a server would start on");

    let manifest = copy.join("backup.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("\"database\": \"sha256-", "\"database\": \"sha256-0")).unwrap();
    let refused = restore(&copy, &place.path().join("other")).await.unwrap_err().to_string();
    assert!(refused.contains("lightpath.db hashes to"), "{refused}");
    fs::remove_file(&manifest).unwrap();
    let refused = restore(&copy, &place.path().join("other")).await.unwrap_err().to_string();
    assert!(refused.contains("is no complete backup: backup.json cannot be read"), "{refused}");

    fs::remove_file(file(lab.path(), "artifacts", &lab.photo)).unwrap();
    let damaged = backup(lab.path(), &place.path().join("third")).await;
    assert!(matches!(damaged, Err(UpkeepError::Damaged { .. })), "{damaged:?}");
    assert!(!place.path().join("third/backup.json").exists());
}
