//! Tests of the store on a real database: SQLite in a temporary folder or, if `LIGHTPATH_TEST_DATABASE` is `postgres`, a
//! database of the PostgreSQL server that `scripts/with-postgres` starts. What concerns only one of them is tested there.
//!
//! `queue`: states of jobs and their changes. `deaths`: what deaths count for. `forecasts`: what is before waiting jobs. `scheduling`: when and for which owner jobs run. `needs`: on
//! which processes. `registry`: displays,
//! artifacts, datasets, kernels. `rollouts`: aliases, gates, devices, rollouts. `preparing`: datasets that jobs align and finalize. `model`: random histories of one
//! job, compared with a small model. `machine`: random histories of a whole queue. `migrations`: databases of earlier
//! versions. `webhooks`: what webhooks learn. `processes`: several processes on one database of PostgreSQL. `transfers`: moves between databases. `scale`: many jobs. `limits`: limits on stored records. `query_plans`: the indexes that queries use.

mod deaths;
mod forecasts;
mod limits;
mod machine;
mod migrations;
mod model;
mod needs;
mod preparing;
mod processes;
mod query_plans;
mod queue;
mod registry;
mod rollouts;
mod scale;
mod scheduling;
mod transfers;
mod webhooks;

use super::sql::{Builder, Connection};
use super::{Inspection, Promotion, Store, StoreError};
use crate::connect::connect_options;
use lightpath_domain::dataset::{Dataset, Encoding, Pair};
use lightpath_domain::job::{FailureReason, JobEffect, JobError, JobResult, JobSpec, NewJob};
use lightpath_domain::kernel::{Cause, KernelKey, KernelMetrics, KernelModel, NewKernelVersion};
use lightpath_domain::lineage::{KernelLineage, KernelOrigin, Learning};
use lightpath_domain::units::Distance;
use lightpath_fixtures::{
    DISTANCE, WAVELENGTH, capture_job, capture_result, display, postgres_database, test_database,
};
use sqlx::{ConnectOptions as _, Connection as _, PgConnection};
use std::path::PathBuf;
use tempfile::TempDir;

const QUEUE_LIMIT: u32 = 100;
const LEASE_MS: i64 = 30_000;

/// The database of a test.
struct TestDatabase {
    folder: TempDir,
    /// URL of a database of PostgreSQL; `None`: SQLite in the folder.
    url: Option<String>,
}

impl TestDatabase {
    /// A new database. It stays at the end of the test, and goes with its server.
    async fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), url: test_database().await }
    }

    fn sqlite() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), url: None }
    }

    async fn postgres() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), url: Some(postgres_database().await) }
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("lightpath.db")
    }

    /// A handle to the database, as another process has one.
    async fn open(&self) -> Store {
        match &self.url {
            None => Store::open(&self.file()).await.unwrap(),
            Some(url) => Store::connect(url).await.unwrap(),
        }
    }

    async fn inspect(&self) -> Inspection {
        match &self.url {
            None => Inspection::open(&self.file()).await.unwrap(),
            Some(url) => Inspection::connect(url).await.unwrap(),
        }
    }

    /// A connection that knows nothing of the store.
    async fn connect(&self) -> Connection {
        match &self.url {
            None => Connection::SqliteFile(connect_options(&self.file()).connect().await.unwrap()),
            Some(url) => Connection::PostgresServer(PgConnection::connect(url).await.unwrap()),
        }
    }

    /// Runs statements directly, because a test cannot make that many calls.
    async fn change(&self, sql: &str) {
        let mut connection = self.connect().await;
        for statement in sql.split(';') {
            Builder::new(statement).build().execute(&mut connection).await.unwrap();
        }
        connection.close().await.unwrap();
    }
}

/// A store with the display `lab`, and its database.
async fn store() -> (Store, TestDatabase) {
    let database = TestDatabase::new().await;
    let store = database.open().await;
    prepare(&store).await;
    (store, database)
}

/// The same, always in SQLite.
async fn sqlite_store() -> (Store, TestDatabase) {
    let database = TestDatabase::sqlite();
    let store = database.open().await;
    prepare(&store).await;
    (store, database)
}

async fn prepare(store: &Store) {
    store.create_display(&display("lab"), 1).await.unwrap();
    // The artifact that `new_job` refers to.
    store.record_artifact(&digest(0), 7, "", None, 1).await.unwrap().unwrap();
}

/// A job of the cheapest kind. Jobs with different seeds have different content.
fn new_job(request_id: &str, seed: u64) -> NewJob {
    capture_job(request_id, &digest(0), seed)
}

fn result() -> JobResult {
    capture_result(&digest(1))
}

fn io_error() -> JobError {
    JobError { reason: FailureReason::Io, message: "the disk failed".to_owned(), retryable: true }
}

/// Something that ada did.
fn cause(reason: &str) -> Cause {
    Cause { caller: "ada".to_owned(), reason: reason.to_owned() }
}

fn promotion(version: u32, expected_active: Option<u32>) -> Promotion {
    Promotion { version, expected_active, cause: cause("better"), overridden: Vec::new() }
}

fn digest(n: u32) -> String {
    format!("sha256-{n:064x}")
}

async fn submit(store: &Store, request_id: &str, now_ms: i64) -> String {
    store.submit(&new_job(request_id, 1), now_ms, QUEUE_LIMIT).await.unwrap().0.id
}

fn dataset(id: &str) -> Dataset {
    Dataset::empty(id.to_owned(), "lab".to_owned(), WAVELENGTH, DISTANCE, Encoding::Linear)
}

fn pair(n: u32) -> Pair {
    Pair { id: format!("p{n}"), pattern: digest(2 * n), photo: digest(2 * n + 1), ..Pair::default() }
}

fn key() -> KernelKey {
    KernelKey { display: "lab".to_owned(), wavelength: WAVELENGTH, distance: DISTANCE }
}

fn new_version(n: u32) -> NewKernelVersion {
    let parameters = serde_json::json!({
        "model": "display", "seed": u64::MAX, "detector": "pixel",
        "region_of_interest": { "x_px": 6, "y_px": 5, "width_px": 52, "height_px": 38 },
    });
    let learning = Learning { parameters: serde_json::from_value(parameters).unwrap(), ..Learning::default() };
    NewKernelVersion {
        model: KernelModel::Display,
        artifact: digest(n),
        size_bytes: 7,
        metrics: KernelMetrics { test_loss: 0.001, ..KernelMetrics::default() },
        lineage: KernelLineage::of(KernelOrigin::Learned(learning)),
    }
}

/// Records the artifacts 0 to `count` − 1.
async fn record(store: &Store, count: u32) {
    for n in 0..count {
        store.record_artifact(&digest(n), 7, "", None, 1).await.unwrap().unwrap();
    }
}
