//! Several processes on one database of PostgreSQL. Here each has a store of its own.

use super::*;
use crate::sql::{query_as, scalar};
use crate::{Changed, ClaimLimits, LIFE, Process, ProcessKind};
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_domain::job::JobState;
use std::collections::HashSet;
use std::time::Duration;
use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;

/// Longest wait for something that happens at once.
const SOON: Duration = Duration::from_secs(20);

async fn two_processes() -> (Store, Store, TestDatabase) {
    let database = TestDatabase::postgres().await;
    let (one, other) = tokio::join!(database.open(), database.open());
    prepare(&one).await;
    (one, other, database)
}

/// Receives until `is_wanted` comes. A receiver that fell behind has missed some.
async fn wait_for<T: Clone>(changes: &mut Receiver<T>, is_wanted: impl Fn(&T) -> bool) {
    let found = timeout(SOON, async { while !is_wanted(&changes.recv().await.unwrap()) {} });
    found.await.expect("the other process hears of it");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn processes_hear_of_the_changes_of_others() {
    let (one, other, _database) = two_processes().await;
    let (mut jobs, mut cancels) = (other.subscribe_job_changes(), other.subscribe_cancels());
    let (mut kernels, mut all) = (other.subscribe_kernel_changes(), other.subscribe_changes());
    let claimable = other.claimable();
    let id = submit(&one, "r", 5).await;
    timeout(SOON, claimable.notified()).await.unwrap();
    wait_for(&mut jobs, |changed| *changed == id).await;
    one.claim(6, LEASE_MS, "w").await.unwrap().unwrap();
    one.cancel(&id, 7).await.unwrap();
    wait_for(&mut cancels, |changed| *changed == id).await;
    record(&one, 2).await;
    one.add_kernel_version(&key(), new_version(1), 8).await.unwrap();
    wait_for(&mut kernels, |changed| *changed == key()).await;
    one.pause(None, "the laser is off", 9).await.unwrap();
    wait_for(&mut all, |changed| *changed == Changed::Queue).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_happened_without_a_connection_is_announced_when_it_is_back() {
    let (one, other, database) = two_processes().await;
    let id = submit(&one, "r", 5).await;
    let mut jobs = other.subscribe_job_changes();
    // Ends the connections of both listeners, as a restart of the server does.
    let ended = "select pg_terminate_backend(pid) from pg_stat_activity \
                 where datname = current_database() and pid <> pg_backend_pid()";
    database.change(ended).await;
    wait_for(&mut jobs, |changed| *changed == id).await;
    let later = submit(&one, "later", 6).await;
    wait_for(&mut jobs, |changed| *changed == later).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn racing_processes_keep_turns_and_limits() {
    let (one, other, database) = two_processes().await;
    let third = database.open().await;
    for n in 0..60 {
        let mut new = new_job(&format!("r{n}"), 1);
        new.scheduling.owner = format!("owner {}", n % 3);
        new.scheduling.needs = Labels::parse(["", "gpu", "lab"][n / 20]).unwrap();
        one.submit(&new, 1, QUEUE_LIMIT).await.unwrap();
    }
    let limits = ClaimLimits { per_owner: 2, per_display: 5 };
    let work = |store: Store, labels: &'static str| {
        tokio::spawn(async move {
            let mut done = Vec::new();
            for _ in 0..1000 {
                let claimant = super::needs::able(labels, u64::MAX);
                let Some((job, lease)) = store.claim_within(limits, 2, LEASE_MS, &claimant).await.unwrap() else {
                    if store.queue_counts().await.unwrap().succeeded == 60 {
                        break;
                    }
                    continue;
                };
                assert!(claimant.abilities.labels.contain(&job.scheduling.needs), "{:?} on {labels:?}", job.scheduling);
                let running = store.owner_queues().await.unwrap();
                assert!(running.iter().all(|owner| owner.running <= 2), "{running:?}");
                assert!(running.iter().map(|owner| owner.running).sum::<u64>() <= 5, "{running:?}");
                store.finish(&lease, result(), JobEffect::None, 3).await.unwrap();
                done.push(job.id);
            }
            done
        })
    };
    let workers = [work(one.clone(), "gpu"), work(other.clone(), "lab"), work(third, "gpu,lab"), work(other, "")];
    let mut all = Vec::new();
    for worker in workers {
        all.extend(worker.await.unwrap());
    }
    assert_eq!((all.len(), all.iter().collect::<HashSet<_>>().len()), (60, 60), "each job once");
    let mut inspection = database.inspect().await;
    assert_eq!(inspection.contradictions().await.unwrap(), Vec::<String>::new());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_panic_in_a_write_does_not_stop_the_writers() {
    let (one, other, _database) = two_processes().await;
    for _ in 0..5 {
        let store = one.clone();
        let panicked = tokio::spawn(async move { store.write::<()>(async |_| panic!("a mistake in a write")).await });
        assert!(panicked.await.unwrap_err().is_panic());
    }
    // The process of the panics writes nothing more: its next writer would end the transaction.
    timeout(SOON, submit(&other, "r", 5)).await.expect("the turn of the writers is free");
    timeout(SOON, submit(&one, "s", 5)).await.expect("the turn of the writers is free");
}

#[tokio::test]
async fn both_databases_have_the_same_tables_and_columns() {
    let (database, file) = (TestDatabase::postgres().await, TestDatabase::sqlite());
    database.open().await.close().await;
    file.open().await.close().await;
    let columns = async |database: &TestDatabase, sql| {
        let mut connection = database.connect().await;
        let columns: Vec<(String, String)> = query_as(sql).fetch_all(&mut connection).await.unwrap();
        connection.close().await.unwrap();
        columns
    };
    let of_sqlite = "select m.name, c.name from sqlite_master m join pragma_table_info(m.name) c \
                     where m.type = 'table' and m.name not like '%sqlx%' and m.name not like 'sqlite_%' order by 1, c.cid";
    let of_postgres = "select table_name::text, column_name::text from information_schema.columns \
                       where table_schema = 'public' and table_name not like '%sqlx%' order by 1, ordinal_position";
    let expected = columns(&file, of_sqlite).await;
    assert!(expected.len() > 100, "{expected:?}");
    assert_eq!(columns(&database, of_postgres).await, expected);
    // Names and indexes are in the order of their bytes, whatever the locale of the database.
    let others = columns(
        &database,
        "select table_name::text, column_name::text from information_schema.columns where table_schema = 'public' \
         and table_name not like '%sqlx%' and data_type = 'text' and collation_name is distinct from 'C'",
    );
    assert_eq!(others.await, []);
    let named = "select name, '' from sqlite_master where type = 'index' and sql is not null order by 1";
    let indexes = "select indexname::text, '' from pg_indexes where schemaname = 'public' \
                   and indexname in (select relname from pg_class c join pg_index i on i.indexrelid = c.oid \
                   where not exists (select 1 from pg_constraint where conindid = i.indexrelid)) order by 1";
    assert_eq!(columns(&database, indexes).await, columns(&file, named).await);
}

/// A claimant of a process that shares the database.
fn claimant(process: &str) -> crate::Claimant {
    crate::Claimant { process: Some(process.to_owned()), ..crate::Claimant::named(&format!("{process}-0")) }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_process_takes_back_its_own_jobs_only() {
    let (one, other, _database) = two_processes().await;
    let mut jobs = Vec::new();
    for (request, store, process) in [("a", &one, "one"), ("b", &other, "other"), ("c", &one, "one")] {
        submit(store, request, 5).await;
        let claimed = store.claim_within(ClaimLimits::default(), 6, LEASE_MS, &claimant(process)).await.unwrap();
        jobs.push(claimed.unwrap().0.id);
    }
    let state = async |id: &str| one.job(id).await.unwrap().state;
    let taken = one.recover_orphans(Some("one"), 7).await.unwrap();
    assert_eq!(taken.iter().map(|job| &job.id).collect::<HashSet<_>>(), HashSet::from([&jobs[0], &jobs[2]]));
    assert_eq!(state(&jobs[1]).await, JobState::Running);
    assert!(one.release_all(Some("one"), 8).await.unwrap().is_empty());
    assert_eq!(other.release_all(Some("other"), 8).await.unwrap().len(), 1);
    assert_eq!(state(&jobs[1]).await, JobState::Queued);
    assert!(one.recover_orphans(Some("other"), 9).await.unwrap().is_empty(), "a queued job has no process");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lease_from_a_clock_that_was_ahead_ends() {
    let (one, _other, _database) = two_processes().await;
    let id = submit(&one, "r", 5).await;
    let day_ms = 24 * 3_600_000;
    one.claim(day_ms, LEASE_MS, "dead").await.unwrap().unwrap();
    one.cap_leases(6 + 2 * LEASE_MS).await.unwrap();
    assert!(one.expire_leases(6 + LEASE_MS).await.unwrap().is_empty(), "a lease that may be valid stays");
    assert_eq!(one.expire_leases(6 + 2 * LEASE_MS).await.unwrap().len(), 1);
    assert_eq!(one.job(&id).await.unwrap().state, JobState::Queued);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_process_at_a_time_tells_a_webhook() {
    let (one, other, _database) = two_processes().await;
    super::webhooks::add_webhook(&one, "ci").await;
    assert!(one.hold_webhook("ci", 10, 30).await.unwrap());
    assert!(one.hold_webhook("ci", 20, 30).await.unwrap(), "the holder holds on");
    assert!(!other.hold_webhook("ci", 49, 30).await.unwrap());
    assert!(other.hold_webhook("ci", 50, 30).await.unwrap(), "the first holder fell silent");
    one.release_webhook("ci").await.unwrap();
    assert!(!one.hold_webhook("ci", 51, 30).await.unwrap(), "it lets go of what it no longer holds");
    other.release_webhook("ci").await.unwrap();
    assert!(one.hold_webhook("ci", 52, 30).await.unwrap());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn time_is_that_of_the_database() {
    let (one, _other, database) = two_processes().await;
    let mut connection = database.connect().await;
    let sql = "select cast(extract(epoch from clock_timestamp()) * 1000 as bigint)";
    let time_ms: i64 = crate::sql::scalar(sql).fetch_one(&mut connection).await.unwrap();
    assert!((one.now_ms() - time_ms).abs() < 1000, "{} {time_ms}", one.now_ms());
    assert!(one.is_shared() && one.since_time_jump().is_none());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_process_that_is_suspended_in_a_write_does_not_stop_the_others() {
    let (one, other, _database) = two_processes().await;
    let begun = std::sync::Arc::new(tokio::sync::Notify::new());
    let store = one.clone();
    let has_begun = std::sync::Arc::clone(&begun);
    let suspended = tokio::spawn(async move {
        store
            .write::<()>(async move |write| {
                has_begun.notify_one();
                // Longer than PostgreSQL waits for the next statement.
                tokio::time::sleep(Duration::from_secs(13)).await;
                crate::sql::query("delete from display").execute(write.sql()).await?;
                Ok(())
            })
            .await
    });
    begun.notified().await;
    timeout(SOON, submit(&other, "r", 5)).await.expect("the turn of the writers is free after some seconds");
    let ended = suspended.await.unwrap();
    assert!(matches!(ended, Err(StoreError::Unreachable(_))), "{ended:?}");
    assert_eq!(one.displays(None, 9).await.unwrap().len(), 1, "the suspended write did nothing");
}

/// A process that both serves and works.
fn process(id: &str, labels: &str) -> Process {
    Process {
        id: id.to_owned(),
        kind: ProcessKind::Both,
        name: format!("machine of {id}"),
        version: "0.1.0".to_owned(),
        abilities: Abilities { labels: Labels::parse(labels).unwrap(), memory_bytes: 7 << 30, ..Abilities::default() },
        workers: 2,
        start_time_ms: 5,
        seen_time_ms: 0,
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn processes_know_of_the_life_and_death_of_others() {
    let (one, other, database) = two_processes().await;
    let ids = |store: &Store| store.living().iter().map(|process| process.id.clone()).collect::<Vec<_>>();
    one.sign_of_life(&process("a", "")).await.unwrap();
    assert_eq!(ids(&one), ["a"]);
    assert_eq!(ids(&other), [""; 0], "it has not looked");
    other.sign_of_life(&process("b", "gpu,bench-2")).await.unwrap();
    assert_eq!(ids(&other), ["a", "b"]);
    let read = other.living()[1].clone();
    assert!((other.now_ms() - read.seen_time_ms).abs() < 5000, "{read:?}");
    assert_eq!(read, Process { seen_time_ms: read.seen_time_ms, ..process("b", "gpu,bench-2") });
    // A restart replaces the row of the process.
    other.sign_of_life(&Process { version: "0.2.0".into(), start_time_ms: 9, ..process("b", "") }).await.unwrap();
    assert_eq!((other.living()[1].version.as_str(), other.living()[1].start_time_ms), ("0.2.0", 9));

    // The time of b, which died, is over in a moment.
    let (life_ms, rows) = (LIFE.as_millis(), "select count(*) from process");
    database
        .change(&format!("update process set seen_time_ms = seen_time_ms - {} where id = 'b'", life_ms - 1000))
        .await;
    one.sign_of_life(&process("a", "")).await.unwrap();
    assert_eq!(ids(&one), ["a", "b"]);
    tokio::time::sleep(Duration::from_millis(1100)).await;
    one.sign_of_life(&process("a", "")).await.unwrap();
    assert_eq!(ids(&one), ["a"]);
    let mut connection = database.connect().await;
    let count = async |connection: &mut Connection| -> i64 { scalar(rows).fetch_one(connection).await.unwrap() };
    assert_eq!(count(&mut connection).await, 1, "its row is removed");
    // A sign from a time when the clock was ahead counts no more than one that is over.
    database.change("insert into process select 'c', kind, name, version, labels, memory_bytes, workers, 1, 9999999999999 from process").await;
    one.read_living().await.unwrap();
    assert_eq!(ids(&one), ["a"]);
    one.sign_off("a").await.unwrap();
    other.sign_of_life(&process("b", "")).await.unwrap();
    assert_eq!(ids(&other), ["b"]);
    assert_eq!(count(&mut connection).await, 1);
}
