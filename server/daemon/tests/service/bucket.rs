//! Servers with a PostgreSQL database and a bucket. The tests need both `scripts/with-postgres` and `scripts/s3-for-tests`;
//! without them they do nothing.

use crate::holograms::hologram;
use crate::jobs::{optimize, picture, submit, watch_to_end};
use crate::serving::Serving;
use lightpath_artifacts::{Artifacts, BlobKind, BucketInventory, SpaceLimits, digest_of};
use lightpath_fixtures::postgres_database;
use lightpath_proto::v1::{self, job_spec};
use lightpath_server::config::{Config, SecretText};
use lightpath_server::upkeep::{FindingKind, Report, UpkeepError, check_with};
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tonic::Code;

/// Settings with a new database and a new place in the bucket; the data folder is still to be chosen.
pub(crate) async fn settings() -> Option<Config> {
    std::env::var_os("LIGHTPATH_POSTGRES")?;
    let endpoint = std::env::var("LIGHTPATH_TEST_S3").ok()?;
    let database_url = postgres_database().await;
    let name = database_url.rsplit('/').next().unwrap().split('?').next().unwrap().to_owned();
    Some(Config {
        database_url: Some(SecretText::new(database_url)),
        artifacts_url: Some(format!("s3://lightpath-tests/{name}")),
        artifacts_endpoint: Some(endpoint),
        artifacts_access_key_id: Some("lightpath-tests".into()),
        artifacts_secret_access_key: Some(SecretText::new("lightpath-tests".into())),
        artifacts_allow_http: true,
        ..Config::default()
    })
}

/// Starts a server with an empty data folder.
pub(crate) async fn start(settings: &Config) -> Serving {
    let folder = TempDir::new().unwrap();
    let config = Config { data_dir: folder.path().join("data"), ..settings.clone() };
    Serving::start_in(folder, config, |_| {}).await
}

async fn checked(config: &Config) -> Result<Report, UpkeepError> {
    check_with(&config.data_dir, &config.database().unwrap(), config.bucket().unwrap().as_ref()).await
}

/// Removes the files of all artifacts from a data folder, and returns their number.
fn empty_cache(data_dir: &Path) -> usize {
    let mut removed = 0;
    for shard in fs::read_dir(data_dir.join("artifacts")).unwrap() {
        for file in fs::read_dir(shard.unwrap().path()).unwrap() {
            fs::remove_file(file.unwrap().path()).unwrap();
            removed += 1;
        }
    }
    removed
}

fn job(target: &str, iterations: u32) -> job_spec::Kind {
    job_spec::Kind::OptimizeHologram(v1::OptimizeHologram { iterations: Some(iterations), ..optimize(target) })
}

#[tokio::test]
async fn results_outlive_the_data_folder() {
    let Some(settings) = settings().await else { return };
    let serving = start(&settings).await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let ended = submit(&serving, job(&target, 30), "").await.unwrap();
    let ended = watch_to_end(&serving, &ended.name).await;
    let phase = hologram(&ended).wavelengths[0].subframes[0].phase.clone();
    let bytes = serving.read(&phase).await;
    assert!(empty_cache(&serving.config.data_dir) > 2);
    assert!(serving.read(&phase).await == bytes, "it returns from the bucket");
    assert!(serving.read(&target).await == picture());
    serving.stop().await.unwrap();

    let serving = start(&settings).await;
    assert!(serving.read(&phase).await == bytes, "it returns to another data folder");
    let report = checked(&serving.config).await.unwrap();
    assert_eq!((report.problems.as_slice(), report.unreferenced_files), ([].as_slice(), 0));
    assert!(report.artifacts > 3 && report.artifact_bytes > bytes.len() as u64, "{report:?}");

    let bucket = serving.config.bucket().unwrap().unwrap();
    let inventory = BucketInventory::open(&bucket).await.unwrap();
    let other = TempDir::new().unwrap();
    let other = Artifacts::open_with(other.path(), SpaceLimits::default(), Some(&bucket)).unwrap();
    other.delete(&phase).await.unwrap();
    other.put_bytes(b"never recorded".to_vec()).await.unwrap();
    assert!(!inventory.list(BlobKind::Artifact).await.unwrap().contains(&phase));
    let report = checked(&serving.config).await.unwrap();
    let [found] = &report.problems[..] else { panic!("{report:?}") };
    assert_eq!((found.kind, &found.what), (FindingKind::Artifact, &phase));
    assert_eq!((found.problem.as_str(), report.unreferenced_files), ("is not in the bucket", 1));
}

/// A job that one server began is continued by another one with its own data folder, from the state in the bucket.
#[tokio::test]
async fn job_continues_in_another_data_folder() {
    let Some(settings) = settings().await else { return };
    let serving = start(&settings).await;
    serving.display("lab").await;
    let target = serving.upload(&picture()).await;
    let begun = submit(&serving, job(&target, 500), "").await.unwrap();
    let request = v1::WatchJobRequest { name: begun.name.clone() };
    let mut stream = serving.jobs().watch_job(request).await.unwrap().into_inner();
    while stream.message().await.unwrap().unwrap().progress.is_none_or(|progress| progress.step == 0) {}
    drop(stream);
    serving.stop().await.unwrap();

    let serving = start(&settings).await;
    let resumed = watch_to_end(&serving, &begun.name).await;
    assert_eq!((resumed.state(), resumed.attempt), (v1::job::State::Succeeded, 2));
    let whole = submit(&serving, job(&target, 500), "").await.unwrap();
    let whole = watch_to_end(&serving, &whole.name).await;
    assert_eq!(hologram(&whole).wavelengths, hologram(&resumed).wavelengths);
    let report = checked(&serving.config).await.unwrap();
    assert_eq!((report.problems.as_slice(), report.unreferenced_files), ([].as_slice(), 0), "no state is left");
}

/// What one server stores, another one finds. An artifact that was removed is stored again by whoever offers its bytes.
#[tokio::test]
async fn two_servers_share_artifacts() {
    let Some(settings) = settings().await else { return };
    let (one, two) = (start(&settings).await, start(&settings).await);
    let digest = one.upload(b"kernel").await;
    assert_eq!(two.read(&digest).await, b"kernel");
    let request = v1::GetUploadRequest { digest: digest_of(b"kernel") };
    assert!(two.artifacts().get_upload(request).await.unwrap().into_inner().complete);
    two.stop().await.unwrap();

    // All copies in the bucket are lost. Only the first server has the bytes.
    let (folder, bucket) = (TempDir::new().unwrap(), one.config.bucket().unwrap().unwrap());
    let other = Artifacts::open_with(folder.path(), SpaceLimits::default(), Some(&bucket)).unwrap();
    other.delete(&digest).await.unwrap();
    one.upload(b"kernel").await;
    assert_eq!(other.read_all(&digest).await.unwrap(), b"kernel");
}

/// A folder that was used with the database alone may move to the bucket, and not back.
#[tokio::test]
async fn data_folder_moves_to_the_bucket() {
    let Some(settings) = settings().await else { return };
    let serving = start(&Config {
        artifacts_url: None,
        artifacts_endpoint: None,
        artifacts_access_key_id: None,
        artifacts_secret_access_key: None,
        ..settings.clone()
    })
    .await;
    let digest = serving.upload(b"kernel").await;
    let without = serving.config.clone();
    let restart = |config: &mut Config| *config = Config { data_dir: config.data_dir.clone(), ..settings.clone() };
    let serving = serving.restart_with(restart).await;
    assert_eq!(serving.read(&digest).await, b"kernel");
    let elsewhere = start(&settings).await;
    assert_eq!(elsewhere.read(&digest).await, b"kernel");
    let refused = checked(&without).await.unwrap_err().to_string();
    assert!(refused.contains("artifacts_url"), "{refused}");
    let missing = v1::ReadArtifactRequest { digest: digest_of(b"other"), ..Default::default() };
    let missing = elsewhere.artifacts().read_artifact(missing).await.unwrap_err();
    assert_eq!(missing.code(), Code::NotFound);
}
