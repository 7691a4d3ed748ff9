//! Copies of whole databases between SQLite and PostgreSQL.

use super::migrations::create_database;
use super::*;
use crate::migrations::MIGRATIONS;
use crate::sql::{query, scalar};
use crate::transfer::TABLES;
use crate::{Side, Transfer, TransferError};
use lightpath_domain::job::JobState;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// More events than a page of a copy has rows.
const EVENTS: u32 = 1200;

/// A database of SQLite with rows in every table.
async fn full(folder: &Path) -> PathBuf {
    let path = folder.join("full.db");
    create_database(&path, MIGRATIONS.len()).await;
    let more = format!(
        "insert into made_by_request values ('ada', 'once', 'ImportKernel sha256-0', 1, 8); \
         insert into job_dependency values ('a', 'b'); \
         update job set waiting_for = 1 where id = 'a'; \
         update job set state = 'queued', finish_time_ms = null where id = 'd'; \
         insert into job_event (job, time_ms, attempt, message) \
         with recursive n(i) as (select 1 union all select i + 1 from n where i < {EVENTS}) select 'a', i, 0, 'é' || i from n; \
         insert into job_event (job, time_ms, attempt, message) values ('a', 1, 0, 'the newest, and deleted'); \
         delete from job_event where message = 'the newest, and deleted'"
    );
    change(&path, &more).await;
    path
}

async fn change(path: &Path, sql: &str) {
    let mut connection = connect_options(path).connect().await.unwrap();
    for statement in sql.split("; ") {
        sqlx::query(sqlx::AssertSqlSafe(statement.to_owned())).execute(&mut connection).await.unwrap();
    }
    connection.close().await.unwrap();
}

async fn copied(from: &Side, to: &Side) -> Result<(), TransferError> {
    let mut transfer = Transfer::begin(from, to, "the source").await?;
    transfer.copy(|_, _| ()).await?;
    let compared = transfer.verify(|_, _| ()).await?;
    assert_eq!(compared.iter().map(|table| table.name).collect::<Vec<_>>(), TABLES);
    transfer.finish(None).await
}

#[tokio::test]
async fn every_table_is_copied_behind_those_to_which_it_refers() {
    let folder = tempfile::tempdir().unwrap();
    let path = full(folder.path()).await;
    let mut connection = Connection::SqliteFile(connect_options(&path).connect().await.unwrap());
    let stored: Vec<String> =
        scalar("select name from sqlite_master where type = 'table'").fetch_all(&mut connection).await.unwrap();
    let stays = ["artifact_place", "older_programs", "process", "_sqlx_migrations", "sqlite_sequence"];
    let known: BTreeSet<&str> = TABLES.iter().copied().chain(stays).collect();
    assert_eq!(stored.iter().map(String::as_str).collect::<BTreeSet<_>>(), known);
    let place: HashMap<&str, usize> = TABLES.iter().copied().zip(0..).collect();
    for table in TABLES {
        let rows: i64 = Builder::new(format!("select count(*) from {table}"))
            .build()
            .fetch_one(&mut connection)
            .await
            .unwrap()
            .try_get(0)
            .unwrap();
        assert!(rows > 0, "the fixture has no row of {table}");
        let references = query("select \"table\" as parent, \"from\" as name from pragma_foreign_key_list($1)");
        for row in references.bind(*table).fetch_all(&mut connection).await.unwrap() {
            let (parent, column): (String, String) = (row.try_get("parent").unwrap(), row.try_get("name").unwrap());
            let is_late = *table == "kernel" && parent == "kernel_version";
            assert!(is_late || place[&*parent] <= place[table], "{table}.{column}");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_is_the_same_after_two_moves() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (full(folder.path()).await, folder.path().join("second.db"));
    let server = TestDatabase::postgres().await;
    let url = Side::Server(server.url.clone().unwrap());
    copied(&Side::File(first.clone()), &url).await.unwrap();
    copied(&url, &Side::File(second.clone())).await.unwrap();
    let mut connection = Connection::SqliteFile(connect_options(&first).connect().await.unwrap());
    query("attach $1 as second").bind(second.to_str().unwrap()).execute(&mut connection).await.unwrap();
    for table in TABLES.iter().copied().chain(["sqlite_sequence"]) {
        for (one, other) in [("main", "second"), ("second", "main")] {
            let sql =
                format!("select count(*) from (select * from {one}.{table} except select * from {other}.{table})");
            let row = Builder::new(sql).build().fetch_one(&mut connection).await.unwrap();
            assert_eq!(row.try_get::<i64>(0).unwrap(), 0, "rows of {one}.{table} alone");
        }
    }
    let triggers =
        "select count(*) from (select sql from main.sqlite_master except select sql from second.sqlite_master)";
    assert_eq!(scalar::<i64>(triggers).fetch_one(&mut connection).await.unwrap(), 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_continues_where_the_other_database_ended() {
    let folder = tempfile::tempdir().unwrap();
    let first = full(folder.path()).await;
    let server = TestDatabase::postgres().await;
    copied(&Side::File(first.clone()), &Side::Server(server.url.clone().unwrap())).await.unwrap();
    let mut connection = server.connect().await;
    let newest: i64 = scalar("select max(sequence) from job_event").fetch_one(&mut connection).await.unwrap();
    let store = server.open().await;
    // A killed server leaves running jobs, which go on from their saved state.
    store.recover_orphans(Some("a process of the target"), 20).await.unwrap();
    let job = store.job("b").await.unwrap();
    assert_eq!((job.state, job.checkpoint.as_deref()), (JobState::Queued, Some("sha256-c")));
    let event = store.events("b", None, 1001).await.unwrap().pop().unwrap();
    assert_eq!(event.sequence, newest + 2, "the number of the deleted event is not given again");
    // The triggers are on.
    store.resume(None).await.unwrap();
    let claimed = store.claim(30, LEASE_MS, "w").await.unwrap().unwrap().0.id;
    assert_eq!(claimed, "b", "the job a waits for it");
    assert_eq!(store.queue_counts().await.unwrap().running, 1);
    let stays = query("update kernel_version set size_bytes = 1").execute(&mut connection).await.unwrap_err();
    assert!(stays.to_string().contains("immutable"), "{stays}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_killed_move_continues() {
    let folder = tempfile::tempdir().unwrap();
    let (file, database) = (full(folder.path()).await, TestDatabase::postgres().await);
    let servers = [database.url.clone().unwrap()];
    let from = Side::File(file);
    for to in servers.map(Side::Server).into_iter().chain([Side::File(folder.path().join("other.db"))]) {
        // Ends in the middle of the events.
        let mut transfer = Transfer::begin(&from, &to, "the source").await.unwrap();
        let died = tokio::spawn(async move { transfer.copy(|done, _| assert!(done < 600)).await }).await;
        assert!(died.unwrap_err().is_panic());
        let opened = match &to {
            Side::File(path) => Store::open(path).await,
            Side::Server(url) => Store::connect(url).await,
        };
        assert!(matches!(opened, Err(StoreError::Unfinished)), "{opened:?}");
        let source = Transfer::begin(&to, &Side::File(folder.path().join("third.db")), "the source").await;
        assert!(matches!(source, Err(TransferError::Store(StoreError::Unfinished))), "{source:?}");
        let other = Transfer::begin(&from, &to, "another source").await;
        assert!(matches!(&other, Err(TransferError::NotEmpty { .. })), "{other:?}");
        drop(other);
        let mut transfer = Transfer::begin(&from, &to, "the source").await.unwrap();
        let mut begun = None;
        transfer.copy(|done, all| assert!(*begun.get_or_insert(done) >= 600 && done <= all)).await.unwrap();
        transfer.verify(|_, _| ()).await.unwrap();
        transfer.finish(None).await.unwrap();
        let opened = match &to {
            Side::File(path) => Store::open(path).await,
            Side::Server(url) => Store::connect(url).await,
        };
        assert_eq!(opened.unwrap().jobs(&Default::default(), None, 9).await.unwrap().len(), 6);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn targets_with_rows_and_databases_in_use_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let from = Side::File(full(folder.path()).await);
    let database = TestDatabase::postgres().await;
    let store = database.open().await;
    store.create_display(&display("other"), 1).await.unwrap();
    let to = Side::Server(database.url.clone().unwrap());
    let refused = copied(&from, &to).await;
    assert!(matches!(refused, Err(TransferError::Served)), "{refused:?}");
    store.close().await;
    let refused = copied(&from, &to).await.unwrap_err().to_string();
    assert!(refused.contains("rows in the table display"), "{refused}");
    let older = folder.path().join("older.db");
    create_database(&older, MIGRATIONS.len() - 1).await;
    let refused = copied(&Side::File(older), &Side::File(folder.path().join("new.db"))).await;
    assert!(matches!(refused, Err(TransferError::Store(StoreError::OlderDatabase))), "{refused:?}");
}

#[tokio::test]
async fn a_change_behind_the_copy_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let from = Side::File(full(folder.path()).await);
    for (n, (change_to, table)) in [
        ("update display set generation_time_ms = 11", "display"),
        ("update job set label = '' || 'x' where id = 'a'", "job"),
        ("delete from rollout_report", "rollout_report"),
        ("update sqlite_sequence set seq = seq + 1 where name = 'kernel_move'", "kernel_move"),
    ]
    .into_iter()
    .enumerate()
    {
        let to = folder.path().join(format!("{n}.db"));
        let mut transfer = Transfer::begin(&from, &Side::File(to.clone()), "the source").await.unwrap();
        transfer.copy(|_, _| ()).await.unwrap();
        change(&to, change_to).await;
        match transfer.verify(|_, _| ()).await {
            Err(TransferError::Different { table: found, .. }) => assert_eq!(found, table),
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_that_has_worked_on_the_server_moves_back() {
    let (server, folder) = (TestDatabase::postgres().await, tempfile::tempdir().unwrap());
    let store = server.open().await;
    prepare(&store).await;
    record(&store, 5).await;
    // Each version of a kernel that exists leaves out a number for kernels.
    for version in 1..=3 {
        store.add_kernel_version(&key(), new_version(version), 8).await.unwrap();
    }
    submit(&store, "r", 9).await;
    store.close().await;
    let file = folder.path().join("lightpath.db");
    copied(&Side::Server(server.url.clone().unwrap()), &Side::File(file.clone())).await.unwrap();
    let store = Store::open(&file).await.unwrap();
    assert_eq!(store.add_kernel_version(&key(), new_version(4), 10).await.unwrap().version, 4);
}
