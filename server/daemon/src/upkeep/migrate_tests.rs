//! Moves of a whole server. They need `scripts/with-postgres`, and the one to a bucket also `scripts/s3-for-tests`.

use super::tests::{TestData, file};
use super::*;
use crate::config::{Effective, SecretText, Settings};
use crate::database::{DATABASE, Database, DatabaseError};
use lightpath_fixtures::postgres_database;
use lightpath_store::Store;
use std::fs;
use std::path::Path;

fn migration(data_dir: &Path, url: &str, to_server: bool, settings: &[(&str, &str)]) -> Migration {
    let given = Settings::default().with("data_dir", data_dir.to_str().unwrap());
    let given = given.with("database_url", url);
    let given = settings.iter().fold(given, |given, (key, value)| given.with(key, value));
    let mut config = Effective::merge(given, Settings::default()).unwrap().config;
    config.database_url = to_server.then(|| SecretText::new(url.to_owned()));
    Migration { config, url: url.to_owned(), to_server }
}

async fn run(migration: &Migration) -> Result<Moved, UpkeepError> {
    migration.run(&mut |_, _, _| ()).await
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_moves_to_postgresql_and_back() {
    let (data, url) = (TestData::new().await, postgres_database().await);
    let path = data.path().to_owned();
    let there = migration(&path, &url, true, &[]);
    let locked = run(&there).await;
    assert!(matches!(locked, Err(UpkeepError::Artifacts(ArtifactError::Locked { .. }))), "{locked:?}");
    let photo = data.photo.clone();
    let folder = data.closed().await;
    let moved = run(&there).await.unwrap();
    assert!(moved.tables.iter().any(|table| table.name == "job" && table.rows == 2));
    assert_eq!(moved.blobs, None);

    let database = Database::OnServer(url.clone());
    assert_eq!(check_with(&path, &database, None).await.unwrap().problems, []);
    let artifacts = Artifacts::open(&path).unwrap();
    let store = database.open(&artifacts).await.unwrap();
    assert_eq!(artifacts.read_all(&photo).await.unwrap(), b"photo");
    let (job, _) = store.claim(9, 1000, "w").await.unwrap().unwrap();
    assert!(job.checkpoint.is_some());
    store.close().await;
    drop((store, artifacts));

    let back = migration(&path, &url, false, &[]);
    let refused = run(&back).await.unwrap_err().to_string();
    assert!(refused.contains("the target is not empty"), "{refused}");
    let other = tempfile::tempdir().unwrap();
    let refused = run(&migration(other.path(), &url, false, &[])).await;
    assert!(matches!(refused, Err(UpkeepError::Database(DatabaseError::OtherArtifacts { .. }))), "{refused:?}");
    assert!(!other.path().join(DATABASE).exists(), "a refused move leaves nothing behind");
    fs::rename(path.join(DATABASE), path.join("old.db")).unwrap();
    run(&back).await.unwrap();
    assert_eq!(check(&path).await.unwrap().problems, []);
    let store = Store::open(&path.join(DATABASE)).await.unwrap();
    assert_eq!(store.queue_counts().await.unwrap().running, 1, "as it was when the server ended");
    drop(folder);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn files_move_to_a_bucket_and_are_read_back() {
    let Ok(endpoint) = std::env::var("LIGHTPATH_TEST_S3") else { return };
    let (data, url) = (TestData::new().await, postgres_database().await);
    let (path, photo) = (data.path().to_owned(), data.photo.clone());
    let _folder = data.closed().await;
    fs::write(file(&path, "artifacts", &photo), b"phota").unwrap();
    let bucket = format!("s3://lightpath-tests/move-{}", url.rsplit('_').next().unwrap_or_default());
    let bucket = format!("{bucket}-{}", std::process::id());
    let settings = [
        ("artifacts_url", &*bucket),
        ("artifacts_access_key_id", "lightpath-tests"),
        ("artifacts_secret_access_key", "lightpath-tests"),
    ];
    let mut there = migration(&path, &url, true, &settings);
    there.config.artifacts_allow_http = true;
    there.config.artifacts_endpoint = Some(endpoint);
    let moved = run(&there).await.unwrap();
    let blobs = moved.blobs.unwrap();
    // The phase, and the state of the waiting job.
    assert_eq!((blobs.files, blobs.bytes), (2, 10));
    assert_eq!(blobs.damaged.iter().map(|found| &found.what).collect::<Vec<_>>(), [&photo]);
    // Without the bucket, the server finds other artifacts than those of its database.
    let opened = Database::OnServer(url).open(&Artifacts::open(&path).unwrap()).await;
    assert!(matches!(opened, Err(DatabaseError::OtherArtifacts { .. })), "{opened:?}");
}
